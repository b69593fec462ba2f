"""Implicit UVs (Genest, Gueth, Levallois and Wang 2025, "Implicit UVs: Real-time semi-global parameterization
of implicit surfaces"), for the comparison of methods.

A seed is a point of the surface with two tangents. From a point, a walk of a fixed number of steps leads
towards the seed. Each step heads for the seed in the tangent plane, along a parabola with the curvature of
the field, and returns to the surface by a step of Newton. The length of the walk and its direction at the
seed are the coordinates. A walk ends without a result where the normal turns by too much: at a sharp edge.
A point belongs to the seed with the shortest walk.

All is computed from values of the field alone, by central differences. The method is written after the
authors' public talk and a public implementation by others (ARez2/ImplicitUVsImplementation), as the text of
the paper was not at hand. The number of steps, the limit of the turn and the test of arrival follow that
implementation; the steps of the differences are ours. Left out: the weighted average of neighbouring
coordinate fields with their best frames and offsets, which makes one image continue over several seeds.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Field = Callable[[Float64Array], Float64Array]
"""Values float64[n] of points float64[n, 3], below zero inside."""

STEPS = 16
LEAST_COSINE = 0.8
"""Cosine of the largest turn of the normal in one step."""

ARRIVAL = 0.1
"""Largest distance from the seed at the end of a walk, over the distance at its start."""

DIFFERENCE = 1e-4
"""Step of differences, over the unit of length."""

SEED_BYTES = 48
"""Position, two tangents and an offset, in float32, with padding."""


def gradients(field: Field, points: Float64Array) -> Float64Array:
    """Return gradients float64[n, 3] by central differences."""
    shifts = DIFFERENCE * np.vstack([np.eye(3), -np.eye(3)])
    values = field((points + shifts[:, None]).reshape(-1, 3)).reshape(2, 3, -1)
    result: Float64Array = (values[0] - values[1]).T / (2 * DIFFERENCE)
    return result


def unit(vectors: Float64Array) -> Float64Array:
    """Return vectors at length 1; those of length 0 stay."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    result: Float64Array = vectors / np.where(lengths > 0, lengths, 1.0)
    return result


def log_maps(field: Field, points: Float64Array, seed: Float64Array, *, steps: int = STEPS) -> Float64Array:
    """Return offsets of points from a seed float64[3], in its tangent plane; NaN where no walk arrives.

    Their lengths are those of the walks.
    """
    place, before = points.copy(), points.copy()
    length, arrives = np.zeros(len(points)), np.ones(len(points), np.bool_)
    slope = gradients(field, place)
    for step in range(steps):
        size = np.linalg.norm(slope, axis=1)
        normal = unit(slope)
        away = seed - place
        flat = away - (away * normal).sum(axis=1, keepdims=True) * normal
        heading = unit(flat)
        ends = field(np.vstack([place - DIFFERENCE * heading, place, place + DIFFERENCE * heading]))
        low, middle, high = ends.reshape(3, -1)
        bend = -(low - 2 * middle + high) / DIFFERENCE**2 / size
        chord = np.linalg.norm(away, axis=1) / (steps - step)
        # The parabola τ ↦ τ v + τ²/2 bend n whose end has the distance `chord`.
        time = chord * np.sqrt(2 / (1 + np.sqrt(1 + (chord * bend) ** 2)))
        time = np.where(np.linalg.norm(flat, axis=1) > 1e-9, time, 0.0)
        before, previous = np.where(time[:, None] > 0, place, before), normal
        place = place + time[:, None] * heading + (0.5 * time**2 * bend)[:, None] * normal
        slope = gradients(field, place)
        place = place - (field(place) / (slope**2).sum(axis=1))[:, None] * slope
        arrives &= (unit(slope) * previous).sum(axis=1) >= LEAST_COSINE
        turn = (time * bend) ** 2
        length += time / 6 * (1 + 4 * np.sqrt(1 + turn / 4) + np.sqrt(1 + turn))
    rest = np.linalg.norm(place - seed, axis=1)
    arrives &= rest <= ARRIVAL * np.linalg.norm(points - seed, axis=1)
    normal = unit(gradients(field, seed[None]))
    flat = before - seed
    flat -= (flat @ normal.T) * normal
    result: Float64Array = (length + rest)[:, None] * unit(flat)
    result[~arrives] = np.nan
    return result


@dataclass(frozen=True)
class Nearest:
    """The seed with the shortest walk from each point.

    Attributes
    ----------
    seed : int64[n]
        Number of the seed; −1 if no walk arrives.
    offsets : float64[n, 3]
        Offsets from the seed in its tangent plane.
    walks : float
        Walks from a point, on average.
    """

    seed: NDArray[np.int64]
    offsets: Float64Array
    walks: float


def nearest(field: Field, points: Float64Array, seeds: Float64Array) -> Nearest:
    """Find the nearest seed of each point; seeds farther away than the shortest walk are not tried."""
    chords = np.linalg.norm(points[:, None] - seeds, axis=2)
    order = chords.argsort(axis=1)
    best, owner = np.full(len(points), np.inf), np.full(len(points), -1, np.int64)
    offsets, walks = np.zeros(points.shape), 0
    for rank in range(len(seeds)):
        tried = np.take_along_axis(chords, order[:, rank : rank + 1], axis=1)[:, 0] < best
        if not tried.any():
            break
        for seed in np.unique(order[tried, rank]):
            rows = np.flatnonzero(tried & (order[:, rank] == seed))
            found = log_maps(field, points[rows], seeds[seed])
            lengths = np.linalg.norm(found, axis=1)
            less = lengths < best[rows]
            rows, walks = rows[less], walks + len(rows)
            best[rows], owner[rows], offsets[rows] = lengths[less], seed, found[less]
    return Nearest(owner, offsets, walks / len(points))
