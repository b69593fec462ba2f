from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from decals.errors import InvalidMesh, InvalidPoints
from decals.surfaces import MeshSurface, Surface
from tests.decals.meshes import box, plane, sphere
from tests.oracles.triangles import closest_points, first_hits
from tests.vectors import random_units


def triangle_soup(seed: int, count: int = 30) -> Any:
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1, 1, (3 * count, 3)).astype(np.float32)
    return vertices, np.arange(3 * count).reshape(-1, 3)


def test_a_mesh_is_a_surface() -> None:
    assert isinstance(plane(), Surface)


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_sphere_area_bounds_and_samples(radius: float) -> None:
    ball = sphere(radius)
    assert ball.area == pytest.approx(4 * np.pi * radius**2, rel=5e-3)
    assert np.allclose(ball.bounds, [[-radius] * 3, [radius] * 3], rtol=1e-2)
    positions, normals = ball.sample(5000, seed=3)
    assert positions.dtype == normals.dtype == np.float32
    assert np.allclose(np.linalg.norm(positions, axis=1), radius, rtol=1e-2)
    assert np.allclose(normals, positions / radius, atol=0.1)
    assert np.abs(positions.mean(axis=0)).max() < 0.02 * radius


def test_samples_are_uniform_by_area() -> None:
    slab = box((4.0, 1.0, 1.0))
    positions, normals = slab.sample(18_000, seed=0)
    on_top = normals[:, 2] > 0.5
    assert on_top.sum() == pytest.approx(4000, abs=2)
    counts, _ = np.histogram(positions[on_top, 0], bins=8, range=(-2, 2))
    assert np.abs(counts - 500).max() < 5 * np.sqrt(500)


def test_samples_repeat_for_a_seed_and_differ_for_another() -> None:
    ball = sphere()
    first, again, other = (ball.sample(100, seed=seed)[0].tobytes() for seed in (5, 5, 6))
    assert first == again != other
    assert len(ball.sample(0, seed=1)[0]) == 0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("seed", range(3))
def test_projection_finds_the_closest_point(seed: int, scale: float) -> None:
    vertices, faces = triangle_soup(seed)
    soup = MeshSurface(vertices * scale, faces)
    points = np.random.default_rng(seed + 100).uniform(-3, 3, (200, 3)) * scale
    positions, normals = soup.project(points)
    distances = np.linalg.norm(positions - points, axis=1)
    assert np.allclose(distances, closest_points(points, soup.vertices, faces), atol=2e-6 * scale, rtol=1e-5)
    assert np.allclose(closest_points(positions, soup.vertices, faces), 0, atol=1e-6 * scale)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    assert np.array_equal(soup.normal(points), normals)


def test_normals_follow_the_winding_of_the_faces() -> None:
    assert np.allclose(plane().normal([[0.1, 0.2, 3.0], [0.1, 0.2, -3.0]]), [0, 0, 1])
    turned = MeshSurface(plane().vertices, plane().faces[:, ::-1])
    assert np.allclose(turned.normal([[0.1, 0.2, 3.0]]), [0, 0, -1])


@pytest.mark.parametrize("seed", range(3))
def test_rays_hit_the_first_triangle(seed: int) -> None:
    vertices, faces = triangle_soup(seed)
    soup = MeshSurface(vertices, faces)
    origins = 3.0 * random_units(np.random.default_rng(seed), 300)
    ways = random_units(np.random.default_rng(seed + 50), 300)
    expected = first_hits(origins.astype(np.float32), ways, vertices, faces)
    found = soup.raycast(origins, 7.0 * ways)
    assert (np.isfinite(found) == np.isfinite(expected)).mean() > 0.99
    both = np.isfinite(found) & np.isfinite(expected)
    assert both.any()
    assert np.allclose(found[both], expected[both], rtol=1e-4)


