"""Convolution surfaces along segments, arcs, strokes and triangles (Zanni et al. 2013).

Abutting pieces in a sum join without a bulge. A piece ends where its skeleton ends: its surface runs through
the end, without the round cap of a `Segment`. Pieces much shorter than their radius show nothing alone.
"""

from dataclasses import KW_ONLY, dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, Self

import numpy as np

from blobtree._typing import Box, Float64Array
from blobtree.declare.parameters import Color, Parameter, Quantity, Radius, parameters_of
from blobtree.errors import InvalidNode
from blobtree.formulas.convolution import (
    CONVOLUTION_ARC,
    CONVOLUTION_SEGMENT,
    CONVOLUTION_TRIANGLE,
    LINE_RIM,
    SHEET_RIM,
)
from blobtree.lazy import Lazy
from blobtree.nodes.curves import Arc, checked_radii
from blobtree.nodes.fields import FieldPrimitive
from blobtree.nodes.flats import check_corners, triangle_texels
from blobtree.nodes.node import Node
from blobtree.nodes.primitives import DEFAULT_COLOR, Columns, Leaf, beside
from blobtree.nodes.tree import (
    Macro,
    Sum,
)
from blobtree.validation import Vector

STEEPEST_TAPER = 0.5
"""Change of radius per length up to which a tapered segment shows its radii; steeper ones are thicker."""

FLATTEST_TRIANGLE = 1e-4
"""Height of a triangle over its longest side below which float32 takes it for a line."""


class ConvolutionPrimitive(FieldPrimitive):
    """A leaf whose field is an integral over a skeleton; `hull` and `kernel_radii` give its box."""

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return points (n, k, 3) whose convex hulls hold n skeletons; by default their points."""
        declared = parameters_of(cls).values()
        return np.stack([columns[p.name] for p in declared if p.quantity is Quantity.POINT], axis=1)

    @classmethod
    def kernel_radii(cls, columns: Columns) -> Float64Array:
        """Return the radii (n, 1 or k) of the kernels at the points of `hull`."""
        raise NotImplementedError

    @classmethod
    def box(cls, columns: Columns) -> Box:
        """Return the boxes around the balls of the kernels' radii."""
        points, radii = cls.hull(columns), cls.kernel_radii(columns)[:, :, None]
        return (points - radii).min(axis=1), (points + radii).max(axis=1)

    def grown(self, distance: float) -> Self:
        """Return this leaf with radii larger by a distance."""
        radii = {
            name: getattr(self, name) + distance
            for name, parameter in parameters_of(type(self)).items()
            if parameter.quantity is Quantity.RADIUS
        }
        if min(radii.values()) <= 0.0:
            raise InvalidNode(f"offset: {distance:g} leaves nothing of {self!r}")
        return replace(self, **radii)


