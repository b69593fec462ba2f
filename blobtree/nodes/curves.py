"""Primitives along curves: circles, arcs, Bézier curves, polylines and strokes, each with visible radii.

`nodes.primitives` states what a skeleton is. For a curve c(t) with the influence s(t), 0 ≤ t ≤ 1, the
closest point minimises |q − c(t)| / s(t). Its derivative has the sign of a polynomial N of degree 5 at most,
so every local minimum is found: the roots of N''' bracket those of N'', these bracket those of N', and these
bracket the minima. No start value can lead to the wrong one of two minima.
"""

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import KW_ONLY, field
from itertools import chain, pairwise
from typing import Annotated

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.declare.skeleton import TUBE_CELLS
from blobtree.errors import InvalidNode
from blobtree.formulas.skeletons import (
    JOINT_YIELD,
    distance_to_segment,
    influence_bound,
    least_influence_at_joints,
)
from blobtree.lazy import Lazy
from blobtree.nodes.node import Node
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.primitives import (
    OPTIONAL_FIELD,
    Columns,
    JoinedPrimitive,
    Primitive,
    RoundPrimitive,
    Torus,
    beside,
)
from blobtree.texels import Texels
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

CHORDS = 6
"""Chords that bound the distance from a curve."""

ROOT_STEPS = 20
"""Most steps of a bracketed root: bisection alone then leaves an interval of 1e-6."""

ROOT_TOLERANCE = 1e-7
"""Change of a root, for parameters from 0 to 1, that ends its iteration."""

POLISH_STEPS = 3

POLISH_LIMIT = 4e-3
"""Longest step of `polished`: beside a centre of curvature, a root in float32 is that far off."""

STRAIGHTEST_ARC = 1e3
"""Radius of an arc, over the longest distance of its points, beyond which it counts as a line."""

ARC_PIECES = 4
"""Parts of an arc whose tangents enclose it: none is longer than a quarter of a circle."""

BERNSTEIN_TO_POWERS = np.array([[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], np.float64)
"""Coefficients of t⁰ to t³, as rows, from the control points of a cubic Bézier curve."""

STEEPEST_RADIUS = 0.5
"""Part of a stroke's radius at a point by which the radius of the next control point may differ from it."""


class Circle(RoundPrimitive):
    """A tube around a circle, the same shape as a `Torus`.

    Examples
    --------
    >>> from blobtree import Circle
    >>> Circle((0, 0, 0), (0, 0, 1), 1.0, radius=0.2)([[1.2, 0, 0]]).round(3).tolist()
    [0.5]
    """

    file_tag = "circle"
    skeleton = Torus.skeleton

    center: Vector = par.point("centre of the circle")
    axis: Vector = par.direction("normal of the circle's plane, of any length")
    circle_radius: float = par.length("radius of the circle")


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

    cells = TUBE_CELLS

    start: Vector = par.point("start of the arc")
    through: Vector = par.point("a point of the arc between its ends")
    end: Vector = par.point("end of the arc")

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
    def numbers(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return centres; two vectors that span the arc, with cosine and sine of its half."""
        centers, u, v, halves = _arc_frames(columns["start"], columns["through"], columns["end"])
        return np.concatenate([centers, beside(u, np.cos(halves)), beside(v, np.sin(halves))], axis=1)

    @formula
    def closest(
        q: wp.vec3, center: wp.vec3, u: wp.vec3, least: wp.float32, v: wp.vec3, most: wp.float32
    ) -> wp.vec3:
        """Return the closest point of an arc of radius |u| from −h to h about u; v is u turned by 90°.

        The numbers are cos h and sin h.
        """
        w = q - center
        radius = wp.length(u)
        x = wp.dot(w, u) / radius
        y = wp.dot(w, v) / radius
        across = wp.sqrt(x * x + y * y)
        cosine = float(1.0)
        sine = float(0.0)
        if across > 1.0e-6 * wp.length(w):
            cosine = x / across
            sine = y / across
        if cosine < least:
            cosine = least
            sine = most * wp.sign(sine)
        c = u * cosine + v * sine
        return center + c


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


@wp.func
def joined_influence(
    influence: wp.float32, joints: wp.float32, at_start: wp.bool, at_end: wp.bool
) -> wp.float32:
    """Return the influence at a closest point, which yields at joints: 1 start, 2 end, 3 both, 0 none."""
    if (at_start and (joints == 1.0 or joints == 3.0)) or (at_end and joints >= 2.0):
        return influence * (1.0 - JOINT_YIELD)
    return influence


@wp.func
def closest_on_joined_segment(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (start, influence); tape[at + 1] = (end − start, joints), as in `joined_influence`."""
    start = tape[at]
    axis = tape[at + 1]
    a = wp.vec3(start[0], start[1], start[2])
    ab = wp.vec3(axis[0], axis[1], axis[2])
    t = wp.clamp(wp.dot(q - a, ab) / wp.max(wp.dot(ab, ab), 1.0e-37), 0.0, 1.0)
    c = a + ab * t
    return wp.vec4(c[0], c[1], c[2], joined_influence(start[3], axis[3], t == 0.0, t == 1.0))


@wp.func
def polynomial(t: wp.float32, c: wp.vec4, c4: wp.float32, c5: wp.float32) -> wp.float32:
    """Return Σ cₖ tᵏ for k from 0 to 5."""
    return c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c4 + t * c5))))


