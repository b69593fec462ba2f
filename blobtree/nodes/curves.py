"""Primitives along curves: circles, arcs and Bézier curves with a visible radius around them."""

from dataclasses import KW_ONLY, dataclass
from typing import Annotated

import numpy as np

from blobtree._typing import Float64Array
from blobtree.errors import InvalidNode
from blobtree.formulas.curve_skeletons import ARC, CURVE
from blobtree.formulas.skeletons import CIRCLE
from blobtree.nodes.parameters import Color, Parameter, Quantity, Radius
from blobtree.nodes.primitives import DEFAULT_COLOR, Columns, Primitive, beside, octagons
from blobtree.validation import Vector

STRAIGHTEST_ARC = 1e3
"""Radius of an arc, over the longest distance of its points, beyond which it counts as a line."""

ARC_PIECES = 4
"""Parts of an arc whose tangents enclose it: none is longer than a quarter of a circle."""

BERNSTEIN_TO_POWERS = np.array([[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], np.float64)
"""Coefficients of t⁰ to t³, as rows, from the control points of a cubic Bézier curve."""


@dataclass(frozen=True, eq=False, repr=False)
class Circle(Primitive):
    """A tube around a circle, the same shape as a `Torus`.

    Examples
    --------
    >>> from blobtree import Circle
    >>> Circle((0, 0, 0), (0, 0, 1), 1.0, radius=0.2)([[1.2, 0, 0]]).round(3).tolist()
    [0.5]
    """

    file_tag = "circle"
    skeleton = CIRCLE

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre of the circle")]
    axis: Annotated[Vector, Parameter(Quantity.DIRECTION, "normal of the circle's plane, of any length")]
    circle_radius: Annotated[float, Parameter(Quantity.LENGTH, "radius of the circle")]
    _: KW_ONLY
    radius: Radius
    color: Color = DEFAULT_COLOR

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the corners of an octagon around the circle."""
        return octagons(columns["center"], columns["axis"], columns["circle_radius"])


@dataclass(frozen=True, eq=False, repr=False)
class Arc(Primitive):
    """A tube around the part of a circle from `start` to `end` that leads through a third point.

    Raises
    ------
    InvalidNode
        Two points are equal, or the three lie on a line: then use a `Segment`.

    Examples
    --------
    >>> from blobtree import Arc
    >>> half = Arc((1, 0, 0), (0, 1, 0), (-1, 0, 0), radius=0.2)
    >>> half([[0, 1.2, 0], [-1, -0.2, 0], [0, -1, 0]]).round(3).tolist()
    [0.5, 0.5, 0.0]
    """

    file_tag = "arc"
    skeleton = ARC

    start: Annotated[Vector, Parameter(Quantity.POINT, "start of the arc")]
    through: Annotated[Vector, Parameter(Quantity.POINT, "a point of the arc between its ends")]
    end: Annotated[Vector, Parameter(Quantity.POINT, "end of the arc")]
    _: KW_ONLY
    radius: Radius
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        points = np.array([self.start, self.through, self.end])
        longest = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).max()
        with np.errstate(divide="ignore", invalid="ignore"):
            _, u, *_ = _arc_frames(*points[:, None])
        if not np.linalg.norm(u) <= STRAIGHTEST_ARC * longest:
            raise InvalidNode(
                f"arc: expected three points on a circle, got {self.start}, {self.through}, {self.end}, "
                "which lie on a line or are equal; use a Segment, or a Circle if start and end are equal"
            )

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the ends, and where the tangents of the ends of four equal pieces meet."""
        centers, u, v, halves = _arc_frames(columns["start"], columns["through"], columns["end"])
        steps = np.arange(ARC_PIECES) * 2.0 + 1.0 - ARC_PIECES
        angles = halves[:, None] * steps / ARC_PIECES
        reach = 1.0 / np.cos(halves / ARC_PIECES)
        around = np.cos(angles)[:, :, None] * u[:, None] + np.sin(angles)[:, :, None] * v[:, None]
        corners = centers[:, None] + reach[:, None, None] * around
        return np.concatenate([columns["start"][:, None], corners, columns["end"][:, None]], axis=1)

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return centre and influence radius; two vectors that span the arc, cosine and sine of its half."""
        centers, u, v, halves = _arc_frames(columns["start"], columns["through"], columns["end"])
        spans = [beside(u, np.cos(halves)), beside(v, np.sin(halves))]
        return np.stack([beside(centers, influences[:, 0]), *spans], axis=1)


def _arc_frames(
    starts: Float64Array, throughs: Float64Array, ends: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
    """Return centres (n, 3), radii to the middle and across it (n, 3), and half angles (n,) of arcs."""
    b, d = throughs - starts, ends - starts
    sizes = np.maximum(np.linalg.norm(b, axis=1), np.linalg.norm(d, axis=1))[:, None]
    b, d = b / sizes, d / sizes
    normals = np.cross(b, d)
    squares = (normals**2).sum(axis=1, keepdims=True)
    across_b, across_d = np.cross(normals, b), np.cross(d, normals)
    weighted = (d**2).sum(axis=1, keepdims=True) * across_b + (b**2).sum(axis=1, keepdims=True) * across_d
    from_start = weighted / (2.0 * squares)
    e1 = -from_start
    e2 = np.cross(normals / np.sqrt(squares), e1)
    to_end = d - from_start
    angles = np.arctan2((to_end * e2).sum(axis=1), (to_end * e1).sum(axis=1)) % (2.0 * np.pi)
    cosines, sines = np.cos(0.5 * angles)[:, None], np.sin(0.5 * angles)[:, None]
    u, v = cosines * e1 + sines * e2, cosines * e2 - sines * e1
    return starts + sizes * from_start, sizes * u, sizes * v, 0.5 * angles


class BezierCurve(Primitive):
    """A tube around a Bézier curve, whose control points are the parameters in order."""

    skeleton = CURVE

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return the coefficients of powers of t, of the curve and of its constant influence radius."""
        controls = np.stack(list(columns.values()), axis=1)
        degree = controls.shape[1] - 1
        if degree == 2:  # the same curve as a cubic
            start, control, end = controls.transpose(1, 0, 2)
            controls = np.stack(
                [start, (start + 2.0 * control) / 3.0, (2.0 * control + end) / 3.0, end], axis=1
            )
        powers = np.zeros((len(controls), 4, 4))
        powers[:, : degree + 1, :3] = (BERNSTEIN_TO_POWERS @ controls)[:, : degree + 1]
        powers[:, 0, 3] = influences[:, 0]
        return powers


@dataclass(frozen=True, eq=False, repr=False)
class QuadraticBezier(BezierCurve):
    """A tube around a parabola: a quadratic Bézier curve.

    Examples
    --------
    >>> from blobtree import QuadraticBezier
    >>> bow = QuadraticBezier((-1, 0, 0), (0, 2, 0), (1, 0, 0), radius=0.2)
    >>> bow([[0, 1.2, 0], [0, 1, 0]]).round(3).tolist()
    [0.5, 1.0]
    """

    file_tag = "quadratic_bezier"

    start: Annotated[Vector, Parameter(Quantity.POINT, "start of the curve")]
    control: Annotated[Vector, Parameter(Quantity.POINT, "where the tangents of the ends meet")]
    end: Annotated[Vector, Parameter(Quantity.POINT, "end of the curve")]
    _: KW_ONLY
    radius: Radius
    color: Color = DEFAULT_COLOR


@dataclass(frozen=True, eq=False, repr=False)
class CubicBezier(BezierCurve):
    """A tube around a cubic Bézier curve.

    Examples
    --------
    >>> from blobtree import CubicBezier
    >>> wave = CubicBezier((-1, 0, 0), (0, 2, 0), (0, -2, 0), (1, 0, 0), radius=0.2)
    >>> wave([[0, 0, 0.2], [0, 0, 0]]).round(3).tolist()
    [0.5, 1.0]
    """

    file_tag = "cubic_bezier"

    start: Annotated[Vector, Parameter(Quantity.POINT, "start of the curve")]
    start_control: Annotated[Vector, Parameter(Quantity.POINT, "control point on the tangent of the start")]
    end_control: Annotated[Vector, Parameter(Quantity.POINT, "control point on the tangent of the end")]
    end: Annotated[Vector, Parameter(Quantity.POINT, "end of the curve")]
    _: KW_ONLY
    radius: Radius
    color: Color = DEFAULT_COLOR
