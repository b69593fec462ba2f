"""Parts of a BlobTree that are small beside it, for `decals.surfaces.ImplicitSurface`."""

import numpy as np

from blobtree import ISO, Node
from blobtree._typing import Float32Array, Int64Array
from blobtree.meshing.thin_parts import polygonize_parts, shows_small_parts
from blobtree.tape.grown import runs_of_leaves
from blobtree.tape.model import values_at
from blobtree.tape.operands import leaves_of
from blobtree.tape.part_sizes import has_small_bodies

__all__ = ["has_small_parts", "nearest_leaves", "polygonize_parts"]

SMALL_PART = 2.5
"""Radius in cells below which the area of a part's triangles is not that of its surface."""

MAX_PARTS = 64
"""Leaves of a tree up to which parts are told apart."""


def has_small_parts(tree: Node, resolution: int, cell_size: float, device: str) -> bool:
    """Return True if parts of a tree are small beside it, not only what is cut out of it."""
    small = has_small_bodies(tree, SMALL_PART * cell_size)
    return small and shows_small_parts(tree, resolution, SMALL_PART, device)


def nearest_leaves(tree: Node, points: Float32Array) -> Int64Array:
    """Return the leaf whose surface is nearest to each of the points (n,); 0 for trees of many leaves."""
    gaps = []
    if sum(1 for _ in runs_of_leaves(tree._program)) <= MAX_PARTS:
        gaps = [np.abs(values_at(tape, points) - ISO) for tape in leaves_of(tree._program, tree.tape)]
    return np.argmin(gaps, axis=0) if gaps else np.zeros(len(points), np.int64)
