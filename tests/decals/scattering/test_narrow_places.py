"""Particles move to places that no particle elsewhere faces."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from blobtree import Point
from blobtree._typing import Float32Array, Float64Array
from decals import Relaxation
from decals.model import FACING_LIMIT
from decals.scattering.domain import apportion
from decals.scattering.extras import PLACEMENTS
from decals.surfaces import ImplicitSurface, MeshSurface

COUNT = 500
SIDES = 96


def rimmed(bend: float, depth: float) -> MeshSurface:
    """Return an open vessel, 1 in radius and 1.4 high, whose rim turns inward with a bend and then down."""
    turns = np.linspace(0.0, np.pi, 9)
    arc = np.column_stack([1.0 - bend + bend * np.cos(turns), 1.4 + bend * np.sin(turns)])
    wall = np.linspace((1.0, 0.0), (1.0, 1.4), 24, endpoint=False)
    inside = np.linspace(arc[-1], arc[-1] - (0.0, depth), 4)[1:]
    points = np.concatenate([wall, arc, inside])
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = [np.column_stack([radius * circle, np.full(SIDES, height)]) for radius, height in points]
    along = np.arange(SIDES)
    faces = []
    for ring in range(len(points) - 1):
        a, b = ring * SIDES + along, ring * SIDES + (along + 1) % SIDES
        faces += [np.column_stack([a, b, b + SIDES]), np.column_stack([a, b + SIDES, a + SIDES])]
    return MeshSurface(np.concatenate(rings).astype(np.float32), np.concatenate(faces).astype(np.int32))


def farthest(relaxation: Relaxation) -> Float64Array:
    """Return the distance of samples from the nearest facing particle, in spacings, by brute force."""
    domain = relaxation.domain
    samples = domain.sample(apportion(domain.masses, 8_000), stream=5)
    positions = relaxation.positions.astype(np.float64)
    distances = cdist(samples.positions, positions)
    facing = samples.normals @ relaxation.normals.T > FACING_LIMIT
    gaps: Float64Array = np.where(facing, distances, np.inf).min(axis=1) / relaxation.spacing
    return gaps


def unreached(seed: int) -> int:
    """Return how many samples of a random vessel lie farther than a spacing from all facing particles."""
    bend, depth = np.random.default_rng(seed).uniform([0.01, 0.02], [0.03, 0.03])
    relaxation = Relaxation(rimmed(bend, depth), count=COUNT, seed=seed)
    relaxation.run()
    assert relaxation.statistics().rho > 0.8
    return int((farthest(relaxation) > 1.0).sum())


def test_rims_get_particles(monkeypatch: pytest.MonkeyPatch) -> None:
    seeds = range(2)
    reached = sum(unreached(seed) for seed in seeds)
    monkeypatch.setattr("decals.scattering.relaxation.PLACEMENTS", [])
    assert reached < 0.3 * sum(unreached(seed) for seed in seeds)


def test_particles_of_rims_stay_where_they_are() -> None:
    relaxation = Relaxation(rimmed(0.02, 0.03), count=COUNT)
    while relaxation.steps < 60:
        relaxation.step()
    state = relaxation._device_state()
    (place,) = PLACEMENTS
    rows = place(state)
    assert len(rows) > 0
    held = relaxation._device_state().points().positions[rows]
    assert not state.movable[rows].any()
    while not relaxation.finished:
        relaxation.step()
    np.testing.assert_array_equal(relaxation.positions[rows], held)


def test_fixed_particles_do_not_move() -> None:
    vessel = rimmed(0.02, 0.03)
    fixed = vessel.sample(COUNT - 20, 1)[0]
    relaxation = Relaxation(vessel, count=COUNT, fixed=fixed)
    at = relaxation.positions[relaxation.fixed].copy()
    relaxation.run()
    np.testing.assert_array_equal(relaxation.positions[relaxation.fixed], at)


def test_nothing_moves_without_narrow_places(monkeypatch: pytest.MonkeyPatch) -> None:
    def run() -> Float32Array:
        relaxation = Relaxation(ImplicitSurface(Point((0, 0, 0), radius=1.0)), count=200)
        relaxation.run()
        return relaxation.positions

    expected = run()
    monkeypatch.setattr("decals.scattering.relaxation.PLACEMENTS", [])
    np.testing.assert_array_equal(run(), expected)


def test_nothing_moves_where_the_density_is_uneven() -> None:
    relaxation = Relaxation(
        rimmed(0.02, 0.03), count=COUNT, density=lambda points: 1.0 + 3.0 * (points[:, 2] > 0.7)
    )
    for _ in range(60):
        relaxation.step()
    (place,) = PLACEMENTS
    assert len(place(relaxation._device_state())) == 0
