from typing import Any

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import SphericalVoronoi

from blobtree import Point, PolarRepeat, Repeat, Segment
from blobtree.kernels import COMPILING
from decals import Decals, Sizing, scatter
from decals.errors import InvalidScattering
from decals.scattering import ImageChoice, Orientation
from decals.surfaces import ImplicitSurface, MeshSurface, Surface
from tests.decals.meshes import box, plane, sphere
from tests.oracles.sized_decals import covered, rho
from tests.oracles.triangles import closest_points


def all_bytes(decals: Decals) -> list[bytes]:
    return [
        getattr(decals, name).tobytes() for name in ("positions", "normals", "tangents", "radii", "images")
    ]


def count_bare(decals: Decals, surface: Surface, count: int = 10_000) -> int:
    return int((~covered(decals, *surface.sample(count, seed=123))).sum())


@pytest.mark.slow_cases("1.0", "1000.0")
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_sphere_is_covered_evenly_at_any_size(scale: float) -> None:
    ball = sphere(scale)
    decals = scatter(ball, count=500, seed=1)
    assert len(decals) == 500
    assert rho(decals.positions, decals.normals, ball.area) > 0.87
    assert count_bare(decals, ball) == 0
    assert decals.radii.max() < 1.6 * np.median(decals.radii)
    spacing = np.sqrt(2 * ball.area / np.sqrt(3) / 500)
    assert np.linalg.norm(ball.project(decals.positions)[0] - decals.positions, axis=1).max() < 1e-4 * spacing
    assert np.array_equal(decals.normals, ball.normal(decals.positions))


@pytest.mark.slow  # 0.7 s of processor time
@pytest.mark.parametrize("seed", [0, 1])
def test_no_gap_opens_where_a_decal_faces_the_surface_no_longer(seed: int) -> None:
    """Beside the seam of a ball and a box, which is thinner than the distance of the samples."""
    block = pv.Cube(x_length=2, y_length=2, z_length=1).triangulate().clean()
    ball = ImplicitSurface(Point((0, 0, 0.5), radius=0.8))
    decals = scatter([block, ball], count=150, seed=seed)
    rng = np.random.default_rng(9)
    angles, heights = rng.uniform(0, 2 * np.pi, 40_000), rng.uniform(1e-4, 0.02, 40_000)
    across = np.sqrt(0.64 - heights**2)
    normals = np.column_stack([across * np.cos(angles), across * np.sin(angles), heights]) / 0.8
    assert covered(decals, 0.8 * normals + [0, 0, 0.5], normals).all()


def test_radii_match_voronoi_cells() -> None:
    decals = scatter(sphere(level=5), count=300)
    directions = decals.positions.astype(float)
    cells = SphericalVoronoi(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    least = [
        np.linalg.norm(cells.vertices[region] - position, axis=1).max()
        for region, position in zip(cells.regions, cells.points, strict=True)
    ]
    assert (decals.radii > np.array(least) * 1.01).all()
    assert (decals.radii < np.array(least) * 1.06).all()


def test_seed_sets_the_bytes() -> None:
    surfaces: list[Surface] = [
        sphere(level=3),
        ImplicitSurface(Point((1.6, 0, 0), radius=1.0), resolution=24),
    ]
    first, again, other = (scatter(surfaces, count=60, seed=number, images=3) for number in (4, 4, 5))
    assert all_bytes(first) == all_bytes(again)
    assert all(a != b for a, b in zip(all_bytes(first), all_bytes(other), strict=True))


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_few_decals_cover_an_open_mesh(count: int) -> None:
    decals = scatter(plane(), count=count)
    assert len(decals) == count
    assert count_bare(decals, plane()) == 0


def test_no_decals() -> None:
    assert len(scatter(sphere(), count=0)) == len(scatter([], count=0)) == 0


def test_single_decal_covers_facing_points() -> None:
    ball = sphere()
    decals = scatter(ball, count=1)
    points, normals = ball.sample(2000, seed=0)
    facing = normals @ decals.normals[0] > -0.25
    assert covered(decals, points, normals)[facing].all()


def test_more_decals_than_triangles() -> None:
    decals = scatter(MeshSurface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), count=400)
    assert len(decals) == 400
    assert rho(decals.positions, decals.normals, 0.5) > 0.8
    assert count_bare(decals, MeshSurface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])) == 0


def test_box_is_covered_across_edges() -> None:
    assert count_bare(scatter(box(), count=200), box()) == 0


def test_sides_of_a_thin_wall_are_covered_separately() -> None:
    wall = box((1.0, 1.0, 0.02))
    decals = scatter(wall, count=400)
    sides = [decals[decals.normals[:, 2] * side > 0.5] for side in (1, -1)]
    for side in sides:
        assert len(side) == pytest.approx(192, abs=15)
        assert rho(side.positions, side.normals, 1.0) > 0.7  # decals beside the rim move
        points, normals = wall.sample(10_000, seed=8)
        inner = (normals @ side.normals[0] > 0.5) & (np.abs(points[:, :2]).max(axis=1) < 0.45)
        assert inner.sum() > 3000
        assert covered(side, points[inner], normals[inner]).all()
    assert count_bare(decals, wall) == 0


