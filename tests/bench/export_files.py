"""Exported files: read back by all readers, and the error of distances."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import blobtree
import decals
from tests.blobtree.sampling.test_field_grid import EXACT, rows_of
from tests.decals.baking.exported import FORMATS, READERS, random_scene
from tests.decals.baking.test_export import RESOLUTION, expected

Array = NDArray[Any]

TARGETS = {
    "files_wrong": "0",
    "distance_over_stated": "<= 1",
}
"""Targets; counts stand beside their numbers of cases."""

SCENES, QUICK_SCENES = 100, 3
"""Random scenes that are written in each format."""


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Return the figures of files and of distances."""
    return {
        **files(seed, QUICK_SCENES if quick else SCENES),
        **distances(),
    }


def files(seed: int, count: int) -> dict[str, float]:
    """Count the files in which a reader finds other surfaces than those of the scene."""
    cases = wrong = 0
    for number in range(seed, seed + count):
        want = expected(number)
        with tempfile.TemporaryDirectory() as folder:
            for suffix, readers in FORMATS.items():
                path = Path(folder) / f"scene{suffix}"
                for reader in readers:
                    try:
                        __import__(reader)
                    except ImportError:
                        continue
                    if not path.exists():
                        colors = None if suffix == ".stl" else "vertices"
                        decals.export(random_scene(number), path, colors=colors, resolution=RESOLUTION)
                    cases += 1
                    wrong += not np.array_equal(READERS[reader](path).ordered.triangles, want.triangles)
    return {"files_wrong": wrong, "files_cases": cases}


def distances() -> dict[str, float]:
    """Return the largest ratio of the measured error of signed distances to the stated one."""
    ratios = []
    for tree, exact in EXACT.values():
        grid = blobtree.field_grid(tree, resolution=32, distance=True)
        assert grid.error is not None
        off = np.abs(grid.values.reshape(-1) - exact(rows_of(grid)))
        ratios.append(float(off.max()) / grid.error)
    return {"distance_over_stated": max(ratios), "distance_cases": len(ratios)}
