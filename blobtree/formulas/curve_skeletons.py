"""Skeletons along curves: pieces of polylines, circular arcs, and polynomial curves up to cubics.

`formulas.skeletons` states what a skeleton is. For a curve c(t) with the influence s(t), 0 ≤ t ≤ 1, the
closest point minimises |q − c(t)| / s(t). Its derivative has the sign of a polynomial N of degree 5 at most,
so every local minimum is found: the roots of N''' bracket those of N'', these bracket those of N', and these
bracket the minima. No start value can lead to the wrong one of two minima.
"""

import warp as wp

from blobtree.declare.registry import library_rows
from blobtree.formulas.skeletons import (
    JOINT_YIELD,
    TUBE_CELLS,
    Skeleton,
    distance_to_segment,
    influence_near,
    min_influence_of_one,
)
from blobtree.texels import Texels

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
def min_influence_of_joined_segment(tape: Texels, at: wp.int32) -> wp.float32:
    """Return the influence radius at joints."""
    return tape[at][3] * (1.0 - JOINT_YIELD)


@wp.func
def closest_on_arc(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """tape[at] = (centre, influence); tape[at + 1], tape[at + 2] = (r·u, cos h), (r·v, sin h).

    The arc of radius r reaches from −h to h about the unit vector u; v is perpendicular to u in its plane.
    """
    center = tape[at]
    first = tape[at + 1]
    second = tape[at + 2]
    u = wp.vec3(first[0], first[1], first[2])
    v = wp.vec3(second[0], second[1], second[2])
    w = q - wp.vec3(center[0], center[1], center[2])
    radius = wp.length(u)
    x = wp.dot(w, u) / radius
    y = wp.dot(w, v) / radius
    across = wp.sqrt(x * x + y * y)
    cosine = float(1.0)
    sine = float(0.0)
    if across > 1.0e-6 * wp.length(w):
        cosine = x / across
        sine = y / across
    if cosine < first[3]:
        cosine = first[3]
        sine = second[3] * wp.sign(sine)
    c = u * cosine + v * sine
    return wp.vec4(center[0] + c[0], center[1] + c[1], center[2] + c[2], center[3])


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
    """Return `influence_near` of a curve."""
    return influence_near(q, c, min_influence_of_curve(tape, at), clearance_of_curve(q, tape, at))


JOINED_SEGMENT = Skeleton(
    "joined_segment",
    closest_on_joined_segment,
    min_influence_of_joined_segment,
    parameters=2,
    convex=True,
    cells=TUBE_CELLS,
)
ARC = Skeleton("arc", closest_on_arc, min_influence_of_one, parameters=3, cells=TUBE_CELLS)
CURVE = Skeleton(
    "curve",
    closest_on_curve,
    min_influence_of_curve,
    parameters=4,
    own_influence_near=influence_near_curve,
    cells=TUBE_CELLS,
)

library_rows(JOINED_SEGMENT, ARC, CURVE)
