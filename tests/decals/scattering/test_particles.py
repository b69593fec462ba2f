from typing import Any

import numpy as np
import pytest

from blobtree._typing import Float32Array, Float64Array
from decals.model import FACING_LIMIT
from decals.scattering.repulsion import CORE, CUTOFF, DAMPING, MAX_MOVE, Law
from decals.scattering.repulsion_kernels import CLOSEST, ISOTROPY, MAX_RING_DEVIATION
from tests.decals.scattering.evaluation import device_particles, evaluate
from tests.oracles.repulsion import moves as expected_moves
from tests.oracles.repulsion import ring_energy, rings, total_energy
from tests.vectors import unit

SPACING = 0.3

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


def sphere_points(count: int, seed: int, radius: float = 1.0) -> tuple[Float32Array, Float32Array]:
    normals = unit(np.random.default_rng(seed).normal(size=(count, 3))).astype(np.float32)
    return np.float32(radius) * normals, normals


def step(
    positions: Float32Array,
    normals: Float32Array,
    *,
    stiffness: float = 0.0,
    spacing: Any = SPACING,
) -> tuple[Float32Array, Float32Array]:
    moves, energies, _ = evaluated(positions, normals, Law(stiffness), spacing)
    return moves, energies


def evaluated(
    positions: Float32Array, normals: Float32Array, law: Law, spacing: Any, device: str = "cpu"
) -> tuple[Float32Array, Float32Array, Float64Array]:
    sizes = np.broadcast_to(np.float32(spacing), len(positions))
    particles = device_particles(positions, normals, sizes, device)
    return evaluate(particles, law, varied=bool(sizes.min() != sizes.max()), device=device)


def oracle(
    positions: Float32Array,
    normals: Float32Array,
    *,
    stiffness: float = 0.0,
    spacing: Any = SPACING,
    ring_weight: float = 0.0,
    mean: float = 0.0,
) -> tuple[Float64Array, Float64Array]:
    return expected_moves(
        positions,
        normals,
        np.broadcast_to(spacing, len(positions)),
        cutoff=CUTOFF,
        core=CORE,
        stiffness=stiffness,
        facing_limit=FACING_LIMIT,
        damping=DAMPING,
        longest=MAX_MOVE,
        isotropy=ISOTROPY,
        closest=CLOSEST,
        ring_weight=ring_weight,
        mean=mean,
        max_deviation=MAX_RING_DEVIATION,
    )


@pytest.mark.parametrize("stiffness", [0.0, 300.0])
@pytest.mark.parametrize("varied", [False, True])
def test_step_matches_oracle(stiffness: float, varied: bool) -> None:
    positions, normals = sphere_points(150, seed=3)
    spacing = SPACING * (1.0 + 0.3 * varied * positions[:, 2])
    options: dict[str, Any] = {"stiffness": stiffness, "spacing": spacing}
    moves, energies = step(positions, normals, **options)
    expected, expected_energies = oracle(positions, normals, **options)
    assert np.allclose(moves, expected, atol=2e-4 * SPACING)
    assert np.allclose(energies, expected_energies, rtol=1e-3)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("varied", [False, True])
def test_ring_terms_match_oracle(varied: bool, device: str) -> None:
    positions, normals = sphere_points(150, seed=9)
    sizes = (SPACING * (1.0 + 0.3 * varied * positions[:, 2])).astype(np.float32)
    double_sizes = sizes.astype(float)
    law = Law(300.0, 600.0)
    moves, energies, pair_energies = evaluated(positions, normals, law, sizes, device)
    around: dict[str, Any] = {"farthest": CUTOFF, "facing_limit": FACING_LIMIT}
    ring_means = rings(positions, normals, double_sizes, **around)[0]
    mean = ring_means.mean()
    deviates = np.abs(ring_means - mean) > MAX_RING_DEVIATION
    assert deviates.any()
    assert not deviates.all()
    options: dict[str, Any] = {"stiffness": law.stiffness, "spacing": double_sizes}
    expected, expected_energies = oracle(
        positions, normals, **options, ring_weight=law.ring_weight, mean=mean
    )
    assert np.allclose(moves, expected, atol=2e-4 * SPACING)
    assert np.allclose(energies, expected_energies, rtol=1e-3)
    rule: dict[str, Any] = {"cutoff": CUTOFF, "core": CORE, "closest": CLOSEST, "facing_limit": FACING_LIMIT}
    rule["stiffness"] = law.stiffness
    pairs = total_energy(positions, normals, double_sizes, **rule)
    ring_total = ring_energy(
        positions,
        normals,
        double_sizes,
        ring_weight=law.ring_weight,
        mean=mean,
        max_deviation=MAX_RING_DEVIATION,
        **around,
    )
    assert ring_total > 0.01 * pairs
    assert pair_energies.sum() == pytest.approx(pairs + ring_total, rel=1e-4)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_step_scales_with_the_model(scale: float) -> None:
    positions, normals = sphere_points(150, seed=4)
    moves, _ = step(positions * np.float32(scale), normals, spacing=SPACING * scale)
    assert np.allclose(moves / scale, step(positions, normals)[0], atol=2e-4 * SPACING)


def test_moves_are_bounded_and_tangential() -> None:
    positions, normals = sphere_points(400, seed=5)
    moves, _ = step(positions, normals)
    assert np.linalg.norm(moves, axis=1).max() <= MAX_MOVE * SPACING * 1.0001
    assert np.abs(np.einsum("ni,ni->n", moves, normals)).max() < 1e-5


def test_two_particles_repel_each_other() -> None:
    positions = np.array([[0, 0, 0], [0.5 * SPACING, 0, 0]], np.float32)
    moves, _ = step(positions, np.tile(np.array([0, 0, 1], np.float32), (2, 1)))
    assert moves[0, 0] < 0 < moves[1, 0]
    assert np.allclose(moves[0], -moves[1])


def test_opposite_normals_do_not_interact() -> None:
    positions = np.array([[0, 0, 0], [0.2 * SPACING, 0, -0.02]], np.float32)
    moves, energies = step(positions, np.array([[0, 0, 1], [0, 0, -1]], np.float32))
    assert not moves.any()
    assert not energies.any()


def test_coincident_particles_separate() -> None:
    moves, _ = step(np.ones((2, 3), np.float32), np.tile(np.array([0, 1, 0], np.float32), (2, 1)))
    assert np.isfinite(moves).all()
    assert np.linalg.norm(moves[0]) > 0
    assert np.allclose(moves[0], -moves[1])


def test_single_particle_rests() -> None:
    moves, energies = step(*sphere_points(1, seed=0))
    assert not moves.any()
    assert not energies.any()


def test_evaluation_is_deterministic() -> None:
    positions, normals = sphere_points(500, seed=6)
    assert step(positions, normals)[0].tobytes() == step(positions, normals)[0].tobytes()


@pytest.mark.parametrize("stiffness", [0.0, 300.0])
def test_pair_energies_sum_to_the_total(stiffness: float) -> None:
    positions, normals = sphere_points(150, seed=7)
    spacing = (SPACING * (1.0 + 0.3 * positions[:, 2])).astype(np.float32)
    pair_energies = evaluated(positions, normals, Law(stiffness), spacing)[2]
    expected = total_energy(
        positions,
        normals,
        spacing.astype(float),
        cutoff=CUTOFF,
        core=CORE,
        stiffness=stiffness,
        facing_limit=FACING_LIMIT,
        closest=CLOSEST,
    )
    assert pair_energies.sum() == pytest.approx(expected, rel=1e-4)
