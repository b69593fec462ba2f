"""Vertices on creases and corners of CSG, against the exact curves and points."""

from dataclasses import replace
from functools import reduce
from operator import and_
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree import Mesh, Node, Point, Polygonizer, Segment, Transform, polygonize, split_creases
from blobtree._typing import Float64Array
from blobtree.custom import define_skeleton
from tests.bench import creases as creases_bench
from tests.blobtree.meshing.test_polygonize import assert_closed, assert_valid, crosses, volume
from tests.blobtree.trees import random_trees
from tests.oracles.creases import circle, distance_to_crease, sphere_intersections

NEAR = 0.05
"""How far from the true crease a vertex may lie, in cells."""

CENTERS = np.array([(0.0, 0.0, 0.0), (0.8, 0.13, 0.07)])
RADII = (1.0, 0.9)
A = Point((0.0, 0.0, 0.0), radius=1.0, color=(1, 0, 0))
B = Point((0.8, 0.13, 0.07), radius=0.9, color=(0, 0, 1))
RING = circle(CENTERS[0], RADII[0], CENTERS[1], RADII[1])
PAIRS = pytest.mark.parametrize("pair", [A | B, A & B, A - B], ids=["union", "intersection", "difference"])


def longest(tree: Node) -> float:
    return float((tree.support[1] - tree.support[0]).max())


def sharp(tree: Node, resolution: int) -> tuple[Mesh, Float64Array, float]:
    """The mesh, its vertices on creases and corners, and the side of a cell."""
    mesh = polygonize(tree, resolution=resolution, creases=True)
    assert_valid(mesh)
    assert_closed(mesh)
    assert mesh.sheet_counts is not None
    assert mesh.sheet_counts.shape == (len(mesh.vertices),)
    return mesh, mesh.vertices[mesh.sheet_counts > 1].astype(np.float64), longest(tree) / resolution


def count_of(mesh: Mesh, sheet_count: int) -> int:
    assert mesh.sheet_counts is not None
    return int((mesh.sheet_counts == sheet_count).sum())


def widest_gap(points: Float64Array) -> float:
    """Length of the longest arc of the ring, in radians, that has no point."""
    _, _, axes = np.linalg.svd(RING.axis[None])
    u, v = ((points - RING.center) @ axis for axis in axes[1:])
    angles = np.sort(np.arctan2(v, u))
    return float(np.diff(angles, append=angles[0] + 2.0 * np.pi).max())


@PAIRS
@pytest.mark.parametrize("resolution", [16, 40, 100])
def test_two_balls_meet_in_a_circle(pair: Node, resolution: int) -> None:
    mesh, points, cell = sharp(pair, resolution)
    assert count_of(mesh, 0) == 0
    assert RING.distances(points).max() <= NEAR * cell
    assert widest_gap(points) * RING.radius <= 2.5 * cell


@pytest.mark.slow_cases("gaussian")
@pytest.mark.parametrize("falloff", ["wyvill", "gaussian"])
def test_profiles_of_primitives_leave_creases_in_place(falloff: str) -> None:
    """The radii, and so the circle, stay the same."""
    _, points, cell = sharp(replace(A, width=0.3) | replace(B, falloff=falloff, width=1.5), 24)
    assert RING.distances(points).max() <= NEAR * cell
    assert widest_gap(points) * RING.radius <= 2.5 * cell


@PAIRS
def test_a_mesh_without_creases_cuts_them_off(pair: Node) -> None:
    """The tests above fail without creases."""
    mesh, _, cell = sharp(pair, 40)
    plain = polygonize(pair, resolution=40)
    assert plain.sheet_counts is None
    assert len(plain.vertices) == len(mesh.vertices)
    assert mesh.sheet_counts is not None
    assert RING.distances(plain.vertices[mesh.sheet_counts > 1]).max() > 3.0 * NEAR * cell
    assert abs(volume(mesh) - volume(plain)) > 0.0


@PAIRS
@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_creases_of_any_size(pair: Node, scale: float) -> None:
    _, points, cell = sharp(pair.scale(scale), 24)
    assert RING.distances(points / scale).max() <= NEAR * cell / scale


