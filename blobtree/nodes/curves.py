"""Primitives along curves: circles, arcs, Bézier curves, polylines and strokes, each with visible radii."""

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import KW_ONLY, dataclass, field
from itertools import chain, pairwise
from typing import Annotated

import numpy as np

from blobtree._typing import Float64Array
from blobtree.declare.parameters import Color, Parameter, Quantity, Radius
from blobtree.errors import InvalidNode
from blobtree.formulas.curve_skeletons import ARC, CURVE, JOINED_SEGMENT
from blobtree.formulas.skeletons import CIRCLE
from blobtree.lazy import Lazy
from blobtree.nodes.node import Node
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.primitives import (
    DEFAULT_COLOR,
    OPTIONAL_FIELD,
    Columns,
    JoinedPrimitive,
    Primitive,
    RoundPrimitive,
    Segment,
    beside,
)
from blobtree.validation import Vector

STRAIGHTEST_ARC = 1e3
"""Radius of an arc, over the longest distance of its points, beyond which it counts as a line."""

ARC_PIECES = 4
"""Parts of an arc whose tangents enclose it: none is longer than a quarter of a circle."""

BERNSTEIN_TO_POWERS = np.array([[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], np.float64)
"""Coefficients of t⁰ to t³, as rows, from the control points of a cubic Bézier curve."""

STEEPEST_RADIUS = 0.5
"""Part of a stroke's radius at a point by which the radius of the next control point may differ from it."""


@dataclass(frozen=True, eq=False, repr=False)
class Circle(RoundPrimitive):
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


@dataclass(frozen=True, eq=False, repr=False)
class TaperedBezier(JoinedPrimitive):
    """A tube around a parabola, whose radius varies as the fourth coordinate of a quadratic Bézier curve.

    The radius is (1 − t)² r₀ + 2 t (1 − t) r₁ + t² r₂, with `control_radius` as r₁.

    Examples
    --------
    >>> from blobtree import TaperedBezier
    >>> horn = TaperedBezier(
    ...     (-1, 0, 0), (0, 2, 0), (1, 0, 0), radius=0.3, control_radius=0.2, end_radius=0.1
    ... )
    >>> horn([[0, 1, 0.2]]).round(2).tolist()
    [0.5]
    """

    file_tag = "tapered_bezier"
    skeleton = CURVE
    joint_texels = (3,)

    start: Annotated[Vector, Parameter(Quantity.POINT, "start of the curve")]
    control: Annotated[Vector, Parameter(Quantity.POINT, "where the tangents of the ends meet")]
    end: Annotated[Vector, Parameter(Quantity.POINT, "end of the curve")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius at the start")]
    control_radius: Annotated[float, Parameter(Quantity.RADIUS, "second Bernstein coefficient of the radius")]
    end_radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius at the end")]
    color: Color = DEFAULT_COLOR

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return the coefficients of powers of t of the curve and of its influence radius."""
        balls = np.concatenate([np.stack(list(columns.values()), axis=1), influences[:, :, None]], axis=2)
        start, control, end = balls.transpose(1, 0, 2)
        powers = [start, 2.0 * (control - start), start - 2.0 * control + end, np.zeros_like(start)]
        return np.stack(powers, axis=1)


class JoinedSegment(JoinedPrimitive, Segment):
    """A piece of a polyline."""

    skeleton = JOINED_SEGMENT
    joint_texels = (1,)

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return start and influence radius; the axis."""
        axes = columns["end"] - columns["start"]
        return np.stack(
            [beside(columns["start"], influences[:, 0]), beside(axes, np.zeros(len(axes)))], axis=1
        )


@dataclass(frozen=True, eq=False, repr=False)
class Polyline(Pieces):
    """A tube around straight lines from point to point: the union of segments.

    Raises
    ------
    InvalidNode
        There are less than two points, or all are equal.

    Examples
    --------
    >>> from blobtree import Polyline
    >>> pipe = Polyline([(0, 0, 0), (1, 0, 0), (1, 1, 0)], radius=0.1)
    >>> pipe([[0.5, 0.1, 0], [1.1, 0.5, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    file_tag = "polyline"

    points: Annotated[tuple[Vector, ...], Parameter(Quantity.POINTS, "two or more points in order")]
    _: KW_ONLY
    radius: Radius
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(set(self.points)) < 2:
            raise InvalidNode(
                f"points: expected at least two different points, got {self.points}; use a Point for one"
            )

    @Lazy
    def expanded(self) -> Node:
        """Return the union of segments between different neighbours."""
        ends = [pair for pair in pairwise(self.points) if pair[0] != pair[1]]
        return self.united(
            JoinedSegment(*pair, radius=self.radius, **self.shared).joined(joints)
            for pair, joints in zip(ends, _joints(ends), strict=True)
        )


@dataclass(frozen=True, eq=False, repr=False)
class Stroke(Pieces):
    """A limb along points, with given radii there: a spline of any length, whose pieces are parabolas.

    A Catmull–Rom spline runs through the points with their radii. Its tangents are those of the chordal
    spline (Catmull & Rom 1974; Barry & Goldman 1988). Two parabolas in the four coordinates x, y, z
    and radius join two points. Where radii change steeply, their slope is limited, so that they stay above 0.

    A B-spline is smoother, and never leaves the convex hull of the points and their radii. It starts and ends
    at the first and last one, and the others attract it: it is quadratic, with uniform knots (de Boor 1978).

    Curve and radius are C¹. A `width` is that at the start; elsewhere it is in proportion to the radius.

    Raises
    ------
    InvalidNode
        There are less than two points, neighbours are equal, or the number of radii is another.

    Examples
    --------
    >>> from blobtree import Stroke
    >>> worm = Stroke([(0, 0, 0), (1, 1, 0), (2, 0, 0)], [0.1, 0.3, 0.1])
    >>> worm([[1, 1.3, 0], [1, 1, 0.3]]).round(3).tolist()
    [0.5, 0.5]
    >>> arch = Stroke([(0, 0, 0), (1, 1, 0), (2, 0, 0)], [0.2], spline="b_spline")
    >>> arch([[1, 0.7, 0], [0, 0, 0.2]]).round(3).tolist()
    [0.5, 0.5]
    """

    file_tag = "stroke"

    points: Annotated[tuple[Vector, ...], Parameter(Quantity.POINTS, "two or more points in order")]
    radii: Annotated[
        tuple[float, ...], Parameter(Quantity.RADII, "visible radius at each point, or one for all points")
    ]
    _: KW_ONLY
    spline: Annotated[
        str,
        Parameter(
            Quantity.CHOICE,
            "'catmull_rom' through the points, or 'b_spline', which they attract",
            choices=("catmull_rom", "b_spline"),
        ),
    ] = field(default="catmull_rom", metadata=OPTIONAL_FIELD)
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "radii", checked_radii(self.points, self.radii))

    @Lazy
    def expanded(self) -> Node:
        """Return the union of the parabolas."""
        balls = np.column_stack([self.points, self.radii])
        pieces = _b_spline(balls) if self.spline == "b_spline" else _catmull_rom(balls)
        joints = _joints([(tuple(start), tuple(end)) for start, _, end in pieces.tolist()])
        return self.united(map(self._piece, joints, pieces.tolist()))

    def _piece(self, joints: tuple[float], controls: list[list[float]]) -> TaperedBezier:
        start, control, end = controls
        a, b, c = (tuple(ball[:3]) for ball in controls)
        radii = {"radius": start[3], "control_radius": control[3], "end_radius": end[3]}
        piece = TaperedBezier(a, b, c, **radii, **self.shared)  # type: ignore[arg-type]  # lists of four
        object.__setattr__(piece, "to_width_radius", self.radii[0] - start[3])
        return piece.joined(joints)


def _joints(ends: Sequence[tuple[Hashable, Hashable]]) -> list[tuple[float]]:
    """Return the joints of pieces between two ends each: 1 start, 2 end, 3 both, 0 none."""
    shared = Counter(chain.from_iterable(ends))
    return [((shared[start] > 1) + 2.0 * (shared[end] > 1),) for start, end in ends]


def checked_radii(points: tuple[Vector, ...], radii: tuple[float, ...]) -> tuple[float, ...]:
    """Return a radius for each point of a limb; raise `InvalidNode` if points or radii are none."""
    if len(points) < 2 or any(a == b for a, b in pairwise(points)):
        raise InvalidNode(
            f"points: expected two or more points, each other than the one before, got {points}"
        )
    if len(radii) == 1:
        return radii * len(points)
    if len(radii) != len(points):
        raise InvalidNode(
            f"radii: expected one for each of {len(points)} points, or one for all, got {len(radii)}"
        )
    return radii


def _catmull_rom(balls: Float64Array) -> Float64Array:
    """Return the control points (2n − 2, 3, 4) of two parabolas between each two of n balls (x, y, z, r)."""
    lengths = np.linalg.norm(np.diff(balls[:, :3], axis=0), axis=1)[:, None]
    slopes = _chordal_slopes(balls, lengths)
    longest = np.maximum(np.vstack([lengths, [[0.0]]]), np.vstack([[[0.0]], lengths]))[:, 0]
    steepest = 4.0 * STEEPEST_RADIUS * balls[:, 3] / longest
    slopes[:, 3] = np.clip(slopes[:, 3], -steepest, steepest)
    after = balls[:-1] + 0.25 * lengths * slopes[:-1]
    before = balls[1:] - 0.25 * lengths * slopes[1:]
    middles = 0.5 * (after + before)
    first = np.stack([balls[:-1], after, middles], axis=1)
    second = np.stack([middles, before, balls[1:]], axis=1)
    return np.stack([first, second], axis=1).reshape(-1, 3, 4)


def _chordal_slopes(balls: Float64Array, lengths: Float64Array) -> Float64Array:
    """Return derivatives (n, 4) by length: of parabolas through three neighbours, of lines at the ends."""
    chords = np.diff(balls, axis=0) / lengths
    inner = (lengths[1:] * chords[:-1] + lengths[:-1] * chords[1:]) / (lengths[1:] + lengths[:-1])
    slopes: Float64Array = np.concatenate([chords[:1], inner, chords[-1:]])
    return slopes


def _b_spline(balls: Float64Array) -> Float64Array:
    """Return the control points (n − 2, 3, 4) of the parabolas of a quadratic B-spline, one for two balls.

    Neighbours meet in the middle between two balls; the first and the last parabola end at balls.
    """
    middles = 0.5 * (balls[:-1] + balls[1:])
    if len(balls) == 2:
        return np.stack([balls[:1], middles, balls[1:]], axis=1)
    joints = np.concatenate([balls[:1], middles[1:-1], balls[-1:]])
    return np.stack([joints[:-1], balls[1:-1], joints[1:]], axis=1)
