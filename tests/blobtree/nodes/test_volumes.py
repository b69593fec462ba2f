"""Volumes: fields of sampled distances, from grids, functions and triangle meshes; distances from trees."""

import json
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from blobtree import (
    ISO,
    RIM,
    Point,
    Segment,
    Volume,
    from_json,
    from_mesh,
    from_sdf,
    polygonize,
    sample,
    to_json,
    to_sdf,
)
from blobtree._typing import Float64Array
from blobtree.errors import InvalidFile, InvalidNode
from blobtree.nodes.paths import moved, resized
from blobtree.nodes.samples import Samples
from tests.blobtree.meshing.test_polygonize import assert_closed
from tests.blobtree.trees import points_around
from tests.conformance import broken_laws


def ball_distance(points: Float64Array) -> Float64Array:
    distances: Float64Array = np.linalg.norm(points - 0.1, axis=1) - 1.0
    return distances


def slab_distance(points: Float64Array) -> Float64Array:
    distances: Float64Array = np.abs(points[:, 2]) - 0.3
    return distances


BALL = from_sdf(ball_distance, (-1.6, -1.7, -1.8), (1.9, 1.9, 1.9), spacing=0.1, width=0.6, color=(1, 0, 0))
SLAB = from_sdf(slab_distance, (-1, -1, -0.8), (1, 1, 0.8), spacing=0.1, width=0.4)
EACH = pytest.mark.parametrize("node", [BALL, SLAB], ids=["ball", "slab"])


def test_a_sampled_ball_is_a_point() -> None:
    """Of radius 1, where the blend width is that of a point."""
    width = 1.0 / RIM - 1.0
    sampled = from_sdf(ball_distance, (-3, -3, -3), (3, 3, 3), spacing=0.1, width=width)
    exact = Point((0.1, 0.1, 0.1), radius=1.0)
    points = points_around(np.random.default_rng(3), exact, 1000)
    outer = np.linalg.norm(points - np.float32(0.1), axis=1) > 0.3  # distances have a kink in the middle
    np.testing.assert_allclose(sampled(points[outer]), exact(points[outer]), atol=5e-3)
    mesh = polygonize(sampled, resolution=60)
    limit = sampled.spacing**2 / 4.0 * 1.1  # curvature 1
    assert np.abs(ball_distance(mesh.vertices.astype(np.float64))).max() < limit


@EACH
def test_values_and_bounds_hold(node: Volume) -> None:
    laws = ("value", "gradient", "interval", "Lipschitz bound", "box", "file", "pickle")
    for each in (node, node.offset(0.1)):
        assert broken_laws(each, np.random.default_rng(4), *laws) == []


def test_volumes_blend_under_maps_and_are_traced() -> None:
    tree = BALL.rotate((1, 2, 3), 30).scale((1.0, 0.8, 1.2)) + Segment((0, 0, 0), (2, 0, 0), radius=0.3)
    tree = (tree - SLAB.translate((0, 0, 1))).twist(20.0)
    mesh = polygonize(tree, resolution=40)
    assert_closed(mesh)
    assert len(mesh.faces) > 400
    eye = np.array([6.0, 5.0, 4.0])
    hits = tree.raycast(np.tile(eye, (200, 1)), mesh.vertices[:200] - eye)
    assert hits.hit.mean() > 0.9
    assert np.quantile(np.abs(tree(hits.positions[hits.hit]) - ISO), 0.99) < 2e-3


@EACH
def test_files_pickles_and_edits(node: Volume) -> None:
    assert hash(from_json(to_json(node))) == hash(node)
    assert len(repr(node)) < 300
    assert "numbers; save() or to_json() keep them" in repr(node)
    points = points_around(np.random.default_rng(6), node, 200)
    shift = np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(moved(node, shift)(points + shift), node(points), atol=2e-5)
    twice = resized(node, 2.0)
    corner = np.array(node.corner)
    np.testing.assert_allclose(twice(corner + 2.0 * (points - corner)), node(points), atol=2e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shape": [3, 3, 3]}, "samples: expected 108 bytes"),
        ({"shape": [0, 3, 3]}, "samples: expected a grid of at least 2 × 2 × 2 numbers"),
        ({"shape": [100000, 100000, 3]}, "samples: expected at most"),
        ({"data": "AAAA"}, "samples: expected numbers compressed by zlib, got damaged data"),
    ],
)
def test_damaged_files_are_refused(change: dict[str, Any], message: str) -> None:
    file = json.loads(to_json(BALL))
    file["nodes"][0]["samples"].update(change)
    with pytest.raises(InvalidFile, match=message):
        from_json(json.dumps(file))


def fails(_points: Float64Array) -> Float64Array:
    raise KeyError("no distance")


