"""Open rims push as if the surface went on beyond them."""

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from decals.coat.seeding import seed
from decals.model import FACING_LIMIT
from decals.seeds.creases import Creases
from decals.seeds.particles import CLOSEST, ISOTROPY, ODD, ON_WALL
from decals.seeds.relaxation import Relaxation
from decals.seeds.repulsion import CORE, CUTOFF, DAMPING, LONGEST, Law, Repulsion
from decals.seeds.rim_kernels import WALLS
from decals.seeds.rims import Rims, Walls
from decals.surfaces.mesh import MeshSurface
from tests.decals.meshes import box, plane, sphere
from tests.oracles.repulsion import moves as expected_moves
from tests.oracles.repulsion import ring_energy, rings, total_energy
from tests.oracles.triangles import closest_points

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
UP = np.float32([0, 0, 1])


def disc(corners=200):
    turn = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    around = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    faces = [[0, 1 + i, 1 + (i + 1) % corners] for i in range(corners)]
    return MeshSurface(np.vstack([[0, 0, 0], around]), faces)


def half_ball(rings=48, corners=160):
    """The upper half of a unit ball, its rim on z = 0."""
    away, turn = np.linspace(0, np.pi / 2, rings), np.linspace(0, 2 * np.pi, corners, endpoint=False)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rows = [np.column_stack([np.sin(a) * around, np.full(corners, np.cos(a))]) for a in away]
    here = np.arange(rings * corners).reshape(rings, corners)
    one, other = here[:-1], here[1:]
    after, beyond = np.roll(one, -1, axis=1), np.roll(other, -1, axis=1)
    faces = np.concatenate(
        [np.stack(f, axis=-1).reshape(-1, 3) for f in ((one, other, beyond), (one, beyond, after))]
    )
    return MeshSurface(np.concatenate(rows), faces)


def cells(relaxation):
    """Area nearest to each particle, in its fair share."""
    samples, _ = relaxation.world.surfaces[0].sample(60 * relaxation.count, seed=8)
    near = cKDTree(relaxation.positions).query(samples)[1]
    return np.bincount(near, minlength=relaxation.count) / 60


MODELS = {
    "disc": (disc, lambda p: 1 - np.hypot(p[:, 0], p[:, 1])),
    "square": (lambda: plane(2.0), lambda p: 1 - np.abs(p[:, :2]).max(axis=1)),
    "half ball": (half_ball, lambda p: np.arcsin(np.clip(np.abs(p[:, 2]), 0, 1))),
}


@pytest.mark.parametrize("count", [500, 2000])
@pytest.mark.parametrize("name", list(MODELS))
def test_the_outermost_row_has_as_much_room_as_all_others(name, count):
    make, depth_of = MODELS[name]
    relaxation = Relaxation([make()], count=count)
    relaxation.run()
    depth = depth_of(relaxation.positions) / relaxation.spacing
    room = cells(relaxation)
    outer, inner = depth < 0.7, depth > 2.5
    assert room[outer].mean() == pytest.approx(1.0, abs=0.08)
    assert room[inner].mean() == pytest.approx(1.0, abs=0.015)
    assert depth.min() > 0.4
    assert np.median(depth[outer]) < 0.62
    assert relaxation.statistics().rho > 0.88


def half_plane(count, seed):
    """Particles over the half plane x > 0, none as near to its rim as a wall begins to fade."""
    rng = np.random.default_rng(seed)
    positions = np.zeros((count, 3), np.float32)
    positions[:, 0] = rng.uniform(1.05 * ON_WALL, 4.0, count)
    positions[:, 1] = rng.uniform(-2.0, 2.0, count)
    return positions