@PAIRS
def test_creases_under_maps_that_stretch(pair: Node) -> None:
    """Turned, scaled by three factors and moved; measured where the balls are round."""
    placed = pair.rotate((1, 2, 3), 40.0).scale((1.0, 1.4, 0.8)).translate((0.3, -5.0, 2.0))
    _, points, cell = sharp(placed, 40)
    matrix = np.eye(4)
    node: Any = placed
    while node is not pair:
        matrix = matrix @ np.vstack([node.matrix, [0, 0, 0, 1]])
        (node,) = node.children
    inner = (points - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    assert len(points) > 40
    assert RING.distances(inner).max() <= NEAR * cell / 1.4


@PAIRS
def test_creases_under_a_twist(pair: Node) -> None:
    """Measured where it is undone, where lengths differ by the twist's stretch at most."""
    degrees = 50.0
    _, points, cell = sharp(pair.twist(degrees), 40)
    angles = -np.radians(degrees) * points[:, 2]
    x, y = points[:, 0], points[:, 1]
    inner = np.column_stack(
        [np.cos(angles) * x - np.sin(angles) * y, np.sin(angles) * x + np.cos(angles) * y, points[:, 2]]
    )
    shear = np.radians(degrees) * np.hypot(x, y).max()
    stretch = (shear + np.hypot(shear, 2.0)) / 2.0
    assert len(points) > 40
    assert RING.distances(inner).max() <= NEAR * cell / stretch


def test_a_drilled_ball() -> None:
    """A cylinder's rims on a ball, and the bore in its middle."""
    drill, bore = np.array([0.3, 0.1]), 0.4
    start, end = ((float(drill[0]), float(drill[1]), z) for z in (-3.0, 3.0))
    _, points, cell = sharp(A - Segment(start, end, radius=bore), 60)
    to_ball = np.linalg.norm(points, axis=1) - 1.0
    outward = points[:, :2] - drill
    to_bore = np.linalg.norm(outward, axis=1) - bore
    cosines = (points[:, :2] * outward).sum(axis=1) / (to_ball + 1.0) / (to_bore + bore)
    assert distance_to_crease(to_ball, to_bore, cosines).max() <= NEAR * cell
    assert len(points) > 2 * 2.0 * np.pi * bore / (1.5 * cell)


def test_three_balls_meet_in_two_corners() -> None:
    centers = [(0.0, 0.0, 0.0), (0.7, 0.1, 0.05), (0.3, 0.65, -0.1)]
    radii = (1.0, 0.9, 0.8)
    balls: list[Node] = [Point(c, radius=r) for c, r in zip(centers, radii, strict=True)]
    mesh, points, cell = sharp(reduce(and_, balls), 40)
    assert mesh.sheet_counts is not None
    corners = mesh.vertices[mesh.sheet_counts == 3].astype(np.float64)
    assert len(corners) == 2
    expected = sphere_intersections(centers, radii)
    distances = np.linalg.norm(corners[:, None] - expected, axis=2)
    assert distances.min(axis=0).max() <= NEAR * cell
    rings = [circle(centers[i], radii[i], centers[j], radii[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    assert np.min([ring.distances(points) for ring in rings], axis=0).max() <= NEAR * cell


def test_a_box_of_large_balls_has_twelve_edges_and_eight_corners() -> None:
    far = 20.0
    centers = [tuple(sign * far * axis) for axis in np.eye(3) for sign in (-1.0, 1.0)]
    box = reduce(and_, [Point(c, radius=far + 1.0) for c in centers])
    turned = box.rotate((1, 2, 3), 25.0)
    assert isinstance(turned, Transform)
    mesh = polygonize(turned, cell_size=0.11, creases=True)
    assert_closed(mesh)
    assert mesh.sheet_counts is not None
    matrix = np.array(turned.matrix)[:, :3]
    points = mesh.vertices.astype(np.float64) @ matrix
    gaps = np.abs(np.linalg.norm(points[:, None] - np.array(centers), axis=2) - (far + 1.0))
    touching = (gaps <= 0.5 * NEAR * 0.11).sum(axis=1)
    np.testing.assert_array_equal(touching[mesh.sheet_counts > 0], mesh.sheet_counts[mesh.sheet_counts > 0])
    assert count_of(mesh, 3) == 8
    assert count_of(mesh, 2) > 12 * 1.8 / (1.5 * 0.11)
    assert count_of(mesh, 0) == 0


def test_a_crease_inside_a_blend() -> None:
    """A union under a sum keeps its kink, where both balls are equal and the sum is on the surface."""
    tree = (A | B) + Point((0.4, 0.0, 1.0), radius=0.5)
    _, points, cell = sharp(tree, 40)
    mirrored = np.abs(A(points) - B(points)) / np.linalg.norm(A.gradient(points) - B.gradient(points), axis=1)
    off = np.abs(tree(points) - 0.5) / np.linalg.norm(tree.gradient(points), axis=1)
    assert len(points) > 40
    assert np.hypot(mirrored, off).max() <= NEAR * cell


@pytest.mark.parametrize("seed", range(3))
def test_random_trees(seed: int) -> None:
    """Closed, on the surface, and the gradient turns within NEAR of every vertex on a crease."""
    met = unmet = 0
    rng = np.random.default_rng(seed)
    for tree in random_trees(seed=140 + seed, count=10, depth=3):
        mesh, points, cell = sharp(tree, 32)
        if len(points) == 0:
            continue
        met, unmet = met + len(points), unmet + count_of(mesh, 0)
        steepness = np.linalg.norm(tree.gradient(points), axis=1)
        assert (np.abs(tree(points) - 0.5) <= NEAR * cell * steepness).all()
        ways = rng.normal(size=(64, 3))
        ways *= NEAR * cell / np.linalg.norm(ways, axis=1, keepdims=True)
        around = tree.gradient((points[:, None] + ways).reshape(-1, 3)).reshape(len(points), 64, 3)
        normals = around / np.linalg.norm(around, axis=2, keepdims=True)
        turns = 1.0 - np.einsum("nik,njk->nij", normals, normals).min(axis=(1, 2))
        assert np.median(turns) > 0.1
        assert (turns > 3e-4).mean() > 0.98
    assert met > 300
    assert unmet <= 0.1 * met


@PAIRS
def test_triangles_do_not_fold_over(pair: Node) -> None:
    """Faces look outward; what does not is a sliver between vertices of one crease."""
    mesh, _, cell = sharp(pair, 40)
    assert mesh.sheet_counts is not None
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    area = crosses(mesh) / 2.0
    inward = (area * -pair.gradient(middles)).sum(axis=1) < 0.0
    folded = np.linalg.norm(area[inward], axis=1) / cell**2
    on_one_crease = (mesh.sheet_counts[mesh.faces[inward]] == 2).all(axis=1)
    assert (folded[on_one_crease] < 0.02).all()
    assert folded[~on_one_crease].sum() < 0.1


def test_a_smooth_model_is_unchanged() -> None:
    tree = A + B
    plain, mesh = polygonize(tree, resolution=24), polygonize(tree, resolution=24, creases=True)
    for name in ("vertices", "faces", "normals", "colors"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(mesh, name))
    assert count_of(mesh, 1) == len(mesh.vertices)


def test_a_model_without_surface() -> None:
    mesh = polygonize(A & A.translate((10, 0, 0)), resolution=16, creases=True)
    assert len(mesh.vertices) == 0
    assert mesh.sheet_counts is not None
    assert mesh.sheet_counts.shape == (0,)


def test_meshes_with_creases_are_reproducible() -> None:
    before, after = A - B, A - B.translate((0.1, 0, 0))
    polygonizer = Polygonizer(before, cell_size=0.1, creases=True)
    first = polygonize(before, cell_size=0.1, creases=True)
    edited, fresh = polygonizer.update(after), polygonize(after, cell_size=0.1, creases=True)
    for one, other in ((Polygonizer(before, cell_size=0.1, creases=True).mesh, first), (edited, fresh)):
        for name in ("vertices", "faces", "normals", "colors", "sheet_counts"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


# -- normals of both sides ------------------------------------------------------------------------------


def test_a_normal_on_a_crease_lies_between_those_of_its_sides() -> None:
    mesh, points, _ = sharp(A & B, 40)
    assert mesh.sheet_counts is not None
    sides = [(points - center) / radius for center, radius in zip(CENTERS, RADII, strict=True)]
    mean = sides[0] + sides[1]
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals[mesh.sheet_counts > 1], mean, atol=1e-3)


@PAIRS
def test_split_creases_have_the_normals_and_colours_of_their_sides(pair: Node) -> None:
    mesh, _, _ = sharp(pair, 40)
    split = split_creases(pair, mesh)
    assert split.sheet_counts is not None
    np.testing.assert_array_equal(split.vertices[split.faces], mesh.vertices[mesh.faces])
    copies = len(split.vertices) - len(mesh.vertices)  # now and then all triangles lie on one side
    assert 0.8 * count_of(mesh, 2) < copies <= count_of(mesh, 2)
    on = split.sheet_counts > 1
    sides = np.stack([(split.vertices[on] - c) / r for c, r in zip(CENTERS, RADII, strict=True)], axis=1)
    turned = np.abs(np.einsum("nk,nsk->ns", split.normals[on], sides))
    side = turned.argmax(axis=1)
    assert (turned.max(axis=1) > 0.99).all()
    assert (np.bincount(side) >= 0.8 * count_of(mesh, 2)).all()
    np.testing.assert_allclose(split.colors[on], np.array([(1, 0, 0), (0, 0, 1)])[side], atol=1e-5)


def test_only_a_mesh_with_creases_is_split() -> None:
    plain = polygonize(A | B, resolution=16)
    assert split_creases(A | B, plain) is plain


# -- custom kinds, and graphics cards -------------------------------------------------------------


@wp.func
def _dot(q: wp.vec3, center: wp.vec3) -> wp.vec3:
    """Return a point, as a user would write it."""
    return center


@pytest.mark.slow
def test_creases_of_custom_skeletons() -> None:
    """Kernels for custom kinds compile for most of a minute."""
    dot = define_skeleton(_dot, name="crease_dot")
    first, second = (dot(tuple(c), radius=r) for c, r in zip(CENTERS.tolist(), RADII, strict=True))
    for tree in (first | second, first - second):
        _, points, cell = sharp(tree, 32)
        assert len(points) > 40
        assert RING.distances(points).max() <= NEAR * cell
    mesh = polygonize(first - second, chord_error=0.01, creases=True)
    assert len(mesh.faces) > 1000


@pytest.mark.gpu
def test_creases_on_a_graphics_card() -> None:
    figures = creases_bench.errors("cuda:0")
    assert figures["crease_error_h"] <= NEAR
    assert figures["unmet"] == 0
    assert figures["met"] > 500
    close = polygonize(A - B, chord_error=0.01, creases=True, device="cuda:0")
    assert 2000 < len(close.faces) < 8000