def test_disconnected_parts_are_covered() -> None:
    parts = [sphere(center=(4.0 * k, 0, 0), level=3) for k in range(3)]
    size = len(parts[0].vertices)
    joined = MeshSurface(
        np.vstack([part.vertices for part in parts]), np.vstack([parts[0].faces + k * size for k in range(3)])
    )
    decals = scatter(joined, count=150)
    assert count_bare(decals, joined) == 0
    assert np.abs(np.bincount(np.round(decals.positions[:, 0] / 4).astype(int)) - 50).max() <= 3


def test_distant_scrap_makes_no_outsized_decal() -> None:
    scrap = sphere(radius=0.01, center=(10, 0, 0), level=2)
    decals = scatter([sphere(), scrap], count=200)
    assert decals.radii.max() < 1.6 * np.median(decals.radii)
    both = MeshSurface(
        np.vstack([sphere().vertices, scrap.vertices]),
        np.vstack([sphere().faces, scrap.faces + len(sphere().vertices)]),
    )
    decals = scatter(both, count=200)
    assert decals.radii.max() < 1.7 * np.median(decals.radii)


def test_mesh_and_tree_are_covered_where_they_meet() -> None:
    ball = sphere()
    arm = ImplicitSurface(Segment((0.8, 0, 0), (2.5, 0, 0), radius=0.4), resolution=48)
    decals = scatter([ball, arm], count=400, seed=2)
    assert (np.linalg.norm(decals.positions, axis=1) > 0.99).all()
    assert arm.tree(decals.positions + 1e-3 * decals.normals).max() < 0.5
    for surface, other in ((ball, arm), (arm, ball)):
        points, normals = surface.sample(10_000, seed=5)
        shown = ~other.contains(points + 1e-3 * normals)
        assert covered(decals, points[shown], normals[shown]).all()


def test_image_weights() -> None:
    images = scatter(plane(), count=300, regularity=0.0, images=3, weights=[1, 0, 3]).images
    counts = np.bincount(images, minlength=3)
    assert counts[1] == 0
    assert counts[2] == pytest.approx(225, abs=40)
    assert set(scatter(plane(), count=100, regularity=0.0, images=2).images) == {0, 1}
    assert not scatter(plane(), count=10).images.any()


def test_number_of_images_does_not_change_positions() -> None:
    one, many = scatter(sphere(level=2), count=30), scatter(sphere(level=2), count=30, images=5)
    assert all_bytes(one)[:4] == all_bytes(many)[:4]


def test_direction() -> None:
    decals = scatter(sphere(), count=50, direction=(0, 0, 2.0))
    assert (decals.tangents[:, 2] > 0).all()
    assert np.abs(np.einsum("ni,ni->n", decals.tangents, decals.normals)).max() < 1e-5


def test_sizing_rules() -> None:
    covering, touching, paper = (scatter(sphere(), count=200, sizing=rule).radii for rule in Sizing)
    assert covering.min() > touching.max()
    # the farthest Delaunay neighbour is up to half as far again as the nearest one
    assert 1.0 < np.median(paper) / (2 * 0.4542 * np.median(touching)) < 1.5
    assert np.allclose(scatter(sphere(), count=200, factor=0.5).radii, 0.5 * covering, rtol=1e-6)


def test_cancelled_relaxation_is_covered() -> None:
    calls = iter(range(100))
    decals = scatter(sphere(), count=100, cancel=lambda: next(calls) > 3)
    assert next(calls) == 5
    assert count_bare(decals, sphere()) == 0


def test_density_spacing_and_fixed_decals() -> None:
    fixed = np.array([[0, 0, 1]], np.float32)
    decals = scatter(sphere(), spacing=0.3, density=lambda points: np.exp(points[:, 0]), fixed=fixed)
    assert np.linalg.norm(decals.positions - fixed, axis=1).min() < 1e-3
    assert (decals.positions[:, 0] > 0).sum() > 1.5 * (decals.positions[:, 0] < 0).sum()
    assert count_bare(decals, sphere()) == 0


