"""Decals that are outsized, or too near to others, move together with their neighbours."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

import decals
from blobtree._typing import BoolArray, Float64Array
from decals import Relaxation
from decals.model import FACING_LIMIT
from decals.scattering.decal_normals import DecalNormals
from decals.scattering.domain import OrientedPoints
from decals.scattering.neighbors import NearestFacing
from decals.scattering.rearrangement import ACTIVE, LARGEST, _kept_apart, _near_pairs, rearranged
from decals.surfaces.surface import unit_rows
from tests.decals.family_models import model_of
from tests.decals.meshes import sphere

COUNT = 300


@pytest.fixture(scope="module")
def relaxation() -> Relaxation:
    """Even particles on a ball."""
    found = Relaxation([sphere(48)], count=COUNT, seed=1)
    found.run()
    return found


def pushed(relaxation: Relaxation, seed: int, share: float) -> OrientedPoints:
    """Return the particles, of which five moved so many spacings toward a neighbour."""
    rng = np.random.default_rng(seed)
    positions = relaxation.positions.astype(np.float64)
    rows = rng.choice(COUNT, 5, replace=False)
    nearest = np.argsort(cdist(positions[rows], positions), axis=1)[:, 1]
    steps = positions[nearest] - positions[rows]
    positions[rows] += share * relaxation.spacing * steps / np.linalg.norm(steps, axis=1, keepdims=True)
    return relaxation.domain.project(on_ball(positions))[0]


def on_ball(positions: Float64Array) -> OrientedPoints:
    """Return points of the only surface, a ball of radius 1."""
    normals = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    ids = np.zeros(len(positions), np.int32)
    return OrientedPoints(positions.astype(np.float32), normals.astype(np.float32), ids)


def moved(relaxation: Relaxation, centers: OrientedPoints, movable: BoolArray) -> OrientedPoints:
    """Return the decals at centres, after some of them moved."""
    samples = relaxation.domain.sample(np.array([64 * len(centers)]), stream=3)
    spacings = np.full(len(centers), relaxation.spacing, np.float32)
    nearest = NearestFacing(samples.positions, samples.normals)
    normals = DecalNormals(centers, spacings, samples, lambda points, _spacings: points)
    spacing = float(relaxation.spacing)
    return rearranged(
        relaxation.domain, centers, movable, spacing, samples, nearest, normals, lambda points: points
    )


def least(relaxation: Relaxation, points: OrientedPoints) -> float:
    """Return the least distance of two points, in spacings, by brute force."""
    distances = cdist(points.positions.astype(np.float64), points.positions.astype(np.float64))
    np.fill_diagonal(distances, np.inf)
    return float(distances.min() / relaxation.spacing)


def largest(relaxation: Relaxation, points: OrientedPoints) -> float:
    """Return the largest cell over the median one, by brute force at 20,000 samples."""
    samples = relaxation.domain.sample(np.array([20_000]), stream=9)
    distances = cdist(samples.positions, points.positions)
    radii = np.zeros(len(points))
    np.maximum.at(radii, distances.argmin(axis=1), distances.min(axis=1))
    return float(radii.max() / np.median(radii))


@pytest.mark.parametrize("seed", range(4))
def test_displaced_decals_and_their_neighbours_spread(relaxation: Relaxation, seed: int) -> None:
    centers = pushed(relaxation, seed, 0.45)
    assert least(relaxation, centers) < 0.7
    found = moved(relaxation, centers, np.ones(COUNT, np.bool_))
    assert least(relaxation, found) > 0.86
    assert largest(relaxation, found) < 1.42
    changed = (found.positions != centers.positions).any(axis=1)
    faulty = np.flatnonzero((centers.positions != relaxation.positions).any(axis=1))
    far = cdist(centers.positions, centers.positions[faulty]).min(axis=1)
    assert not changed[far > (ACTIVE + 1.0) * relaxation.spacing].any()


def test_fixed_decals_stay(relaxation: Relaxation) -> None:
    centers = pushed(relaxation, 0, 0.45)
    movable = centers.positions[:, 2] > 0.0
    found = moved(relaxation, centers, movable)
    stays = (found.positions == centers.positions).all(axis=1)
    assert stays[~movable].all()
    assert not stays.all()


def test_many_decals_at_one_point_stay_there(relaxation: Relaxation) -> None:
    """Most of them own no sample, so the median radius is 0."""
    centers = on_ball(np.repeat([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], [40, 2], axis=0))
    found = moved(relaxation, centers, np.arange(42) == 41)
    np.testing.assert_array_equal(found.positions[:41], centers.positions[:41])
    assert np.isfinite(found.positions).all()


def test_even_decals_stay(relaxation: Relaxation) -> None:
    centers = on_ball(relaxation.positions.astype(np.float64))
    found = moved(relaxation, centers, np.ones(COUNT, np.bool_))
    np.testing.assert_array_equal(found.positions, centers.positions)


def test_decals_that_are_uneven_by_intent_are_not_pushed(relaxation: Relaxation) -> None:
    centers = relaxation.domain.sample(np.array([COUNT]), stream=7)
    distances = cdist(centers.positions, centers.positions)
    np.fill_diagonal(distances, np.inf)
    near = np.flatnonzero(distances.min(axis=1) < 0.2 * relaxation.spacing)
    found = moved(relaxation, centers, np.ones(COUNT, np.bool_))
    distances = cdist(found.positions, found.positions)
    np.fill_diagonal(distances, np.inf)
    assert (distances[near].min(axis=1) < 0.3 * relaxation.spacing).mean() > 0.7


@pytest.mark.parametrize("with_heights", [False, True])
def test_near_pairs_are_those_of_brute_force(with_heights: bool) -> None:
    rng = np.random.default_rng(4)
    normals = rng.normal(size=(400, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centers = OrientedPoints(
        rng.uniform(size=(400, 3)).astype(np.float32), normals.astype(np.float32), np.zeros(400, np.int32)
    )
    heights = np.where(rng.random(400) < 0.5, 0.005, np.inf) if with_heights else None
    pairs, found = _near_pairs(centers, heights, 0.1)
    offsets = centers.positions[None].astype(np.float64) - centers.positions[:, None]
    distances = np.linalg.norm(offsets, axis=2)
    near = (distances <= 0.1) & (normals @ normals.T > FACING_LIMIT) & np.triu(np.ones((400, 400), bool), 1)
    if heights is not None:
        mine, theirs = np.einsum("abi,ai->ab", offsets, normals), np.einsum("abi,bi->ab", offsets, normals)
        near &= mine * theirs <= LARGEST**2 * np.minimum(heights[:, None], heights) ** 2
    expected = np.argwhere(near)
    assert len(expected) > 50
    np.testing.assert_array_equal(pairs, expected)
    np.testing.assert_allclose(found, distances[near], rtol=1e-5)


@pytest.mark.parametrize("name", ["patches-3", "patches-7", "vessel-0"])
def test_decals_of_hard_models_are_even(name: str) -> None:
    scene = decals.cover(model_of(name, 1), count=1000)
    radii = scene.decals.radii
    assert radii.max() < 1.51 * np.median(radii)
    assert scene.measure(samples=20_000).rho > 0.85


@pytest.mark.parametrize("seed", range(4))
def test_guarded_moves_bring_no_two_decals_too_near(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = [rng.normal(size=(COUNT, 3))]
    places += [unit_rows(places[0]) + 0.2 * rng.normal(size=(COUNT, 3))]
    before, after = (on_ball(unit_rows(rows).astype(np.float64)) for rows in places)
    found = _kept_apart(before, after, None, 0.05)
    facing = np.triu(before.normals @ before.normals.T > FACING_LIMIT, 1)
    facing &= found.normals @ found.normals.T > FACING_LIMIT
    earlier, now = (cdist(points.positions, points.positions) for points in (before, found))
    assert not (facing & (now < 0.05) & (now < earlier - 1e-6)).any()
    kept = (found.positions == after.positions).all(axis=1)
    assert 0.3 < kept.mean() < 1.0
    assert (found.positions[~kept] == before.positions[~kept]).all()
