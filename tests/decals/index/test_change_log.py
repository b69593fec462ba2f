"""Beyond the reach of what an editor changed everything is what it was, bit for bit."""

import numpy as np
import pytest

from decals import Contact, Decals, evaluate
from decals.index import DecalEditor
from decals.index.change_log import MAX_DIRTY_BALLS, MAX_SIZE_RATIO, DirtyBalls, affected_balls
from tests.decals.rendering.pictures import in_layers
from tests.vectors import random_units, unit


def random_decals(rng: np.random.Generator, count: int = 300) -> Decals:
    """Decals of sizes up to eight times each other on a ball, crowded enough to push."""
    normals = random_units(rng, count)
    radii = np.exp(rng.uniform(np.log(0.04), np.log(0.32), count))
    return Decals(normals, normals, rng.normal(size=(count, 3)), radii, spill=rng.random(count) < 0.2)


def field(editor: DecalEditor, points: np.ndarray, contact: Contact) -> np.ndarray:
    found = evaluate(editor, points, points, contact=contact)
    return np.column_stack([found.owner, found.field, found.uv])


@pytest.mark.ordinary_cases("0-True", "1-False", "2-True", "3-False")
@pytest.mark.parametrize("layered", [False, True])
@pytest.mark.parametrize("contact", list(Contact))
def test_what_a_change_cannot_reach_stays_and_not_much_more(contact: Contact, layered: bool) -> None:
    rng = np.random.default_rng(5)
    decals = random_decals(rng)
    editor = DecalEditor(in_layers(decals, 1) if layered else decals)
    points = unit(rng.normal(size=(6_000, 3)).astype(np.float32))
    before, changed, reached = field(editor, points, contact), 0, 0
    for step in range(40):
        version, number = editor.version, int(rng.choice(editor.numbers))
        if step % 4 == 3:
            editor.change(number, radii=editor[number].radii * np.float32(rng.uniform(0.6, 1.5)))
        elif step % 8 == 2:
            editor.delete(number)
        else:
            moved = editor[number].positions + rng.normal(0, 0.1, (1, 3)).astype(np.float32)
            editor.change(number, positions=moved / np.linalg.norm(moved))
        touched = editor.changed_balls(version)
        assert touched is not None
        balls = affected_balls(touched, contact, editor.max_influence)
        assert balls is not None
        gaps = np.linalg.norm(points[:, None].astype(np.float64) - balls[:, :3], axis=2)
        inside = (gaps < balls[:, 3]).any(axis=1)
        after = field(editor, points, contact)
        different = (after != before).any(axis=1)
        assert not (different & ~inside).any()
        changed, reached, before = changed + different.sum(), reached + inside.sum(), after
    assert changed > (0.02 if contact is Contact.RADIAL else 0.2) * reached


def test_an_index_whose_levels_are_read_in_another_order_is_said_to_change_everything() -> None:
    rng = np.random.default_rng(6)
    editor = DecalEditor(random_decals(rng).replace(radii=np.full(300, 0.1)))
    version = editor.version
    editor.change(7, radii=[0.9])
    editor.change(8, radii=[0.01])
    assert len(editor._index._level_of) == 3
    assert editor.changed_balls(version) is not None
    editor.assign(editor.numbers[:200], editor.take(editor.numbers[:200][::-1]))
    assert editor.changed_balls(version) is None
    version = editor.version
    editor.assign(editor.numbers[:200], editor.take(editor.numbers[:200][::-1]))
    touched = editor.changed_balls(version)
    assert touched is not None
    assert len(touched) == 400


def test_old_entries_are_forgotten_and_said_to_be_anywhere() -> None:
    dirty, ball = DirtyBalls(), np.ones((1, 4), np.float32)
    for version in range(1, MAX_DIRTY_BALLS + 11):
        dirty.add(version, version * ball)
    assert dirty.since(9) is None
    found = dirty.since(10)
    assert found is not None
    assert found[:, 0].tolist() == list(range(11, MAX_DIRTY_BALLS + 11))
    assert dirty.since(MAX_DIRTY_BALLS + 10) is not None
    dirty.add(MAX_DIRTY_BALLS + 11, np.ones((2 * MAX_DIRTY_BALLS, 4), np.float32))
    assert dirty.since(MAX_DIRTY_BALLS + 10) is None
    assert dirty.since(MAX_DIRTY_BALLS + 11) is not None


