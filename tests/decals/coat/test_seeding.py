import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import SphericalVoronoi

from blobtree import Point, Segment
from decals.coat.seeding import seed
from decals.coat.sizing import Sizing
from decals.errors import InvalidSeeding
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface
from tests.decals.meshes import box, plane, sphere
from tests.oracles.coats import covered, rho


def all_bytes(decals):
    return [
        getattr(decals, name).tobytes() for name in ("positions", "normals", "tangents", "radii", "images")
    ]


def is_bare(decals, surface, count=10_000):
    return (~covered(decals, *surface.sample(count, seed=123))).sum()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_sphere_is_covered_evenly_and_without_gap_at_any_size(scale):
    ball = sphere(scale)
    decals = seed(ball, count=500, seed=1)
    assert len(decals) == 500
    assert rho(decals.positions, decals.normals, ball.area) > 0.87
    assert is_bare(decals, ball) == 0
    assert decals.radii.max() < 1.6 * np.median(decals.radii)
    spacing = np.sqrt(2 * ball.area / np.sqrt(3) / 500)
    assert np.linalg.norm(ball.project(decals.positions)[0] - decals.positions, axis=1).max() < 1e-4 * spacing
    assert np.array_equal(decals.normals, ball.normal(decals.positions))


def test_radii_are_those_of_the_voronoi_cells():
    decals = seed(sphere(level=5), count=300)
    directions = decals.positions.astype(float)
    cells = SphericalVoronoi(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    least = [
        np.linalg.norm(cells.vertices[region] - position, axis=1).max()
        for region, position in zip(cells.regions, cells.points, strict=True)
    ]
    assert (decals.radii > np.array(least) * 1.01).all()
    assert (decals.radii < np.array(least) * 1.06).all()


def test_the_same_seed_gives_the_same_bytes_and_another_one_others():
    surfaces = [sphere(level=3), ImplicitSurface(Point((1.6, 0, 0), radius=1.0), resolution=24)]
    first, again, other = (seed(surfaces, count=60, seed=number, images=3) for number in (4, 4, 5))
    assert all_bytes(first) == all_bytes(again)
    assert all(a != b for a, b in zip(all_bytes(first), all_bytes(other), strict=True))


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_a_few_decals_cover_an_open_mesh(count):
    decals = seed(plane(), count=count)
    assert len(decals) == count
    assert is_bare(decals, plane()) == 0


def test_no_decals_at_all():
    assert len(seed(sphere(), count=0)) == len(seed([], count=0)) == 0


def test_one_decal_covers_what_faces_it():
    ball = sphere()
    decals = seed(ball, count=1)
    points, normals = ball.sample(2000, seed=0)
    facing = normals @ decals.normals[0] > -0.25
    assert covered(decals, points, normals)[facing].all()


def test_far_more_decals_than_triangles():
    decals = seed(MeshSurface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), count=1000)
    assert len(decals) == 1000
    assert rho(decals.positions, decals.normals, 0.5) > 0.8
    assert is_bare(decals, MeshSurface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])) == 0


def test_a_box_is_covered_round_its_edges():
    assert is_bare(seed(box(), count=200), box()) == 0


def test_both_sides_of_a_thin_wall_are_covered_on_their_own():
    wall = box((1.0, 1.0, 0.02))
    decals = seed(wall, count=400)
    sides = [decals[decals.normals[:, 2] * side > 0.5] for side in (1, -1)]
    for side in sides:
        assert len(side) == pytest.approx(192, abs=15)
        assert rho(side.positions, side.normals, 1.0) > 0.8
        points, normals = wall.sample(10_000, seed=8)
        inner = (normals @ side.normals[0] > 0.5) & (np.abs(points[:, :2]).max(axis=1) < 0.45)
        assert inner.sum() > 3000
        assert covered(side, points[inner], normals[inner]).all()
    assert is_bare(decals, wall) == 0


