from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from blobtree import Box, EndlessRepeat, Node, Point, PolarRepeat, Repeat, Transform
from decals import Decals, evaluate, scatter
from decals.errors import InvalidDecals, InvalidScattering
from decals.scattering import on_copies
from decals.scattering.copies import has_copies, on_all_copies, one_copy
from decals.surfaces import ImplicitSurface
from tests.vectors import random_units

STONE = Point((0.2, 0.1, 0.0), radius=0.5) + Point((-0.2, 0.0, 0.1), radius=0.4)


@cache
def marks_of(node: Node) -> Decals:
    """Decals on the child of a repeat."""
    return scatter(node, count=24, images=[3, 5])


APART: dict[str, Repeat | PolarRepeat] = {
    "row": Repeat(STONE, (2.0, 0.5, 0.0), 3),
    "mirrored": Repeat(STONE, (0.0, 2.0, 1.0), 3, copies="mirrored"),
    "ring": PolarRepeat(STONE.translate((2, 0, 0)), (0, 0, 1), 5, "union"),
}


@pytest.mark.parametrize("name", APART)
def test_each_copy_shows_the_images_of_the_child(name: str) -> None:
    """At a point of a copy, the owner and the place in its image are those of the child's point."""
    repeat = APART[name]
    marks = marks_of(repeat.child)
    everywhere = on_copies(marks, repeat)
    count = len(repeat.expanded.children)
    assert len(everywhere) == count * len(marks)
    points, normals = _on(repeat.child)
    of_child = evaluate(marks, points, normals, contact="elastic")
    for number, copy in enumerate(repeat.expanded.children):
        linear, offset = _map(copy, repeat.child)
        there = evaluate(everywhere, points @ linear.T + offset, normals @ linear.T, contact="elastic")
        same = np.where(of_child.owner >= 0, of_child.owner + number * len(marks), -1) == there.owner
        assert same.mean() > 0.995  # points on contact lines round to either side
        sides = 1.0 if np.linalg.det(linear) > 0.0 else -1.0
        expected = np.array(of_child.uv)[same & (of_child.owner >= 0)]
        if sides < 0.0:
            expected[:, 0] = 1.0 - expected[:, 0]
        assert_allclose(np.array(there.uv)[same & (there.owner >= 0)], expected, atol=2e-3)


def _on(node: Node) -> tuple[Any, Any]:
    return ImplicitSurface(node).sample(2000, seed=0)


def _map(copy: Node, child: Node) -> tuple[Any, Any]:
    matrix = np.eye(3, 4) if copy is child else np.array(copy.matrix)  # type: ignore[attr-defined]
    return matrix[:, :3], matrix[:, 3]


def test_a_grid_takes_two_calls_and_keeps_all_columns() -> None:
    row = Repeat(STONE, (2, 0, 0), 2)
    grid = Repeat(row, (0, 2, 0), 3)
    marks = marks_of(STONE).replace(
        layers=np.arange(24) % 3, tints=random_units(np.random.default_rng(0), 24) ** 2
    )
    everywhere = on_copies(on_copies(marks, row), grid)
    assert len(everywhere) == 6 * 24
    for name in ("images", "layers", "tints", "radii", "opacities"):
        assert_allclose(getattr(everywhere, name), np.concatenate([getattr(marks, name)] * 6))
    corner = everywhere[5 * 24 :]
    assert_allclose(corner.positions, marks.positions + np.array([2.0, 4.0, 0.0]), atol=1e-6)
    assert_allclose(corner.tangents, marks.tangents, atol=1e-6)


@settings(max_examples=12, deadline=None)
@given(step=st.floats(0.5, 1.6), joining=st.sampled_from(["sum", "union"]))
@example(step=1.21, joining="union")
@example(step=1.29, joining="union")
def test_decals_lie_on_copies_that_touch_and_none_is_buried(step: float, joining: Any) -> None:
    row = Repeat(STONE, (step, 0.0, 0.0), 3, joining)
    everywhere = on_copies(marks_of(STONE), row)
    assert 24 < len(everywhere) <= 72
    assert np.abs(row(everywhere.positions) - 0.5).max() < 1e-3
    slopes = -row.gradient(everywhere.positions)
    slopes /= np.linalg.norm(slopes, axis=1, keepdims=True)
    assert np.median(np.einsum("ni,ni->n", slopes, everywhere.normals)) > 0.99
    assert_allclose(np.einsum("ni,ni->n", everywhere.tangents, everywhere.normals), 0.0, atol=1e-5)