def evaluated(positions, law, device):
    count = len(positions)
    places, ways = (
        wp.array(rows, dtype=wp.vec3, device=device) for rows in (positions, np.tile(UP, (count, 1)))
    )
    spacings = wp.full(count, 1.0, dtype=wp.float32, device=device)
    planes = np.zeros((WALLS * count, 3), np.float32)
    planes[::WALLS, 0] = 1.0
    origins = wp.zeros(WALLS * count, dtype=wp.vec3, device=device)
    walls = Walls(WALLS, origins, wp.array(planes, dtype=wp.vec3, device=device))
    moves = wp.zeros(count, dtype=wp.vec3, device=device)
    energies = wp.zeros(count, dtype=wp.float32, device=device)
    works = wp.zeros(count, dtype=wp.float64, device=device)
    repulsion = Repulsion(count, device=device)
    repulsion.relist(places, ways, spacings, spacing=1.0, varied=False, walls=walls)
    repulsion.level(places)
    repulsion.evaluate(places, ways, law, moves=moves, energies=energies, works=works)
    return moves.numpy(), energies.numpy(), works.numpy()


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("exponent", "stiffness"), [(2.0, 0.0), (3.0, 300.0)])
def test_a_step_at_a_wall_is_that_among_particles_and_their_images(exponent, stiffness, device):
    positions = half_plane(40, seed=3)
    normals, sizes = np.tile(UP, (40, 1)), np.ones(40)
    rule = {"cutoff": CUTOFF, "exponent": exponent, "core": CORE, "stiffness": stiffness}
    rule |= {"facing_limit": FACING_LIMIT, "closest": CLOSEST}
    moves, energies, works = evaluated(positions, Law(exponent, stiffness), device)
    step = {"damping": DAMPING, "longest": LONGEST, "isotropy": ISOTROPY}
    wall = np.zeros(3), np.array([1.0, 0, 0])
    expected, crowdedness = expected_moves(positions, normals, sizes, **rule, **step, wall=wall)
    assert np.allclose(moves, expected, atol=2e-4)
    assert np.allclose(energies, crowdedness, rtol=1e-3)
    # what lies on both sides of a mirror has twice the energy of one side
    both = np.concatenate([positions, positions * np.float32([-1, 1, 1])])
    whole = total_energy(both, np.tile(UP, (80, 1)), np.ones(80), **rule)
    assert works.sum() == pytest.approx(0.5 * whole, rel=1e-4)


@pytest.mark.parametrize("device", DEVICES)
def test_rings_at_a_wall_go_on_among_the_images(device):
    positions = half_plane(40, seed=5)
    normals, sizes = np.tile(UP, (40, 1)), np.ones(40)
    law = Law(3.0, 300.0, 600.0)
    moves, energies, works = evaluated(positions, law, device)
    wall = np.zeros(3), np.array([1.0, 0, 0])
    around = {"farthest": CUTOFF, "facing_limit": FACING_LIMIT}
    mean = rings(positions, normals, sizes, **around, wall=wall)[0].mean()
    rule = {"cutoff": CUTOFF, "exponent": law.exponent, "core": CORE, "stiffness": law.stiffness}
    rule |= {"facing_limit": FACING_LIMIT, "closest": CLOSEST}
    step = {
        "damping": DAMPING,
        "longest": LONGEST,
        "isotropy": ISOTROPY,
        "evening": law.evening,
        "mean": mean,
        "odd": ODD,
    }
    expected, crowdedness = expected_moves(positions, normals, sizes, **rule, **step, wall=wall)
    assert np.allclose(moves, expected, atol=2e-4)
    assert np.allclose(energies, crowdedness, rtol=1e-3)
    both = np.concatenate([positions, positions * np.float32([-1, 1, 1])])
    ways, ones = np.tile(UP, (80, 1)), np.ones(80)
    whole = total_energy(both, ways, ones, **rule)
    whole += ring_energy(both, ways, ones, evening=law.evening, mean=mean, odd=ODD, **around)
    assert works.sum() == pytest.approx(0.5 * whole, rel=1e-4)


def walls_of(surfaces, places, spacing=0.1, wanted=None, owners=None):
    """Normals of the walls that particles at such places of the surfaces have, ``[n, WALLS, 3]``."""
    count = len(places)
    numbers = np.zeros(count, np.int32) if owners is None else np.int32(owners)
    normals = [surfaces[number].project([place])[1][0] for number, place in zip(numbers, places, strict=True)]
    rows = [wp.array(np.float32(values), dtype=wp.vec3, device="cpu") for values in (places, normals)]
    flags = np.ones(count, np.int32) if wanted is None else np.int32(wanted)
    whole = [wp.array(values, dtype=wp.int32, device="cpu") for values in (numbers, flags)]
    sizes = wp.full(count, spacing, dtype=wp.float32, device="cpu")
    found = Rims(surfaces, spacing, "cpu").walls(*rows, sizes, *whole, reach=CUTOFF)
    return found.normals.numpy().reshape(count, -1, 3)


def test_walls_stand_where_the_surface_ends():
    places = [[0.45, 0, 0], [0, 0, 0], [0.45, 0.48, 0], [0.5, 0.1, 0]]
    found = walls_of([plane()], places)
    assert found[0] == pytest.approx(np.array([[-1, 0, 0], [0, 0, 0]]), abs=1e-6)
    assert not found[1].any()  # too far from all rims
    assert found[2] == pytest.approx(np.array([[0, -1, 0], [-1, 0, 0]]), abs=1e-6)  # the nearer one first
    assert found[3, 0] == pytest.approx([-1, 0, 0], abs=1e-6)  # on the very rim
    assert not walls_of([plane()], places, wanted=[0] * 4).any()


