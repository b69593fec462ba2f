"""Several surfaces: hidden parts and apportionment."""

import numpy as np
import pytest

from decals import Relaxation
from decals.errors import InvalidScattering
from decals.scattering.domain import Domain, apportion
from tests.decals.meshes import box, plane, sphere
from tests.oracles.sized_decals import rho


def test_surfaces_keep_their_counts() -> None:
    relaxation = Relaxation([sphere(), box(center=(0, 0, 9)), plane(3.0)], count=500, iterations=30)
    expected = apportion(relaxation.domain.areas, 500)
    relaxation.run()
    assert (expected > 0).all()
    assert np.array_equal(np.bincount(relaxation.surface_ids), expected)
    assert expected.sum() == 500


def test_particles_of_touching_spheres_repel_each_other() -> None:
    left, right = sphere(), sphere(center=(2.0, 0, 0))
    relaxation = Relaxation([left, right], count=400)
    relaxation.run()
    for surface, number in ((left, 1), (right, 0)):
        assert not surface.contains(relaxation.positions[relaxation.surface_ids == number]).any()
    assert relaxation.statistics().rho > 0.8


def test_no_particles_inside_another_surface() -> None:
    balls = [sphere(), sphere(center=(1.2, 0, 0)), sphere(radius=0.5)]
    relaxation = Relaxation(balls, count=300)
    assert relaxation.domain.areas[2] == 0
    # the lens of two unit spheres at distance 1.2 hides a cap of height 0.4 of each
    assert relaxation.domain.areas[:2] == pytest.approx(2 * np.pi * 1.6, rel=0.02)
    relaxation.run()
    assert not (relaxation.surface_ids == 2).any()
    for number in (0, 1):
        own = relaxation.positions[relaxation.surface_ids == number]
        center = [1.2 * number, 0, 0]
        assert not balls[1 - number].contains(own + 1e-3 * (own - center)).any()
    assert relaxation.statistics().rho > 0.75


@pytest.mark.slow
def test_coincident_surfaces_do_not_hide_each_other() -> None:
    ball = sphere(level=3)
    relaxation = Relaxation([ball, ball], count=200)
    relaxation.run()
    assert np.bincount(relaxation.surface_ids).tolist() == [100, 100]
    # together they are 200 particles over a single sphere
    assert rho(relaxation.positions, relaxation.normals, ball.area) > 0.75


def test_faces_that_touch_are_hidden() -> None:
    domain = Domain([box(), box(center=(1, 0, 0))], seed=0)
    assert domain.areas == pytest.approx([5.0, 5.0], abs=0.1)
    points = domain.sample(np.array([500, 500]), stream=1)
    assert not (np.abs(points.positions[:, 0] - 0.5) < 1e-6).any()


def test_open_surfaces_hide_nothing() -> None:
    domain = Domain([sphere(), plane(3.0)], seed=0)
    assert domain.areas[0] == sphere().area
    assert domain.areas[1] == pytest.approx(9 - np.pi, rel=0.05)


def test_apportionment_by_largest_remainder() -> None:
    assert apportion(np.array([1.0, 1.0, 1.0]), 10).tolist() == [4, 3, 3]
    assert apportion(np.array([0.0, 5.0]), 3).tolist() == [0, 3]
    assert apportion(np.array([1.0, 2.0, 4.0]), 0).tolist() == [0, 0, 0]
    for count in range(50):
        counts = apportion(np.array([0.1, 3.0, 7.7, 1e-9]), count)
        assert counts.sum() == count
        assert np.abs(counts - count * np.array([0.1, 3.0, 7.7, 1e-9]) / 10.8).max() < 1
    with pytest.raises(InvalidScattering, match="visible area"):
        apportion(np.array([0.0]), 1)


def test_apportionment_by_density() -> None:
    pair = [sphere(), sphere(center=(5, 0, 0))]
    relaxation = Relaxation(pair, count=300, density=lambda points: np.where(points[:, 0] > 2, 2.0, 1.0))
    assert np.bincount(relaxation.surface_ids).tolist() == [100, 200]