@pytest.mark.parametrize("name", APART)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_repeat_below_transforms_gets_the_decals_moved_as_it_is(name: str, seed: int) -> None:
    repeat, rng = APART[name], np.random.default_rng(seed)
    axis, offset = random_units(rng, 1)[0], rng.uniform(-20.0, 20.0, 3)
    angle, factor = rng.uniform(0.0, np.pi), rng.uniform(0.5, 2.0)
    linear = _turn(axis, angle)

    def moved(decals: Decals) -> Decals:
        return decals.replace(
            positions=factor * decals.positions @ linear.T + offset,
            normals=decals.normals @ linear.T,
            tangents=decals.tangents @ linear.T,
            radii=factor * decals.radii,
        )

    turned = Transform(repeat, tuple((*row, 0.0) for row in linear.tolist()))
    tree = turned.scale(factor).translate(offset.tolist())
    marks = marks_of(repeat.child)
    found, expected = on_copies(moved(marks), tree), moved(on_copies(marks, repeat))
    for field, error in (("positions", 1e-4), ("normals", 1e-4), ("tangents", 1e-4), ("radii", 1e-5)):
        assert_allclose(getattr(found, field), getattr(expected, field), atol=error)
    one, copies = one_copy(tree)
    assert copies == len(repeat.expanded.children)
    assert_allclose(one(moved(marks).positions), 0.5, atol=1e-3)


def _turn(axis: Any, angle: float) -> Any:
    """Return the rotation (3, 3) around an axis (Rodrigues)."""
    across = np.cross(np.eye(3), axis)
    return np.eye(3) - np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across


def test_transforms_may_stretch_a_row_but_not_a_ring() -> None:
    row, ring = APART["row"], APART["ring"]
    stretched = row.scale((1.0, 2.0, 1.0))
    marks = scatter(one_copy(stretched)[0], count=24)
    everywhere = on_copies(marks, stretched)
    assert_allclose(everywhere.positions[48:] - marks.positions, [[4.0, 2.0, 0.0]] * 24, atol=1e-5)
    with pytest.raises(InvalidScattering, match="expected copies of one shape"):
        on_copies(marks, ring.scale((1.0, 2.0, 1.0)))


def test_one_copy_of_a_grid_is_below_its_transforms() -> None:
    row = Repeat(STONE, (2, 0, 0), 2).translate((0, 1, 0))
    grid = Repeat(row, (0, 2, 0), 3).scale(2.0)
    one, copies = one_copy(grid)
    assert one == STONE.translate((0, 1, 0)).scale(2.0)
    assert copies == 6
    assert has_copies(grid)
    assert not has_copies(one)
    everywhere = on_all_copies(scatter(one, count=10), grid)
    assert_allclose(everywhere.positions[-10:] - everywhere.positions[:10], [[4.0, 8.0, 0.0]] * 10, atol=1e-5)
    assert one_copy(STONE) == (STONE, 1)


def test_copies_apart_keep_every_decal_however_many_and_far_they_are() -> None:
    ball = Point((0, 0, 0), radius=0.5)
    marks = scatter(ball, count=30)
    for step in (2.0, 100.0):
        everywhere = on_copies(marks, Repeat(ball, (step, 0, 0), 100))
        offsets = np.arange(100)[:, None, None] * [step, 0.0, 0.0]
        assert_allclose(everywhere.positions, (marks.positions + offsets).reshape(-1, 3), atol=1e-3)


def test_decals_between_solids_that_touch_are_left_out() -> None:
    crate = Box((0, 0, 0), (1, 1, 1), radius=0)
    marks = scatter(crate, count=60, sizing="touching")
    hidden = np.abs(marks.positions[:, 0]) > 0.4999
    row = on_copies(marks, Repeat(crate, (1, 0, 0), 4, "union"))
    outermost = (np.abs(row.positions[:, 0] - 1.5) > 1.9999).sum()
    assert outermost == hidden.sum()  # one end of the first crate, and one of the last
    assert not ((np.abs(row.positions[:, 0] % 1.0 - 0.5) < 1e-4) & (np.abs(row.normals[:, 0]) > 0.9))[
        np.abs(row.positions[:, 0] - 1.5) < 1.9
    ].any()
    assert len(row) >= 4 * (len(marks) - hidden.sum()) + outermost - 6


def test_nothing_stays_nothing() -> None:
    assert len(on_copies(Decals.empty(), APART["row"])) == 0


@pytest.mark.parametrize(
    "node", [STONE, EndlessRepeat(STONE, (3, 0, 0)), Box((0, 0, 0), (1, 1, 1), radius=0), None]
)
def test_other_nodes_are_refused(node: Any) -> None:
    with pytest.raises(InvalidScattering, match="expected a Repeat or a PolarRepeat"):
        on_copies(marks_of(STONE), node)


def test_other_decals_are_refused() -> None:
    wrong: Any = marks_of(STONE).positions
    with pytest.raises(InvalidDecals, match="expected a Decals"):
        on_copies(wrong, Repeat(STONE, (2, 0, 0), 2))


def test_more_decals_than_memory_holds_are_refused() -> None:
    many = Decals.concatenate([marks_of(STONE)] * 417)
    with pytest.raises(
        InvalidScattering, match="at most 100,000,000 on all copies, got 10,008 on each of 10,000"
    ):
        on_copies(many, Repeat(STONE, (2, 0, 0), 10_000))