GRID = np.linalg.norm(np.stack(np.meshgrid(*[np.arange(-3.0, 4.0)] * 3)), axis=0) - 2.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: from_sdf(np.where(GRID > 1.0, np.nan, GRID), (0, 0, 0), spacing=1.0, width=1.0),
            "finite numbers",
        ),
        (lambda: from_sdf(GRID[0], (0, 0, 0), spacing=1.0, width=1.0), "2 × 2 × 2 numbers, got the shape"),
        (lambda: from_sdf(GRID[:, :, :1], (0, 0, 0), spacing=1.0, width=1.0), "2 × 2 × 2 numbers"),
        (lambda: from_sdf("grid", (0, 0, 0), spacing=1.0, width=1.0), "expected an array of numbers"),
        (lambda: from_sdf(10.0 * GRID, (0, 0, 0), spacing=1.0, width=1.0), "change by about 1 per unit"),
        (lambda: from_sdf(GRID + 9.0, (0, 0, 0), spacing=1.0, width=1.0), "expected some below 0"),
        (lambda: from_sdf(GRID, (0, 0, 0), spacing=0.0, width=1.0), "spacing: expected a number above 0"),
        (lambda: from_sdf(GRID, (0, 0, 0), spacing=1.0, width=-1.0), "width: expected a number above 0"),
        (
            lambda: from_sdf(ball_distance, (0, 0, 0), spacing=1.0, width=1.0),
            "upper: expected the other corner",
        ),
        (
            lambda: from_sdf(ball_distance, (0, 0, 0), (1, 0, 1), spacing=1.0, width=1.0),
            "upper: expected a corner above",
        ),
        (
            lambda: from_sdf(ball_distance, (0, 0, 0), (1, 1, 1), spacing=1e-6, width=1.0),
            "spacing: expected at most",
        ),
        (
            lambda: from_sdf(lambda p: p, (0, 0, 0), (1, 1, 1), spacing=0.5, width=1.0),
            "distances: expected 27 numbers",
        ),
        (
            lambda: from_sdf(fails, (0, 0, 0), (1, 1, 1), spacing=0.5, width=1.0),
            "distances: the function fails: KeyError",
        ),
    ],
)
def test_wrong_distances_are_refused(make: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        make()


# -- meshes ---------------------------------------------------------------------------------------------


def test_a_mesh_becomes_a_solid_within_a_cell() -> None:
    cube = pv.Cube(x_length=2.0, y_length=1.0, z_length=1.5)
    solid = from_mesh(cube, cell_size=0.1)
    mesh = polygonize(solid, resolution=50)
    assert_closed(mesh)
    half = np.array([1.0, 0.5, 0.75])
    beyond = np.abs(mesh.vertices) - half
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    assert np.abs(outside).max() < 0.1
    corners = half * np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    gaps = np.linalg.norm(mesh.vertices[None] - corners[:, None], axis=2).min(axis=1)
    assert gaps.max() < 0.1 * np.sqrt(3.0)


def test_meshes_of_every_kind_and_either_orientation_are_the_same_solid() -> None:
    sphere = pv.Sphere(theta_resolution=20, phi_resolution=20)
    points, faces = np.asarray(sphere.points), sphere.regular_faces
    expected = from_mesh(sphere, cell_size=0.1)
    assert from_mesh((points, faces), cell_size=0.1) == expected
    assert from_mesh(sphere.cast_to_unstructured_grid(), cell_size=0.1) == expected
    soup = points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    turned = from_mesh((points, faces[:, ::-1]), cell_size=0.1)
    for other in (from_mesh(soup, cell_size=0.1), turned):
        np.testing.assert_allclose(other.samples.array, expected.samples.array, atol=1e-5)
    again = from_mesh(polygonize(expected, resolution=40), cell_size=0.1)
    inside = [[0.0, 0.0, 0.0], [0.9, 0.9, 0.9]]
    assert (again(inside) >= ISO).tolist() == (expected(inside) >= ISO).tolist() == [True, False]


def test_distances_of_a_mesh_are_exact_at_the_grid_points() -> None:
    solid = from_mesh(pv.Cube(), cell_size=0.25, width=0.5)
    counts = solid.samples.shape
    grid = np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), axis=-1)
    q = np.abs(np.array(solid.corner) + solid.spacing * grid) - 0.5
    exact = np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0)
    np.testing.assert_allclose(solid.samples.array * solid.spacing, np.clip(exact, -1.0, 1.0), atol=1e-5)


