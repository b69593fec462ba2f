"""What is known of the points at which the parity check finds the largest errors."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.bench.parity_worlds import KINDS, World
from tests.oracles.contact import RIM, rim_distance

TIE, EDGE = 1e-4, 1e-6
MOST = 4


def worst_points(
    world: World,
    points: NDArray[np.float32],
    sets: NDArray[np.int32],
    found: list[NDArray[Any]],
    wanted: list[NDArray[Any]],
) -> list[str]:
    """Describe the worst few points: owners that differ first, then by the error of r.

    found, wanted: the arrays of `Chunk.found` and `Chunk.wanted`, on the host.
    """
    owner, rim = found[:2]
    want_owner, complement, _, doubt, edge = wanted
    want = np.minimum(rim_distance(complement), 1)
    differ = (owner != want_owner) & (doubt > TIE)
    comparable = (owner == want_owner) & (owner >= 0) & (edge > EDGE)
    error = np.where(differ, 2.0, np.where(comparable, np.abs(rim - want), 0.0))
    lines = []
    for i in np.argsort(-error, kind="stable")[:MOST].tolist():
        rows = slice(sets[i] * world.members, (sets[i] + 1) * world.members)
        w = points[i].astype(np.float64) - world.decals.positions[rows]
        radii = world.decals.radii[rows].astype(np.float64)
        away = np.linalg.norm(w, axis=1) / radii * RIM
        lines += [
            f"  error {error[i]:.3e} in set {sets[i]} (kind {sets[i] % KINDS}): owner {owner[i] - rows.start}"
            f" and {want_owner[i] - rows.start}, r {rim[i]!r} and {want[i]!r},"
            f" E {complement[i]:.9e}, doubt {doubt[i]:.2e}, edge {edge[i]:.2e}",
            f"    |q - p|/s {away.tolist()}",
            f"    radii {radii.tolist()}",
            f"    ranks {(4 * world.decals.layers[rows] + world.decals.interactions[rows]).tolist()}",
        ]
    return lines
