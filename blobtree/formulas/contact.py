"""Operators of contact between solids (Gascuel 1993; Cani & Desbrun 1997).

Two solids in contact share one surface, and the material bulges around it. In the papers the field of a solid
becomes F = f + h, where h < 0 inside the other solid (compression) and h > 0 in a region around the contact
(propagation). Their surface lies where f is 1; here it lies where f is ½, and fields are larger inside.

A solid a of stiffness s meets an obstacle b of stiffness s′ where s(a − ½) = s′(b − ½). `rated_field` brings
the obstacle to the scale of the solid, m = r(b) with slope s′/s at ½. Then

    F = a − (m − ½)          where m ≥ ½,
    F = a + B(½ − m) φ(a)    outside of the obstacle,

with a bulge B(t) of the given height and width. B rises with slope 1 at t = 0, so F is C¹ where contact
begins, and B(t) < t, so two bulges never overlap. φ confines the bulge to the support of a; it is 1 where F
can reach ½.
"""

import warp as wp

from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE, OperatorRow
from blobtree.declare.registry import library_rows
from blobtree.texels import Texels

wp.set_module_options({"enable_backward": False})

LARGEST_HEIGHT = 0.125
"""Largest height of a bulge, in field values."""

HEIGHT_OVER_WIDTH = 0.25
"""Largest height of a bulge over its width: the top lies at twice the height, in the nearer half."""

FADE = 0.25
"""Field value of the solid below which its bulge fades, at most ½ − LARGEST_HEIGHT."""


@wp.func
def rated_field(b: wp.float32, ratio: wp.float32) -> wp.vec2:
    """Return r(b) and r′(b): 0 at b = 0, ½ at b = ½ with slope `ratio`, linear above.

    The maps of all ratios are a group: first k, then k′ is k · k′. So a point has one order of solids.
    """
    t = 0.5 - b
    if t <= 0.0:
        return wp.vec2(0.5 - ratio * t, ratio)
    if b <= 0.0:
        return wp.vec2(0.0, 0.0)
    divisor = 1.0 + 2.0 * (ratio - 1.0) * t
    return wp.vec2(wp.max(0.5 - ratio * t / divisor, 0.0), ratio / (divisor * divisor))


@wp.func
def hump(t: wp.float32, width: wp.float32, height: wp.float32) -> wp.vec2:
    """Return B(t) and B′(t): up to `height` at t = 2 · height, then down to 0 at t = `width`."""
    top = 2.0 * height
    if t <= 0.0 or t >= width or height <= 0.0:
        return wp.vec2(0.0, 0.0)
    if t < top:
        return wp.vec2(t * (1.0 - 0.5 * t / top), 1.0 - t / top)
    v = (t - top) / (width - top)
    return wp.vec2(
        height * (1.0 - v) * (1.0 - v) * (1.0 + 2.0 * v), -6.0 * height * v * (1.0 - v) / (width - top)
    )


@wp.func
def pressed_value(a: wp.float32, m: wp.float32, width: wp.float32, height: wp.float32) -> wp.float32:
    """Return F(a, m) for a rated obstacle."""
    if m >= 0.5:
        return wp.max(a - (m - 0.5), 0.0)
    x = wp.clamp(a / FADE, 0.0, 1.0)
    return a + hump(0.5 - m, width, height)[0] * x * x * (3.0 - 2.0 * x)


@wp.func
def press_partials(a: wp.float32, b: wp.float32, parameter: wp.float32, tape: Texels) -> wp.vec3:
    """Return F, ∂F/∂a and ∂F/∂b; the parameters are (ratio, width, height)."""
    p = tape[int(parameter)]
    m = rated_field(b, p[0])
    if b <= 0.0:
        return wp.vec3(a, 1.0, 0.0)
    if m[0] >= 0.5:
        value = a - (m[0] - 0.5)
        if value <= 0.0:
            return wp.vec3(0.0, 0.0, 0.0)
        return wp.vec3(value, 1.0, -m[1])
    h = hump(0.5 - m[0], p[1], p[2])
    x = wp.clamp(a / FADE, 0.0, 1.0)
    fade = x * x * (3.0 - 2.0 * x)
    return wp.vec3(a + h[0] * fade, 1.0 + h[0] * 6.0 * x * (1.0 - x) / FADE, -h[1] * fade * m[1])


@wp.func
def steepest_rating(max_b: wp.float32, ratio: wp.float32, width: wp.float32) -> wp.float32:
    """Bound r′ where r(b) > ½ − width and b ≤ max_b."""
    b = wp.min(max_b, 0.5)
    if ratio < 1.0:
        b = rated_field(0.5 - width, 1.0 / ratio)[0]
    divisor = 1.0 + 2.0 * (ratio - 1.0) * (0.5 - b)
    return ratio / (divisor * divisor)