def test_there_are_none_where_a_surface_goes_on():
    assert Rims([sphere(), box()], 0.1, "cpu").count == 0
    left, right = plane(), MeshSurface(plane().vertices + np.float32([1, 0, 0]), plane().faces)
    found = walls_of([left, right], [[0.45, 0, 0], [0.55, 0, 0], [-0.45, 0, 0]], owners=[0, 1, 0])
    assert not found[:2].any()
    assert found[2, 0] == pytest.approx([1, 0, 0], abs=1e-6)
    floor = MeshSurface(plane(4.0).vertices, plane().faces)
    upright = MeshSurface([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    found = walls_of([upright, floor], [[0.5, 0, 0.05], [0.5, 0, 0.95]])
    assert not found[0].any()
    assert found[1, 0] == pytest.approx([0, 0, -1], abs=1e-6)


def test_a_card_that_lies_on_a_table_does_not_bound_it():
    table, card = plane(4.0), MeshSurface(plane().vertices + np.float32([0, 0, 0.02]), plane().faces)
    assert not walls_of([table, card], [[0.45, 0, 0]]).any()


def test_a_soup_of_faces_is_seeded_like_the_surface_that_it_makes():
    ball = sphere(level=3)
    soup = MeshSurface(ball.vertices[ball.faces.reshape(-1)] * 1.0, np.arange(ball.faces.size).reshape(-1, 3))
    rng = np.random.default_rng(0)
    shaken = MeshSurface(soup.vertices + rng.normal(0, 2e-4, soup.vertices.shape), soup.faces)
    assert not shaken.closed
    assert Rims([shaken], 0.2, "cpu").count == 0
    relaxation = Relaxation([shaken], count=300)
    relaxation.run()
    assert relaxation.statistics().rho > 0.85


def test_two_halves_of_a_sheet_hold_as_much_as_the_whole():
    whole = plane(2.0)
    parts = [
        MeshSurface([[x, -1, 0], [x + 1, -1, 0], [x + 1, 1, 0], [x, 1, 0]], whole.faces) for x in (-1, 0)
    ]
    relaxation = Relaxation(parts, count=1000)
    relaxation.run()
    across = np.abs(relaxation.positions[:, 0])
    # nobody keeps away from the seam as from a rim
    assert across.min() < 0.25 * relaxation.spacing
    strip = 3.0 * relaxation.spacing
    assert (across < strip).sum() == pytest.approx(1000 * strip, rel=0.05)


def test_decals_that_a_user_puts_on_a_rim_stay_there_and_are_no_more_than_others():
    square = plane(2.0)
    spacing = 0.1
    places = Creases(square).points(spacing)
    decals = seed(square, spacing=spacing, fixed=places)
    gaps, _ = cKDTree(decals.positions).query(places)
    assert gaps.max() < 1e-6
    depth = 1 - np.abs(decals.positions[:, :2]).max(axis=1)
    second = depth[(depth > 1e-6) & (depth < 1.4 * spacing)]
    assert np.median(second) == pytest.approx(np.sqrt(0.75) * spacing, rel=0.15)


@settings(max_examples=15, deadline=None)
@given(number=st.integers(0, 10_000), count=st.integers(1, 80), scale=st.sampled_from([1e-3, 1.0, 1e3]))
def test_strips_and_scraps_of_any_shape_are_seeded(number, count, scale):
    """A narrow strip, a corner and a scrap at once: on the surface, finite, and as many as wished for."""
    rng = np.random.default_rng(number)
    turn = np.sort(rng.uniform(0, 2 * np.pi, 7))
    rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1) * rng.uniform(0.05, 1.0, (7, 1))
    fan = MeshSurface(scale * np.vstack([[0, 0, 0], rim]), [[0, 1 + i, 1 + (i + 1) % 7] for i in range(7)])
    strip = MeshSurface(
        scale * np.array([[3, 0, 0], [5, 0, 0], [5, 0.1, 0], [3, 0.1, 0]]), [[0, 1, 2], [0, 2, 3]]
    )
    relaxation = Relaxation([fan, strip], count=count, seed=number, iterations=30)
    energies, epochs = [], []
    for _ in range(30):
        relaxation.step()
        energies.append(relaxation.energy)
        epochs.append(relaxation.epoch)
    rises = np.diff(energies)[np.diff(epochs) == 0]
    assert (rises <= 0).all()
    assert relaxation.count == count
    for index, surface in enumerate((fan, strip)):
        own = relaxation.positions[relaxation.surface_ids == index]
        gaps = closest_points(own, surface.vertices, surface.faces)  # slim faces want more than float32
        assert gaps.max(initial=0.0) < 1e-4 * relaxation.spacing
