"""Windings: generated solids with parts turned at random, beside the same solids as they should be."""

import sys

import numpy as np

import decals
from decals.surfaces import MeshSurface
from tests.oracles.windings import KINDS, Case, oriented_triangles, volume

TARGETS = {"winding_faults": "0"}
"""Targets of the counts; each stands beside its number of cases."""

CASES, QUICK_CASES = 500, 40
"""Solids, and those of a quick run."""

PICTURES_EVERY = 10
"""A solid of so many is covered and drawn too."""

COVERAGE_ERROR = 0.01
"""Difference of the covered parts of two surfaces that counts as none."""

SIZE = (64, 48)
"""Size of the pictures."""


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Count the solids of which volume, normals, decals or pictures differ from the right ones."""
    count = QUICK_CASES if quick else CASES
    kinds = list(KINDS)
    faults = pictures = 0
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        case = KINDS[kinds[number % len(kinds)]](rng)
        drawn = number % (len(kinds) * PICTURES_EVERY) < len(kinds)
        pictures += drawn
        if is_wrong(case) or (drawn and looks_wrong(case, number)):
            faults += 1
            print(f"windings: case {number} ({case.kind}) is wrong", file=sys.stderr, flush=True)
    return {"winding_faults": faults, "winding_cases": count, "winding_pictures": pictures}


def is_wrong(case: Case) -> bool:
    """Return True if volume or normals differ from those of the solid as it should be."""
    right, surface = case.arrays(right=True), MeshSurface(*case.arrays(right=False))
    vertices = right[0].astype(np.float32)
    expected = volume(vertices, right[1])
    if abs(volume(surface.vertices, surface.faces) - expected) > 1e-6 * abs(expected):
        return True
    return not np.array_equal(
        oriented_triangles(surface.vertices, surface.faces), oriented_triangles(vertices, right[1])
    )


def looks_wrong(case: Case, seed: int) -> bool:
    """Return True if decals or their picture differ from those on the solid as it should be.

    Decals on solids that share walls are compared by the area they cover: a wall may change sides, and decals
    then get other places.
    """
    scenes = [decals.cover(case.arrays(right=right), count=12, seed=seed) for right in (True, False)]
    if case.welded:
        shares = [scene.measure().coverage for scene in scenes]
        return bool(abs(shares[0] - shares[1]) > COVERAGE_ERROR)
    pictures = [np.asarray(decals.render(scene, size=SIZE), np.float64) for scene in scenes]
    same = np.array_equal(scenes[0].decals.positions, scenes[1].decals.positions)
    return not same or bool(np.abs(pictures[0] - pictures[1]).max() > 2.0)
