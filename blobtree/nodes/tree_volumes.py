"""Volumes of trees: the solid of a whole tree as one leaf."""

from typing import Any

import numpy as np

from blobtree.errors import InvalidNode
from blobtree.nodes.node import Node
from blobtree.nodes.primitives import DEFAULT_COLOR
from blobtree.nodes.samples import MAX_NUMBERS
from blobtree.nodes.volumes import WIDTH_CELLS, Volume, from_sdf
from blobtree.sampling.mesh_distances import grid_points
from blobtree.sampling.tree_distances import to_sdf
from blobtree.tape.model import checked_tree
from blobtree.validation import positive_number

MARGIN_CELLS = 2.0
"""Cells between the surface of a tree and the faces of its grid."""


def sample(tree: Node, *, spacing: float, width: float | None = None, color: Any = DEFAULT_COLOR) -> Volume:
    """Return the solid of a tree as a volume, a leaf whose cost does not depend on the tree.

    Signed distances from the surface are sampled on a grid, so the volume has the tree's surface, and blends
    over `width` like any other. It does not keep the tree's field, colours and creases: parts thinner than
    `spacing` may vanish, and edges are rounded by about that.

    Parameters
    ----------
    tree : Node
        The tree.
    spacing : float
        Distance between grid points, in model units.
    width : float, optional
        Distance from the surface at which the field becomes 0; by default four spacings.
    color : color
        Colour of the solid.

    Raises
    ------
    InvalidNode
        `tree` is no tree or has no surface, or the grid has too many points.

    Examples
    --------
    >>> from blobtree import Point, sample
    >>> ball = sample(Point((0, 0, 0), radius=1.0), spacing=0.1)
    >>> bool(abs(ball([[1, 0, 0]])[0] - 0.5) < 0.01)
    True
    """
    step = positive_number("spacing", spacing)
    checked_tree(tree)
    lower, upper = (corner.astype(np.float64) for corner in tree.bounds)
    corner = lower - MARGIN_CELLS * step
    with np.errstate(over="ignore"):  # infinite counts are refused
        cells = np.ceil((upper - lower) / step + 2.0 * MARGIN_CELLS) + 1.0
        total = float(cells.prod())
    if not total <= MAX_NUMBERS:
        raise InvalidNode(
            f"spacing: expected at most {MAX_NUMBERS:,} grid points, got {total:,.0f}; take a larger one"
        )
    counts = cells.astype(np.int64)
    points = grid_points(corner, step, counts)
    size = tree.support[1] - tree.support[0]
    distances = to_sdf(tree, points, resolution=max(int(np.ceil(float(size.max()) / step)), 1))
    return from_sdf(
        distances.values.reshape(counts),
        corner,
        spacing=step,
        width=WIDTH_CELLS * step if width is None else width,
        color=color,
    )
