"""Editing: after any edits, look-ups give what an index built anew gives, and only their bytes changed."""

import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decals.editor import IDS, RECORDS, TABLE, DecalEditor
from decals.errors import InvalidDecals
from decals.evaluate import evaluate
from decals.index import DecalIndex
from decals.model import Decals


def some(rng, count, *, space=1.0):
    return Decals(
        rng.normal(size=(count, 3)) * space,
        rng.normal(size=(count, 3)),
        rng.normal(size=(count, 3)),
        10.0 ** rng.uniform(-2, 0, count),
        layers=rng.integers(-1, 2, count),
        interactions=rng.integers(0, 3, count),
    )


def lists(offsets, ids):
    return [sorted(ids[a:b].tolist()) for a, b in pairwise(offsets)]


def check(editor, points):
    """Look-ups and pictures against a fresh build."""
    decals, numbers = editor.decals, editor.numbers
    fresh = DecalIndex.of(decals)
    offsets, ids = fresh.candidates(points)
    assert lists(*editor.index.candidates(points)) == lists(offsets, numbers[ids])
    rows = editor.arrays[RECORDS].reshape(-1, 4, 4)[numbers].reshape(-1, 4)
    assert np.array_equal(rows, decals.packed())
    seen = evaluate(decals, points, points)
    every = everything(editor)
    edited = evaluate(every, points, points, index=editor.index)
    owner = np.where(seen.owner < 0, -1, numbers[seen.owner] if len(numbers) else -1)
    assert np.array_equal(edited.owner, owner)
    assert np.abs(edited.uv - seen.uv).max(initial=0) < 1e-6


def everything(editor):
    """All decals that ever were, so that numbers are rows; the index lists the living alone."""
    last = int(editor.numbers.max(initial=-1))
    filler = some(np.random.default_rng(0), 1)
    parts = []
    for number in range(last + 1):
        try:
            parts.append(editor[number])
        except InvalidDecals:
            parts.append(filler)
    return Decals.concatenate(parts)


EDITS = st.lists(
    st.tuples(st.sampled_from(["add", "move", "resize", "layer", "delete"]), st.integers(0, 2**32)),
    max_size=40,
)


@settings(max_examples=40, deadline=None)
@given(count=st.integers(0, 30), seed=st.integers(0, 2**32), edits=EDITS)
def test_any_edits_look_like_a_fresh_build(count, seed, edits):
    rng = np.random.default_rng(seed)
    editor = DecalEditor(some(rng, count))
    for edit, choice in edits:
        one = some(np.random.default_rng(choice), 1, space=float(10.0 ** (choice % 4)))
        if edit == "add" or not len(editor.numbers):
            editor.add(one)
            continue
        number = int(editor.numbers[choice % len(editor.numbers)])
        if edit == "move":
            editor.change(number, positions=one.positions)
        elif edit == "resize":
            editor.change(number, radii=one.radii * np.float32(10.0 ** (choice % 5 - 2)))
        elif edit == "layer":
            editor.change(number, layers=one.layers, interactions=one.interactions)
        else:
            editor.delete(number)
    centres = editor.decals.positions
    check(editor, np.concatenate([rng.normal(size=(200, 3)), centres, centres * 1.01]).astype(np.float32))


def test_many_edits_of_many_decals():
    rng = np.random.default_rng(1)
    editor = DecalEditor(some(rng, 500))
    for step in range(1500):
        number = int(rng.choice(editor.numbers))
        if step % 3 == 0:
            editor.add(some(rng, 1))
        elif step % 3 == 1:
            editor.change(number, positions=rng.normal(size=(1, 3)))
        else:
            editor.delete(number)
    check(editor, rng.normal(size=(2000, 3)).astype(np.float32))


def test_changes_are_all_that_changed():
    """A copy that is kept up by the changes alone is the same as the arrays, after every edit."""
    rng = np.random.default_rng(2)
    editor = DecalEditor(some(rng, 300))
    assert editor.take_changes() == {}
    copies = {name: array.copy() for name, array in editor.arrays.items()}
    for step in range(600):
        number = int(rng.choice(editor.numbers))
        if step % 4 == 0:
            editor.add(some(rng, 1))
        elif step % 4 == 3:
            editor.delete(number)
        else:
            editor.change(number, positions=rng.normal(size=(1, 3)), radii=[rng.uniform(0.01, 1)])
        for name, ranges in editor.take_changes().items():
            array = editor.arrays[name]
            if copies[name].shape != array.shape:
                assert ranges == [(0, len(array))]
                copies[name] = np.empty_like(array)
            for first, end in ranges:
                copies[name][first:end] = array[first:end]
        for name, array in editor.arrays.items():
            assert np.array_equal(copies[name], array), name


def test_one_edit_among_a_hundred_thousand_costs_its_own_bytes():
    rng = np.random.default_rng(3)
    n = rng.normal(size=(100_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    editor = DecalEditor(Decals(n, n, rng.normal(size=(100_000, 3)), np.full(100_000, 0.006)))
    seconds, touched = [], 0
    for step in range(60):
        place = n[step : step + 1] * 1.0001
        start = time.perf_counter()
        editor.change(step * 7, positions=place)
        changes = editor.take_changes()
        seconds.append(time.perf_counter() - start)
        rows = {name: sum(end - first for first, end in ranges) for name, ranges in changes.items()}
        touched = max(touched, rows[IDS] + 4 * rows[RECORDS] + 4 * rows.get(TABLE, 0))
    print(f"an edit: {1e3 * np.median(seconds):.3f} ms, at most {touched * 4} bytes")
    assert touched < 2000
    assert np.median(seconds) < 2e-3  # 1 ms on a machine of one's own


def test_refuses_what_is_no_decal_and_stays_as_it_was():
    editor = DecalEditor(some(np.random.default_rng(4), 3))
    editor.delete(1)
    for number in (1, 3, -1):
        with pytest.raises(InvalidDecals, match=f"got {number}"):
            editor.delete(number)
    with pytest.raises(InvalidDecals, match="radii"):
        editor.change(0, radii=[-1])
    with pytest.raises(InvalidDecals):
        editor.change(0, radii=[1, 2])
    with pytest.raises(InvalidDecals, match="expected one decal, got 2"):
        editor.add(some(np.random.default_rng(4), 2))
    assert editor.numbers.tolist() == [0, 2]
    check(editor, np.zeros((1, 3), np.float32))
