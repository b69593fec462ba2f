"""Repeats: macros of copies of a node along a way, or around an axis. Repeats of repeats make grids.

Endless repeats fold space into one cell of a lattice, which holds the copies that reach it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import warp as wp

from blobtree._typing import Box, Float32Array, Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity, unit_vectors
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.node import Node
from blobtree.nodes.tree import Macro, Sum, Union
from blobtree.nodes.warp import Warp
from blobtree.tape.bounds import ENDLESS
from blobtree.validation import LARGEST_NUMBER, LIMIT, Vector

wp.set_module_options({"enable_backward": False})

MOST_COPIES = 10_000
"""Most copies of one repeat; a repeat of repeats has more."""

MOST_OVERLAPS = 1000
"""Most copies of an endless repeat that one cell holds."""

MARGIN = 0.25
"""Least distance around a cell, in cells, in which its copies give the field too."""

LEAST_MARGIN = 0.02
"""The same once the copies have grown by offsets above the repeat."""

ROUNDING = 0.999
"""Share of that distance which counts, for rounding."""

TINY_SHARE = 1e-12
"""Component of a period, over the largest one, below which the lattice counts as square to that axis."""

LEAST_ANGLE = 1e-3
"""Smallest sine of the angle between a step and the steps inside."""

JOINS = ("sum", "union")
"""How copies are joined: they blend, or they meet in creases."""

FloatArray = Float32Array | Float64Array

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
        return _row(self, self.child, range(self.count))


@dataclass(frozen=True, eq=False, repr=False)
class EndlessRepeat(Macro):
    """Endless copies of `child` in a row, on both sides of it.

    A mirrored copy is the mirror image across the way to the next one. An endless repeat of an endless repeat
    is a grid, and a third one fills space. What needs a box, such as a mesh, takes the tree's part in a
    finite solid: an intersection of both.

    Examples
    --------
    >>> from blobtree import EndlessRepeat, Point
    >>> row = EndlessRepeat(Point((0, 0, 0), radius=0.4), (2, 0, 0))
    >>> row([[-4, 0, 0], [1000, 0, 0], [1, 0, 0]]).tolist()
    [1.0, 1.0, 0.0]
    """

    file_tag = "endless_repeat"

    child: Node
    step: Annotated[Vector, Parameter(Quantity.DIRECTION, "way from each copy to the next, in model units")]
    joining: Joining = "sum"
    copies: Alternation = "alike"

    def __post_init__(self) -> None:
        super().__post_init__()
        ways = np.array([row.step for row in self._rows])
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        if len(ways) > 3 or np.linalg.svd(ways, compute_uv=False)[-1] < LEAST_ANGLE:
            raise InvalidNode(
                f"step: expected a direction apart from those of the endless repeats inside, got {self.step}"
            )
        mirrored = [row.copies == "mirrored" for row in self._rows]
        if (np.abs(ways @ ways.T - np.eye(len(ways))).max(axis=1) > LEAST_ANGLE)[mirrored].any():
            raise InvalidNode("step: expected steps at right angles to each other where copies are mirrored")

    @property
    def _rows(self) -> "list[EndlessRepeat]":
        """The repeat itself, and the endless repeats right below it."""
        rows = [self]
        while isinstance(rows[-1].child, EndlessRepeat):
            rows.append(rows[-1].child)
        return rows

    @Lazy
    def expanded(self) -> Node:
        """Return the copies that reach a cell around the origin, joined, in space that repeats that cell."""
        rows = self._rows
        steps = np.array([row.step for row in rows])
        cells = np.array([2.0 if row.copies == "mirrored" else 1.0 for row in rows])
        across = np.linalg.pinv(steps).T
        content, lattice = rows[-1].child, np.zeros((8, 3))
        low, high = _extents(*content.support, across)
        mirrored = cells > 1.0
        low, high = np.where(mirrored, [np.minimum(low, -high), np.maximum(high, -low)], [low, high])
        middle = np.where(mirrored, 0.5, 0.5 * (low + high))  # the sides of cells lie between copies
        first = np.floor(middle - (0.5 + MARGIN) * cells - high) + 1.0
        last = np.ceil(middle + (0.5 + MARGIN) * cells - low) - 1.0
        if (last - first + 1.0).prod() > MOST_OVERLAPS:
            raise InvalidNode(
                f"step: expected a longer one than {self.step}, more than {MOST_OVERLAPS} copies overlap"
            )
        for row, begin, end in zip(rows[::-1], first[::-1], last[::-1], strict=True):
            content = _row(row, content, range(int(begin), int(end) + 1))
        spare = np.minimum(last + 1.0 + low - middle, middle - first + 1.0 - high) / cells - 0.5
        center = middle @ steps
        content = content.translate(-center)
        lattice[: len(rows)], lattice[3 : 3 + len(rows)] = steps * cells[:, None], across / cells[:, None]
        lattice[6:] = _extents(*content.support, lattice[3:6])
        lattice[6, : len(rows)] -= spare
        lattice[7, : len(rows)] += spare
        return _Lattice(content, tuple(lattice.ravel().tolist())).translate(center)


def _extents(lower: FloatArray, upper: FloatArray, ways: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return how far a box reaches along ways (n, 3), in both directions (n,)."""
    middle, half = ways @ (0.5 * (lower + upper)), np.abs(ways) @ (0.5 * (upper - lower))
    return middle - half, middle + half


