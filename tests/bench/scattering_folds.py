"""Where rings of six neighbours are uneven: CV6 by the bend of the surface around a particle.

``python -m tests.bench.scattering_folds [--model dragon] [--count 10000] [--steps 150]``

Also by the number of near particles that face away, and the share of the variance of the most uneven ones.

A bend is the mean cosine between a particle's normal and those of the surface within 1.5 spacings that face
the same way: 1 on a plane, smaller where the surface is as thin as the spacing.
"""

import argparse
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from decals import Relaxation
from decals.model import FACING_LIMIT
from decals.scattering.neighbors import NEIGHBOR_REACH, FacingTree
from tests.bench.scattering_models import MODELS, surfaces_of

BEND_RADIUS = 1.5
"""Radius within which bends are measured, in spacings."""

SAMPLES = 60
"""Samples of the surface for each particle."""

NEAR = 1.3
"""Distance, in spacings, within which facing particles belong to a ring."""

WORST = (0.01, 0.03)
"""Shares of the particles, the most uneven, whose part of the variance is printed."""

EDGES = (-1.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.01)


def max_curvatures(relaxation: Relaxation, surfaces: Any) -> np.ndarray:
    """Return the mean cosine of normals around each particle."""
    positions, normals = relaxation.positions, relaxation.normals
    samples = [surface.sample(SAMPLES * relaxation.count + 100_000, seed=1) for surface in surfaces]
    points, directions = (np.concatenate(rows) for rows in zip(*samples, strict=True))
    around = cKDTree(points).query_ball_point(positions, BEND_RADIUS * relaxation.spacing)
    cosine_means = np.ones(relaxation.count)
    for row, near in enumerate(around):
        cosines = directions[near] @ normals[row]
        facing = cosines[cosines > FACING_LIMIT]
        if len(facing):
            cosine_means[row] = facing.mean()
    return cosine_means


def rings(relaxation: Relaxation) -> np.ndarray:
    """Return the mean distance of each particle to its six neighbours, in spacings; infinity with fewer."""
    positions, normals = relaxation.positions, relaxation.normals
    distances, _ = FacingTree(positions, normals).nearest(positions, normals, count=6, skip_self=True)
    distances /= relaxation.spacing
    means: np.ndarray = np.where(distances <= NEIGHBOR_REACH, distances, np.inf).mean(axis=1)
    return means


def turned_away(relaxation: Relaxation) -> np.ndarray:
    """Count the near particles that face away from each."""
    tree = cKDTree(relaxation.positions)
    pairs = tree.query_pairs(NEAR * relaxation.spacing, output_type="ndarray")
    cosines = np.einsum("ni,ni->n", *(relaxation.normals[pairs[:, side]] for side in (0, 1)))
    return np.bincount(pairs[cosines <= FACING_LIMIT].ravel(), minlength=relaxation.count)


def show(title: str, ring: np.ndarray, whole: int) -> None:
    if len(ring) > 5:
        spread = 100 * ring.std() / ring.mean()
        print(f"  {title:13s} {100 * len(ring) / whole:10.1f} {ring.mean():11.3f} {spread:14.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", default="dragon", choices=MODELS)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--steps", type=int, default=150)
    options = parser.parse_args()
    surfaces = surfaces_of(options.model)
    relaxation = Relaxation(surfaces, count=options.count, iterations=options.steps)
    relaxation.run()
    print(f"{options.model}, {options.count}: {relaxation.statistics()}")
    bend, ring = max_curvatures(relaxation, surfaces), rings(relaxation)
    ringed = np.isfinite(ring)
    whole = int(ringed.sum())
    print("  mean cosine      share  %   mean ring   CV6 within %")
    for low, high in pairwise(EDGES):
        show(f"{low:5.2f} to {min(high, 1):4.2f}", ring[ringed & (bend >= low) & (bend < high)], whole)
    print("  facing away      share  %   mean ring   CV6 within %")
    away = turned_away(relaxation)
    for number in range(4):
        here = away >= number if number == 3 else away == number
        show(f"{number}{' and more' * (number == 3)}", ring[ringed & here], whole)
    deviations = np.sort((ring[ringed] - ring[ringed].mean()) ** 2)[::-1]
    for part in WORST:
        first = int(part * whole)
        rest = 100 * np.sqrt(deviations[first:].mean()) / ring[ringed].mean()
        held = deviations[:first].sum() / deviations.sum()
        print(f"  the worst {part:.0%} hold {held:.0%} of the variance; CV6 without them {rest:.2f} %")


if __name__ == "__main__":
    main()
