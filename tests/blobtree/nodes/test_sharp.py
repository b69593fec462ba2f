"""Solids with sharp edges: their distances, offsets, edges of meshes, rays and refusals."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, product
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
    Mesh,
    Node,
    Point,
    Prism,
    fit,
    from_json,
    numeric_parameters,
    polygonize,
    to_json,
)
from blobtree.errors import InvalidNode
from blobtree.tape.poses import maps_to_rest
from blobtree.tape.program import compile_program
from tests.blobtree.meshing.test_polygonize import assert_closed
from tests.oracles import blobtree as oracle
from tests.oracles import sharp
from tests.thin_trees import is_closed

Floats = Any
SQUARE = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0))
BLOCK = Box((0, 0, 0), (2, 1, 1), radius=0)
NEAR_EDGE, NEAR_VOLUME = 1e-4, 1e-3
"""Errors of meshes: distances of vertices from edges over the size, and relative errors of volumes."""


def random_solid(rng: np.random.Generator) -> tuple[Any, float]:
    """A sharp solid and its volume."""
    a, b = rng.uniform(-1, 1, (2, 3))
    first, last = rng.uniform(0.3, 0.8, 2).tolist()
    length = float(np.linalg.norm(b - a))
    match rng.integers(0, 4):
        case 0:
            size = rng.uniform(0.4, 2, 3)
            return Box(tuple(a), tuple(size), radius=0), float(size.prod())
        case 1:
            return Cylinder(tuple(a), tuple(b), first, radius=0), np.pi * first**2 * length
        case 2:
            volume = np.pi / 3 * (first**2 + first * last + last**2) * length
            return Frustum(tuple(a), tuple(b), first, last), volume
    count = int(rng.integers(4, 8))
    angles = np.arange(count) * 2 * np.pi / count
    flat = rng.uniform(0.6, 1, count)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    x, y = flat.T
    area = 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    return Prism(tuple(a + np.array([u, v, 0]) for u, v in flat), first), area * first


def distance_from_edges(node: Any, q: Floats) -> Floats:
    """Distances (n,) of points from the edges of a solid."""
    if isinstance(node, Cylinder | Frustum):
        corners = sharp.profile(node)[1:3]
        axis = np.subtract(node.end, node.start)
        axis = axis / np.linalg.norm(axis)
        along = (q - np.array(node.start)) @ axis
        across = np.linalg.norm(q - np.array(node.start) - along[:, None] * axis, axis=1)
        return np.min([np.hypot(across - r, along - x) for r, x in corners], axis=0)
    if isinstance(node, Box):
        signs = np.array(list(product((-0.5, 0.5), repeat=3)))
        edges = [(i, j) for i, j in combinations(range(8), 2) if np.abs(signs[i] - signs[j]).sum() == 1]
        corners = np.array(node.center) + signs * np.array(node.size)
    else:
        base, count = np.array(node.points), len(node.points)
        corners = np.concatenate([base, base + np.array([0, 0, node.height])])
        ring = [(i, (i + 1) % count) for i in range(count)]
        edges = [*ring, *((i + count, j + count) for i, j in ring), *((i, i + count) for i in range(count))]
    best = np.full(len(q), np.inf)
    for i, j in edges:
        way, w = corners[j] - corners[i], q - corners[i]
        t = np.clip(w @ way / (way @ way), 0, 1)
        best = np.minimum(best, np.linalg.norm(w - t[:, None] * way, axis=1))
    return best


def volume_of(mesh: Mesh) -> float:
    a, b, c = mesh.vertices.astype(np.float64)[mesh.faces].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum()) / 6.0


def check_mesh(seed: int) -> None:
    rng = np.random.default_rng(seed)
    solid, volume = random_solid(rng)
    turned = solid.rotate(tuple(rng.normal(size=3)), float(rng.uniform(0, 180)))
    size = float((turned.bounds[1] - turned.bounds[0]).max())
    mesh = polygonize(turned, chord_error=3e-4 * size, creases=True)
    assert is_closed(mesh.faces)
    assert volume_of(mesh) == pytest.approx(volume, rel=NEAR_VOLUME)
    assert mesh.sheet_counts is not None
    assert (mesh.sheet_counts > 0).all()
    there = mesh.vertices[mesh.sheet_counts > 1] @ np.array(turned.matrix)[:, :3]  # a rotation
    assert len(there) > 8
    assert distance_from_edges(solid, there).max() <= NEAR_EDGE * size


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


def test_files_keep_the_solids() -> None:
    tree = BLOCK | Prism(SQUARE, 0.7, radius=0.1) | Cone((0, 0, 0), (1, 0, 0), radius=0.2, end_radius=0)
    assert from_json(to_json(tree)) == tree
    assert eval(repr(BLOCK)) == BLOCK


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
            lambda: Box((0, 0, 0), (1, 0, 1), radius=0).tape,
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
