"""Voronoi cells of particles, and the moves that close wide gaps."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial import Voronoi, cKDTree

from blobtree._typing import Float32Array
from decals import Relaxation
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.gap_filling import GAP_REACH, WIDE_GAP, fill_gaps
from decals.scattering.neighbors import FacingTree, NeighborQuery
from decals.scattering.particle_state import ParticleState
from decals.surfaces import MeshSurface
from tests.decals.meshes import plane, sphere, star

LEAST = 0.8
"""Least distance of particles that `fill_gaps` keeps, in spacings."""


def state_of(surface: MeshSurface, positions: Float32Array, normals: Float32Array) -> ParticleState:
    """Particles of one surface, at the spacing of a hexagonal tiling of its area."""
    count = len(positions)
    points = OrientedPoints(positions, normals, np.zeros(count, np.int32))
    spacing = np.float32(np.sqrt(2.0 / np.sqrt(3.0) * surface.area / count))
    return ParticleState(Domain([surface], seed=0), points, np.ones(count, bool), np.full(count, spacing))


def with_holes(surface: MeshSurface, holes: int) -> ParticleState:
    """Even particles, of which some are missing."""
    relaxation = Relaxation([surface], count=400, iterations=60)
    relaxation.run()
    rows = np.arange(400) % (400 // holes) != 7
    return state_of(surface, relaxation.positions[rows], relaxation.normals[rows])


def test_cells_of_a_plane_are_voronoi_cells() -> None:
    surface = plane(10.0)
    positions, normals = surface.sample(400, seed=4)
    state = state_of(surface, positions, normals)
    radii, outlines = NeighborQuery(state, 2.0 * GAP_REACH).cells(np.arange(400))
    cells = Voronoi(positions[:, :2].astype(np.float64))
    exact = np.array(
        [
            np.inf
            if -1 in cells.regions[region]
            else np.linalg.norm(cells.vertices[cells.regions[region]] - p, axis=1).max()
            for p, region in zip(positions[:, :2], cells.point_region, strict=True)
        ]
    )
    exact = np.minimum(exact / state.spacing, GAP_REACH)
    assert (radii > 0.98 * exact).mean() > 0.9
    assert (radii < 1.001 * exact).mean() > 0.75  # corners that a third neighbour cuts off are too far
    distances = cKDTree(positions).query(outlines.reshape(-1, 3))[0].reshape(400, -1)
    own = np.linalg.norm(outlines - positions[:, None], axis=2)
    assert (own < 1.001 * distances + 1e-6).mean() > 0.9


def test_particles_near_points_are_those_within_the_reach() -> None:
    surface = star()
    positions, normals = surface.sample(500, seed=1)
    state = state_of(surface, positions, normals)
    places = positions[::50] + np.float32(0.1)
    found = NeighborQuery(state, 1.2).near(places)
    gaps = cKDTree(places).query(positions)[0]
    assert found.tolist() == np.flatnonzero(gaps < 1.2 * state.spacing).tolist()


def test_distance_to_other_particles_leaves_out_the_own_one() -> None:
    surface = star()
    positions, normals = surface.sample(500, seed=2)
    state = state_of(surface, positions, normals)
    rows = np.arange(0, 500, 7)
    found = NeighborQuery(state, 2.0).apart(state.points()[rows], rows) * state.spacing
    expected = FacingTree(positions, normals).nearest(positions, normals, skip_self=True)[0][rows, 0]
    assert found == pytest.approx(np.minimum(expected, 2.0 * state.spacing), rel=1e-5)


@pytest.mark.parametrize("make", [sphere, star], ids=["sphere", "star"])
def test_particles_move_into_holes(make: Callable[[], MeshSurface]) -> None:
    surface = make()
    state = with_holes(surface, 20)
    samples = surface.sample(20_000, seed=5)
    before = state.points()
    fill_gaps(state, LEAST)
    after = state.points()
    gaps = [
        FacingTree(points.positions, points.normals).nearest(*samples)[0][:, 0] / state.spacing
        for points in (before, after)
    ]
    assert (gaps[1] > WIDE_GAP).mean() < 0.3 * (gaps[0] > WIDE_GAP).mean()
    nearest = FacingTree(after.positions, after.normals).nearest(
        after.positions, after.normals, skip_self=True
    )
    assert nearest[0].min() > 0.999 * LEAST * state.spacing
    assert np.linalg.norm(surface.project(after.positions)[0] - after.positions, axis=1).max() < 1e-4


def test_even_particles_stay() -> None:
    relaxation = Relaxation([sphere()], count=400)
    relaxation.run()
    state = state_of(sphere(), relaxation.positions, relaxation.normals)
    fill_gaps(state, LEAST)
    assert np.array_equal(state.points().positions, relaxation.positions)
