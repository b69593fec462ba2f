"""Gaps narrower than cells: random pairs of primitives whose mesh has another number of pieces.

The cost is the mean processor time of the meshes, over that of meshes with cells of one size.
"""

import time

import numpy as np

from blobtree import polygonize
from tests.bench.trust_thin import RESOLUTION, Messages
from tests.gap_pairs import random_pair
from tests.thin_trees import is_closed, pieces

TARGETS = {"gaps_bridged": "0"}


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
    return figures | {"gap_cost": float(np.mean(costs)), "gap_cost_median": float(np.median(costs))}