@dataclass(frozen=True, eq=False, repr=False)
class ConvolutionSegment(ConvolutionPrimitive):
    """A straight limb whose radius changes linearly, and which joins others in a sum without a bulge.

    A long one shows its radii, as the hull of two balls does, up to a change of radius of half its length.
    The field is SCALIS of a compact polynomial kernel (Zanni et al. 2013), in closed form.

    Raises
    ------
    InvalidNode
        Start and end are equal: a point has no length to integrate over; use a `Point`.

    Examples
    --------
    >>> from blobtree import ConvolutionSegment
    >>> limb = ConvolutionSegment((0, 0, 0), (4, 0, 0), radius=0.5, end_radius=0.5)
    >>> halves = [ConvolutionSegment(a, b, radius=0.5, end_radius=0.5)
    ...           for a, b in [((0, 0, 0), (2, 0, 0)), ((2, 0, 0), (4, 0, 0))]]
    >>> points = [[2, 0.5, 0], [2, 0, 0], [4, 0, 0]]
    >>> limb(points).round(3).tolist(), sum(halves)(points).round(3).tolist()
    ([0.5, 1.0, 0.5], [0.5, 1.0, 0.5])
    """

    file_tag = "convolution_segment"
    field_kind = CONVOLUTION_SEGMENT

    start: Annotated[Vector, Parameter(Quantity.POINT, "start of the segment")]
    end: Annotated[Vector, Parameter(Quantity.POINT, "end of the segment")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius at the start")]
    end_radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius at the end")]
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start == self.end:
            raise InvalidNode(
                f"end: expected a point other than the start, got {self.end} for both; use a Point for a ball"
            )

    @classmethod
    def kernel_radii(cls, columns: Columns) -> Float64Array:
        """Return the radii (n, 2) at both ends, smaller where the segment is tapered.

        The field of a tapered line at its radius is larger than ½, because the thicker part adds more than
        the thinner lacks. A factor that depends on the taper alone restores the radius of the hull of two
        balls. It was fitted to the field of endless cones, with an error below 2e-4.
        """
        radii = np.concatenate([columns["radius"], columns["end_radius"]], axis=1)
        lengths = np.linalg.norm(columns["end"] - columns["start"], axis=1, keepdims=True)
        tapers = np.minimum(np.abs(radii[:, 1:] - radii[:, :1]) / lengths, STEEPEST_TAPER) ** 2
        factors = 1.0 - tapers * (0.65794805 - tapers * (0.46114516 - tapers * 0.76805927))
        kernels: Float64Array = radii * factors / LINE_RIM
        return kernels

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return start and end, each beside the reciprocal of the kernel's radius."""
        inverses = 1.0 / cls.kernel_radii(columns)
        ends = [beside(columns["start"], inverses[:, 0]), beside(columns["end"], inverses[:, 1])]
        return np.stack(ends, axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class ConvolutionArc(ConvolutionPrimitive):
    """A limb of one radius along a part of a circle, which joins segments and arcs without a bulge.

    The field is SCALIS of a compact polynomial kernel (Zanni et al. 2013), to an error of 1e-6.

    Raises
    ------
    InvalidNode
        Two points are equal, or the three lie on a line: then use a `ConvolutionSegment`.

    Examples
    --------
    >>> from blobtree import ConvolutionArc
    >>> half = ConvolutionArc((3, 0, 0), (0, 3, 0), (-3, 0, 0), radius=0.5)
    >>> half([[0, 3, 0.5], [3, 0, 0], [0, -3, 0]]).round(2).tolist()
    [0.5, 0.5, 0.0]
    """

    file_tag = "convolution_arc"
    field_kind = CONVOLUTION_ARC

    start: Annotated[Vector, Parameter(Quantity.POINT, "start of the arc")]
    through: Annotated[Vector, Parameter(Quantity.POINT, "a point of the arc between its ends")]
    end: Annotated[Vector, Parameter(Quantity.POINT, "end of the arc")]
    _: KW_ONLY
    radius: Radius
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        Arc(self.start, self.through, self.end, radius=self.radius)  # refuses points that are on no circle

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the corners of the hull of the `Arc` through the same points."""
        return Arc.hull(columns)

    @classmethod
    def kernel_radii(cls, columns: Columns) -> Float64Array:
        """Return the radii (n, 1)."""
        return columns["radius"] / LINE_RIM

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return the texels of an `Arc`, with 1 / kernel radius in place of the influence radius."""
        return Arc.texels(columns, 1.0 / cls.kernel_radii(columns))


@dataclass(frozen=True, eq=False, repr=False)
class ConvolutionTriangle(ConvolutionPrimitive):
    """A flat sheet of one thickness over a triangle, which joins others at an edge without a bulge.

    The field is SCALIS of a compact polynomial kernel (Zanni et al. 2013), in closed form.

    Raises
    ------
    InvalidNode
        The corners lie on a line: then use a `ConvolutionSegment`.

    Examples
    --------
    >>> from blobtree import ConvolutionTriangle
    >>> sail = ConvolutionTriangle((0, 0, 0), (9, 0, 0), (0, 9, 0), radius=0.3)
    >>> sail([[2, 2, 0.3], [2, 2, 0], [2, 0, 0]]).round(3).tolist()
    [0.5, 1.0, 0.5]
    """

    file_tag = "convolution_triangle"
    field_kind = CONVOLUTION_TRIANGLE

    a: Annotated[Vector, Parameter(Quantity.POINT, "first corner")]
    b: Annotated[Vector, Parameter(Quantity.POINT, "second corner")]
    c: Annotated[Vector, Parameter(Quantity.POINT, "third corner")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "half the visible thickness")]
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        check_corners(self.a, self.b, self.c, FLATTEST_TRIANGLE, "a ConvolutionSegment")

    @classmethod
    def kernel_radii(cls, columns: Columns) -> Float64Array:
        """Return the radii (n, 1)."""
        return columns["radius"] / SHEET_RIM

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return the first corner beside 1 / kernel radius, the edges from it, and the unit normal."""
        return triangle_texels(columns, 1.0 / cls.kernel_radii(columns)[:, 0])


@dataclass(frozen=True, eq=False, repr=False)
class ConvolutionStroke(Macro, Leaf):
    """A limb along a polyline without bulges at its corners: the sum of convolution segments.

    Repeat the first point at the end for a closed one.

    Raises
    ------
    InvalidNode
        There are less than two points, neighbours are equal, or the number of radii is another.

    Examples
    --------
    >>> from blobtree import ConvolutionStroke
    >>> tail = ConvolutionStroke([(0, 0, 0), (3, 0, 0), (6, 0, 0)], [0.5, 0.5, 0.1])
    >>> tail([[1.5, 0.5, 0], [1.5, 0, 0]]).round(2).tolist()
    [0.5, 1.0]
    """

    file_tag = "convolution_stroke"

    points: Annotated[tuple[Vector, ...], Parameter(Quantity.POINTS, "two or more points in order")]
    radii: Annotated[
        tuple[float, ...], Parameter(Quantity.RADII, "visible radius at each point, or one for all points")
    ]
    _: KW_ONLY
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "radii", checked_radii(self.points, self.radii))

    @Lazy
    def expanded(self) -> Node:
        """Return the sum of segments between neighbours."""
        ends = zip(pairwise(self.points), pairwise(self.radii), strict=True)
        same: dict[str, Any] = {"color": self.color, "attributes": self.attributes, "weight": self.weight}
        return Sum(
            tuple(
                ConvolutionSegment(*points, radius=radii[0], end_radius=radii[1], **same)
                for points, radii in ends
            )
        )
