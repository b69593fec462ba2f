"""One step at a time: energies that fall, crowded particles that move, close pairs that part."""

import numpy as np
import pytest
import warp as wp

from blobtree.launch import launch
from decals.model import FACING_LIMIT
from decals.seeds.crowd import Crowd
from decals.seeds.looking import Lookout, whole_numbers
from decals.seeds.neighbours import FacingTree
from decals.seeds.particles import CLOSEST
from decals.seeds.polishing import polish
from decals.seeds.population import Sites, World
from decals.seeds.refilling import crowded, refill
from decals.seeds.relaxation import Relaxation
from decals.seeds.repulsion import CORE, CUTOFF, Law
from decals.seeds.search_kernels import choose_best
from tests.decals.meshes import box, plane, sphere, star
from tests.oracles.coats import nearest_facing
from tests.oracles.repulsion import rings, total_energy


def row_of(places, number=0):
    """Sites in a row, facing up."""
    positions = np.zeros((len(places), 3), np.float32)
    positions[:, 0] = places
    normals = np.tile(np.float32([0, 0, 1]), (len(places), 1))
    return Sites(positions, normals, np.full(len(places), number, np.int32))


def crowd_in_a_row(movable):
    world = World([plane(100.0)], seed=0)
    sites = row_of([0.0, 0.01, 1.0, 2.0, 3.0, 4.0, 5.0])
    crowd = Crowd(world, sites, np.asarray(movable), np.ones(7, np.float32))
    crowd.begin(Law(3.0, 0.0))
    return crowd


def test_crowded_particles_move_to_bare_places():
    crowd = crowd_in_a_row([True] * 7)
    movers = crowded(crowd)
    assert movers.tolist() == [1]  # as crowded as its neighbour from the left, and more from the right
    scouts = row_of([0.5, 9.0, 1.1])
    refill(crowd, movers, scouts, np.ones(3, np.float32))
    assert crowd.sites().positions[:, 0].tolist() == [0, 9, 1, 2, 3, 4, 5]
    assert crowded(crowd_in_a_row(np.arange(7) > 1)).tolist() == []


def test_crowded_particles_move_within_their_own_surface():
    crowd = crowd_in_a_row([True] * 7)
    before = crowd.sites().positions
    refill(crowd, np.array([1]), row_of([9.0, 11.0], number=1), np.ones(2, np.float32))
    assert np.array_equal(crowd.sites().positions, before)


def test_polishing_parts_close_pairs_and_never_lets_the_least_distance_fall():
    surface = box()
    rough = Relaxation([surface], count=150, iterations=60)
    while rough.steps < 12:
        rough.step()
    everybody, sizes = np.ones(150, bool), rough.sizes_at(rough.positions)
    crowd = Crowd(rough.world, rough.sites, everybody, sizes)
    first = last = nearest_facing(rough.positions, rough.normals).min()
    for number in range(15):
        polish(crowd, rounds=1, seed=number, sizes_at=rough.sizes_at)
        sites = crowd.sites()
        least = nearest_facing(sites.positions, sites.normals).min()
        assert least > last * (1 - 1e-6)
        last = least
    assert last > 1.05 * first
    assert np.abs(surface.project(sites.positions)[0] - sites.positions).max() < 1e-6


@pytest.mark.parametrize("surface", [sphere, box, star])
def test_the_energy_never_rises_within_an_epoch(surface):
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


def test_a_step_that_raises_the_energy_is_taken_back():
    count = 121
    crowd = Crowd(
        World([Jumpy()], seed=0), jittered(0.3, 11), np.ones(count, bool), np.full(count, 0.3, np.float32)
    )
    law = Law(3.0, 300.0)
    crowd.begin(law)
    guides = crowd.sites().normals
    rule = {"cutoff": CUTOFF, "core": CORE, "facing_limit": FACING_LIMIT, "closest": CLOSEST}
    energies, stayed = [], 0
    for _ in range(12):
        before = crowd.sites().positions
        crowd.step()
        sites = crowd.sites()
        stayed += np.array_equal(before, sites.positions)
        sizes = crowd.host_sizes.astype(float)
        law_of = {"exponent": law.exponent, "stiffness": law.stiffness}
        energies.append(total_energy(sites.positions, sites.normals, sizes, guides=guides, **law_of, **rule))
        assert crowd.energy == pytest.approx(energies[-1], rel=1e-4)
    assert stayed > 0  # some steps did fail
    assert energies[-1] < energies[0]
    assert (np.diff(energies) <= 1e-5 * energies[0]).all()


class Jumpy:
    """A plane on which points land beside where they wanted to go, all the farther the farther they went."""

    def __init__(self):
        self._plane = plane(4.0)
        self.area, self.bounds = self._plane.area, self._plane.bounds
        self.sample, self.contains = self._plane.sample, self._plane.contains
        self.raycast, self.normal = self._plane.raycast, self._plane.normal

    def project(self, points, *, within=None):
        positions, normals = self._plane.project(points)
        if within is not None:
            sideways = 60.0 * np.maximum(within - 0.001, 0.0) ** 2
            positions[:, 0] += sideways * np.where(np.arange(len(points)) % 2, 1, -1)
        return positions.astype(np.float32), normals


