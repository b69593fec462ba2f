"""Energy test, relocation, polish and neighbour queries."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array
from blobtree.device import launch
from decals import Relaxation
from decals.model import FACING_LIMIT
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.neighbors import FacingTree, NearestFacing, NeighborQuery, index_array
from decals.scattering.particle_state import ParticleState
from decals.scattering.polish import polish
from decals.scattering.relocation import crowded_particles, relocate
from decals.scattering.repulsion import CORE, CUTOFF, Law, law_at
from decals.scattering.repulsion_kernels import CLOSEST
from decals.scattering.search_kernels import Candidates, ChoiceRule, move_to_best
from decals.surfaces import MeshSurface
from decals.surfaces.surface import unit_rows
from tests.decals.meshes import box, plane, sphere, star
from tests.decals.scattering.evaluation import device_particles, evaluate
from tests.oracles.repulsion import rings, total_energy
from tests.oracles.sized_decals import nearest_facing


def row_of(ticks: Sequence[float], surface_id: int = 0) -> OrientedPoints:
    """OrientedPoints in a row, facing up."""
    positions = np.zeros((len(ticks), 3), np.float32)
    positions[:, 0] = ticks
    normals = np.tile(np.array([0, 0, 1], np.float32), (len(ticks), 1))
    return OrientedPoints(positions, normals, np.full(len(ticks), surface_id, np.int32))


def state_in_a_row(movable: ArrayLike) -> ParticleState:
    domain = Domain([plane(100.0)], seed=0)
    points = row_of([0.0, 0.01, 1.0, 2.0, 3.0, 4.0, 5.0])
    state = ParticleState(domain, points, np.asarray(movable), np.ones(7, np.float32))
    state.begin_epoch(Law(0.0))
    return state


def test_crowded_particles_move_to_gaps() -> None:
    state = state_in_a_row([True] * 7)
    movers = crowded_particles(state)
    assert movers.tolist() == [1]  # as crowded as its neighbour from the left, and more from the right
    candidates = row_of([0.5, 9.0, 1.1])
    relocate(state, movers, candidates, np.ones(3, np.float32))
    assert state.points().positions[:, 0].tolist() == [0, 9, 1, 2, 3, 4, 5]
    assert crowded_particles(state_in_a_row(np.arange(7) > 1)).tolist() == []


def test_relocation_stays_on_the_surface() -> None:
    state = state_in_a_row([True] * 7)
    before = state.points().positions
    relocate(state, np.array([1]), row_of([9.0, 11.0], surface_id=1), np.ones(2, np.float32))
    assert np.array_equal(state.points().positions, before)


def test_polish_never_lowers_the_least_distance() -> None:
    surface = box()
    rough = Relaxation([surface], count=150, iterations=60)
    while rough.steps < 12:
        rough.step()
    movable, sizes = np.ones(150, bool), rough.sizes_at(rough.positions)
    state = ParticleState(rough.domain, rough.points, movable, sizes)
    first = last = nearest_facing(rough.positions, rough.normals).min()
    for number in range(15):
        polish(state, rounds=1, seed=number, sizes_at=rough.sizes_at)
        points = state.points()
        least = nearest_facing(points.positions, points.normals).min()
        assert least > last * (1 - 1e-6)
        last = least
    assert last > 1.05 * first
    assert np.abs(surface.project(points.positions)[0] - points.positions).max() < 1e-6


@pytest.mark.parametrize("surface", [sphere, box, star])
def test_energy_never_rises_within_an_epoch(surface: Callable[[], MeshSurface]) -> None:
    relaxation = Relaxation([surface()], count=400, iterations=90, density=lambda points: 2.0 + points[:, 0])
    energies, epochs = [], []
    for _ in range(89):
        relaxation.step()
        energies.append(relaxation.energy)
        epochs.append(relaxation.epoch)
    same = np.diff(epochs) == 0
    assert same.sum() > 15
    assert (np.diff(energies)[same] <= 0).all()
    assert (np.diff(energies)[same] < 0).any()


def test_lists_kept_over_epochs_hold_all_neighbors() -> None:
    relaxation = Relaxation([sphere()], count=400)
    while relaxation.steps < 80:
        relaxation.step()
    sizes = np.full(400, relaxation.spacing)
    particles = device_particles(relaxation.positions, relaxation.normals, sizes, "cpu")
    expected = evaluate(particles, law_at(0.5, 0.5), varied=False, device="cpu")[1]
    assert np.allclose(relaxation.energies, expected, rtol=1e-3)


def test_owners_are_the_nearest_facing_particles() -> None:
    relaxation = Relaxation([star()], count=300, iterations=30)
    relaxation.run()
    positions, normals, spacing = relaxation.positions, relaxation.normals, relaxation.spacing
    state = ParticleState(relaxation.domain, relaxation.points, np.ones(300, bool), np.full(300, spacing))
    samples = relaxation.domain.sample(np.array([5000]), stream=3)
    reach = 0.6
    gaps, owners = NeighborQuery(state, reach).owners(samples.positions, samples.normals)
    expected, indices = (
        rows[:, 0] for rows in FacingTree(positions, normals).nearest(samples.positions, samples.normals)
    )
    near = expected < 0.999 * reach * spacing
    far = expected > 1.001 * reach * spacing
    assert np.allclose(gaps[near] * spacing, expected[near], rtol=1e-4)
    assert (owners == indices)[near].mean() > 0.999  # two may be equally near
    assert far.any()
    assert (owners[far] == -1).all()


def test_step_that_raises_the_energy_is_rejected() -> None:
    count = 121
    state = ParticleState(
        Domain([BiasedPlane()], seed=0),
        jittered(0.3, 11),
        np.ones(count, bool),
        np.full(count, 0.3, np.float32),
    )
    law = Law(300.0)
    state.begin_epoch(law)
    guides = state.points().normals
    rule: dict[str, Any] = {"cutoff": CUTOFF, "core": CORE, "facing_limit": FACING_LIMIT, "closest": CLOSEST}
    rule["stiffness"] = law.stiffness
    energies, stayed = [], 0
    for _ in range(12):
        before = state.points().positions
        state.step()
        points = state.points()
        stayed += np.array_equal(before, points.positions)
        sizes = state.host_sizes.astype(float)
        energies.append(total_energy(points.positions, points.normals, sizes, guides=guides, **rule))
        assert state.energy == pytest.approx(energies[-1], rel=1e-4)
    assert stayed > 0  # some steps were rejected
    assert energies[-1] < energies[0]
    assert (np.diff(energies) <= 1e-5 * energies[0]).all()


class BiasedPlane:
    """A plane whose projection displaces points sideways, farther for larger steps."""

    def __init__(self) -> None:
        self._plane = plane(4.0)
        self.area, self.bounds = self._plane.area, self._plane.bounds
        self.sample, self.contains = self._plane.sample, self._plane.contains
        self.raycast, self.normal = self._plane.raycast, self._plane.normal

    def project(
        self, points: ArrayLike, *, within: Float32Array | None = None
    ) -> tuple[Float32Array, Float32Array]:
        positions, normals = self._plane.project(points)
        if within is not None:
            sideways = 60.0 * np.maximum(within - 0.001, 0.0) ** 2
            positions[:, 0] += sideways * np.where(np.arange(len(positions)) % 2, 1, -1)
        return positions.astype(np.float32), normals


def jittered(spacing: float, side: int) -> OrientedPoints:
    """A square grid of displaced particles."""
    ticks = spacing * (np.arange(side) - 0.5 * (side - 1))
    positions = np.zeros((side**2, 3), np.float32)
    positions[:, :2] = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    positions[:, :2] += np.random.default_rng(3).uniform(-0.05, 0.05, (side**2, 2))
    return OrientedPoints(
        positions, np.tile(np.array([0, 0, 1], np.float32), (side**2, 1)), np.zeros(side**2, np.int32)
    )


@pytest.mark.parametrize("surface", [sphere, plane])
def test_ring_distances_match_all_pairs(surface: Callable[[], MeshSurface]) -> None:
    relaxation = Relaxation([surface()], count=200)
    state = ParticleState(
        relaxation.domain, relaxation.points, np.ones(200, bool), relaxation.sizes_at(relaxation.positions)
    )
    own = index_array(np.arange(200), "cpu")
    mirrors: Any = state.mirror_planes(state.particles, state.device_surface_ids, state.device_movable)
    nearest, ring = (
        array.numpy() for array in NeighborQuery(state, 2.0).rings(state.particles, own, mirrors)
    )
    points, sizes = state.points(), state.host_sizes.astype(float)
    middle = np.ones(200, bool)
    wall = None
    if mirrors.per_point:  # on the square only particles near one side
        depths = 0.5 - np.abs(points.positions[:, :2])
        middle = (depths[:, 1] > 2.1 * sizes) & (points.positions[:, 0] < 0)
        wall = np.array([-0.5, 0, 0]), np.array([1.0, 0, 0])
        assert (depths[middle, 0] < sizes[middle]).any()
    rule: dict[str, Any] = {"farthest": 2.0, "facing_limit": FACING_LIMIT}
    expected = rings(points.positions, points.normals, sizes, wall=wall, **rule)[0]
    assert middle.sum() > 20
    assert ring[middle] == pytest.approx(expected[middle], rel=1e-5)
    assert (nearest[middle] <= ring[middle]).all()


def test_best_candidate_has_the_most_even_ring() -> None:
    up = np.array([0, 0, 1], np.float32)
    candidates: Any = Candidates()
    candidates.per_particle = 4
    offsets = np.array([[-0.2, 0, 0], [-0.5, 0, 0], [-0.6, 0, 0], [-0.7, 0, 0]], np.float32)
    candidates.positions = wp.array(offsets, dtype=wp.vec3, device="cpu")
    candidates.normals = wp.array(np.tile(up, (4, 1)), dtype=wp.vec3, device="cpu")
    candidates.forbidden = wp.zeros(4, dtype=wp.int32, device="cpu")
    candidates.nearest = wp.array(np.array([0.7, 1.0, 1.1, 1.2], np.float32), dtype=wp.float32, device="cpu")
    candidates.rings = wp.array(np.array([1.0, 1.3, 1.2, 0.7], np.float32), dtype=wp.float32, device="cpu")
    rule: Any = ChoiceRule()
    rule.min_gain, rule.close, rule.ideal_ring = 1.0, 0.89, 1.0
    particles = device_particles([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], np.tile(up, (2, 1)), np.ones(2), "cpu")
    rows, moved = index_array(np.array([0]), "cpu"), index_array(np.array([0]), "cpu")
    current: Any = wp.array(np.array([0.5], np.float32), dtype=wp.float32, device="cpu")
    launch(move_to_best, 1, [rule, rows, current, candidates], [particles, moved], device="cpu")
    assert moved.numpy().tolist() == [1]
    # three candidates are far enough, and this one has the best ring
    assert particles.positions.numpy()[0] == pytest.approx([-0.6, 0, 0])


@pytest.mark.parametrize("skip_self", [False, True])
def test_nearest_facing_neighbors_match_all_pairs(skip_self: bool) -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(300, 3)).astype(np.float32)
    normals = (points / np.linalg.norm(points, axis=1, keepdims=True)).astype(np.float32)
    distances, indices = FacingTree(points, normals).nearest(points, normals, count=3, skip_self=skip_self)
    expected = np.linalg.norm(points[:, None].astype(float) - points[None], axis=2)
    expected[normals.astype(float) @ normals.T.astype(float) <= -0.25] = np.inf
    if skip_self:
        np.fill_diagonal(expected, np.inf)
    assert np.allclose(distances, np.sort(expected, axis=1)[:, :3], atol=1e-5)
    assert np.allclose(np.take_along_axis(expected, indices, axis=1), distances, atol=1e-5)


def test_neighbors_beyond_the_reach_do_not_count() -> None:
    rng = np.random.default_rng(4)
    points = unit_rows(rng.normal(size=(900, 3)))
    queries, tree = points[:200], FacingTree(points, points)
    found = tree.nearest(queries, queries, count=9, reach=0.15)
    distances, indices = tree.nearest(queries, queries, count=9)
    near = distances <= 0.15
    assert near[:, -1].any()
    assert not near[:, -1].all()
    np.testing.assert_array_equal(found[0], np.where(near, distances, np.inf))
    np.testing.assert_array_equal(found[1], np.where(near, indices, -1))


def test_missing_neighbors_are_infinitely_far() -> None:
    up, down = np.array([[0, 0, 1]], np.float32), np.array([[0, 0, -1]], np.float32)
    spot = np.zeros((1, 3), np.float32)
    distances, indices = FacingTree(spot, up).nearest(spot, up, count=3)
    assert distances.tolist() == [[0.0, np.inf, np.inf]]
    assert indices.tolist() == [[0, -1, -1]]
    assert FacingTree(spot, up).nearest(spot, down)[1].tolist() == [[-1]]
    assert FacingTree(spot[:0], up[:0]).nearest(spot, up)[1].tolist() == [[-1]]


def test_the_nearest_facing_centres_are_right_after_every_change() -> None:
    rng = np.random.default_rng(3)
    points, centers = (unit_rows(rng.normal(size=(count, 3))) for count in (2000, 150))
    normals, nearest = centers, NearestFacing(points, points)
    heights = np.full(len(centers), np.inf)
    for _ in range(6):
        expected = FacingTree(centers, normals, heights).nearest(points, points)
        apart = nearest.copy()
        for searched in (nearest, apart):
            for found, exact in zip(searched.of(centers, normals, heights), expected, strict=True):
                np.testing.assert_array_equal(found, exact[:, 0])
        apart.of(-centers, -normals)  # leaves the other as it is
        heights = heights.copy()
        heights[rng.integers(0, len(centers), 20)] = 0.01
        rows = rng.integers(0, len(centers), 4)
        centers, normals = centers.copy(), normals.copy()
        centers[rows] = unit_rows(centers[rows] + rng.normal(0.0, 0.3, (4, 3)))
        normals[rows[1:]] = unit_rows(normals[rows[1:]] + rng.normal(0.0, 0.5, (3, 3)))