def test_an_open_mesh_is_refused_as_a_solid_and_has_a_shell() -> None:
    sheet = pv.Plane(i_resolution=2, j_resolution=2)
    with pytest.raises(InvalidNode, match="expected a closed surface, got 8 edges with a hole"):
        from_mesh(sheet)
    shell = from_mesh(sheet, cell_size=0.05, radius=0.1)
    np.testing.assert_allclose(shell([[0.0, 0.0, 0.1], [0.2, 0.1, -0.1], [0.6, 0.0, 0.0]]), ISO, atol=2e-3)
    assert (shell([[0.0, 0.0, 0.3], [0.0, 0.0, 0.0]]) >= ISO).tolist() == [False, True]


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        ("bunny", "mesh: expected a pyvista mesh"),
        (pv.PolyData(), "mesh: expected triangles"),
        ((np.zeros((3, 2)), [[0, 1, 2]]), r"finite vertices of shape \(n, 3\)"),
        ((np.full((3, 3), np.nan), [[0, 1, 2]]), "finite vertices"),
        ((np.eye(3), [[0, 1, 3]]), "indices from 0 to 2"),
        ((np.eye(3), [[0.0, 1.0, 2.0]]), "whole numbers"),
        ((np.eye(3), [[0, 1, 1]]), "expected triangles with three different corners, got none"),
        ((np.eye(3), np.zeros((0, 3), int)), "expected triangles"),
    ],
    ids=range(8),
)
def test_wrong_meshes_are_refused(mesh: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        from_mesh(mesh)
    with pytest.raises(InvalidNode, match="cell_size: expected a grid of at most"):
        from_mesh(pv.Cube(), cell_size=1e-4)


@pytest.mark.slow
def test_a_large_mesh_blends_and_traces() -> None:
    """100,352 triangles, a mesh of 48 cells and 10,000 rays."""
    sphere = pv.Sphere(radius=1.0, theta_resolution=225, phi_resolution=225)
    solid = from_mesh(sphere)
    tree = solid + Segment((0, 0, 0), (0, 0, 1.5), radius=0.2)
    rays = np.random.default_rng(7).normal(size=(10_000, 3))
    mesh = polygonize(tree.translate((0.1, 0.0, 0.0)), resolution=48)
    rays *= 4.0 / np.linalg.norm(rays, axis=1, keepdims=True)
    hits = tree.raycast(rays, -rays)
    below = rays[:, 2] < -1.0  # these meet the ball alone
    assert np.abs(np.linalg.norm(hits.positions[below], axis=1) - 1.0).max() < solid.spacing
    away = mesh.vertices[:, 2] < 0.5
    assert np.abs(np.linalg.norm(mesh.vertices[away] - [0.1, 0.0, 0.0], axis=1) - 1.0).max() < solid.spacing


# -- distances of trees ---------------------------------------------------------------------------------


def test_distances_from_a_tree_are_within_their_error() -> None:
    points = np.random.default_rng(8).uniform(-2.0, 2.0, (500, 3))
    found = to_sdf(Point((0.1, 0.1, 0.1), radius=1.0), points, resolution=48)
    error = np.abs(found.values - ball_distance(points)).max()
    assert error <= 2.0 * found.error + 1e-6
    assert found.error < 3e-3
    assert (found.values < 0.0).sum() > 20
    one = to_sdf(Point((0.1, 0.1, 0.1), radius=1.0), points[0], resolution=48)
    assert one.values == found.values[0]


def test_a_tree_through_distances_and_back() -> None:
    tree = Point((0, 0, 0), radius=0.7) | Segment((0, 0, 0), (1, 0, 0), radius=0.4)
    axes = [np.arange(low, high, 0.1) for low, high in ((-1.0, 1.8), (-1.0, 1.1), (-1.0, 1.1))]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    distances = to_sdf(tree, grid.reshape(-1, 3)).values.reshape(grid.shape[:3])
    volume = from_sdf(distances, grid[0, 0, 0], spacing=0.1, width=0.3)
    mesh = polygonize(volume, resolution=40)
    gaps = np.abs(tree(mesh.vertices) - ISO) / np.linalg.norm(tree.gradient(mesh.vertices), axis=1)
    assert gaps.max() < 0.05
    assert np.median(gaps) < 0.005


def test_a_tree_without_a_surface_has_no_distances() -> None:
    nothing = Point((0, 0, 0), radius=0.1) & Point((9, 9, 9), radius=0.1)
    with pytest.raises(InvalidNode, match="expected a surface, got none"):
        to_sdf(nothing, [[0, 0, 0]])
    with pytest.raises(InvalidNode, match="expected a BlobTree node"):
        to_sdf("tree", [[0, 0, 0]])  # type: ignore[arg-type]


def test_samples_are_values() -> None:
    one, other = Samples.of(GRID), Samples.of(GRID.tolist())
    assert one == other
    assert len({one, other}) == 1
    assert not one.array.flags.writeable
    np.testing.assert_allclose(one.array, GRID, rtol=1e-6)


def test_a_sampled_tree_has_the_surface_of_the_tree() -> None:
    tree = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0), (2, 0.3, 0), radius=0.4)
    volume = sample(tree, spacing=0.1, color=(1.0, 0.0, 0.0))
    mesh = polygonize(tree, resolution=16)
    normals = 0.1 * mesh.normals
    assert (volume(mesh.vertices + normals) < ISO).all()
    assert (volume(mesh.vertices - normals) > ISO).all()
    assert volume.width == pytest.approx(0.4)
    assert volume.color == (1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("tree", "spacing", "message"),
    [
        (Point((0, 0, 0), radius=1.0), 0.0, "spacing"),
        (Point((0, 0, 0), radius=1.0), 1e-4, "take a larger one"),
        (Point((0, 0, 0), radius=1.0) & Point((9, 0, 0), radius=1.0), 0.1, "surface"),
        ("no tree", 0.1, "tree"),
    ],
)
def test_trees_that_cannot_be_sampled_are_refused(tree: Any, spacing: float, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        sample(tree, spacing=spacing)