@wp.func
def press_slope(
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
    tape: Texels,
) -> wp.float32:
    """Bound |∇F|: ∂F/∂a ≤ 1 + 1.5 · height / FADE, |∂F/∂b| ≤ r′."""
    p = tape[int(parameter)]
    if rated_field(max_b, p[0])[0] <= 0.5 - p[1]:
        return slope_a
    return slope_a * (1.0 + 1.5 * p[2] / FADE) + slope_b * steepest_rating(max_b, p[0], p[1])


@wp.func
def pressed_range(a: wp.vec2, low: wp.float32, high: wp.float32, p: wp.vec4) -> wp.vec2:
    """F rises with a; over m from `low` to `high` it rises up to the top of the bulge and falls behind."""
    top = wp.clamp(0.5 - 2.0 * p[2], low, high)
    smallest = wp.min(pressed_value(a[0], low, p[1], p[2]), pressed_value(a[0], high, p[1], p[2]))
    return wp.vec2(smallest, pressed_value(a[1], top, p[1], p[2]))


@wp.func
def press_range(a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels) -> wp.vec2:
    """F rises with a; over b it rises up to the top of the bulge and falls behind."""
    p = tape[int(parameter)]
    return pressed_range(a, rated_field(b[0], p[0])[0], rated_field(b[1], p[0])[0], p)


@wp.func
def press_choice(a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels) -> wp.int32:
    """Return the dependence of a pressed solid: on itself alone where the obstacle's region ends."""
    p = tape[int(parameter)]
    if a[1] <= 0.0 or a[1] <= rated_field(b[0], p[0])[0] - 0.5:
        return KEEP_NONE
    if b[1] <= 0.0 or rated_field(b[1], p[0])[0] <= 0.5 - p[1]:
        return KEEP_LEFT
    return KEEP_BOTH


@wp.func
def bulge_partials(a: wp.float32, b: wp.float32, parameter: wp.float32, tape: Texels) -> wp.vec3:
    """Return F, ∂F/∂a and ∂F/∂b of a solid that bulges, but is not compressed."""
    if rated_field(b, tape[int(parameter)][0])[0] >= 0.5:
        return wp.vec3(a, 1.0, 0.0)
    return press_partials(a, b, parameter, tape)


@wp.func
def bulge_range(a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels) -> wp.vec2:
    """F rises with a; over b it rises up to the top of the bulge and falls behind, up to b = ½."""
    p = tape[int(parameter)]
    low = wp.min(rated_field(b[0], p[0])[0], 0.5)
    return pressed_range(a, low, wp.min(rated_field(b[1], p[0])[0], 0.5), p)


@wp.func
def bulge_choice(a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: Texels) -> wp.int32:
    """Return the dependence of a bulge: on the solid alone inside the obstacle and beyond its region."""
    p = tape[int(parameter)]
    if a[1] <= 0.0:
        return KEEP_NONE
    if b[1] <= 0.0 or rated_field(b[1], p[0])[0] <= 0.5 - p[1] or rated_field(b[0], p[0])[0] >= 0.5:
        return KEEP_LEFT
    return KEEP_BOTH


@wp.func
def rated_union_partials(a: wp.float32, b: wp.float32, ratio: wp.float32) -> wp.vec3:
    """F = max(a, r(b))."""
    m = rated_field(b, ratio)
    if a >= m[0]:
        return wp.vec3(a, 1.0, 0.0)
    return wp.vec3(m[0], 0.0, m[1])


@wp.func
def rated_union_slope(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32, ratio: wp.float32
) -> wp.float32:
    """Bound the rise: r′ lies between the ratio and its inverse."""
    steepest = wp.max(ratio, 1.0 / ratio)
    if slope_b < 0.0:
        steepest = 1.0 / steepest
    return wp.max(slope_a, slope_b * steepest)


@wp.func
def rated_union_range(a: wp.vec2, b: wp.vec2, ratio: wp.float32) -> wp.vec2:
    """F is monotone in both operands."""
    return wp.max(a, wp.vec2(rated_field(b[0], ratio)[0], rated_field(b[1], ratio)[0]))


@wp.func
def rated_union_choice(a: wp.vec2, b: wp.vec2, ratio: wp.float32) -> wp.int32:
    """Return the dependence of a rated union: on the first operand where that is always the larger."""
    if b[1] <= 0.0 or rated_field(b[1], ratio)[0] <= a[0]:
        return KEEP_LEFT
    return KEEP_BOTH


PRESS = OperatorRow(
    "press",
    press_partials,
    press_slope,
    "difference",
    press_range,
    press_choice,
    commutes=False,
    paints=False,
)
BULGE = OperatorRow(
    "bulge",
    bulge_partials,
    press_slope,
    "difference",
    bulge_range,
    bulge_choice,
    commutes=False,
    paints=False,
)
RATED_UNION = OperatorRow(
    "rated_union",
    rated_union_partials,
    rated_union_slope,
    None,
    rated_union_range,
    rated_union_choice,
    commutes=False,
    monotone=True,
)

library_rows(PRESS, BULGE, RATED_UNION)
