"""Particles of thin parts that are joined to others: the numbers stay those of the areas."""

import numpy as np
import pytest

from blobtree import Disc, Node, Point
from blobtree._typing import Float32Array, Int64Array
from decals import Relaxation
from decals.surfaces import ImplicitSurface

SAMPLES = 100_000


def crossing_plates(seed: int) -> tuple[Node, ...]:
    """Return a thin and a thick plate that cross each other, for a sum."""
    rng = np.random.default_rng([51, seed])
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    nodes: list[Node] = []
    for axis, extent, radius in zip(axes, (1.1, 0.8), (0.03, 0.09), strict=False):
        x, y, z = (rng.uniform(0.3, 0.6) * axes[2]).tolist()
        nodes.append(Disc((x, y, z), tuple(axis.tolist()), extent, radius=radius * rng.uniform(0.8, 1.2)))
    return tuple(nodes)


def nearest(nodes: tuple[Node, ...], points: Float32Array) -> Int64Array:
    """Return the number of the node whose surface is nearest, for each point."""
    gaps = np.abs(np.stack([node(points) for node in nodes]) - 0.5)
    return np.asarray(gaps.argmin(axis=0), np.int64)


@pytest.mark.ordinary_cases("3")
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_particles_keep_the_shares_of_joined_parts(seed: int) -> None:
    """Without relocation between the parts, 2.5 to 6 of 400 particles drift from one to the other."""
    nodes = crossing_plates(seed)
    surface = ImplicitSurface(nodes[0] + nodes[1])
    assert surface.has_small_parts
    relaxation = Relaxation(surface, count=400, seed=seed)
    relaxation.run()
    found = np.bincount(nearest(nodes, relaxation.positions), minlength=2)
    shares = 400 * np.bincount(nearest(nodes, surface.sample(SAMPLES, 9)[0]), minlength=2) / SAMPLES
    assert np.abs(found - shares).max() <= 2.0
    assert relaxation.statistics().rho > 0.88


@pytest.mark.slow
def test_fixed_particles_stay_and_surfaces_keep_their_numbers() -> None:
    nodes = crossing_plates(3)
    surfaces = [ImplicitSurface(nodes[0] + nodes[1]), ImplicitSurface(Point((5, 0, 0), radius=0.7))]
    points = surfaces[0].sample(400, 1)[0]
    fixed = points[nearest(nodes, points) == 0][:60]

    def begun() -> Relaxation:
        return Relaxation(
            surfaces, count=200, fixed=fixed, density=lambda points: 1.0 + (points[:, 0] > 0.3), seed=2
        )

    relaxation, again = begun(), begun()
    numbers = np.bincount(relaxation.surface_ids)
    start = relaxation.positions[relaxation.fixed]
    relaxation.run()
    assert np.array_equal(relaxation.positions[relaxation.fixed], start)
    assert np.array_equal(np.bincount(relaxation.surface_ids), numbers)
    again.run()
    assert np.array_equal(again.positions, relaxation.positions)
