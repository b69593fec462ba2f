"""Several surfaces: what is hidden, and who gets how many."""

import numpy as np
import pytest

from decals.errors import InvalidSeeding
from decals.seeds.population import World, shares
from decals.seeds.relaxation import Relaxation
from tests.decals.meshes import box, plane, sphere
from tests.oracles.coats import rho


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


def test_surfaces_share_by_density():
    pair = [sphere(), sphere(center=(5, 0, 0))]
    relaxation = Relaxation(pair, count=300, density=lambda points: np.where(points[:, 0] > 2, 2.0, 1.0))
    assert np.bincount(relaxation.surface_ids).tolist() == [100, 200]