@wp.func
def polynomial_slope(t: wp.float32, c: wp.vec4, c4: wp.float32, c5: wp.float32) -> wp.float32:
    """Return Σ k cₖ tᵏ⁻¹."""
    return c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c4 + t * 5.0 * c5)))


@wp.func
def root_between(low: wp.float32, high: wp.float32, c: wp.vec4, c4: wp.float32, c5: wp.float32) -> wp.float32:
    """Return the root of a polynomial that is monotone from `low` to `high`; `high` if it has none there.

    Newton's method, and a bisection where a step of it would leave the bracket.
    """
    left = float(low)
    right = float(high)
    rises = polynomial(low, c, c4, c5) < 0.0
    if rises == (polynomial(high, c, c4, c5) < 0.0):
        return high
    t = 0.5 * (left + right)
    for _step in range(ROOT_STEPS):
        value = polynomial(t, c, c4, c5)
        if (value < 0.0) == rises:
            left = t
        else:
            right = t
        slope = polynomial_slope(t, c, c4, c5)
        following = 0.5 * (left + right)
        if (t - left) * wp.abs(slope) > wp.abs(value) or (right - t) * wp.abs(slope) > wp.abs(value):
            newton = t - value / slope
            if newton > left and newton < right:
                following = newton
        change = wp.abs(following - t)
        t = following
        if change <= ROOT_TOLERANCE:
            break
    return t


@wp.func
def unit_quotient(a: wp.float32, b: wp.float32) -> wp.float32:
    """Return a / b clamped to [0, 1]; 0 for 0 / 0."""
    numerator = a * wp.sign(b)
    denominator = wp.abs(b)
    if numerator <= 0.0:
        return 0.0
    if numerator >= denominator:
        return 1.0
    return numerator / denominator


@wp.func
def quadratic_roots(c: wp.float32, b: wp.float32, a: wp.float32) -> wp.vec2:
    """Return the roots of a t² + b t + c in ascending order, clamped to [0, 1]; its extremum if it has none.

    The form −2c / (b ± …) of the smaller root does not cancel (Press et al., Numerical Recipes, 5.6).
    """
    discriminant = b * b - 4.0 * a * c
    if discriminant <= 0.0:
        extremum = unit_quotient(-b, 2.0 * a)
        return wp.vec2(extremum, extremum)
    k = -0.5 * (b + wp.sign(b) * wp.sqrt(discriminant))
    first = unit_quotient(k, a)
    second = unit_quotient(c, k)
    return wp.vec2(wp.min(first, second), wp.max(first, second))


@wp.func
def roots_between(ends: wp.vec4, c: wp.vec4, c4: wp.float32, c5: wp.float32) -> wp.vec4:
    """Return `root_between` of the four intervals from 0 through the ascending `ends`."""
    roots = wp.vec4()
    low = float(0.0)
    for k in range(4):
        roots[k] = root_between(low, ends[k], c, c4, c5)
        low = ends[k]
    return roots


@wp.func
def extrema(c: wp.vec4, c4: wp.float32, c5: wp.float32) -> wp.vec4:
    """Return numbers in [0, 1], ascending, between which a polynomial of degree 5 is monotone."""
    inflections = quadratic_roots(6.0 * c[3], 24.0 * c4, 60.0 * c5)
    ends = wp.vec4(inflections[0], inflections[1], 1.0, 1.0)
    turns = roots_between(ends, wp.vec4(2.0 * c[2], 6.0 * c[3], 12.0 * c4, 20.0 * c5), 0.0, 0.0)
    slope = wp.vec4(c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c4)
    return roots_between(turns, slope, 5.0 * c5, 0.0)


