"""The relaxation on any Warp device."""

import numpy as np
import pytest

from blobtree import Point
from decals import Relaxation
from decals.surfaces import ImplicitSurface, MeshSurface, Surface
from tests.decals.meshes import sphere

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


def scene(device: str) -> list[Surface]:
    ball = sphere(center=(2.0, 0, 0))
    tree = ImplicitSurface(Point((0, 0, 0), radius=1.0), resolution=24, device=device)
    return [tree, MeshSurface(ball.vertices, ball.faces, device=device)]


@pytest.mark.parametrize("device", DEVICES)
def test_relaxation_over_mesh_and_tree(device: str) -> None:
    surfaces = scene(device)
    relaxation = Relaxation(surfaces, count=600, device=device)
    energies, epochs = [], []
    for _ in range(40):
        relaxation.step()
        energies.append(relaxation.energy)
        epochs.append(relaxation.epoch)
    same = np.diff(epochs) == 0
    assert same.any()
    assert (np.diff(energies)[same] <= 0).all()
    relaxation.run()
    assert relaxation.count == 600
    for number, surface in enumerate(surfaces):
        own = relaxation.positions[relaxation.surface_ids == number]
        assert np.linalg.norm(surface.project(own)[0] - own, axis=1).max() < 1e-4 * relaxation.spacing
        assert not surfaces[1 - number].contains(own).any()
    statistics = relaxation.statistics()
    assert statistics.rho > 0.85
    assert statistics.cv < 0.03


@pytest.mark.parametrize("device", DEVICES)
def test_edits_and_masks(device: str) -> None:
    surfaces = scene(device)
    relaxation = Relaxation(
        surfaces, count=200, device=device, iterations=40, mask=lambda points: points[:, 1] > 0.0
    )
    relaxation.run()
    assert (relaxation.positions[:, 1] > 0).all()
    row = relaxation.insert((0.0, 1.0, 0.0))
    assert relaxation.count == 201
    relaxation.remove(row)
    assert relaxation.count == 200
    assert relaxation.statistics().rho > 0.6


def test_user_surface_without_device_support() -> None:
    class Plain:
        """A surface with the members of `Surface` alone."""

        def __init__(self, surface: MeshSurface) -> None:
            self.area, self.bounds = surface.area, surface.bounds
            self.sample, self.project = surface.sample, surface.project
            self.contains, self.raycast, self.normal = surface.contains, surface.raycast, surface.normal

    pairs = [[wrap(sphere()), sphere(center=(1.5, 0, 0))] for wrap in (Plain, lambda surface: surface)]
    user, builtin = (Relaxation(pair, count=200) for pair in pairs)
    user.run()
    builtin.run()
    assert user.positions.tobytes() == builtin.positions.tobytes()
