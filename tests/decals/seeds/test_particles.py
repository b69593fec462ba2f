import numpy as np
import pytest
import warp as wp

from decals.model import FACING_LIMIT
from decals.seeds.particles import CLOSEST, ISOTROPY, ODD
from decals.seeds.repulsion import CORE, CUTOFF, DAMPING, LONGEST, Law, Repulsion
from tests.oracles.repulsion import moves as expected_moves
from tests.oracles.repulsion import ring_energy, rings, total_energy

SPACING = 0.3

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def sphere_points(count, seed, radius=1.0):
    normals = unit(np.random.default_rng(seed).normal(size=(count, 3))).astype(np.float32)
    return np.float32(radius) * normals, normals


def step(positions, normals, *, exponent=4.0, stiffness=0.0, spacing=SPACING):
    found, energies, _ = evaluated(positions, normals, Law(exponent, stiffness), spacing)
    return found, energies


def evaluated(positions, normals, law, spacing, device="cpu"):
    count = len(positions)
    sizes = np.broadcast_to(np.float32(spacing), count).copy()
    places, ways = (wp.array(rows, dtype=wp.vec3, device=device) for rows in (positions, normals))
    spacings = wp.array(sizes, dtype=wp.float32, device=device)
    moves = wp.zeros(count, dtype=wp.vec3, device=device)
    energies = wp.zeros(count, dtype=wp.float32, device=device)
    works = wp.zeros(count, dtype=wp.float64, device=device)
    repulsion = Repulsion(count, device=device)
    varied = bool(sizes.min() != sizes.max())
    repulsion.relist(places, ways, spacings, spacing=float(np.median(sizes)), varied=varied)
    repulsion.level(places)
    repulsion.evaluate(places, ways, law, moves=moves, energies=energies, works=works)
    return moves.numpy(), energies.numpy(), works.numpy()


def oracle(positions, normals, *, exponent=4.0, stiffness=0.0, spacing=SPACING, evening=0.0, mean=0.0):
    return expected_moves(
        positions,
        normals,
        np.broadcast_to(spacing, len(positions)),
        cutoff=CUTOFF,
        exponent=exponent,
        core=CORE,
        stiffness=stiffness,
        facing_limit=FACING_LIMIT,
        damping=DAMPING,
        longest=LONGEST,
        isotropy=ISOTROPY,
        closest=CLOSEST,
        evening=evening,
        mean=mean,
        odd=ODD,
    )


@pytest.mark.parametrize(("exponent", "stiffness"), [(3.0, 0.0), (4.0, 300.0)])
@pytest.mark.parametrize("varied", [False, True])
def test_a_step_is_that_of_every_pair_by_itself(exponent, stiffness, varied):
    positions, normals = sphere_points(150, seed=int(exponent))
    spacing = SPACING * (1.0 + 0.3 * varied * positions[:, 2])
    wish = {"exponent": exponent, "stiffness": stiffness, "spacing": spacing}
    found, energies = step(positions, normals, **wish)
    expected, expected_energies = oracle(positions, normals, **wish)
    assert np.allclose(found, expected, atol=2e-4 * SPACING)
    assert np.allclose(energies, expected_energies, rtol=1e-3)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("varied", [False, True])
def test_rings_are_evened_by_the_slope_of_their_energy(varied, device):
    positions, normals = sphere_points(150, seed=9)
    sizes = (SPACING * (1.0 + 0.3 * varied * positions[:, 2])).astype(np.float32)
    wide = sizes.astype(float)
    law = Law(3.0, 300.0, 600.0)
    found, energies, works = evaluated(positions, normals, law, sizes, device)
    around = {"farthest": CUTOFF, "facing_limit": FACING_LIMIT}
    widths = rings(positions, normals, wide, **around)[0]
    mean = widths.mean()
    odd = np.abs(widths - mean) > ODD
    assert odd.any()
    assert not odd.all()
    wish = {"exponent": law.exponent, "stiffness": law.stiffness, "spacing": wide}
    expected, expected_energies = oracle(positions, normals, **wish, evening=law.evening, mean=mean)
    assert np.allclose(found, expected, atol=2e-4 * SPACING)
    assert np.allclose(energies, expected_energies, rtol=1e-3)
    rule = {"cutoff": CUTOFF, "core": CORE, "closest": CLOSEST, "facing_limit": FACING_LIMIT}
    rule |= {"exponent": law.exponent, "stiffness": law.stiffness}
    pairs = total_energy(positions, normals, wide, **rule)
    uneven = ring_energy(positions, normals, wide, evening=law.evening, mean=mean, odd=ODD, **around)
    assert uneven > 0.01 * pairs
    assert works.sum() == pytest.approx(pairs + uneven, rel=1e-4)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_step_grows_with_the_model(scale):
    positions, normals = sphere_points(150, seed=4)
    found, _ = step(positions * np.float32(scale), normals, spacing=SPACING * scale)
    assert np.allclose(found / scale, step(positions, normals)[0], atol=2e-4 * SPACING)


def test_moves_are_short_and_tangential():
    positions, normals = sphere_points(400, seed=5)
    found, _ = step(positions, normals)
    assert np.linalg.norm(found, axis=1).max() <= LONGEST * SPACING * 1.0001
    assert np.abs(np.einsum("ni,ni->n", found, normals)).max() < 1e-5


def test_two_particles_part():
    positions = np.array([[0, 0, 0], [0.5 * SPACING, 0, 0]], np.float32)
    found, _ = step(positions, np.tile(np.float32([0, 0, 1]), (2, 1)))
    assert found[0, 0] < 0 < found[1, 0]
    assert np.allclose(found[0], -found[1])


def test_particles_on_two_sides_of_a_wall_ignore_each_other():
    positions = np.array([[0, 0, 0], [0.2 * SPACING, 0, -0.02]], np.float32)
    found, energies = step(positions, np.array([[0, 0, 1], [0, 0, -1]], np.float32))
    assert not found.any()
    assert not energies.any()


def test_coincident_particles_part_in_opposite_directions():
    found, _ = step(np.ones((2, 3), np.float32), np.tile(np.float32([0, 1, 0]), (2, 1)))
    assert np.isfinite(found).all()
    assert np.linalg.norm(found[0]) > 0
    assert np.allclose(found[0], -found[1])


def test_a_lone_particle_rests():
    found, energies = step(*sphere_points(1, seed=0))
    assert not found.any()
    assert not energies.any()


def test_the_same_particles_move_by_the_same_bytes():
    positions, normals = sphere_points(500, seed=6)
    assert step(positions, normals)[0].tobytes() == step(positions, normals)[0].tobytes()


@pytest.mark.parametrize(("exponent", "stiffness"), [(2.0, 0.0), (3.0, 300.0)])
def test_works_add_up_to_the_energy_of_all_pairs(exponent, stiffness):
    positions, normals = sphere_points(150, seed=7)
    spacing = (SPACING * (1.0 + 0.3 * positions[:, 2])).astype(np.float32)
    works = evaluated(positions, normals, Law(exponent, stiffness), spacing)[2]
    expected = total_energy(
        positions,
        normals,
        spacing.astype(float),
        cutoff=CUTOFF,
        exponent=exponent,
        core=CORE,
        stiffness=stiffness,
        facing_limit=FACING_LIMIT,
        closest=CLOSEST,
    )
    assert works.sum() == pytest.approx(expected, rel=1e-4)