@wp.func
def curve_point(t: wp.float32, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return the point of a curve, and the influence there."""
    last = tape[at + 3]
    cubic = wp.vec4(last[0], last[1], last[2], 0.0)
    return tape[at] + (tape[at + 1] + (tape[at + 2] + cubic * t) * t) * t


@wp.func
def curve_ratio(t: wp.float32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return (|q − c(t)| / s(t))²."""
    c = curve_point(t, tape, at)
    w = q - wp.vec3(c[0], c[1], c[2])
    return wp.dot(w, w) / (c[3] * c[3])


@wp.func
def polished(t: wp.float32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return t after Newton steps for N(t) = ½ (|c − q|²)' s − |c − q|² s'.

    Its vectors cancel less than the coefficients of N. Lengths are in units of s(0), for squares overflow.
    """
    unit = 1.0 / tape[at][3]
    last = tape[at + 3]
    cubic = wp.vec4(last[0], last[1], last[2], 0.0)
    root = float(t)
    for _step in range(POLISH_STEPS):
        c = curve_point(root, tape, at)
        slope = (tape[at + 1] + (tape[at + 2] * 2.0 + cubic * (3.0 * root)) * root) * unit
        bend = (tape[at + 2] * 2.0 + cubic * (6.0 * root)) * unit
        w = (wp.vec3(c[0], c[1], c[2]) - q) * unit
        s = c[3] * unit
        d = wp.vec3(slope[0], slope[1], slope[2])
        n = wp.dot(w, d) * s - wp.dot(w, w) * slope[3]
        rate = (wp.dot(d, d) + wp.dot(w, wp.vec3(bend[0], bend[1], bend[2]))) * s
        rate -= wp.dot(w, d) * slope[3] + wp.dot(w, w) * bend[3]
        if rate <= 0.0:
            break
        following = wp.clamp(root - wp.clamp(n / rate, -POLISH_LIMIT, POLISH_LIMIT), 0.0, 1.0)
        change = wp.abs(following - root)
        root = following
        if change <= ROOT_TOLERANCE:
            break
    return root


@wp.func
def closest_on_curve(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at + k] = coefficient of tᵏ in (c(t), s(t)), k from 0 to 3; s is constant if that of t³ is not 0.

    s has no term in t³. In its place stand the joints, as in `joined_influence`.
    With c − q = w + b t + a t² + g t³ and s = 1 + s₁ t + s₂ t² in units of s(0), to which N is proportional,
    N = ½ (|c − q|²)' s − |c − q|² s'.
    """
    start = tape[at]
    unit = 1.0 / start[3]
    k1 = tape[at + 1] * unit
    k2 = tape[at + 2] * unit
    k3 = tape[at + 3] * unit
    w = (wp.vec3(start[0], start[1], start[2]) - q) * unit
    b = wp.vec3(k1[0], k1[1], k1[2])
    a = wp.vec3(k2[0], k2[1], k2[2])
    g = wp.vec3(k3[0], k3[1], k3[2])
    h0 = wp.dot(w, b)
    h1 = wp.dot(b, b) + 2.0 * wp.dot(w, a)
    h2 = 3.0 * wp.dot(a, b)
    h3 = 2.0 * wp.dot(a, a)
    e0 = wp.dot(w, w)
    n0 = h0 - e0 * k1[3]
    n1 = h1 - h0 * k1[3] - 2.0 * e0 * k2[3]
    n2 = h2 + 3.0 * wp.dot(w, g) - 3.0 * h0 * k2[3]
    n3 = h3 + 4.0 * wp.dot(b, g) + h2 * k1[3] / 3.0 - h1 * k2[3]
    n4 = 5.0 * wp.dot(a, g) + 0.5 * h3 * k1[3] - h2 * k2[3] / 3.0
    n5 = 3.0 * wp.dot(g, g)
    largest = wp.max(wp.max(wp.abs(n0), wp.abs(n1)), wp.max(wp.abs(n2), wp.abs(n3)))
    largest = wp.max(largest, wp.max(wp.abs(n4), wp.abs(n5)))
    scale = 1.0 / wp.max(largest, 1.0e-30)
    n = wp.vec4(n0, n1, n2, n3) * scale
    n4 *= scale
    n5 *= scale
    ends = extrema(n, n4, n5)
    best = float(0.0)
    least = curve_ratio(0.0, q, tape, at)
    low = float(0.0)
    for k in range(6):
        high = float(1.0)
        t = float(1.0)
        if k < 4:
            high = ends[k]
        if k < 5 and polynomial(low, n, n4, n5) < 0.0:
            t = root_between(low, high, n, n4, n5)
        ratio = curve_ratio(t, q, tape, at)
        if ratio < least:
            least = ratio
            best = t
        low = high
    best = polished(best, q, tape, at)
    c = curve_point(best, tape, at)
    c[3] = joined_influence(c[3], tape[at + 3][3], best == 0.0, best == 1.0)
    return c


@wp.func
def min_influence_of_curve(tape: Texels, at: wp.int32) -> wp.float32:
    """Return the smallest of the influences s₀, s₀ + s₁ / 2, s₀ + s₁ + s₂, whose hull holds all of s(t)."""
    start = tape[at][3]
    first = tape[at + 1][3]
    return wp.min(start, wp.min(start + 0.5 * first, start + first + tape[at + 2][3]))


@wp.func
def clearance_of_curve(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return a lower bound on the distance from a parabola, by chords of its pieces.

    Over a piece of Δt it is at most |a| Δt² / 4 away from the chord, a being the coefficient of t². Nothing
    is known of a cubic, whose influence is constant.
    """
    bend = tape[at + 2]
    if tape[at + 1][3] == 0.0 and bend[3] == 0.0:
        return 0.0
    before = curve_point(0.0, tape, at)
    least = float(1.0e30)
    for k in range(CHORDS):
        after = curve_point(float(k + 1) / float(CHORDS), tape, at)
        a = wp.vec3(before[0], before[1], before[2])
        least = wp.min(least, distance_to_segment(q, a, wp.vec3(after[0], after[1], after[2])))
        before = after
    sag = wp.length(wp.vec3(bend[0], bend[1], bend[2])) / float(4 * CHORDS * CHORDS)
    return wp.max(least - sag, 0.0)


@wp.func
def influence_near_curve(tape: Texels, at: wp.int32, q: wp.vec3, c: wp.vec4) -> wp.float32:
    """Return `influence_bound` of a curve."""
    return influence_bound(q, c, min_influence_of_curve(tape, at), clearance_of_curve(q, tape, at))


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

    cells = TUBE_CELLS
    joint_texels = (3,)
    texels_read = 4
    closest_with_influence = formula(closest_on_curve)
    least_influence = formula(min_influence_of_curve)
    influence_near = formula(influence_near_curve)

    start: Vector = par.point("start of the curve")
    control: Vector = par.point("where the tangents of the ends meet")
    end: Vector = par.point("end of the curve")
    _: KW_ONLY
    radius: float = par.radius("visible radius at the start")
    control_radius: float = par.radius("second Bernstein coefficient of the radius")
    end_radius: float = par.radius("visible radius at the end")

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return the coefficients of powers of t of the curve and of its influence radius."""
        balls = np.concatenate([np.stack(list(columns.values()), axis=1), influences[:, :, None]], axis=2)
        start, control, end = balls.transpose(1, 0, 2)
        powers = [start, 2.0 * (control - start), start - 2.0 * control + end, np.zeros_like(start)]
        return np.stack(powers, axis=1)


class BezierCurve(Primitive):
    """A tube around a Bézier curve, whose control points are the parameters in order."""

    skeleton = TaperedBezier.skeleton

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

    start: Vector = par.point("start of the curve")
    control: Vector = par.point("where the tangents of the ends meet")
    end: Vector = par.point("end of the curve")


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

    start: Vector = par.point("start of the curve")
    start_control: Vector = par.point("control point on the tangent of the start")
    end_control: Vector = par.point("control point on the tangent of the end")
    end: Vector = par.point("end of the curve")


class _JoinedSegment(JoinedPrimitive):
    """A piece of a polyline."""

    tag = "joined_segment"
    convex = True
    cells = TUBE_CELLS
    texels_read = 2
    joint_texels = (1,)
    closest_with_influence = formula(closest_on_joined_segment)
    least_influence = formula(least_influence_at_joints)

    start: Vector = par.point("start of the line")
    end: Vector = par.point("end of the line")

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return start and influence radius; the axis."""
        axes = columns["end"] - columns["start"]
        return np.stack(
            [beside(columns["start"], influences[:, 0]), beside(axes, np.zeros(len(axes)))], axis=1
        )


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

    points: tuple[Vector, ...] = par.points("two or more points in order")
    _: KW_ONLY
    radius: float = par.radius("visible radius around the skeleton")

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
            _JoinedSegment(*pair, radius=self.radius, **self.shared).joined(joints)
            for pair, joints in zip(ends, _joints(ends), strict=True)
        )


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

    points: tuple[Vector, ...] = par.points("two or more points in order")
    radii: tuple[float, ...] = par.radii("visible radius at each point, or one for all points")
    _: KW_ONLY
    spline: Annotated[
        str,
        Parameter(
            Quantity.CHOICE,
            "'catmull_rom' through the points, or 'b_spline', which they attract",
            choices=("catmull_rom", "b_spline"),
        ),
    ] = field(default="catmull_rom", metadata=OPTIONAL_FIELD)

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
        piece = TaperedBezier(a, b, c, **radii, **self.shared)
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
