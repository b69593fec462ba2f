"""Where rings of six neighbours are uneven: CV6 by how much the surface bends around a seed.

``python -m tests.bench.seed_bends [--model dragon] [--count 10000] [--steps 150]``

A bend is the mean cosine between a seed's normal and those of the surface within 1.5 spacings that face
the same way: 1 on a plane, smaller where the surface is as thin as the seeds are apart.
"""

import argparse
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from decals.model import FACING_LIMIT
from decals.seeds.evenness import BEYOND
from decals.seeds.neighbours import FacingTree
from decals.seeds.relaxation import Relaxation
from tests.bench.seed_models import MODELS, surfaces_of

AROUND = 1.5
"""Radius within which bends are measured, in spacings."""

SAMPLES = 60
"""Samples of the surface for each seed."""

EDGES = (-1.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.01)


def bends(relaxation: Relaxation, surfaces) -> np.ndarray:
    """Mean cosine of normals around each seed."""
    positions, normals = relaxation.positions, relaxation.normals
    samples = [surface.sample(SAMPLES * relaxation.count + 100_000, seed=1) for surface in surfaces]
    points, ways = (np.concatenate(rows) for rows in zip(*samples, strict=True))
    around = cKDTree(points).query_ball_point(positions, AROUND * relaxation.spacing)
    found = np.ones(relaxation.count)
    for row, near in enumerate(around):
        cosines = ways[near] @ normals[row]
        facing = cosines[cosines > FACING_LIMIT]
        if len(facing):
            found[row] = facing.mean()
    return found


def rings(relaxation: Relaxation) -> np.ndarray:
    """Mean distance of each seed to its six neighbours, in spacings; infinity where it has fewer."""
    positions, normals = relaxation.positions, relaxation.normals
    distances, _ = FacingTree(positions, normals).nearest(positions, normals, count=6, skip_self=True)
    distances /= relaxation.spacing
    return np.where(distances <= BEYOND, distances, np.inf).mean(axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", default="dragon", choices=MODELS)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--steps", type=int, default=150)
    wish = parser.parse_args()
    surfaces = surfaces_of(wish.model)
    relaxation = Relaxation(surfaces, count=wish.count, iterations=wish.steps)
    relaxation.run()
    print(f"{wish.model}, {wish.count}: {relaxation.statistics()}")
    bend, ring = bends(relaxation, surfaces), rings(relaxation)
    ringed = np.isfinite(ring)
    print("  mean cosine      seeds %   mean ring   CV6 within %")
    for low, high in pairwise(EDGES):
        here = ring[ringed & (bend >= low) & (bend < high)]
        if len(here) > 5:
            share = 100 * len(here) / ringed.sum()
            spread = 100 * here.std() / here.mean()
            print(f"  {low:5.2f} to {min(high, 1):4.2f} {share:10.1f} {here.mean():11.3f} {spread:14.2f}")


if __name__ == "__main__":
    main()