def test_radial_contact_reaches_as_far_as_neighbours_do_and_anywhere_among_very_uneven_ones() -> None:
    ball = np.array([[1.0, 2.0, 3.0, 0.5]], np.float32)
    for contact, largest, reach in (
        (Contact.PRODUCT, 9.0, 0.575 * 0.5),
        (Contact.RADIAL, 2.0, 0.575 * 0.5 + 0.4542 * 2.0),
    ):
        affected = affected_balls(ball, contact, largest)
        assert affected is not None
        assert affected[0, 3] == pytest.approx(reach, rel=1e-4)
    assert affected_balls(ball, Contact.RADIAL, 0.51 * MAX_SIZE_RATIO) is None
    nothing = affected_balls(ball[:0], Contact.RADIAL, 1e9)
    assert nothing is not None
    assert nothing.shape == (0, 4)


@pytest.mark.parametrize("shift", [0.0, 1000.0])
def test_small_decals_cut_no_ray_whose_rim_they_do_not_reach(shift: float) -> None:
    """What `MAX_SIZE_RATIO` is for: around a large decal's rim a small one is moved, resized and deleted."""
    rng, changed = np.random.default_rng(8), 0
    for step in range(60):
        small = 1.0 / rng.uniform(2.0, MAX_SIZE_RATIO)
        ways = unit(rng.normal(size=(1, 3)) + np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]))
        distances = np.array([[0.0], [1.0 + rng.uniform(-3.5, 3.5) * small]])
        normal = np.array([[0.0, 0.0, 1.0]])
        decals = Decals(
            shift + distances * ways, normal.repeat(2, 0), [[1, 0, 0]] * 2, [1.0, small], spill=[True, True]
        )
        editor = DecalEditor(decals)
        rays = unit(ways[1] + rng.normal(size=(2000, 3)) * small * np.exp(rng.uniform(-6.0, 1.5, (2000, 1))))
        points = (decals.positions[0] + rng.uniform(0.05, 1.0, (2000, 1)) * rays).astype(np.float32)

        def seen(editor: DecalEditor = editor, points: np.ndarray = points) -> np.ndarray:
            found = evaluate(editor, points, np.tile([0.0, 0.0, 1.0], (2000, 1)), contact=Contact.RADIAL)
            return np.column_stack([found.owner, found.field, found.uv])

        before, version = seen(), editor.version
        if step % 3:
            editor.change(1, positions=decals.positions[1:] + np.float32(0.3 * small) * decals.normals[1:])
        else:
            editor.delete(1)
        touched = editor.changed_balls(version)
        assert touched is not None
        reach = affected_balls(touched, Contact.PRODUCT, 0.0)
        assert reach is not None
        offsets = points.astype(np.float64) - decals.positions[0]
        rims = decals.positions[0] + unit(offsets)
        near = [
            (np.linalg.norm(places[:, None] - reach[:, :3], axis=2) < reach[:, 3]).any(axis=1)
            for places in (points.astype(np.float64), rims)
        ]
        different = (seen() != before).any(axis=1)
        assert not (different & ~near[0] & ~near[1]).any()
        changed += int((different & ~near[0]).sum())
    assert changed


def test_an_editor_that_becomes_another_has_changed_everywhere() -> None:
    editor = DecalEditor(random_decals(np.random.default_rng(7)))
    version, other = editor.version, editor.copy()
    other.change(3, radii=[0.2])
    editor.adopt(other)
    assert editor.changed_balls(version) is None
    version = editor.version
    editor.change(3, radii=[0.1])
    touched = editor.changed_balls(version)
    assert touched is not None
    assert len(touched) == 2