def test_disconnected_parts_are_all_covered():
    parts = [sphere(center=(4.0 * k, 0, 0), level=3) for k in range(3)]
    size = len(parts[0].vertices)
    joined = MeshSurface(
        np.vstack([part.vertices for part in parts]), np.vstack([parts[0].faces + k * size for k in range(3)])
    )
    decals = seed(joined, count=150)
    assert is_bare(decals, joined) == 0
    assert np.abs(np.bincount(np.round(decals.positions[:, 0] / 4).astype(int)) - 50).max() <= 3


def test_a_crumb_far_off_blows_up_no_decal():
    crumb = sphere(radius=0.01, center=(10, 0, 0), level=2)
    decals = seed([sphere(), crumb], count=200)
    assert decals.radii.max() < 1.6 * np.median(decals.radii)
    both = MeshSurface(
        np.vstack([sphere().vertices, crumb.vertices]),
        np.vstack([sphere().faces, crumb.faces + len(sphere().vertices)]),
    )
    decals = seed(both, count=200)
    assert decals.radii.max() < 1.7 * np.median(decals.radii)


def test_a_mesh_and_an_implicit_share_one_coat_where_they_meet():
    ball = sphere()
    arm = ImplicitSurface(Segment((0.8, 0, 0), (2.5, 0, 0), radius=0.4), resolution=48)
    decals = seed([ball, arm], count=400, seed=2)
    assert (np.linalg.norm(decals.positions, axis=1) > 0.99).all()
    assert arm.tree(decals.positions + 1e-3 * decals.normals).max() < 0.5
    for surface, other in ((ball, arm), (arm, ball)):
        points, normals = surface.sample(10_000, seed=5)
        shown = ~other.contains(points + 1e-3 * normals)
        assert covered(decals, points[shown], normals[shown]).all()


def test_images_are_chosen_by_weight():
    images = seed(plane(), count=300, images=3, weights=[1, 0, 3]).images
    counts = np.bincount(images, minlength=3)
    assert counts[1] == 0
    assert counts[2] == pytest.approx(225, abs=40)
    assert set(seed(plane(), count=100, images=2).images) == {0, 1}
    assert not seed(plane(), count=10).images.any()


def test_more_images_leave_the_places_as_they_were():
    one, many = seed(sphere(level=2), count=30), seed(sphere(level=2), count=30, images=5)
    assert all_bytes(one)[:4] == all_bytes(many)[:4]


def test_images_lie_along_a_direction():
    decals = seed(sphere(), count=50, direction=(0, 0, 2.0))
    assert (decals.tangents[:, 2] > 0).all()
    assert np.abs(np.einsum("ni,ni->n", decals.tangents, decals.normals)).max() < 1e-5


def test_sizes_follow_their_rule():
    covering, touching, paper = (seed(sphere(), count=200, sizing=rule).radii for rule in Sizing)
    assert covering.min() > touching.max()
    # the farthest Delaunay neighbour is up to half as far again as the nearest one
    assert 1.0 < np.median(paper) / (2 * 0.4542 * np.median(touching)) < 1.5
    assert np.allclose(seed(sphere(), count=200, factor=0.5).radii, 0.5 * covering, rtol=1e-6)


def test_spreading_that_is_cancelled_is_covered_all_the_same():
    asked = []
    decals = seed(sphere(), count=100, cancel=lambda: len(asked) > 3 or asked.append(0) is not None)
    assert len(asked) == 4
    assert is_bare(decals, sphere()) == 0


def test_seeds_spread_by_density_and_spacing_around_fixed_ones():
    fixed = np.float32([[0, 0, 1]])
    decals = seed(sphere(), spacing=0.3, density=lambda points: np.exp(points[:, 0]), fixed=fixed)
    assert np.linalg.norm(decals.positions - fixed, axis=1).min() < 1e-3
    assert (decals.positions[:, 0] > 0).sum() > 1.5 * (decals.positions[:, 0] < 0).sum()
    assert is_bare(decals, sphere()) == 0


def test_progress_runs_from_start_to_end():
    heard = []
    seed(plane(), count=20, progress=lambda stage, fraction: heard.append((stage, fraction)))
    fractions = [fraction for _, fraction in heard]
    assert fractions == sorted(fractions)
    assert 0 < fractions[0] < 0.1
    assert fractions[-1] == 1.0
    assert {stage for stage, _ in heard} == {"spreading seeds", "measuring sizes"}


