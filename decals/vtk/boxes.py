"""Boxes around objects, quickly: where things move, a new one is wanted with every frame."""

from collections.abc import Iterable

import numpy as np

from blobtree.tracing.cells import tracing_cells
from decals.scenes.scene import Box, SceneObject, TreeObject, bounds_of


def box_around(objects: Iterable[SceneObject]) -> Box:
    """Give lower and upper corner of objects; a tree's are those of the blocks that its surface may cross.

    Those blocks are wanted for drawing in any case; around stretched parts they may lie loosely. Where the
    surface itself is known, its box is taken.
    """
    boxes = [
        _tree_box(thing)
        if isinstance(thing, TreeObject) and "surface" not in vars(thing)
        else bounds_of([thing])
        for thing in objects
    ]
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def _tree_box(thing: TreeObject) -> Box:
    """Box around the blocks that have a tape; around the field's support, if none has."""
    cells = tracing_cells(thing.tree)
    crossed = np.argwhere(cells.blocks.reshape(cells.counts) >= 0)
    if not len(crossed):
        return thing.tree.bounds
    low = cells.lower + cells.block_size * crossed.min(axis=0)
    high = cells.lower + cells.block_size * (crossed.max(axis=0) + 1)
    return low.astype(np.float32), high.astype(np.float32)