def jittered(spacing, side):
    """A square grid of particles, none quite in its place."""
    ticks = spacing * (np.arange(side) - 0.5 * (side - 1))
    positions = np.zeros((side**2, 3), np.float32)
    positions[:, :2] = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    positions[:, :2] += np.random.default_rng(3).uniform(-0.05, 0.05, (side**2, 2))
    return Sites(positions, np.tile(np.float32([0, 0, 1]), (side**2, 1)), np.zeros(side**2, np.int32))


@pytest.mark.parametrize("surface", [sphere, plane])
def test_rings_around_places_are_those_of_all_pairs(surface):
    relaxation = Relaxation([surface()], count=200)
    crowd = Crowd(
        relaxation.world, relaxation.sites, np.ones(200, bool), relaxation.sizes_at(relaxation.positions)
    )
    numbers = whole_numbers(np.arange(200), "cpu")
    walls = crowd.walls(crowd.positions, crowd.normals, crowd.sizes, crowd.owners, crowd.may_move)
    found = Lookout(crowd, 2.0).rings(crowd.positions, crowd.normals, crowd.sizes, numbers, walls)
    nearest, ring = (array.numpy() for array in found)
    sites, sizes = crowd.sites(), crowd.host_sizes.astype(float)
    middle = np.ones(200, bool)
    wall = None
    if walls.number:  # of the square only those who see one side of it
        depths = 0.5 - np.abs(sites.positions[:, :2])
        middle = (depths[:, 1] > 2.1 * sizes) & (sites.positions[:, 0] < 0)
        wall = np.array([-0.5, 0, 0]), np.array([1.0, 0, 0])
        assert (depths[middle, 0] < sizes[middle]).any()
    rule = {"farthest": 2.0, "facing_limit": FACING_LIMIT}
    expected = rings(sites.positions, sites.normals, sizes, wall=wall, **rule)[0]
    assert middle.sum() > 20
    assert ring[middle] == pytest.approx(expected[middle], rel=1e-5)
    assert (nearest[middle] <= ring[middle]).all()


def test_who_is_parted_takes_the_place_whose_ring_is_most_even():
    rows = {
        "positions": [[0, 0, 0], [0.5, 0, 0]],
        "places": [[-0.2, 0, 0], [-0.5, 0, 0], [-0.6, 0, 0], [-0.7, 0, 0]],
    }
    arrays = {
        name: wp.array(np.float32(values), dtype=wp.vec3, device="cpu") for name, values in rows.items()
    }
    ups = [wp.array(np.tile(np.float32([0, 0, 1]), (n, 1)), dtype=wp.vec3, device="cpu") for n in (4, 2)]
    nearness, ring = (
        wp.array(np.float32(values), dtype=wp.float32, device="cpu")
        for values in ([0.7, 1.0, 1.1, 1.2], [1.0, 1.3, 1.2, 0.7])
    )
    mover, free, went = (
        wp.array(np.int32(rows), dtype=wp.int32, device="cpu") for rows in ([0], [0] * 4, [0])
    )
    present = wp.array(np.float32([0.5]), dtype=wp.float32, device="cpu")
    inputs = [4, 1.0, 0.89, 1.0, mover, present, arrays["places"], ups[0], free, nearness, ring]
    launch(choose_best, 1, inputs, [arrays["positions"], ups[1], went], device="cpu")
    assert went.numpy().tolist() == [1]
    assert arrays["positions"].numpy()[0] == pytest.approx(
        [-0.6, 0, 0]
    )  # three are far enough, its ring is the best


@pytest.mark.parametrize("skip_self", [False, True])
def test_nearest_facing_neighbours_are_those_of_all_pairs(skip_self):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(300, 3)).astype(np.float32)
    normals = (points / np.linalg.norm(points, axis=1, keepdims=True)).astype(np.float32)
    distances, indices = FacingTree(points, normals).nearest(points, normals, count=3, skip_self=skip_self)
    everything = np.linalg.norm(points[:, None].astype(float) - points[None], axis=2)
    everything[normals.astype(float) @ normals.T.astype(float) <= -0.25] = np.inf
    if skip_self:
        np.fill_diagonal(everything, np.inf)
    assert np.allclose(distances, np.sort(everything, axis=1)[:, :3], atol=1e-5)
    assert np.allclose(np.take_along_axis(everything, indices, axis=1), distances, atol=1e-5)


def test_fewer_neighbours_than_asked_for():
    up, down = np.float32([[0, 0, 1]]), np.float32([[0, 0, -1]])
    spot = np.zeros((1, 3), np.float32)
    distances, indices = FacingTree(spot, up).nearest(spot, up, count=3)
    assert distances.tolist() == [[0.0, np.inf, np.inf]]
    assert indices.tolist() == [[0, -1, -1]]
    assert FacingTree(spot, up).nearest(spot, down)[1].tolist() == [[-1]]
    assert FacingTree(spot[:0], up[:0]).nearest(spot, up)[1].tolist() == [[-1]]