@pytest.mark.parametrize(
    ("wish", "says"),
    [
        ({"count": -1}, "count: expected at least 0, got -1"),
        ({"count": 2.5}, "count: expected a whole number"),
        ({"count": True}, "count: expected a whole number"),
        ({"count": 10**12}, "count: expected at most 100,000,000, got 1000000000000"),
        ({"spacing": 1e-9}, "spacing: 1e-09 makes more than 100,000,000 seeds"),
        ({"spacing": 1e-200}, "spacing: 1e-200 makes more than 100,000,000 seeds"),
        ({"spacing": "wide"}, "spacing: expected a length above 0, got 'wide'"),
        ({"count": 5, "sizing": "touching"}, "sizing: expected one of Sizing.COVERING, .*, got 'touching'"),
        ({"count": 5, "choice": "size"}, "choice: expected one of ImageChoice.RANDOM, .*, got 'size'"),
        ({"count": 5, "jitter": 0.1}, "jitter: expected a Jitter, got 0.1"),
        ({"count": 5, "seed": -3}, "seed: expected at least 0"),
        ({"count": 5, "factor": 0.0}, "factor: expected"),
        ({"count": 5, "images": 0}, "images: expected"),
        ({"count": 5, "images": 2, "weights": [1]}, "weights: expected shape"),
        ({"count": 5, "images": 2, "weights": [1, -1]}, "weights: expected finite"),
        ({"count": 5, "images": 2, "weights": [0, 0]}, "weights: expected finite"),
        ({"count": 5, "direction": (1, 2)}, "direction: expected shape"),
        ({"count": 5, "direction": "up"}, "direction: expected numbers"),
        ({"count": 5, "direction": lambda points: points[:2]}, "direction: expected shape"),
        ({"count": 5, "direction": lambda points: points * np.nan}, "direction: expected finite"),
    ],
)
def test_what_makes_no_sense_is_refused(wish, says):
    with pytest.raises(InvalidSeeding, match=says):
        seed(plane(), **wish)


@pytest.mark.parametrize("other", [None, 5, "knot", Point((0, 0, 0), radius=1.0), [plane(), None], np.eye(3)])
def test_what_is_no_surface_is_refused(other):
    with pytest.raises(InvalidSeeding, match="surfaces: expected a surface or several, got"):
        seed(other, count=5)


def test_seeds_need_a_surface():
    with pytest.raises(InvalidSeeding, match="visible area"):
        seed([], count=5)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 40), st.integers(1, 6))
def test_any_triangles_get_exactly_as_many_decals_as_wished(number, count, triangles):
    rng = np.random.default_rng(number)
    soup = MeshSurface(rng.normal(size=(3 * triangles, 3)), np.arange(3 * triangles).reshape(-1, 3))
    decals = seed(soup, count=count, seed=number)
    assert len(decals) == count
    assert np.isfinite(decals.positions).all()
    assert (decals.radii > 0).all()
    spacing = np.sqrt(soup.area / max(count, 1))
    assert np.allclose(soup.project(decals.positions)[0], decals.positions, atol=1e-4 * spacing)


def test_regularity_runs_from_chance_to_a_tiling():
    ball = sphere(level=5)
    found = []
    for regularity in (0.0, 0.3, 0.6, 0.9, 1.0):
        decals = seed(ball, count=800, regularity=regularity)
        found.append(rho(decals.positions, decals.normals, ball.area))
        assert is_bare(decals, ball, 2000) == 0
    assert found[0] < 0.2
    assert np.array(found[1:4]) == pytest.approx(np.array([0.3, 0.6, 0.9]) * 0.89, abs=0.2)
    assert (np.array(found[1:]) > np.array([0.3, 0.6, 0.9, 0.99]) * 0.88).all()
    assert (np.diff(found) > 0).all()
    for nonsense in (-0.1, 1.1, np.nan):
        with pytest.raises(InvalidSeeding, match="regularity: expected"):
            seed(ball, count=3, regularity=nonsense)