def test_rays_toward_a_sphere_know_its_size() -> None:
    ways = random_units(np.random.default_rng(0), 500)
    distances = sphere(2.0, center=(5, 0, 0)).raycast(ways * 7 + [5, 0, 0], -ways)
    assert np.allclose(distances, 5.0, atol=0.02)
    assert np.isinf(sphere().raycast([[0, 0, 3], [0, 0, 3]], [[0, 0, 1], [0, 0, 0]])).all()


@pytest.mark.parametrize("turned", [False, True])
def test_a_closed_mesh_contains_its_inside_however_it_winds(turned: bool) -> None:
    ball = sphere(center=(3, 0, 0))
    if turned:
        ball = MeshSurface(ball.vertices, ball.faces[:, ::-1])
    ways = random_units(np.random.default_rng(0), 1000)
    center = [3, 0, 0]
    assert ball.closed
    assert ball.contains(center + 0.98 * ways).all()
    assert not ball.contains(center + 1.01 * ways).any()


def test_unwelded_closed_mesh_is_closed_and_open_ones_contain_nothing() -> None:
    cube = box()
    split = MeshSurface(cube.vertices[cube.faces].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert split.closed
    assert split.contains([[0.0, 0, 0], [0.6, 0, 0]]).tolist() == [True, False]
    lidless = MeshSurface(cube.vertices, cube.faces[1:])
    for surface in (lidless, plane()):
        assert not surface.closed
        assert not surface.contains([[0, 0, 0]]).any()


def test_degenerate_faces_are_tolerated() -> None:
    good = sphere()
    n = len(good.vertices)
    extra = [[0, 0, 1], [2, 2, 2], [n, n + 1, n + 2]]
    line = [[0, 0, 9], [0, 0, 10], [0, 0, 11]]
    surface = MeshSurface(np.vstack([good.vertices, line]), np.vstack([good.faces, extra]))
    assert surface.area == pytest.approx(good.area)
    assert np.array_equal(surface.bounds, good.bounds)
    assert np.array_equal(surface.sample(50, 1)[0], good.sample(50, 1)[0])
    assert np.array_equal(surface.project([[0, 0, 8.0]])[0], good.project([[0, 0, 8.0]])[0])
    assert surface.contains([[0, 0, 0]]).all()


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]], float)


@pytest.mark.parametrize(
    ("vertices", "faces", "says"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "vertices: expected an array of shape .* with n > 0"),
        (SQUARE, np.zeros((0, 3), int), "faces: expected shape"),
        (SQUARE, [[0, 1, 2, 0]], "triangulate"),
        (SQUARE[:, :2], [[0, 1, 2]], r"vertices: expected an array of shape \(n, 3\), got shape \(3, 2\)"),
        ("no mesh", [[0, 1, 2]], "vertices: expected an array of shape"),
        (SQUARE * np.nan, [[0, 1, 2]], "finite"),
        (SQUARE / [[1e-300, 1, 1]], [[0, 1, 2]], "finite"),
        (SQUARE, [[0, 1, 3]], "indices from 0 to 2, got 3"),
        (SQUARE, [[0, 1, -1]], "got -1"),
        (SQUARE, [[0.0, 1.0, 2.0]], "whole numbers"),
        (SQUARE, [[0, 1, 1]], "mesh with area"),
        (SQUARE * [1, 0, 1], [[0, 1, 2]], "mesh with area"),
    ],
)
def test_what_is_no_mesh_is_refused(vertices: Any, faces: Any, says: str) -> None:
    with np.errstate(all="ignore"), pytest.raises(InvalidMesh, match=says):
        MeshSurface(vertices, faces)


@pytest.mark.parametrize("points", [[[0, 0]], [0, 0, 0], [[np.nan, 0, 0]], [[np.inf, 0, 0]], "points"])
def test_what_are_no_points_is_refused(points: NDArray[Any]) -> None:
    for ask in (plane().project, plane().normal, plane().contains):
        with pytest.raises(InvalidPoints, match="points: expected"):
            ask(points)


def test_rays_need_as_many_origins_as_directions() -> None:
    with pytest.raises(InvalidPoints, match="as many directions"):
        plane().raycast([[0, 0, 1]], [[0, 0, 1], [0, 0, 1]])