class _Lattice(Warp):
    """`child` in each cell of a lattice.

    The numbers are a shift, which is 0 except in pruned tapes, three periods of the lattice, the reciprocal
    vectors that give a place in periods, and the extents of the child, from `low` to `high`, in periods.
    Where there are fewer periods, the others are 0. A cell reaches from −½ to ½. The child gives the field in
    the cell around the origin, and in a margin. Each extent is widened by that margin: a child that is grown
    has less of it.
    """

    tag = "lattice"

    lattice: Annotated[tuple[float, ...], Parameter(Quantity.FACTORS, "periods, reciprocals and extents")]

    @classmethod
    def numbers(cls, lattice: tuple[float, ...]) -> tuple[float, ...]:
        """Return no shift, and the numbers one after the other."""
        return (0.0, 0.0, 0.0, *lattice)

    @formula
    def forward(
        q: wp.vec3,
        shift: wp.vec3,
        first: wp.vec3,
        second: wp.vec3,
        third: wp.vec3,
        by_first: wp.vec3,
        by_second: wp.vec3,
        by_third: wp.vec3,
        low: wp.vec3,
        high: wp.vec3,
        room: wp.vec2,
    ) -> wp.vec3:
        """Move by whole periods into the cell around the origin."""
        a = wp.floor(wp.dot(by_first, q) + 0.5)
        b = wp.floor(wp.dot(by_second, q) + 0.5)
        c = wp.floor(wp.dot(by_third, q) + 0.5)
        return q - shift - a * first - b * second - c * third

    @formula
    def pullback(
        q: wp.vec3,
        g: wp.vec3,
        shift: wp.vec3,
        first: wp.vec3,
        second: wp.vec3,
        third: wp.vec3,
        by_first: wp.vec3,
        by_second: wp.vec3,
        by_third: wp.vec3,
        low: wp.vec3,
        high: wp.vec3,
        room: wp.vec2,
    ) -> wp.vec3:
        """Return g: a motion turns nothing."""
        return g

    @formula
    def lipschitz(
        q: wp.vec3,
        reach: wp.float32,
        shift: wp.vec3,
        first: wp.vec3,
        second: wp.vec3,
        third: wp.vec3,
        by_first: wp.vec3,
        by_second: wp.vec3,
        by_third: wp.vec3,
        low: wp.vec3,
        high: wp.vec3,
        room: wp.vec2,
    ) -> wp.float32:
        """Return 1 within the margin; beyond it, a ball that many times as large holds the whole cell."""
        if room[1] <= 0.0 or reach <= room[0]:
            return 1.0
        return 1.0 + room[1] / room[0]

    @formula
    def texel(
        q: wp.vec3,
        reach: wp.float32,
        kept: wp.vec4,
        number: wp.int32,
        shift: wp.vec3,
        first: wp.vec3,
        second: wp.vec3,
        third: wp.vec3,
        by_first: wp.vec3,
        by_second: wp.vec3,
        by_third: wp.vec3,
        low: wp.vec3,
        high: wp.vec3,
        room: wp.vec2,
    ) -> wp.vec4:
        """Return the texels of the motion of q alone, if the ball lies within the margin."""
        if room[1] <= 0.0 or reach > room[0]:
            return kept
        if number > 0:
            return wp.vec4()
        a = wp.floor(wp.dot(by_first, q) + 0.5)
        b = wp.floor(wp.dot(by_second, q) + 0.5)
        c = wp.floor(wp.dot(by_third, q) + 0.5)
        moved = shift + a * first + b * second + c * third
        return wp.vec4(kept[0], moved[0], moved[1], moved[2])

    @classmethod
    def outer_box(cls, lower: Float64Array, upper: Float64Array, **lattice: Vector) -> Box:
        """Return the box without its sides across periods."""
        periods = np.abs([lattice[name] for name in ("first", "second", "third")])
        endless = (periods > TINY_SHARE * periods.max()).any(axis=0)
        return np.where(endless, -ENDLESS, lower), np.where(endless, ENDLESS, upper)

    @classmethod
    def room(cls, lower: Float64Array, upper: Float64Array, **lattice: Vector) -> tuple[float, ...]:
        """Return the margin around the cell in model units, and the sum of the periods' lengths.

        Raises
        ------
        InvalidNode
            The child has grown beyond its margin.
        """
        ways = np.array([lattice[name] for name in ("by_first", "by_second", "by_third")])
        low, high = _extents(lower, upper, ways)
        margins = np.minimum(lattice["high"] - high, low - lattice["low"])
        lengths = np.linalg.norm(ways, axis=1)
        used = lengths > 0.0
        if (margins[used] < LEAST_MARGIN).any():
            raise InvalidNode(
                "offset: expected a smaller one of an endless repeat; offset its child in its place"
            )
        periods = [np.linalg.norm(lattice[name]) for name in ("first", "second", "third")]
        return ROUNDING * float((margins[used] / lengths[used]).min()), float(np.sum(periods))


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


def _row(row: Repeat | EndlessRepeat, child: Node, numbers: range) -> Node:
    """Return the copies of a child with some numbers, joined as those of a repeat."""
    (way,) = unit_vectors(np.array([row.step]))
    mirror = np.eye(3) - 2.0 * np.outer(way, way) if row.copies == "mirrored" else np.eye(3)
    places = np.array(numbers)[:, None] * np.array(row.step)
    return _joined(
        row.joining,
        (
            child.transform(np.column_stack([mirror if number % 2 else np.eye(3), place]))
            if number
            else child
            for number, place in zip(numbers, places, strict=True)
        ),
    )


def _joined(joining: str, copies: Iterable[Node]) -> Node:
    """Return copies as a sum or a union."""
    return (Sum if joining == "sum" else Union)(tuple(copies))
