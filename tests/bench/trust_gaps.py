"""Gaps narrower than cells: random pairs of primitives whose mesh has another number of pieces.

The cost is the mean processor time of the meshes, over that of meshes with cells of one size. The same cost
of trees without gaps is that of the search: of sums, and of unions, which have creases.
"""

import time
from functools import reduce
from operator import add, or_

import numpy as np

from blobtree import Node, Point, Segment, polygonize
from tests.bench.trust_thin import RESOLUTION, Messages
from tests.gap_pairs import random_pair
from tests.thin_trees import is_closed, pieces

TARGETS = {"gaps_bridged": "0", "gap_search_cost": "≤ 1.05", "crease_search_cost": "≤ 1.05"}


def measure(*, quick: bool) -> dict[str, float]:
    """Count pairs that are not two closed pieces; those that a warning names are counted apart."""
    cases = 20 if quick else 200
    figures = {"gap_cases": float(cases), "gaps_bridged": 0.0, "gaps_named": 0.0}
    costs = []
    for number in range(cases):
        tree, messages = random_pair(number).tree, Messages()
        start = time.process_time()
        polygonize(tree, resolution=RESOLUTION)
        middle = time.process_time()
        with messages.received():
            mesh = polygonize(tree)
        costs.append((time.process_time() - middle) / (middle - start))
        if int(pieces(mesh).max(initial=-1)) != 1 or not is_closed(mesh.faces):
            figures["gaps_named" if messages.texts else "gaps_bridged"] += 1
    figures |= {"gap_cost": float(np.mean(costs)), "gap_cost_median": float(np.median(costs))}
    balls = [_balls(300), _balls(50)]
    pair: list[Node] = [Point((0, 0, 0), radius=1.0), Point((1.2, 0.3, 0), radius=0.8)]
    limb: list[Node] = [pair[0], Segment((0, 0, 0), (2, 0.5, 0), radius=0.4)]
    repeats = 5 if quick else 20
    figures["gap_search_cost"] = _search_cost([reduce(add, parts) for parts in (pair, limb, *balls)], repeats)
    figures["crease_search_cost"] = _search_cost([reduce(or_, parts) for parts in (pair, limb)], repeats)
    return figures


def _balls(count: int) -> list[Node]:
    """Return balls that blend in many places."""
    centers = np.random.default_rng(1).uniform(-1.5, 1.5, (count, 3))
    return [Point((x, y, z), radius=0.3 if count > 100 else 0.5) for x, y, z in centers.tolist()]


def _search_cost(trees: list[Node], repeats: int) -> float:
    """Return the mean cost of trees, each in the median of repeats in turns."""
    ratios = []
    for tree in trees:
        times = []
        for _repeat in range(repeats + 1):  # kernels compile in the first one
            start = time.process_time()
            polygonize(tree, resolution=RESOLUTION)
            middle = time.process_time()
            polygonize(tree)
            times.append((middle - start, time.process_time() - middle))
        before, after = np.median(times[1:], axis=0)
        ratios.append(after / before)
    return float(np.mean(ratios))
