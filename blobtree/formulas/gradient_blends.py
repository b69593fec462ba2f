"""Blends that read the gradients of their operands: rows of operators with `OperatorRow.gradients`.

Their functions have more parameters behind the usual ones. `partials` gets the directions ∇a and ∇b, and
returns ∂F/∂a and ∂F/∂b for fixed directions. `slope` gets a bound on the speed at which the angle between the
directions changes, in radians per unit; it is `UNBOUNDED` where none is known.
"""

import warp as wp

from blobtree.declare.claims import UNBOUNDED, OperatorRow, widened_range
from blobtree.formulas.operators import union_partials
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

FLAT = wp.constant(1.0 / 32.0)
"""Ratio of the lengths of two gradients below which the blend fades into the union."""


@wp.func
def cubic_step(t: wp.float32) -> wp.float32:
    """Return 3t² − 2t³ for t clamped to [0, 1]."""
    x = wp.clamp(t, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


@wp.func
def inside_fade(a: wp.float32) -> wp.float32:
    """Return 1 up to a = ½, and then (1 − t²)², t = 2a − 1, down to 0 at a = 1."""
    t = wp.clamp(2.0 * a - 1.0, 0.0, 1.0)
    return (1.0 - t * t) * (1.0 - t * t)


@wp.func
def inside_fade_slope(a: wp.float32) -> wp.float32:
    """Return the derivative of `inside_fade`."""
    t = wp.clamp(2.0 * a - 1.0, 0.0, 1.0)
    return -8.0 * t * (1.0 - t * t)


@wp.func
def angle_between(u: wp.vec3, v: wp.vec3) -> wp.float32:
    """Return the angle between two unit vectors, exact also where it is small."""
    return wp.atan2(wp.length(wp.cross(u, v)), wp.dot(u, v))


@wp.func
def opening(direction_a: wp.vec3, direction_b: wp.vec3, first: wp.float32, last: wp.float32) -> wp.float32:
    """Return the opening o = tan(π/4 − θ): 0 for a union, 1 for a full blend.

    It is tan(π w/4), where w rises by a cubic from 0 at the angle `first` between the directions to 1 at
    `last`. Where one gradient is much shorter than the other, its direction means little: the opening fades.
    """
    length_a = wp.length(direction_a)
    length_b = wp.length(direction_b)
    shorter = wp.min(length_a, length_b)
    if shorter <= 0.0:
        return 0.0
    angle = angle_between(direction_a / length_a, direction_b / length_b)
    fade = cubic_step(shorter / (wp.max(length_a, length_b) * FLAT))
    return fade * wp.tan(0.78539816 * cubic_step((angle - first) / (last - first)))


@wp.func
def opened_partials(a: wp.float32, b: wp.float32, o: wp.float32) -> wp.vec3:
    """Return the blend of opening o, and its partial derivatives for a fixed opening."""
    total = a + b
    fade_a = inside_fade(a)
    fade_b = inside_fade(b)
    k = o * total * fade_a * fade_b
    if k <= 0.0 or wp.abs(a - b) >= k:
        return union_partials(a, b, 0.0)
    share = (a - b) / k
    bend = 0.25 * (1.0 - share * share)
    k_by_a = o * fade_b * (fade_a + total * inside_fade_slope(a))
    k_by_b = o * fade_a * (fade_b + total * inside_fade_slope(b))
    value = 0.5 * total + 0.25 * k + 0.25 * share * (a - b)
    return wp.vec3(value, 0.5 * (1.0 + share) + bend * k_by_a, 0.5 * (1.0 - share) + bend * k_by_b)


@wp.func
def gradient_blend_partials(
    a: wp.float32,
    b: wp.float32,
    parameter: wp.float32,
    tape: Texels,
    direction_a: wp.vec3,
    direction_b: wp.vec3,
) -> wp.vec3:
    """F = (a + b)/2 + k/4 + (a − b)²/(4k) where |a − b| < k = o (a + b) c(a) c(b), and else max(a, b).

    The opening o is that of the angle between the gradients. In the plane of a and b the blend lies between
    the rays b = a tan θ and a = b tan θ (Gourmel et al. 2013, whose boundary functions are these rays up to
    ½). c keeps it from the inside: it is 1 up to ½ and 0 at 1. The paper tabulates its operators, which are
    smooth to any order. This one is a closed form whose derivative is continuous.
    """
    if b <= 0.0 or a <= 0.0:
        return union_partials(a, b, 0.0)
    p = tape[int(parameter)]
    return opened_partials(a, b, opening(direction_a, direction_b, p[0], p[1]))


@wp.func
def gradient_blend_slope(
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
    tape: Texels,
    turn: wp.float32,
) -> wp.float32:
    """|F'| ≤ |∂F/∂a| |a'| + |∂F/∂b| |b'| + |∂F/∂o| |o'|.

    Partial derivatives are at most 1, and up to ½ their sum is at most 3/2. |∂F/∂o| ≤ (a + b)/4. The opening
    changes by at most π/2 · 3/2 / (last − first) per radian, and where it fades by 3/2 more.
    """
    if max_b <= 0.0:
        return slope_a
    if max_a <= 0.0:
        return slope_b
    p = tape[int(parameter)]
    fixed = slope_a + slope_b
    if max_a <= 0.5 and max_b <= 0.5:
        fixed = wp.min(fixed, 1.5 * wp.max(slope_a, slope_b))
    if turn >= UNBOUNDED:
        return UNBOUNDED
    return fixed + 0.25 * (max_a + max_b) * turn * (2.3562 / (p[1] - p[0]) + 1.5)


@wp.func
def gradient_blend_range(a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels) -> wp.vec2:
    """F lies between the union and the full blend without c, 3(a + b)/4 + (a − b)²/(4(a + b)): both rise."""
    total = a[1] + b[1]
    if total <= 0.0:
        return wp.vec2(0.0, 0.0)
    gap = a[1] - b[1]
    return widened_range(wp.max(a[0], b[0]), 0.75 * total + 0.25 * gap * (gap / total))


GRADIENT_BLEND = OperatorRow(
    "gradient_blend",
    gradient_blend_partials,
    gradient_blend_slope,
    "blend",
    gradient_blend_range,
    commutes=False,
    gradients=True,
)