def test_progress() -> None:
    reports = []
    scatter(plane(), count=20, progress=lambda stage, fraction: reports.append((stage, fraction)))
    reports = [report for report in reports if not report[0].startswith(COMPILING)]
    fractions = [fraction for _, fraction in reports]
    assert fractions == sorted(fractions)
    assert 0 < fractions[0] < 0.1
    assert fractions[-1] == 1.0
    assert {stage for stage, _ in reports} == {"spreading particles", "measuring radii"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"count": -1}, "count: expected a whole number from 0 to 100000000, got -1"),
        ({"count": 2.5}, "count: expected a whole number"),
        ({"count": True}, "count: expected a whole number"),
        ({"count": 10**12}, "count: expected a whole number from 0 to 100000000, got 1000000000000"),
        ({"spacing": 1e-9}, "spacing: 1e-09 makes more than 100,000,000 particles"),
        ({"spacing": 1e-200}, "spacing: 1e-200 makes more than 100,000,000 particles"),
        ({"spacing": "wide"}, "spacing: expected a length above 0, got 'wide'"),
        ({"count": 5, "sizing": "touch"}, "sizing: expected one of 'covering', .*, got 'touch'"),
        ({"count": 5, "choice": 1}, "choice: expected one of 'random', .*, got 1"),
        ({"count": 5, "jitter": 0.1}, "jitter: expected a Jitter, got 0.1"),
        ({"count": 5, "seed": -3}, "seed: expected a whole number from 0 upward"),
        ({"count": 5, "factor": 0.0}, "factor: expected"),
        ({"count": 5, "images": 0}, "images: expected"),
        ({"count": 5, "images": 2, "weights": [1]}, "weights: expected shape"),
        ({"count": 5, "images": 2, "weights": [1, -1]}, "weights: expected finite"),
        ({"count": 5, "images": 2, "weights": [0, 0]}, "weights: expected finite"),
        ({"count": 5, "direction": (1, 2)}, "direction: expected shape"),
        ({"count": 5, "direction": "up"}, "direction: expected one of 'curvature', 'cross', got 'up'"),
        ({"count": 5, "direction": lambda points: points[:2]}, "direction: expected shape"),
        ({"count": 5, "direction": lambda points: points * np.nan}, "direction: expected finite"),
    ],
)
def test_invalid_arguments_raise(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidScattering, match=message):
        scatter(plane(), **options)


RANDOM_TRIANGLES = given(number=st.integers(0, 10_000), count=st.integers(0, 40), triangles=st.integers(1, 6))


@settings(max_examples=3)
@RANDOM_TRIANGLES
def test_random_triangles_get_the_exact_count(number: int, count: int, triangles: int) -> None:
    check_random_triangles(number, count, triangles)


@pytest.mark.slow
@settings(max_examples=25)
@RANDOM_TRIANGLES
def test_many_random_triangles_get_the_exact_count(number: int, count: int, triangles: int) -> None:
    check_random_triangles(number, count, triangles)


def check_random_triangles(number: int, count: int, triangles: int) -> None:
    rng = np.random.default_rng(number)
    soup = MeshSurface(rng.normal(size=(3 * triangles, 3)), np.arange(3 * triangles).reshape(-1, 3))
    decals = scatter(soup, count=count, seed=number)
    assert len(decals) == count
    assert np.isfinite(decals.positions).all()
    assert (decals.radii > 0).all()
    spacing = np.sqrt(soup.area / max(count, 1))
    gaps = closest_points(decals.positions, soup.vertices, soup.faces)  # float64, for slim triangles
    assert gaps.max(initial=0.0) < 1e-4 * spacing


@pytest.mark.parametrize("levels", [(0.6, 1.0), pytest.param((0.3, 0.6, 0.9, 1.0), marks=pytest.mark.slow)])
def test_regularity(levels: tuple[float, ...]) -> None:
    ball = sphere()
    least_distances = []
    for regularity in (0.0, *levels):
        decals = scatter(ball, count=500, regularity=regularity)
        least_distances.append(rho(decals.positions, decals.normals, ball.area))
        assert count_bare(decals, ball, 2000) == 0
    assert least_distances[0] < 0.2
    expected = np.minimum(levels, 0.99)
    assert np.array(least_distances[1:-1]) == pytest.approx(expected[:-1] * 0.89, abs=0.2)
    assert (np.array(least_distances[1:]) > expected * 0.88).all()
    assert (np.diff(least_distances) > 0).all()
    for wrong in (-0.1, 1.1, np.nan):
        with pytest.raises(InvalidScattering, match="regularity: expected"):
            scatter(ball, count=3, regularity=wrong)


def test_rules_by_name() -> None:
    """Names in any case give the decals of the members of the enumerations."""
    wall = MeshSurface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    options: dict[str, Any] = {"count": 12, "images": 2, "seed": 3}
    named = scatter(wall, sizing="touching", choice="Size", direction="cross", **options)
    members = scatter(
        wall, sizing=Sizing.TOUCHING, choice=ImageChoice.SIZE, direction=Orientation.CROSS, **options
    )
    for column in ("radii", "images", "tangents"):
        np.testing.assert_array_equal(getattr(named, column), getattr(members, column))


def test_copies_of_a_repeat_have_as_many_decals() -> None:
    row = scatter(Repeat(Point((0, 0, 0), radius=0.5), (1.3, 0, 0), 5, joining="union"), count=150)
    ring = scatter(PolarRepeat(Point((1.5, 0, 0), radius=0.5), (0, 0, 1), 7, joining="union"), count=210)
    turns = np.arctan2(ring.positions[:, 1], ring.positions[:, 0]) / (2.0 * np.pi)
    for copies, of in ((5, row.positions[:, 0] / 1.3), (7, 7.0 * turns % 7.0)):
        counts = np.bincount(np.rint(of).astype(int) % copies, minlength=copies)
        assert len(counts) == copies
        assert 25 <= counts.min() <= counts.max() <= 35