def test_no_points_give_no_answers() -> None:
    none = np.zeros((0, 3))
    assert plane().project(none)[0].shape == (0, 3)
    assert plane().raycast(none, none).shape == plane().contains(none).shape == (0,)


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(1e-3, 1e3), st.floats(-100, 100))
def test_samples_lie_on_the_surface_at_any_scale_and_place(seed: int, scale: float, shift: Any) -> None:
    vertices, faces = triangle_soup(seed, count=5)
    soup = MeshSurface(vertices * scale + shift, faces)
    positions, normals = soup.sample(20, seed)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    assert closest_points(positions, soup.vertices, faces).max() <= 1e-6 * (scale + abs(shift))


@pytest.mark.parametrize("seed", range(4))
def test_parts_of_large_faces_get_their_share_and_neighbours_are_chance(seed: int) -> None:
    square = plane(2.0)
    positions, _ = square.sample(4096, seed)
    cells = np.floor((positions[:, :2] + 1.0) * 2.0).clip(0, 3).astype(int) @ [4, 1]
    counts = np.bincount(cells, minlength=16)
    # of points without any order a cell would get 256 give or take 15.5
    assert np.abs(counts - 256).max() < 24
    assert counts.std() < 10
    distances = np.linalg.norm(positions[:1500, None] - positions[:1500], axis=2)
    np.fill_diagonal(distances, np.inf)
    nearest = distances.min(axis=1)
    assert nearest.std() / nearest.mean() > 0.35


@pytest.mark.parametrize("unit", [1e-46, 1e-30, 3e-11, 1e-9, 1e12])
def test_a_mesh_whose_triangles_float32_cannot_compute_is_refused(unit: float) -> None:
    """The queries divide by the squares of areas: beyond this range they return corners of triangles."""
    ball = sphere()
    with pytest.raises(InvalidMesh, match=r"rescale the model$|check its units"):
        MeshSurface(ball.vertices.astype(np.float64) * unit, ball.faces)


@pytest.mark.parametrize("unit", [1e-7, 1e-3, 1e3, 1e10])
def test_queries_of_a_mesh_in_any_accepted_unit_are_exact(unit: float) -> None:
    ball = sphere()
    surface = MeshSurface(ball.vertices.astype(np.float64) * unit, ball.faces)
    centers = surface.vertices[surface.faces].astype(np.float64).mean(axis=1)
    found = surface.project(centers)[0]
    assert np.linalg.norm(found - centers, axis=1).max() < 1e-6 * unit


def test_a_few_tiny_triangles_are_accepted() -> None:
    ball = sphere()
    n = len(ball.vertices)
    corner = np.array([[0, 0, 3], [1e-12, 0, 3], [0, 1e-12, 3]])
    surface = MeshSurface(np.vstack([ball.vertices, corner]), np.vstack([ball.faces, [[n, n + 1, n + 2]]]))
    assert surface.area == pytest.approx(ball.area)


def test_the_log_names_thin_triangles_with_area(caplog: pytest.LogCaptureFixture) -> None:
    strip = np.array([[0, 0, 0], [1000, 0, 0], [1000, 1e-3, 0], [0, 1e-3, 0]])
    patch = np.array([[0, 0, 5], [0.5, 0, 5], [0, 0.5, 5]])
    vertices = np.vstack([strip, patch])
    surface = MeshSurface(vertices, [[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    assert surface.area == pytest.approx(0.125)
    (said,) = caplog.messages
    assert said.startswith(
        "Left out 2 of 3 triangles that are thinner than a millionth of their length, 89 %"
    )
    with pytest.raises(InvalidMesh, match="wider than a millionth of their length, got 2 thinner ones"):
        MeshSurface(strip, [[0, 1, 2], [0, 2, 3]])
    caplog.clear()
    MeshSurface(vertices, [[0, 0, 1], [4, 5, 6]])
    assert caplog.messages == []
