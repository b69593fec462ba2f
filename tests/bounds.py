"""Bounds of nodes against many samples: intervals in cubes, slopes along rays, and the box of the support."""

import numpy as np

from blobtree import Node
from blobtree.conformance.samples import Rng
from tests.blobtree.tape.evaluations import bounds_along
from tests.blobtree.trees import points_around
from tests.conformance import sample

NODES = 20
"""Nodes of a class among which the samples are divided."""

CUBES, RAYS = 25, 100
STEPS = 50

ROUNDING = 2e-6
"""Rounding of a value in float32, relative to the largest one."""


def violations_of(kind: type[Node], seed: int, samples: int) -> list[str]:
    """Return what samples of random nodes of a class violate; nothing if all bounds hold.

    Each node has the same number of samples in random cubes of all sizes, a tenth of it outside the box, and
    STEPS samples along each of RAYS rays.
    """
    rng = np.random.default_rng(seed)
    found: list[str] = []
    for _ in range(NODES):
        node = sample(kind, rng)
        problems = [
            *_beyond_interval(node, rng, samples // NODES),
            *_beyond_slope(node, rng),
            *_beyond_box(node, rng, samples // NODES // 10),
        ]
        found += [f"{problem}: {node!r:.300}" for problem in problems]
    return found


def _beyond_interval(node: Node, rng: Rng, count: int) -> list[str]:
    """Sample cubes, half of the points near their corners and faces."""
    found: list[str] = []
    for center in points_around(rng, node, CUBES).astype(np.float64):
        half = float(10.0 ** rng.uniform(-2.5, 0.0))
        low, high = node.interval(center - half, center + half)
        offsets = rng.uniform(-1.0, 1.0, (count // CUBES, 3))
        offsets[::2] = np.clip(2.0 * offsets[::2], -1.0, 1.0)
        values = node((center + half * offsets).astype(np.float32))
        margin = ROUNDING * max(1.0, float(np.abs(values).max()))
        if values.min() < low - margin or values.max() > high + margin:
            found.append(f"interval [{low:.7g}, {high:.7g}] lacks [{values.min():.7g}, {values.max():.7g}]")
    return found


def _beyond_slope(node: Node, rng: Rng) -> list[str]:
    """Sample rays, on which the field may rise and fall no faster than its bounds."""
    starts = points_around(rng, node, RAYS)
    reach = (10.0 ** rng.uniform(-3.0, 0.5, RAYS)).astype(np.float32)
    headings = rng.normal(size=(RAYS, 3))
    headings = (headings / np.linalg.norm(headings, axis=1, keepdims=True)).astype(np.float32)
    value, rise, fall = bounds_along(node.tape, starts, headings, reach).astype(np.float64).T
    distance = reach * np.linspace(1.0 / STEPS, 1.0, STEPS)[:, None]
    places = starts.astype(np.float64) + headings.astype(np.float64) * distance[..., None]
    ahead = node(places.reshape(-1, 3).astype(np.float32)).reshape(STEPS, RAYS).astype(np.float64)
    steepest = np.maximum(np.abs(rise), np.abs(fall))
    # A sample lies where float32 has a number, and its value is rounded.
    margin = 2.0 * ROUNDING * np.maximum(1.0, np.abs(value)) + 4e-7 * np.abs(places).max() * steepest
    excess = np.maximum(ahead - value - rise * distance, value - ahead - fall * distance) - margin
    return [f"a ray exceeds its slope bound by {excess.max():.3g}"] if excess.max() > 0.0 else []


def _beyond_box(node: Node, rng: Rng, count: int) -> list[str]:
    """Sample around the support, outside of which the field is 0."""
    lower, upper = (corner.astype(np.float64) for corner in node.support)
    margin = 0.1 * float((upper - lower).max())
    points = rng.uniform(lower - margin, upper + margin, (count, 3)).astype(np.float32)
    outside = points[((points < lower) | (points > upper)).any(axis=1)]
    largest = float(np.abs(node(outside)).max(initial=0.0))
    return [f"the field is {largest:.3g} outside its box"] if largest else []
