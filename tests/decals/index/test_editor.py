"""Editing: after any edits, look-ups find who acts, as in an index built anew; only their bytes changed."""

import re
from collections.abc import Callable
from dataclasses import fields
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from decals import Decals, evaluate
from decals.errors import InvalidDecals
from decals.index import DecalEditor, DecalIndex
from decals.index.change_log import ChangeLog
from decals.index.editor import IDS, LIMITS, RECORDS, TABLE
from decals.record import NEIGHBOR_REACH


def some(rng: np.random.Generator, count: int, *, space: float = 1.0) -> Any:
    places, normals, others = rng.normal(size=(3, count, 3))
    return Decals(
        places * space,
        normals,
        np.cross(normals, others),
        10.0 ** rng.uniform(-2, 0, count),
        layers=rng.integers(-1, 2, count),
        interactions=rng.integers(0, 3, count),
    )


def acting(decals: Decals, points: NDArray[Any], offsets: NDArray[Any], ids: Any) -> Any:
    """Of each point's candidates, sorted, those that act there; larger cells have more that do not."""
    which = np.repeat(np.arange(len(points)), np.diff(offsets))
    away = np.linalg.norm(points[which].astype(float) - decals.positions[ids], axis=1)
    there = away <= NEIGHBOR_REACH * decals.influence[ids]
    ends = np.concatenate([[0], np.cumsum(there)])[offsets]
    return [sorted(ids[there][a:b].tolist()) for a, b in pairwise(ends)]


def check(editor: DecalEditor, points: NDArray[Any]) -> None:
    """Look-ups and pictures against a fresh build."""
    decals, numbers = editor.decals, editor.numbers
    fresh = DecalIndex.of(decals)
    offsets, ids = fresh.candidates(points)
    found, listed = editor.index.candidates(points)
    assert np.isin(listed, numbers).all()
    every = everything(editor)
    assert acting(every, points, found, listed) == acting(every, points, offsets, numbers[ids])
    rows = editor.arrays[RECORDS].reshape(-1, 4, 4)[numbers].reshape(-1, 4)
    assert np.array_equal(rows, decals.packed())
    seen = evaluate(decals, points, points)
    edited = evaluate(every, points, points, index=editor.index)
    owner = np.where(seen.owner < 0, -1, numbers[seen.owner] if len(numbers) else -1)
    assert np.array_equal(edited.owner, owner)
    assert np.abs(edited.uv - seen.uv).max(initial=0) < 1e-6


def everything(editor: DecalEditor) -> Any:
    """All decals that ever were, so that numbers are rows; the index lists the living alone."""
    filler = some(np.random.default_rng(0), 1)
    parts = []
    for number in range(editor.next_number):
        try:
            parts.append(editor[number])
        except InvalidDecals:
            parts.append(filler)
    return Decals.concatenate(parts) if parts else Decals.empty()


EDITS = st.lists(
    st.tuples(st.sampled_from(["add", "move", "resize", "layer", "delete"]), st.integers(0, 2**32)),
    max_size=40,
)


@settings(max_examples=40)
@given(count=st.integers(0, 30), seed=st.integers(0, 2**32), edits=EDITS)
def test_any_edits_look_like_a_fresh_build(count: int, seed: int, edits: Any) -> None:
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


def test_many_edits_of_many_decals() -> None:
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


