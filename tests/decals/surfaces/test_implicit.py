import weakref
from typing import Any

import numpy as np
import pytest

from blobtree import ISO, Box, Disc, Intersection, Node, Point, Repeat, Segment, SolidContact, Sum, Union
from decals import scatter
from decals.errors import InvalidMesh, InvalidPoints
from decals.surfaces import ImplicitSurface, Surface
from decals.surfaces.implicit import FIELD_TOLERANCE, MAX_STEP, project_without_mesh
from tests.blobtree.tape.evaluations import project
from tests.vectors import random_units


def ball(radius: float = 1.0, center: Any = (0.0, 0.0, 0.0)) -> Any:
    return ImplicitSurface(Point(center, radius=radius), resolution=32)


def blob() -> Any:
    return Segment((-1, 0, 0), (1, 0, 0), radius=0.4) + Point((0, 0.6, 0), radius=0.5)


def test_an_implicit_is_a_surface() -> None:
    assert isinstance(ball(), Surface)


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_sphere_area_bounds_samples_and_normals(radius: float) -> None:
    surface = ball(radius)
    assert surface.area == pytest.approx(4 * np.pi * radius**2, rel=1e-2)
    assert np.allclose(surface.bounds, [[-radius] * 3, [radius] * 3], rtol=2e-2)
    positions, normals = surface.sample(2000, seed=1)
    assert np.allclose(np.linalg.norm(positions, axis=1), radius, rtol=1e-6)
    assert np.allclose(normals, positions / radius, atol=1e-5)
    assert np.abs(positions.mean(axis=0)).max() < 0.03 * radius


@pytest.mark.parametrize("factor", [0.3, 0.5, 0.99, 1.01, 1.5, 2.1, 5.0, 40.0])
def test_projection_reaches_the_sphere_from_near_and_far(factor: float) -> None:
    ways = random_units(np.random.default_rng(0), 300)
    positions, normals = ball(center=(3, 0, 0)).project(factor * ways + [3, 0, 0])
    assert np.allclose(np.linalg.norm(positions - [3, 0, 0], axis=1), 1, atol=1e-4)
    assert np.allclose(normals, ways, atol=0.15)  # from afar, as near as a cell of the coarse mesh


def test_a_point_without_gradient_gets_a_place_and_a_normal() -> None:
    positions, normals = ball().project([[0, 0, 0]])
    assert np.linalg.norm(positions) == pytest.approx(1, abs=1e-4)
    assert np.linalg.norm(normals) == pytest.approx(1, abs=1e-4)


def test_straight_onto_the_surface_is_the_same_without_a_mesh() -> None:
    tree, near = blob(), ImplicitSurface(blob()).sample(200, seed=3)[0] * 1.01
    found, expected = project_without_mesh(tree, near), ImplicitSurface(tree).project(near)
    assert found is not None
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1], expected[1])
    far = project_without_mesh(tree, near * 1.15)
    assert far is not None
    assert np.abs(tree(far[0]) - 0.5).max() < 1e-4
    assert np.allclose(np.linalg.norm(far[1], axis=1), 1, atol=1e-5)


@pytest.mark.parametrize("count", [2, 8, 200])
def test_points_come_to_the_places_to_which_the_whole_tree_leads(count: int) -> None:
    rng = np.random.default_rng(count)
    tree = Sum(Point(center, radius=0.3) for center in rng.uniform(-1.0, 1.0, (count, 3)))
    surface = ImplicitSurface(tree, resolution=32)
    points = surface.sample(4000, seed=1)[0]
    points = (points + rng.normal(0.0, 0.02, points.shape)).astype(np.float32)
    low, high = tree.support
    longest = MAX_STEP * float((high - low).max()) / 32
    expected, normals = project(tree.tape, points, longest)
    reached = np.abs(tree(expected) - ISO) < FIELD_TOLERANCE * ISO
    assert reached.mean() > 0.99
    found, found_normals = surface.project(points)
    np.testing.assert_array_equal(found[reached], expected[reached])
    np.testing.assert_array_equal(found_normals[reached], normals[reached])


def test_what_does_not_lead_straight_onto_the_surface_is_said() -> None:
    assert project_without_mesh(blob(), [[0.0, 0.6, 0.5], [9.0, 9.0, 9.0]]) is None
    assert project_without_mesh(blob(), np.zeros((0, 3))) is None


def test_samples_of_a_blend_lie_on_it_with_the_normal_of_the_field() -> None:
    tree = blob()
    surface = ImplicitSurface(tree, resolution=32)
    positions, normals = surface.sample(1000, seed=2)
    assert np.abs(tree(positions) - 0.5).max() < 1e-5
    gradients = tree.gradient(positions).astype(float)
    expected = -gradients / np.linalg.norm(gradients, axis=1, keepdims=True)
    assert np.allclose(normals, expected, atol=1e-5)
    assert np.array_equal(surface.normal(positions), surface.project(positions)[1])
    first, again, other = (surface.sample(100, seed=seed)[0].tobytes() for seed in (5, 5, 6))
    assert first == again != other


