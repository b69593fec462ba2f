"""Repeats: macros of copies of a node along a way, or around an axis. Repeats of repeats make grids."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from blobtree.declare.parameters import Parameter, Quantity, unit_vectors
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.node import Node
from blobtree.nodes.tree import Macro, Sum, Union
from blobtree.validation import LARGEST_NUMBER, LIMIT, Vector

MOST_COPIES = 10_000
"""Most copies of one repeat; a repeat of repeats has more."""

JOINS = ("sum", "union")
"""How copies are joined: they blend, or they meet in creases."""

Count = Annotated[
    int,
    Parameter(
        Quantity.NUMBERS, "number of copies", low=1, high=MOST_COPIES, whole=True, natural=3,
        hint="repeat a repeat for more",
    ),
]  # fmt: skip
Joining = Annotated[str, Parameter(Quantity.CHOICE, "whether copies blend or are united", choices=JOINS)]
Alternation = Annotated[
    str, Parameter(Quantity.CHOICE, "all alike, or every second one mirrored", choices=("alike", "mirrored"))
]


@dataclass(frozen=True, eq=False, repr=False)
class Repeat(Macro):
    """Copies of `child` in a row; the first one is where the child is.

    A mirrored copy is the mirror image across the way to the next one. A repeat of a repeat is a grid.

    Examples
    --------
    >>> from blobtree import Point, Repeat
    >>> row = Repeat(Point((0, 0, 0), radius=0.4), (2, 0, 0), 3)
    >>> row([[0, 0, 0], [4, 0, 0], [6, 0, 0]]).tolist()
    [1.0, 1.0, 0.0]
    """

    file_tag = "repeat"

    child: Node
    step: Annotated[Vector, Parameter(Quantity.DIRECTION, "way from each copy to the next, in model units")]
    count: Count
    joining: Joining = "sum"
    copies: Alternation = "alike"

    def __post_init__(self) -> None:
        super().__post_init__()
        farthest = (self.count - 1) * max(map(abs, self.step))
        if farthest > LARGEST_NUMBER:
            raise InvalidNode(f"step: expected a shorter one, the last copy is {farthest:g} away; {LIMIT}")

    @Lazy
    def expanded(self) -> Node:
        """Return the copies, joined."""
        (way,) = unit_vectors(np.array([self.step]))
        mirror = np.eye(3) - 2.0 * np.outer(way, way) if self.copies == "mirrored" else np.eye(3)
        return _joined(
            self.joining,
            (
                self.child.transform(np.column_stack([mirror if number % 2 else np.eye(3), place]))
                if number
                else self.child
                for number, place in enumerate(np.arange(self.count)[:, None] * np.array(self.step))
            ),
        )


@dataclass(frozen=True, eq=False, repr=False)
class PolarRepeat(Macro):
    """Copies of `child`, evenly around an axis through the origin; the first one is where the child is.

    Examples
    --------
    >>> from blobtree import Point, PolarRepeat
    >>> ring = PolarRepeat(Point((1, 0, 0), radius=0.2), (0, 0, 1), 4)
    >>> ring([[1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 0]]).round(3).tolist()
    [1.0, 1.0, 1.0, 0.0]
    """

    file_tag = "polar_repeat"

    child: Node
    axis: Annotated[Vector, Parameter(Quantity.DIRECTION, "axis through the origin, of any length")]
    count: Count
    joining: Joining = "sum"

    @Lazy
    def expanded(self) -> Node:
        """Return the copies, joined."""
        angles = 360.0 / self.count * np.arange(1, self.count)
        copies = (self.child.rotate(self.axis, float(angle)) for angle in angles)
        return _joined(self.joining, (self.child, *copies))


def _joined(joining: str, copies: Iterable[Node]) -> Node:
    """Return copies as a sum or a union."""
    return (Sum if joining == "sum" else Union)(tuple(copies))
