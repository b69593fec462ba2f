"""Solid shapes that are other nodes under a map: macros without operands."""

from dataclasses import KW_ONLY, dataclass
from typing import Annotated

import numpy as np

from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.parameters import Color, Parameter, Quantity
from blobtree.nodes.primitives import DEFAULT_COLOR, Leaf, Point
from blobtree.nodes.tree import Macro, Node
from blobtree.validation import Vector

LARGEST_RATIO = 1e5
"""Largest ratio of two semi-axes; a flatter map cannot be inverted in float32."""


@dataclass(frozen=True, eq=False, repr=False)
class Ellipsoid(Macro, Leaf):
    """An ellipsoid, its axes parallel to those of its space: a ball of radius 1 under a scale.

    Its field is g(r · RIM) with r = |(x/a, y/b, z/c)|, so its level sets are ellipsoids too.

    Examples
    --------
    >>> from blobtree import Ellipsoid
    >>> egg = Ellipsoid((0, 0, 1), (1, 2, 3))
    >>> egg([[1, 0, 1], [0, 2, 1], [0, 0, 4]]).round(3).tolist()
    [0.5, 0.5, 0.5]
    """

    file_tag = "ellipsoid"

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre of the ellipsoid")]
    semi_axes: Annotated[
        Vector, Parameter(Quantity.SEMI_AXES, "visible radii along the x, y and z axes, above 0")
    ]
    _: KW_ONLY
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        if max(self.semi_axes) > LARGEST_RATIO * min(self.semi_axes):
            raise InvalidNode(
                f"semi_axes: expected lengths whose ratio is at most {LARGEST_RATIO:g}, got {self.semi_axes}"
            )

    @Lazy
    def expanded(self) -> Node:
        """Return a ball of radius 1 under a scale and a translation."""
        ball = Point((0.0, 0.0, 0.0), radius=1.0, color=self.color)
        return ball.transform(np.column_stack([np.diag(self.semi_axes), self.center]))
