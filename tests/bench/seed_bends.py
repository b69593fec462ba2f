"""Where rings of six neighbours are uneven: CV6 by how much the surface bends around a seed.

``python -m tests.bench.seed_bends [--model dragon] [--count 10000] [--steps 150]``

Also by how many others are near but face away, and how much of the variance the most uneven seeds hold.

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

NEAR = 1.3
"""Seeds nearer than so many spacings would be in the ring if they faced the same way."""

WORST = (0.01, 0.03)
"""Parts of the seeds, the most uneven, whose share of the variance is told."""

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


def turned_away(relaxation: Relaxation) -> np.ndarray:
    """How many seeds are near to each but face away."""
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
    wish = parser.parse_args()
    surfaces = surfaces_of(wish.model)
    relaxation = Relaxation(surfaces, count=wish.count, iterations=wish.steps)
    relaxation.run()
    print(f"{wish.model}, {wish.count}: {relaxation.statistics()}")
    bend, ring = bends(relaxation, surfaces), rings(relaxation)
    ringed = np.isfinite(ring)
    whole = int(ringed.sum())
    print("  mean cosine      seeds %   mean ring   CV6 within %")
    for low, high in pairwise(EDGES):
        show(f"{low:5.2f} to {min(high, 1):4.2f}", ring[ringed & (bend >= low) & (bend < high)], whole)
    print("  facing away      seeds %   mean ring   CV6 within %")
    away = turned_away(relaxation)
    for number in range(4):
        here = away >= number if number == 3 else away == number
        show(f"{number}{' and more' * (number == 3)}", ring[ringed & here], whole)
    lacks = np.sort((ring[ringed] - ring[ringed].mean()) ** 2)[::-1]
    for part in WORST:
        first = int(part * whole)
        rest = 100 * np.sqrt(lacks[first:].mean()) / ring[ringed].mean()
        held = lacks[:first].sum() / lacks.sum()
        print(f"  the worst {part:.0%} hold {held:.0%} of the variance; CV6 without them {rest:.2f} %")


if __name__ == "__main__":
    main()
