import numpy as np
import pytest

from decals.errors import InvalidSeeding
from decals.neighbours import FacingTree
from decals.population import Sites, World, shares
from decals.refilling import refill
from decals.relaxation import Relaxation
from tests.decals.meshes import box, plane, sphere
from tests.oracles.coats import nearest_facing, rho


def test_step_by_step_is_the_same_as_in_one_run():
    by_hand, at_once = (Relaxation([sphere()], count=80, seed=3, iterations=40) for _ in range(2))
    while not by_hand.finished:
        by_hand.step()
    at_once.run()
    assert by_hand.steps == at_once.steps == 40
    assert by_hand.positions.tobytes() == at_once.positions.tobytes()


def test_energies_tell_the_crowded_from_the_lonely():
    relaxation = Relaxation([plane()], count=200, iterations=100)
    relaxation.step()
    nearest = nearest_facing(relaxation.positions, relaxation.normals)
    order = np.argsort(nearest)
    assert relaxation.energies[order[:40]].mean() > 1.5 * relaxation.energies[order[-40:]].mean() > 0


def test_statistics_are_those_of_all_pairs():
    relaxation = Relaxation([box()], count=150, iterations=60)
    relaxation.run()
    found = relaxation.statistics()
    nearest = nearest_facing(relaxation.positions, relaxation.normals)
    assert found.rho == pytest.approx(rho(relaxation.positions, relaxation.normals, 6.0), rel=1e-5)
    assert found.mean == pytest.approx(nearest.mean(), rel=1e-5)
    assert found.cv == pytest.approx(nearest.std() / nearest.mean(), rel=1e-4)
    assert found.ideal == pytest.approx(np.sqrt(2 * 6.0 / np.sqrt(3) / 150))


def test_relaxing_makes_even():
    relaxation = Relaxation([sphere()], count=500)
    before = relaxation.statistics()
    relaxation.run()
    after = relaxation.statistics()
    assert before.rho < 0.3 < 0.87 < after.rho
    assert after.cv < 0.03 < before.cv
    assert after.cv6 < 0.03 < before.cv6


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_few_particles_relax(count):
    relaxation = Relaxation([sphere()], count=count, iterations=5)
    relaxation.run()
    assert relaxation.count == len(relaxation.positions) == count
    assert relaxation.statistics().cv == 0.0 or count == 2


def test_every_surface_keeps_its_share():
    relaxation = Relaxation([sphere(), box(center=(0, 0, 9)), plane(3.0)], count=500, iterations=30)
    expected = shares(relaxation.world.areas, 500)
    relaxation.run()
    assert (expected > 0).all()
    assert np.array_equal(np.bincount(relaxation.surface_ids), expected)
    assert expected.sum() == 500


def test_touching_spheres_share_one_coat():
    left, right = sphere(), sphere(center=(2.0, 0, 0))
    relaxation = Relaxation([left, right], count=400)
    relaxation.run()
    for surface, number in ((left, 1), (right, 0)):
        assert not surface.contains(relaxation.positions[relaxation.surface_ids == number]).any()
    assert relaxation.statistics().rho > 0.8


def test_nothing_is_seeded_or_moves_inside_another_surface():
    balls = [sphere(), sphere(center=(1.2, 0, 0)), sphere(radius=0.5)]
    relaxation = Relaxation(balls, count=300)
    assert relaxation.world.areas[2] == 0
    # the lens of two unit spheres at distance 1.2 hides a cap of height 0.4 of each
    assert relaxation.world.areas[:2] == pytest.approx(2 * np.pi * 1.6, rel=0.02)
    relaxation.run()
    assert not (relaxation.surface_ids == 2).any()
    for number in (0, 1):
        own = relaxation.positions[relaxation.surface_ids == number]
        center = [1.2 * number, 0, 0]
        assert not balls[1 - number].contains(own + 1e-3 * (own - center)).any()
    assert relaxation.statistics().rho > 0.75


def test_coincident_surfaces_do_not_hide_each_other():
    relaxation = Relaxation([sphere(), sphere()], count=200)
    relaxation.run()
    assert np.bincount(relaxation.surface_ids).tolist() == [100, 100]
    # one coat of 200 over a single sphere
    assert rho(relaxation.positions, relaxation.normals, sphere().area) > 0.75


def test_faces_that_touch_are_hidden():
    world = World([box(), box(center=(1, 0, 0))], seed=0)
    assert world.areas == pytest.approx([5.0, 5.0], abs=0.1)
    sites = world.sample(np.array([500, 500]), stream=1)
    assert not (np.abs(sites.positions[:, 0] - 0.5) < 1e-6).any()


def test_open_surfaces_hide_nothing():
    world = World([sphere(), plane(3.0)], seed=0)
    assert world.areas[0] == sphere().area
    assert world.areas[1] == pytest.approx(9 - np.pi, rel=0.05)


def test_shares_are_exact_and_by_largest_remainder():
    assert shares(np.array([1.0, 1.0, 1.0]), 10).tolist() == [4, 3, 3]
    assert shares(np.array([0.0, 5.0]), 3).tolist() == [0, 3]
    assert shares(np.array([1.0, 2.0, 4.0]), 0).tolist() == [0, 0, 0]
    for count in range(50):
        found = shares(np.array([0.1, 3.0, 7.7, 1e-9]), count)
        assert found.sum() == count
        assert np.abs(found - count * np.array([0.1, 3.0, 7.7, 1e-9]) / 10.8).max() < 1
    with pytest.raises(InvalidSeeding, match="visible area"):
        shares(np.array([0.0]), 1)


@pytest.mark.parametrize("wish", [{"count": -1}, {"count": 3, "seed": -1}, {"count": 3, "iterations": 0}])
def test_impossible_wishes_are_refused(wish):
    with pytest.raises(InvalidSeeding, match="expected at least"):
        Relaxation([plane()], **wish)


def test_crowded_particles_move_to_bare_places():
    particles = Sites(
        np.float32([[0, 0, 0], [0.01, 0, 0], [1, 0, 0], [2, 0, 0]]),
        np.tile(np.float32([0, 0, 1]), (4, 1)),
        np.zeros(4, np.int32),
    )
    scouts = Sites(
        np.float32([[0.5, 0, 0], [9, 0, 0], [1.1, 0, 0]]),
        np.tile(np.float32([0, 0, 1]), (3, 1)),
        np.zeros(3, np.int32),
    )
    moved = refill(particles, scouts, spacing=1.0)
    assert moved.positions.tolist() == [[9, 0, 0], *particles.positions[1:].tolist()]
    elsewhere = Sites(scouts.positions, scouts.normals, np.ones(3, np.int32))
    assert refill(particles, elsewhere, spacing=1.0) is particles


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