def test_rays_meet_the_sphere() -> None:
    ways = random_units(np.random.default_rng(0), 200)
    assert np.allclose(ball(2.0).raycast(6 * ways, -5 * ways), 4.0, atol=1e-3)
    assert np.isinf(ball().raycast([[0, 0, 3], [0, 0, 3]], [[0, 0, 1], [0, 0, 0]])).all()
    assert ball().raycast(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def test_it_contains_its_inside() -> None:
    ways = random_units(np.random.default_rng(0), 200)
    surface = ball(center=(0, 5, 0))
    assert surface.contains(0.99 * ways + [0, 5, 0]).all()
    assert not surface.contains(1.01 * ways + [0, 5, 0]).any()
    assert not surface.contains([[100, 0, 0]]).any()


def test_a_mesh_of_the_surface_is_the_same_while_something_holds_it() -> None:
    surface = ImplicitSurface(blob(), resolution=32)
    mesh = surface.triangulated(0.5)
    assert surface.triangulated(0.5) is mesh
    assert surface.triangulated(0.001) is not mesh
    gone = weakref.ref(mesh)
    del mesh
    assert gone() is None


def test_a_tree_without_surface_is_refused() -> None:
    nothing = Point((0, 0, 0), radius=1.0) - Point((0, 0, 0), radius=3.0)
    with pytest.raises(InvalidMesh, match="tree with a surface"):
        ImplicitSurface(nothing, resolution=16)


def test_what_are_no_points_is_refused() -> None:
    with pytest.raises(InvalidPoints):
        ball().project([[np.nan, 0, 0]])


def pair(distance: float) -> list[Point]:
    return [Point((0, 0, z), radius=1.0) for z in (-distance, distance)]


@pytest.mark.parametrize(
    ("tree", "height"),
    [(Intersection(pair(0.6)), 0.4), (Intersection(pair(0.9)), 0.1), (Union(pair(0.6)), 1.6)],
)
def test_samples_reach_creases(tree: Node, height: float) -> None:
    """Two caps of balls: their area is exact, and samples lie on both sides of the edge between them."""
    surface = ImplicitSurface(tree)
    assert surface.area == pytest.approx(4 * np.pi * height, rel=5e-3)
    edge = np.sqrt(1 - (1 - height) ** 2)
    positions, normals = surface.sample(4000, seed=5)
    gaps = np.hypot(np.hypot(positions[:, 0], positions[:, 1]) - edge, positions[:, 2])
    for side in (normals[:, 2] < 0, normals[:, 2] > 0):
        assert gaps[side].min() < 0.02


def test_points_beside_a_thin_plate_stay_on_it() -> None:
    axis = np.array([0.0, 1.0, 0.3]) / np.sqrt(1.09)
    fin = Disc((1.9, 0, 0), (0.0, 1.0, 0.3), 1.0, radius=1e-3)
    surface = ImplicitSurface(Point((0, 0, 0), radius=1.0) | fin)
    random = np.random.default_rng(0)
    points = random.uniform([1.3, 0.0, 0.0], [1.9, 0.0, 0.0], (200, 3))
    points += random.uniform(0.003, 0.05, (200, 1)) * axis
    positions, normals = surface.project(points)
    assert np.abs((positions - [1.9, 0, 0]) @ axis - 1e-3).max() < 1e-4
    assert (normals @ axis).min() > 0.99


@pytest.mark.parametrize("degrees", [50.0, 60.0, 70.0])
def test_points_beside_a_bent_tree_of_small_parts_reach_it(degrees: float) -> None:
    """Its mesh is farther from the surface than the thickness by which a mesh misses a thin part."""
    flat = Segment((1, 0, 0), (2, 0, 0), radius=0.5) + Point((1.5, 0, 1.5), radius=0.6)
    tree = flat.twist(degrees)
    surface = ImplicitSurface(tree)
    assert surface.has_small_parts
    lower, upper = surface.bounds
    points = np.random.default_rng(3).uniform(lower, upper, (5000, 3))
    positions, normals = surface.project(points)
    np.testing.assert_allclose(tree(positions), ISO, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)


# -- solids in contact ---------------------------------------------------------------------------------


BALLS = (Point((-0.8, 0, 0), radius=1.0), Point((0.8, 0, 0), radius=1.0))


def test_decals_cover_the_outside_of_a_contact_and_all_of_a_solid() -> None:
    model = SolidContact(BALLS, height=0.06)
    for tree, touching in ((model, False), (model.solids()[0], True)):
        surface = ImplicitSurface(tree)
        decals = scatter(surface, count=120, seed=1)
        assert len(decals) == 120
        np.testing.assert_allclose(tree(decals.positions), ISO, atol=1e-4)
        in_contact = np.hypot(*decals.positions[np.abs(decals.positions[:, 0]) < 0.01, 1:].T) < 0.5
        assert in_contact.any() == touching


def test_rays_hit_the_contact_surface_of_a_single_solid() -> None:
    left = SolidContact(BALLS).solids()[0]
    distances = ImplicitSurface(left).raycast([[3.0, 0.1, 0.0]], [[-1.0, 0.0, 0.0]])
    np.testing.assert_allclose(distances, 3.0, atol=1e-4)


def test_points_inside_one_of_many_copies_are_found() -> None:
    brick = Box((0, 0, 0), (0.6, 0.6, 0.6), radius=0)
    grid = Repeat(Repeat(brick, (1, 0, 0), 12, "union"), (0, 1, 0), 12, "union")
    points = np.random.default_rng(4).uniform([-1, -1, -0.5], [12, 12, 0.5], (4000, 3))
    centers = np.column_stack([points[:, :2].round().clip(0, 11), np.zeros(len(points))])
    within = np.abs(points - centers).max(axis=1) < 0.3
    assert 500 < within.sum() < 2000
    assert ImplicitSurface(grid).contains(points).tolist() == within.tolist()
