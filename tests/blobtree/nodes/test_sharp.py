"""Solids with sharp edges: their distances, offsets, edges of meshes, rays and refusals."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blobtree import (
    Box,
    Cone,
    Cylinder,
    Disc,
    Frustum,
    HalfSpace,
    Node,
    Point,
    Prism,
    fit,
    numeric_parameters,
    polygonize,
)
from blobtree.errors import InvalidNode
from blobtree.tape.poses import maps_to_rest
from blobtree.tape.program import compile_program
from tests.blobtree.meshing.test_polygonize import assert_closed
from tests.oracles import blobtree as oracle
from tests.oracles import sharp
from tests.sharp_solids import measured, volume_of

Floats = Any
SQUARE = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0))
BLOCK = Box((0, 0, 0), (2, 1, 1), radius=0)
NEAR_EDGE, NEAR_VOLUME = 1e-4, 1e-3
"""Errors of meshes: distances of vertices from edges over the size, and relative errors of volumes."""


def check_mesh(seed: int) -> None:
    found = measured(seed)
    assert found.closed
    assert found.edge <= NEAR_EDGE
    assert found.volume <= NEAR_VOLUME
    assert found.unresolved == 0


@pytest.mark.parametrize("seed", range(8))
def test_meshes_have_the_edges(seed: int) -> None:
    check_mesh(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8, 100))
def test_meshes_of_a_hundred_solids_have_the_edges(seed: int) -> None:
    check_mesh(seed)


@pytest.mark.parametrize("center", [(0, 0, 0), (1, 0.5, 0.5), (0.1, 0.2, 0.3)])
@pytest.mark.parametrize("size", [(2, 1, 1), (1, 3, 2)])
def test_boxes_on_the_grid_are_exact(size: Any, center: Any) -> None:
    mesh = polygonize(Box(center, size, radius=0), resolution=32, creases=True)
    assert_closed(mesh)
    assert volume_of(mesh) == pytest.approx(np.prod(size), rel=1e-6)
    corners = np.abs(mesh.vertices[mesh.sheet_counts == 3] - center) - 0.5 * np.array(size)
    assert len(corners) >= 8
    assert np.abs(corners).max() < 1e-6


def test_edges_of_cuts_are_those_of_solids() -> None:
    drilled = BLOCK - Cylinder((0, 0, -1), (0, 0, 1), 0.3, radius=0)
    mesh = polygonize(drilled, chord_error=1e-4, creases=True)
    assert volume_of(mesh) == pytest.approx(2.0 - np.pi * 0.09, rel=NEAR_VOLUME)


lengths = st.floats(0.05, 3.0)


@given(st.tuples(lengths, lengths, lengths), st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3))
def test_a_field_is_a_falloff_of_the_distance(size: Any, place: list[float]) -> None:
    box = Box((0.1, -0.2, 0.3), size, radius=0)
    expected = oracle.value(box, [place])
    (value,) = box(np.array([place]))
    assert value == pytest.approx(expected[0], abs=2e-6)
    inside = sharp.distance(box, np.array([place]))[0] < 0.0
    assert (value > 0.5) == inside or abs(value - 0.5) < 1e-5


@given(
    st.sampled_from([BLOCK, Prism(SQUARE, 0.7), Frustum((0, 0, 0), (0, 0, 1), 0.8, 0.2)]),
    st.floats(-0.15, 0.3),
)
def test_offsets_are_level_sets_of_the_distance(solid: Any, offset: float) -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.5, 1.5, (200, 3))
    moved = sharp.distance(solid, points) - offset
    clear = np.abs(moved) > 1e-5
    assert ((solid.offset(offset)(points) > 0.5) == (moved < 0.0))[clear].all()


def test_the_field_rises_to_the_middle() -> None:
    assert BLOCK([[0.0, 0.0, 0.5], [0.0, 0.0, 0.25], [0.0, 0.0, 0.0]]) == pytest.approx(
        [0.5, 0.853, 1.0], abs=1e-3
    )


def test_rays_meet_the_faces() -> None:
    origins = np.array([[0, 0, 5], [0.9999, 0.4999, 5], [1.0001, 0, 5]], np.float32)
    hits = BLOCK.raycast(origins, [[0, 0, -1]] * 3)
    assert hits.distances == pytest.approx([4.5, 4.5, np.inf], abs=1e-5)
    assert hits.normals[:2] == pytest.approx(np.array([[0, 0, 1]] * 2), abs=1e-6)


def test_blends_read_the_field() -> None:
    tower = BLOCK + Point((0, 0, 0.6), radius=0.4)
    assert tower([[0, 0, 1.02]])[0] > Point((0, 0, 0.6), radius=0.4)([[0, 0, 1.02]])[0]
    assert_closed(polygonize(tower, resolution=32, creases=True))


def test_a_fit_leaves_edges_sharp() -> None:
    assert "radius" not in [parameter.name for parameter in numeric_parameters(BLOCK)]
    mesh = polygonize(Box((0.05, 0, 0), (2.1, 1, 1), radius=0), resolution=24)
    found = fit(BLOCK, mesh.vertices)
    assert found.tree.radius == 0.0  # type: ignore[attr-defined]
    assert found.tree.size == pytest.approx((2.1, 1, 1), abs=2e-3)  # type: ignore[attr-defined]


@pytest.mark.parametrize("solid", [BLOCK, Prism(SQUARE, 0.7), Frustum((0, 0, 0), (0, 0, 1), 0.8, 0.2)])
def test_a_pose_moves_the_solid(solid: Any) -> None:
    names = [name for name in ("center", "start", "end") if hasattr(solid, name)]
    moved: Any = {name: np.add(getattr(solid, name), (1, 2, 3)) for name in names}
    if not names:
        moved = {"points": np.add(solid.points, (1, 2, 3))}
    posed = replace(solid, **moved)
    (back,) = maps_to_rest(posed, compile_program(posed), solid)
    assert back @ (1.5, 2.5, 3.5, 1.0) == pytest.approx([0.5, 0.5, 0.5, 1.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Box((0, 0, 0), (1, 0, 1), radius=0),
            "expected one above 0 for a box without thickness",
        ),
        (lambda: Cone((0, 0, 0), (1, 0, 0), radius=0, end_radius=0), "a radius above 0 at one end"),
        (lambda: Frustum((0, 0, 0), (0, 0, 1), 0, 0), "a radius above 0 at one end"),
        (lambda: Frustum((0, 0, 0), (0, 0, 0), 1, 0), "end: expected another point"),
        (lambda: Frustum((0, 0, 0), (0, 0, 1), -1, 1), "start_radius: expected a number from 0"),
        (lambda: Prism(SQUARE[:2], 1.0), "points: expected at least three corners"),
        (lambda: Prism((*SQUARE[:3], (0, 1, 1)), 1.0), "points: expected corners in one plane"),
        (lambda: Prism(SQUARE, 0.0), "height: expected a number above 0"),
        (lambda: Prism(SQUARE, 1.0, radius=-1), "radius: expected a number from 0"),
        (
            lambda: Cylinder((0, 0, 0), (1, 0, 0), 1.0, radius=float("nan")),
            "radius: expected a finite number",
        ),
        (lambda: HalfSpace((0, 0, 0), (0, 0, 1), 1.0, radius=-1.0), "radius: expected a number from 0"),
        (lambda: Disc((0, 0, 0), (0, 0, 1), 1.0, radius=0.0), "radius: expected a number above 0"),
        (lambda: BLOCK.offset(-0.5).tape, "offset: -0.5 leaves nothing of a solid"),
    ],
)
def test_wrong_solids_are_refused(make: Callable[[], Node], message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()


@pytest.mark.parametrize("radii", [(1e12, 1.0), (1.0, 1e12), (1e12, 0.0)])
def test_a_cone_that_is_almost_flat(radii: tuple[float, float]) -> None:
    flat = Frustum((0, 0, 0), (0, 0, 1), *radii)
    np.testing.assert_allclose(flat([[0, 0, 0], [0, 0, 1]]), 0.5, atol=1e-6)
