"""Normals of decals at edges: the mean of the sides, so that images bend over them."""

from typing import Any

import numpy as np
import pytest

import blobtree
import decals
from decals.editing.queries import mean_normal
from decals.scenes.objects import as_objects
from tests.decals.distortion import bare_corners, distortion
from tests.decals.fault_models import FAULT_MODELS
from tests.decals.meshes import box, icosphere, sphere


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        ((0.5, 0.1, 0.5), (1, 0, 1)),
        ((0.5, 0.5, 0.5), (1, 1, 1)),
        ((0.0, 0.1, 0.5), (0, 0, 1)),
        ((0.38, 0.1, 0.5), (0, 0, 1)),  # the edge is farther than half the radius
    ],
)
def test_edge_corner_and_flat_side_of_a_cube(position: Any, expected: Any) -> None:
    cube = box()
    normal = mean_normal(as_objects([(cube.vertices, cube.faces)]), position, (0, 0, 1), radius=0.2)
    angle = np.degrees(np.arccos(np.clip(normal @ np.array(expected) / np.linalg.norm(expected), -1, 1)))
    assert angle < 6.0
    if expected == (0, 0, 1):
        np.testing.assert_array_equal(normal, (0, 0, 1))


def test_the_other_side_of_a_thin_plate_does_not_count() -> None:
    plate = box((1.0, 1.0, 0.02))
    objects = as_objects([(plate.vertices, plate.faces)])
    np.testing.assert_array_equal(mean_normal(objects, (0, 0, 0.01), (0, 0, 1), radius=0.3), (0, 0, 1))


def test_trees_have_means_too() -> None:
    lens = blobtree.Intersection(
        (blobtree.Point((0, 0, -0.6), radius=1.0), blobtree.Point((0, 0, 0.6), radius=1.0))
    )
    normal = mean_normal(as_objects([lens]), (0.8, 0, 0), (0.8, 0, 0.6), radius=0.1)
    np.testing.assert_allclose(normal, (1, 0, 0), atol=0.15)


def test_smooth_surfaces_keep_their_normals() -> None:
    ball = sphere(level=4)
    layout = decals.scatter(ball, count=30, seed=2)
    np.testing.assert_array_equal(layout.normals, ball.normal(layout.positions))


@pytest.mark.slow_cases("knob")
@pytest.mark.parametrize("name", ["gear", "knob"])
def test_images_bend_over_the_edges_of_parts(name: str) -> None:
    mesh = FAULT_MODELS[name]()
    found = distortion(decals.scatter(mesh, count=300, seed=1), mesh, 100_000)
    assert found.stretched <= 0.003
    assert found.folded <= 5e-4
    assert found.bare == 0  # though images end at the arc, which is longer than the chord


@pytest.mark.ordinary_cases("bowl-4")
@pytest.mark.parametrize(("name", "seed"), [("cup", 1), ("cup", 7), ("bowl", 3), ("bowl", 4), ("ears", 1)])
def test_lips_and_ragged_borders_get_no_outsized_decals(name: str, seed: int) -> None:
    """A cup's wall is thinner than the spacing: its floor faces decals outside, its lip few decals."""
    mesh = FAULT_MODELS[name]()
    relaxation = decals.Relaxation(decals.surfaces.MeshSurface(*mesh), count=300, seed=seed)
    relaxation.run()
    layout = relaxation.to_decals(seed=seed)
    assert layout.radii.max() <= 1.5 * np.median(layout.radii)
    assert relaxation.statistics().rho >= 0.87
    found = distortion(layout, mesh, 30_000)
    assert found.stretched <= 0.003
    assert found.folded <= 5e-4
    assert found.bare == 0
    assert bare_corners(layout, mesh) == 0


@pytest.mark.slow
def test_points_that_a_decal_barely_faces_need_no_outsized_one() -> None:
    """Such points lie on the ears; the next decal that faces them can be far away."""
    relaxation = decals.Relaxation(decals.surfaces.MeshSurface(*FAULT_MODELS["ears"]()), count=300, seed=2)
    relaxation.run()
    radii = relaxation.to_decals(seed=2).radii
    assert radii.max() <= 1.5 * np.median(radii)


def test_few_large_decals_leave_no_pinhole() -> None:
    ball = icosphere(4)
    assert distortion(decals.scatter(ball, count=8, seed=1), ball, 20_000).bare == 0.0
