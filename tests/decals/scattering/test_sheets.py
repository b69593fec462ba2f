"""Sheets of a mesh: patches whose borders meet are one; decals and particles of others do not mix."""

import numpy as np
import pytest

import decals
from decals.scattering.neighbors import FacingTree
from decals.surfaces import MeshSurface
from tests.decals.distortion import random_points
from tests.decals.family_models import model_of
from tests.decals.fault_models import Arrays, joined
from tests.decals.meshes import icosphere
from tests.decals.shapes import sheet_faces


def plate(x: float = 0.0, z: float = 0.0, cells: int = 8) -> Arrays:
    """A unit square that faces up."""
    i, j = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    vertices = np.stack([x + i / cells, j / cells, np.full(i.shape, z)], -1).reshape(-1, 3)
    return vertices, sheet_faces(cells + 1, cells + 1)


@pytest.mark.parametrize(("gap", "sheets"), [(0.0, 1), (0.004, 1), (0.05, 2)])
def test_patches_whose_borders_meet_are_one_sheet(gap: float, sheets: int) -> None:
    surface = MeshSurface(*joined(plate(), plate(x=1 + gap, cells=5)))
    assert surface.sheets.max() + 1 == sheets
    assert len(surface.vertices) == 9**2 + 6**2


def test_a_point_that_meets_another_plate_joins_no_sheets() -> None:
    upper, faces = plate(z=0.1)
    upper[0, 2] = 0.001
    assert MeshSurface(*joined(plate(), (upper, faces))).sheets.max() == 1


def test_gaps_follow_the_parts_not_what_lies_far_away() -> None:
    speck = plate(x=10_000.0)[0] * (1.0, 0.001, 1.0), plate()[1]
    assert MeshSurface(*joined(plate(), plate(z=0.5), speck)).sheets.max() == 2


def test_parallel_plates_have_decals_of_their_own() -> None:
    plates = joined(plate(), plate(z=0.08))
    layout = decals.scatter(MeshSurface(*plates), count=80, seed=3)
    assert layout.single_sheets.any()
    upper = layout.positions[:, 2] > 0.04
    assert 35 <= upper.sum() <= 45
    points, normals = random_points(plates, 20_000, 5)
    owners = decals.evaluate(layout, points, normals).owner
    assert (owners >= 0).all()
    strange = upper[owners] != (points[:, 2] > 0.04)
    assert strange.mean() < 0.04
    mixed = decals.evaluate(layout.replace(single_sheets=None), points, normals).owner
    assert (upper[mixed] != (points[:, 2] > 0.04)).mean() > 0.1
    for side in (upper, ~upper):
        positions = layout.positions[side]
        apart = np.linalg.norm(positions[:, None] - positions, axis=2) + 9 * np.eye(len(positions))
        assert apart.min() > 0.75 * np.sqrt(2 / (np.sqrt(3) * side.sum()))


def test_one_sheet_has_plain_decals() -> None:
    layout = decals.scatter(MeshSurface(*icosphere(3)), count=40)
    assert not layout.single_sheets.any()


def test_a_point_beyond_the_sheet_of_the_nearest_decal_is_in_doubt() -> None:
    """Those whose owner is nearer, or that no such decal would face, are not."""
    centers = np.array([[0, 0, 0], [2, 0, 0]], np.float32)
    up = np.array([[0, 0, 1]], np.float32)
    points = np.array([[0, 0, 0.5], [0, 0, 0.1], [1.9, 0, 0.5], [0, 0, 0.5]], np.float32)
    normals = np.concatenate([up, up, up, -up])
    tree = FacingTree(centers, up.repeat(2, axis=0), np.array([0.2, np.inf]))
    _, owners, doubts = tree.nearest_and_doubts(points, normals)
    assert owners[:, 0].tolist() == [1, 0, 1, -1]
    assert (doubts == 0.0).tolist() == [True, False, False, False]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["patches-27", "patches-75"])
def test_no_point_is_bare_where_sheets_cross(name: str) -> None:
    scene = decals.cover(model_of(name, 1), count=1000)
    assert scene.decals.single_sheets.any()
    assert scene.measure(samples=200_000).coverage == 1.0