CHANGES: dict[str, Callable[[np.random.Generator, Decals], dict[str, Any]]] = {
    "position": lambda rng, one: {"positions": one.positions + rng.normal(scale=0.3, size=(1, 3))},
    "position far away": lambda rng, _: {"positions": 50.0 * rng.normal(size=(1, 3))},
    "radius": lambda rng, _: {"radii": 10.0 ** rng.uniform(-2, 0.5, 1)},
    "one radius for all": lambda rng, _: {"radii": float(rng.uniform(0.1, 1.0))},
    "position and radius": lambda rng, _: {
        "positions": rng.normal(size=(1, 3)),
        "radii": rng.uniform(0.1, 1, 1),
    },
    "image": lambda rng, _: {"images": rng.integers(-1, 9, 1)},
    "the usual image": lambda _rng, _one: {"images": None},
    "opacity": lambda rng, _: {"opacities": rng.uniform(0, 1, 1)},
    "nothing": lambda _rng, _one: {},
    "layer": lambda rng, _: {"layers": rng.integers(-3, 3, 1)},
    "tint and position": lambda rng, one: {
        "tints": rng.uniform(0, 1, (1, 3)),
        "positions": one.positions * 1.5,
    },
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_is_the_assignment_of_a_changed_decal(name: str) -> None:
    """Bit for bit: decals, arrays, and what changed; but a change of few columns leaves the limits alone."""
    rng = np.random.default_rng(len(name))
    decals = some(rng, 60).replace(
        images=rng.integers(-1, 9, 60),
        spill=rng.uniform(size=60) < 0.5,
        opacities=rng.uniform(0, 1, 60),
        fade_depths=rng.choice([0.0, 0.5], 60),
    )
    changed, assigned = DecalEditor(decals), DecalEditor(decals)
    for _ in range(30):
        number = int(rng.integers(60))
        one = assigned[number]
        values = CHANGES[name](rng, one)
        versions = changed.version, assigned.version
        changed.change(number, **values)
        assigned.assign([number], one.replace(**values))
        rows, expected = changed.changed_rows(versions[0]), assigned.changed_rows(versions[1])
        assert {**expected, **rows} == expected
        assert set(expected) - set(rows) <= {LIMITS}
        balls = changed.changed_balls(versions[0]), assigned.changed_balls(versions[1])
        assert (balls[0] is None) == (balls[1] is None)
        if balls[0] is not None and balls[1] is not None:
            assert balls[0].tobytes() == balls[1].tobytes()
    for key, array in assigned.arrays.items():
        assert changed.arrays[key].tobytes() == array.tobytes()
    assert changed.decals.content_hash == assigned.decals.content_hash
    assert changed.layered == assigned.layered


WRONG_CHANGES: list[dict[str, Any]] = [
    {"positions": [[0, 0, np.nan]]},
    {"positions": [[0, 0]]},
    {"positions": [[0, 0, 0], [1, 0, 0]]},
    {"radii": [0.0]},
    {"radii": [1.0, 2.0]},
    {"radii": ["wide"]},
    {"images": [0.5]},
    {"opacities": [1.5]},
    {"positions": [[9, 9, 9]], "radii": [-1.0]},
]


@pytest.mark.parametrize("values", WRONG_CHANGES)
def test_a_wrong_change_raises_as_a_wrong_decal_does_and_changes_nothing(values: dict[str, Any]) -> None:
    editor = DecalEditor(some(np.random.default_rng(0), 9))
    before, version = {name: array.copy() for name, array in editor.arrays.items()}, editor.version
    with pytest.raises(InvalidDecals) as expected:
        DecalEditor(editor.decals).assign([3], editor[3].replace(**values))
    with pytest.raises(InvalidDecals, match=re.escape(str(expected.value))):
        editor.change(3, **values)
    assert editor.version == version
    for name, array in editor.arrays.items():
        assert array.tobytes() == before[name].tobytes()


def test_decals_are_taken_as_their_columns_say() -> None:
    rng = np.random.default_rng(4)
    decals = some(rng, 40).replace(spill=rng.uniform(size=40) < 0.5, images=rng.integers(-1, 9, 40))
    editor = DecalEditor(decals)
    rows = rng.permutation(40)[:7]
    for taken, expected in (
        (editor.take(rows), decals[rows]),
        (editor[3], decals[[3]]),
        (editor.decals, decals),
    ):
        for field in fields(Decals):
            seen, wanted = getattr(taken, field.name), getattr(expected, field.name)
            assert seen.dtype == wanted.dtype
            assert seen.flags.c_contiguous
            assert not seen.flags.writeable
            assert seen.tobytes() == wanted.tobytes()
    for field in fields(Decals):
        assert editor.column(field.name).tobytes() == getattr(decals, field.name).tobytes()


def test_many_changes_one_after_the_other_lay_the_index_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    built, build = 0, DecalIndex.build

    def counted(*arrays: Any) -> DecalIndex:
        nonlocal built
        built += 1
        return build(*arrays)

    monkeypatch.setattr(DecalIndex, "build", counted)
    editor = DecalEditor(some(rng, 400))
    version = editor.version
    assert built == 1
    first = editor.decals
    editor.assign(np.arange(300), some(rng, 300))
    editor.delete(np.arange(350, 400))
    editor.assign(np.arange(400), first)
    editor.change(7, radii=[0.3])
    assert built == 1
    assert editor.version > version
    assert built == 2
    assert {TABLE, IDS} <= set(editor.changed_rows(version))
    assert built == 2
    check(editor, rng.normal(size=(500, 3)).astype(np.float32))


def test_changes_are_all_that_changed() -> None:
    """A copy that is kept up by the changes alone is the same as the arrays, after every edit."""
    rng = np.random.default_rng(2)
    editor = DecalEditor(some(rng, 300))
    version = editor.version
    assert editor.changed_rows(version) == {}
    copies = {name: array.copy() for name, array in editor.arrays.items()}
    for step in range(600):
        number = int(rng.choice(editor.numbers))
        if step % 4 == 0:
            editor.add(some(rng, 1))
        elif step % 4 == 3:
            editor.delete(number)
        else:
            editor.change(number, positions=rng.normal(size=(1, 3)), radii=[rng.uniform(0.01, 1)])
        changes, version = editor.changed_rows(version), editor.version
        for name, ranges in changes.items():
            array = editor.arrays[name]
            if copies[name].shape != array.shape:
                assert ranges == [(0, len(array))]
                copies[name] = np.empty_like(array)
            for first, end in ranges:
                copies[name][first:end] = array[first:end]
        for name, array in editor.arrays.items():
            assert np.array_equal(copies[name], array), name


def test_one_edit_among_a_hundred_thousand_costs_its_own_bytes() -> None:
    rng = np.random.default_rng(3)
    n = rng.normal(size=(100_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    editor = DecalEditor(Decals(n, n, rng.normal(size=(100_000, 3)), np.full(100_000, 0.006)))
    touched = 0
    for step in range(60):
        place = n[step : step + 1] * 1.0001
        version = editor.version
        editor.change(step * 7, positions=place)
        changes = editor.changed_rows(version)
        rows = {name: sum(end - first for first, end in ranges) for name, ranges in changes.items()}
        touched = max(touched, rows[IDS] + 4 * rows[RECORDS] + 4 * rows.get(TABLE, 0))
    assert touched < 2000


def test_refuses_what_is_no_decal_and_stays_as_it_was() -> None:
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
    calls: tuple[Callable[[Any], object], ...] = (
        editor.add,
        lambda none: editor.assign([1], none),
        DecalEditor,
    )
    for wrong in calls:
        with pytest.raises(InvalidDecals, match="decals: expected a Decals, got None"):
            wrong(None)
    assert editor.numbers.tolist() == [0, 2]
    check(editor, np.zeros((1, 3), np.float32))


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32), count=st.integers(0, 300), steps=st.integers(1, 6))
def test_many_at_once_look_like_a_fresh_build(seed: int, count: int, steps: int) -> None:
    """Insert and delete few or many decals: columns and look-ups follow."""
    rng = np.random.default_rng(seed)
    editor = DecalEditor(some(rng, count))
    for _ in range(steps):
        known = {int(number): editor[number] for number in editor.numbers}
        chosen = rng.permutation(editor.next_number)[: int(rng.integers(0, 200))]
        if rng.random() < 0.4:
            gone = chosen[editor.has(chosen)]
            editor.delete(gone)
            known = {number: one for number, one in known.items() if number not in gone}
        else:
            fresh = editor.next_number + np.arange(rng.integers(0, 3))
            numbers = np.concatenate([chosen, fresh])
            news = some(rng, len(numbers))
            editor.assign(numbers, news)
            known.update({int(number): news[row : row + 1] for row, number in enumerate(numbers)})
        assert editor.numbers.tolist() == sorted(known)
        assert len(editor) == len(known)
        there = Decals.concatenate([known[number] for number in sorted(known)])
        assert editor.decals.packed().tobytes() == there.packed().tobytes()
        assert editor.layered == there.layered
    check(editor, rng.normal(size=(100, 3)).astype(np.float32))


def test_numbers_that_cannot_be_put() -> None:
    editor = DecalEditor(some(np.random.default_rng(4), 3))
    two = some(np.random.default_rng(5), 2)
    for numbers, message in (
        ([0], "expected a decal for each of 1 numbers, got 2"),
        ([1, 1], "expected each number once"),
        ([0, -1], "got -1"),
        ([0, 5], "expected numbers from 0 to 4, got 5"),
        ([0.5, 1.5], "expected numbers of decals"),
    ):
        with pytest.raises(InvalidDecals, match=message):
            editor.assign(numbers, two)
    for numbers in ([0, 0], [0, 3]):
        with pytest.raises(InvalidDecals):
            editor.delete(numbers)
    assert editor.numbers.tolist() == [0, 1, 2]
    editor.assign([3, 4], two)
    assert editor.next_number == 5


def test_deleted_numbers_can_be_filled_again() -> None:
    first = some(np.random.default_rng(6), 5)
    editor = DecalEditor(first)
    editor.delete(2)
    assert editor.add(some(np.random.default_rng(7), 1)) == 5
    editor.delete(5)
    editor.assign([2], first[2:3])
    assert editor.numbers.tolist() == [0, 1, 2, 3, 4]
    assert editor.decals.packed().tobytes() == first.packed().tobytes()


def test_records_grow_as_wholes() -> None:
    """Enough is added, one and many at a time, for arrays to grow several times."""
    rng = np.random.default_rng(9)
    editor, parts = DecalEditor(Decals.empty()), []
    for count in (1, 255, 1, 600, 90, 900, 70, 1):
        parts.append(some(rng, count))
        first = editor.next_number
        editor.assign(np.arange(first, first + count), parts[-1])
    assert editor.decals.packed().tobytes() == Decals.concatenate(parts).packed().tobytes()
    check(editor, rng.normal(size=(50, 3)).astype(np.float32))


def test_an_editor_is_evaluated_by_its_numbers() -> None:
    rng = np.random.default_rng(8)
    first = some(rng, 50)
    editor = DecalEditor(first)
    editor.delete([0, 7, 9])
    points = rng.normal(size=(500, 3)).astype(np.float32)
    images = [np.full((2, 2, 4), 255, np.uint8)]
    expected = evaluate(editor.decals, points, points, images=images)
    found = evaluate(editor, points, points, images=images)
    assert (found.owner >= 0).any()
    np.testing.assert_array_equal(
        found.owner, np.where(expected.owner < 0, -1, editor.numbers[expected.owner])
    )
    for name in ("uv", "field", "color"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def test_a_log_forgets_what_is_long_ago() -> None:
    log = ChangeLog(max_entries=3)
    log.add("a", (0, 10))
    log.add("a", (1, 3))
    assert log.since(0) == {"a": [(0, 10)]}
    log.add("b", (4, 6))
    log.add("b", (5, 8))
    assert log.since(0) is None
    assert log.since(1) == {"a": [(1, 3)], "b": [(4, 8)]}
    log.add("b", (0, 2), new=True)
    assert log.since(3) == {"b": [(0, 2)]}
    assert log.since(log.version) == {}
