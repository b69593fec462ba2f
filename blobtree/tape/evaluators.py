"""Evaluators of a tape: its value, slope bound, gradient or colour.

Each evaluator is the set of functions over which the interpreter's loop is closed:

* `leaf(q, c, color, ahead, rate)`: the contribution of a primitive at q. c is its closest point and the
  influence there; `rate` bounds how fast |q − c| / influence changes;
* `direct(kind, q, tape, at, color, ahead, speed)`: the contribution of a direct field at q, whose parameters
  are at tape[at]; q moves at most at `speed`;
* `profiled_leaf(..., profile)`: the same with a profile = (·, code of its falloff, k, weight);
* `pullback_affine(f, tape, at)`: a result behind the map at tape[at], seen in front of it;
* `pullback_warp(kind, f, q, tape, at)`: a subtree's result behind a warp and the map at tape[at], seen in
  front;
* `scale_speed(kind, q, speed, reach, tape, at)`: a bound on the speed behind the warp with parameters at
  tape[at] of a point that moves at most at `speed` in front of it;
* `way(kind, q, c, ahead, speed, tape, at)`: the part of the way ahead on which a primitive of the skeleton at
  tape[at] may change, c being the closest point to q;
* `combine(operator, a, b, reach, parameter, tape)`, and the `empty` field;
* `paint(q, c, color, tape)`: the colour of a leaf at q, from its texel, for the three functions of leaves.

Slopes are bounded along a ray (segment tracing: Galin, Guérin, Paris and Peytavie 2020): along q + u ·
direction for u from 0 to `reach`, per unit of u; `ahead` is (direction, reach). Behind an affine map the ray
is still a line, along the mapped direction. Behind a warp the ray is bent, and for a skeleton that is not
convex a line gives no bound. There the direction is 0, and bounds follow from `speed` alone: a point moves at
most that fast. With a direction of 0 from the start, bounds hold in all directions.
"""

from dataclasses import dataclass
from typing import Any

import warp as wp

from blobtree.formulas.falloff import (
    RIM,
    falloff,
    falloff_derivative,
    falloff_shallowest,
    falloff_slope_bound,
    falloff_steepest,
)
from blobtree.formulas.skeletons import TINY
from blobtree.formulas.windows import box_window, box_window_bounds, windowed, windowed_bounds
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.dispatch import (
    apart,
    depth,
    falloff_numbers,
    falloff_slope,
    falloff_value,
    has_distances,
    is_distance,
    is_monotone,
    is_windowed,
    kind_bounds,
    kind_distance_along,
    kind_distance_at,
    kind_distance_within,
    kind_value_gradient,
    paints,
    partials,
    slope,
    warp_pullback,
    warp_stretch,
)
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

INSIDE = wp.constant(1e-3)
"""Distance from a solid skeleton, over its influence, up to which rounding may move a point inside."""

BALL_MARGIN = wp.constant(1.0 + 1e-6)
"""Widening of the ball around a segment of a ray, for rounding."""


@wp.func
def to_local(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return a point in the space behind the map at tape[at]."""
    x = wp.vec4(q[0], q[1], q[2], 1.0)
    return wp.vec3(wp.dot(tape[at], x), wp.dot(tape[at + 1], x), wp.dot(tape[at + 2], x))


@wp.func
def direction_to_local(v: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return a direction in the space behind the map at tape[at]."""
    x = wp.vec4(v[0], v[1], v[2], 0.0)
    return wp.vec3(wp.dot(tape[at], x), wp.dot(tape[at + 1], x), wp.dot(tape[at + 2], x))


@wp.func
def squared_distance(q: wp.vec3, c: wp.vec4) -> wp.float32:
    """Return (|q − c| / influence)² for c = (closest point, influence)."""
    w = q - wp.vec3(c[0], c[1], c[2])
    return wp.dot(w, w) / (c[3] * c[3])


@wp.func
def profile_distance(u: wp.float32, profile: wp.vec4) -> wp.float32:
    """Return the argument of a falloff, 0 ≤ d ≤ 1, from u = |q − c| / influence.

    d = ρ (1 + k (u / RIM − 1)): where the primitive alone has its surface, u = RIM, the falloff is at its own
    rim ρ, so that it is half. k is 1 for a falloff in proportion to the radius, and otherwise the width that
    this one has over the wanted width.
    """
    rim = falloff_numbers(int(profile[1]))[0]
    return wp.clamp(rim * (1.0 + profile[2] * (u / RIM - 1.0)), 0.0, 1.0)


@wp.func
def profile_value(u: wp.float32, profile: wp.vec4) -> wp.float32:
    """Return g, before its weight."""
    d = profile_distance(u, profile)
    if d >= 1.0:
        return 0.0
    return wp.max(falloff_value(int(profile[1]), d), 0.0)


@wp.func
def profile_slope(u: wp.float32, profile: wp.vec4) -> wp.float32:
    """Return ∂g/∂u, before its weight."""
    code = int(profile[1])
    d = profile_distance(u, profile)
    if d <= 0.0 or d >= 1.0:
        return 0.0
    return falloff_slope(code, d) * profile[2] * falloff_numbers(code)[0] / RIM


@wp.func
def profile_steepest(nearest: wp.float32, farthest: wp.float32, profile: wp.vec4) -> wp.float32:
    """Return a bound on |∂g/∂u| over [nearest, farthest]."""
    code = int(profile[1])
    numbers = falloff_numbers(code)
    largest = numbers[2]
    if numbers[1] >= 0.0:
        near = profile_distance(nearest, profile)
        far = profile_distance(farthest, profile)
        largest = -falloff_slope(code, wp.clamp(numbers[1], near, far))
    return largest * profile[2] * numbers[0] / RIM


@wp.func
def falling_value(u: wp.float32, profile: wp.vec4) -> wp.float32:
    """Return g(u), before its weight, of a direct field that is a falloff of u."""
    if profile[1] != 0.0 or profile[2] != 1.0:
        return profile_value(u, profile)
    x = wp.max(u, 0.0)
    return falloff(x * x)


@wp.func
def falling_steepest(nearest: wp.float32, farthest: wp.float32, profile: wp.vec4) -> wp.float32:
    """Return a bound on |∂g/∂u| over [nearest, farthest] of such a field."""
    if profile[1] != 0.0 or profile[2] != 1.0:
        return profile_steepest(nearest, farthest, profile)
    return falloff_steepest(wp.max(nearest, 0.0), wp.max(farthest, 0.0))


@wp.func
def direct_value_gradient(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (value, ∇f) of a direct field: its kind's function, falloff, window and weight.

    tape[at − 1] is its profile.
    """
    profile = tape[at - 1]
    w = wp.vec4(1.0, 0.0, 0.0, 0.0)
    if is_windowed(kind):
        w = box_window(q, tape, at)
        if w[0] <= 0.0:
            return wp.vec4(0.0, 0.0, 0.0, 0.0)
    f = kind_value_gradient(kind, q, tape, at)
    if is_distance(kind):
        u = wp.max(f[0], 0.0)
        g = falloff(u * u)
        rate = 2.0 * u * falloff_derivative(u * u)
        if profile[1] != 0.0 or profile[2] != 1.0:
            g = profile_value(f[0], profile)
            rate = profile_slope(f[0], profile)
        f = wp.vec4(g, rate * f[1], rate * f[2], rate * f[3])
    if is_windowed(kind):
        f = windowed(f, w)
    return f * profile[3]


@wp.func
def direct_bounds(kind: wp.int32, center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return (smallest value, largest value, largest |∇f|) of a direct field over a ball."""
    profile = tape[at - 1]
    w = wp.vec3(1.0, 1.0, 0.0)
    if is_windowed(kind):
        w = box_window_bounds(center, radius, tape, at)
        if w[1] <= 0.0:
            return wp.vec3(0.0, 0.0, 0.0)
    f = kind_bounds(kind, center, radius, tape, at)
    if is_distance(kind):
        steepest = falling_steepest(f[0], f[1], profile)
        f = wp.vec3(falling_value(f[1], profile), falling_value(f[0], profile), steepest * f[2])
    if is_windowed(kind):
        f = windowed_bounds(f, w)
    if profile[3] < 0.0:
        f = wp.vec3(f[1], f[0], -f[2])
    return f * profile[3]


@wp.func
def direct_value(kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return the value of a direct field; tape[at − 1] is its profile."""
    if has_distances(kind):
        profile = tape[at - 1]
        return falling_value(kind_distance_at(kind, q, tape, at), profile) * profile[3]
    return direct_value_gradient(kind, q, tape, at)[0]


@wp.func
def direct_within(kind: wp.int32, center: wp.vec3, half: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec2:
    """Return (smallest, largest) value, in a box, of a direct field that has `distance_within`."""
    profile = tape[at - 1]
    u = kind_distance_within(kind, center, half, tape, at)
    f = wp.vec2(falling_value(u[1], profile), falling_value(u[0], profile))
    if profile[3] < 0.0:
        return wp.vec2(f[1], f[0]) * profile[3]
    return f * profile[3]


@wp.func
def direct_change(
    kind: wp.int32, q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec2:
    """Return bounds on (rise, fall) along a line of a direct field that has `distance_along`."""
    profile = tape[at - 1]
    u = kind_distance_along(kind, q, direction, reach, tape, at)
    steepest = falling_steepest(u[0], u[1], profile) * wp.abs(profile[3])
    change = wp.vec2(wp.max(-u[2], 0.0), wp.max(u[3], 0.0)) * steepest
    if profile[3] < 0.0:
        return wp.vec2(change[1], change[0])
    return change


@wp.func
def constant_speed(
    kind: wp.int32, q: wp.vec3, speed: wp.float32, reach: wp.float32, tape: Texels, at: wp.int32
) -> wp.float32:
    """Return `speed`: results at a point alone do not depend on it."""
    return speed


@wp.func
def whole_way(
    kind: wp.int32, q: wp.vec3, c: wp.vec4, ahead: wp.vec4, speed: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec4:
    """Return `ahead`: results at a point alone do not depend on it."""
    return ahead


# -- value ----------------------------------------------------------------------------------------------


@wp.func
def value_empty() -> wp.float32:
    """Return the value of the empty field."""
    return 0.0


@wp.func
def value_leaf(q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32) -> wp.float32:
    """Return the field of one primitive."""
    return falloff(squared_distance(q, c))


@wp.func
def value_direct(
    kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32, color: wp.vec4, ahead: wp.vec4, speed: wp.float32
) -> wp.float32:
    """Return the value of a direct field."""
    return direct_value(kind, q, tape, at)


@wp.func
def profiled_value_leaf(
    q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32, profile: wp.vec4
) -> wp.float32:
    """Return the field of one primitive with a profile."""
    return profile[3] * profile_value(wp.sqrt(squared_distance(q, c)), profile)


@wp.func
def value_pullback_affine(f: wp.float32, tape: Texels, at: wp.int32) -> wp.float32:
    """Return `f`: values are the same in every space."""
    return f


@wp.func
def value_pullback_warp(kind: wp.int32, f: wp.float32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return `f`: values are the same in every space."""
    return f


@wp.func
def value_combine(
    operator: wp.int32, a: wp.float32, b: wp.float32, reach: wp.float32, parameter: wp.float32, tape: Texels
) -> wp.float32:
    """Return F(a, b)."""
    return partials(operator, a, b, parameter, tape)[0]


# -- slope bound ----------------------------------------------------------------------------------------


@wp.func
def bound_empty() -> wp.vec3:
    """Return the bounds of the empty field, which is 0 and flat."""
    return wp.vec3(0.0, 0.0, 0.0)


@wp.func
def way_outside(ahead: wp.vec4, inside: wp.float32, speed: wp.float32) -> wp.vec4:
    """Return the way ahead without its part inside a solid skeleton, where the field is constant.

    `inside` is the depth of its start in the skeleton, 0 or less outside.
    """
    if inside <= 0.0:
        return ahead
    return wp.vec4(ahead[0], ahead[1], ahead[2], wp.max(ahead[3] - inside / wp.max(speed, TINY), 0.0))


@wp.func
def way_end(q: wp.vec3, ahead: wp.vec4) -> wp.vec3:
    """Return the end of the way ahead."""
    return q + wp.vec3(ahead[0], ahead[1], ahead[2]) * ahead[3]


@wp.func
def way_between(ahead: wp.vec4, start_apart: wp.float32, end_apart: wp.float32) -> wp.vec4:
    """Return the way ahead; none of it if both its ends lie in a convex skeleton, which then has all of it.

    The numbers are (distance / influence)² of the ends.
    """
    direction = wp.vec3(ahead[0], ahead[1], ahead[2])
    if wp.dot(direction, direction) == 0.0 or start_apart + end_apart > INSIDE * INSIDE:
        return ahead
    return wp.vec4(ahead[0], ahead[1], ahead[2], 0.0)


@wp.func
def bound_way(
    kind: wp.int32, q: wp.vec3, c: wp.vec4, ahead: wp.vec4, speed: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec4:
    """Return the way ahead outside a solid skeleton, as far as its depth or its convexity is known."""
    start_apart = squared_distance(q, c)
    if start_apart > INSIDE * INSIDE:
        return ahead
    outside = way_between(ahead, start_apart, apart(kind, way_end(q, ahead), tape, at))
    return way_outside(outside, depth(kind, q, tape, at), speed)


@wp.func
def bound_leaf(q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32) -> wp.vec3:
    """Return (value at q, bound on the rise of the field ahead, bound on its fall) of one primitive.

    The distance d from a convex skeleton is a convex function along a line: nowhere ahead does it grow more
    slowly, or shrink faster, than at q. Where it shrinks, this bounds the rise of the field and the smallest
    distance ahead. Where it grows, the field falls, and the bound on its rise is not above 0.
    """
    direction = wp.vec3(ahead[0], ahead[1], ahead[2])
    reach = ahead[3]
    z = squared_distance(q, c)
    d = wp.sqrt(z)
    if wp.dot(direction, direction) == 0.0:
        either = rate * falloff_slope_bound(d, reach * rate)
        return wp.vec3(falloff(z), either, either)
    growth = rate
    if d > 0.0:
        w = q - wp.vec3(c[0], c[1], c[2])
        growth = wp.dot(w, direction) / (d * c[3] * c[3])
    nearest = wp.max(d + wp.min(growth, 0.0) * reach, 0.0)
    farthest = d + rate * reach
    rise = -growth * falloff_steepest(nearest, d)
    if growth > 0.0:
        rise = -growth * falloff_shallowest(d, farthest)
    return wp.vec3(falloff(z), rise, rate * falloff_steepest(nearest, farthest))


@wp.func
def bound_direct(
    kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32, color: wp.vec4, ahead: wp.vec4, speed: wp.float32
) -> wp.vec3:
    """Return (value at q, bound on the rise of a direct field ahead, bound on its fall).

    Both are its largest slope over the ball around the way ahead, or around all points within reach, unless
    the kind knows its change along a line.
    """
    direction = wp.vec3(ahead[0], ahead[1], ahead[2])
    reach = ahead[3]
    value = direct_value(kind, q, tape, at)
    rate = wp.length(direction)
    if rate > 0.0:
        if has_distances(kind):
            change = direct_change(kind, q, direction, reach, tape, at)
            return wp.vec3(value, change[0], change[1])
        middle = q + direction * (0.5 * reach)
        along = direct_bounds(kind, middle, 0.5 * reach * rate * BALL_MARGIN, tape, at)[2] * rate
        return wp.vec3(value, along, along)
    around = direct_bounds(kind, q, reach * speed, tape, at)[2] * speed
    return wp.vec3(value, around, around)


@wp.func
def profiled_bound_leaf(
    q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32, profile: wp.vec4
) -> wp.vec3:
    """Do the same as `bound_leaf` with a profile; a negative weight exchanges the bounds."""
    direction = wp.vec3(ahead[0], ahead[1], ahead[2])
    reach = ahead[3]
    u = wp.sqrt(squared_distance(q, c))
    weight = profile[3]
    value = weight * profile_value(u, profile)
    size = wp.abs(weight)
    if wp.dot(direction, direction) == 0.0:
        nearest_u = wp.max(u - reach * rate, 0.0)
        either = size * rate * profile_steepest(nearest_u, u + reach * rate, profile)
        return wp.vec3(value, either, either)
    growth = rate
    if u > 0.0:
        w = q - wp.vec3(c[0], c[1], c[2])
        growth = wp.dot(w, direction) / (u * c[3] * c[3])
    nearest = wp.max(u + wp.min(growth, 0.0) * reach, 0.0)
    rise = size * wp.max(-growth, 0.0) * profile_steepest(nearest, u, profile)
    fall = size * rate * profile_steepest(nearest, u + rate * reach, profile)
    if weight < 0.0:
        return wp.vec3(value, fall, rise)
    return wp.vec3(value, rise, fall)


@wp.func
def bound_pullback_affine(f: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return `f`: slopes along the ray are the same in every space."""
    return f


@wp.func
def bound_pullback_warp(kind: wp.int32, f: wp.vec3, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return `f`: slopes along the ray are the same in every space."""
    return f


@wp.func
def bound_scale_speed(
    kind: wp.int32, q: wp.vec3, speed: wp.float32, reach: wp.float32, tape: Texels, at: wp.int32
) -> wp.float32:
    """Return `speed` times the warp's largest stretch in the ball within reach."""
    return speed * warp_stretch(kind, q, reach * speed, tape, at)


@wp.func
def bound_combine(
    operator: wp.int32, a: wp.vec3, b: wp.vec3, reach: wp.float32, parameter: wp.float32, tape: Texels
) -> wp.vec3:
    """Return the bounds of F(a, b).

    Ahead, an operand exceeds its value at q by at most reach · its rise. The rise of a monotone operator is
    bounded by its `slope` at the operands' rises, its fall by its `slope` at their falls.
    """
    value = partials(operator, a[0], b[0], parameter, tape)[0]
    max_a = a[0] + reach * wp.max(a[1], 0.0)
    max_b = b[0] + reach * wp.max(b[1], 0.0)
    if is_monotone(operator):
        rise = slope(operator, a[1], b[1], max_a, max_b, parameter, tape)
        return wp.vec3(value, rise, slope(operator, a[2], b[2], max_a, max_b, parameter, tape))
    either = slope(operator, wp.max(a[1], a[2]), wp.max(b[1], b[2]), max_a, max_b, parameter, tape)
    return wp.vec3(value, either, either)


# -- gradient -------------------------------------------------------------------------------------------


@wp.func
def vector_empty() -> wp.vec4:
    """Return the empty field with its gradient, or with its colour."""
    return wp.vec4(0.0, 0.0, 0.0, 0.0)


@wp.func
def gradient_leaf(q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32) -> wp.vec4:
    """Return (value, ∇f) of one primitive."""
    z = squared_distance(q, c)
    g = (q - wp.vec3(c[0], c[1], c[2])) * (2.0 * falloff_derivative(z) / (c[3] * c[3]))
    return wp.vec4(falloff(z), g[0], g[1], g[2])


@wp.func
def gradient_direct(
    kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32, color: wp.vec4, ahead: wp.vec4, speed: wp.float32
) -> wp.vec4:
    """Return (value, ∇f) of a direct field."""
    return direct_value_gradient(kind, q, tape, at)


@wp.func
def profiled_gradient_leaf(
    q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32, profile: wp.vec4
) -> wp.vec4:
    """Return (value, ∇f) of one primitive with a profile; on the skeleton the gradient is 0."""
    u = wp.sqrt(squared_distance(q, c))
    weight = profile[3]
    g = wp.vec3()
    if u > 0.0:
        slope_u = weight * profile_slope(u, profile)
        g = (q - wp.vec3(c[0], c[1], c[2])) * (slope_u / (u * c[3] * c[3]))
    return wp.vec4(weight * profile_value(u, profile), g[0], g[1], g[2])


@wp.func
def gradient_pullback_affine(f: wp.vec4, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (value, ∇f) pulled back by the transposed map."""
    g = tape[at] * f[1] + tape[at + 1] * f[2] + tape[at + 2] * f[3]
    return wp.vec4(f[0], g[0], g[1], g[2])


@wp.func
def gradient_pullback_warp(kind: wp.int32, f: wp.vec4, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (value, ∇f) pulled back by the warp's transposed Jacobian, then by the transposed map."""
    g = warp_pullback(kind, to_local(q, tape, at), wp.vec3(f[1], f[2], f[3]), tape, at + 3)
    return gradient_pullback_affine(wp.vec4(f[0], g[0], g[1], g[2]), tape, at)


@wp.func
def gradient_combine(
    operator: wp.int32, a: wp.vec4, b: wp.vec4, reach: wp.float32, parameter: wp.float32, tape: Texels
) -> wp.vec4:
    """Return (F, ∇F) by the chain rule."""
    p = partials(operator, a[0], b[0], parameter, tape)
    g = a * p[1] + b * p[2]
    return wp.vec4(p[0], g[1], g[2], g[3])


# -- colour ---------------------------------------------------------------------------------------------


@wp.func
def color_leaf(q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32) -> wp.vec4:
    """Return (value, red, green, blue) of one primitive."""
    return wp.vec4(falloff(squared_distance(q, c)), color[0], color[1], color[2])


@wp.func
def color_direct(
    kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32, color: wp.vec4, ahead: wp.vec4, speed: wp.float32
) -> wp.vec4:
    """Return (value, red, green, blue) of a direct field."""
    return wp.vec4(direct_value(kind, q, tape, at), color[0], color[1], color[2])


@wp.func
def profiled_color_leaf(
    q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32, profile: wp.vec4
) -> wp.vec4:
    """Return (value, red, green, blue) of one primitive with a profile."""
    value = profile[3] * profile_value(wp.sqrt(squared_distance(q, c)), profile)
    return wp.vec4(value, color[0], color[1], color[2])


@wp.func
def color_pullback_affine(f: wp.vec4, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return `f`: colours are the same in every space."""
    return f


@wp.func
def color_pullback_warp(kind: wp.int32, f: wp.vec4, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return `f`: colours are the same in every space."""
    return f


@wp.func
def second_share(operator: wp.int32, p: wp.vec3, a: wp.float32, b: wp.float32) -> wp.float32:
    """Return the weight of the second operand's colour, from the operands and F's partial derivatives.

    Colours have the weights |∂F/∂a|·a and |∂F/∂b|·b; if both are 0, the stronger operand's is taken. An
    operator that does not paint keeps the first operand's colour. An operand below 0 gives no colour.
    """
    weight_a = wp.abs(p[1]) * wp.max(a, 0.0)
    weight_b = wp.abs(p[2]) * wp.max(b, 0.0)
    t = float(0.0)
    if b > a:
        t = 1.0
    if weight_a + weight_b > 0.0:
        t = weight_b / (weight_a + weight_b)
    if not paints(operator):
        t = 0.0
    return t


@wp.func
def color_combine(
    operator: wp.int32, a: wp.vec4, b: wp.vec4, reach: wp.float32, parameter: wp.float32, tape: Texels
) -> wp.vec4:
    """Return F and the blended colour."""
    p = partials(operator, a[0], b[0], parameter, tape)
    t = second_share(operator, p, a[0], b[0])
    mixed = a * (1.0 - t) + b * t
    return wp.vec4(p[0], mixed[1], mixed[2], mixed[3])


@wp.func
def own_color(q: wp.vec3, c: wp.vec4, color: wp.vec4, tape: Texels) -> wp.vec4:
    """Return the colour of a leaf."""
    return color


@dataclass(frozen=True)
class Evaluator:
    """The functions over which the interpreter's loop is closed, and the type of their results."""

    leaf: wp.Function
    direct: wp.Function
    profiled_leaf: wp.Function
    pullback_affine: wp.Function
    pullback_warp: wp.Function
    scale_speed: wp.Function
    combine: wp.Function
    empty: wp.Function
    type: Any
    paint: wp.Function = own_color
    way: wp.Function = whole_way


VALUE = Evaluator(
    value_leaf,
    value_direct,
    profiled_value_leaf,
    value_pullback_affine,
    value_pullback_warp,
    constant_speed,
    value_combine,
    value_empty,
    wp.float32,
)
BOUND = Evaluator(
    bound_leaf,
    bound_direct,
    profiled_bound_leaf,
    bound_pullback_affine,
    bound_pullback_warp,
    bound_scale_speed,
    bound_combine,
    bound_empty,
    wp.vec3,
    way=bound_way,
)
GRADIENT = Evaluator(
    gradient_leaf,
    gradient_direct,
    profiled_gradient_leaf,
    gradient_pullback_affine,
    gradient_pullback_warp,
    constant_speed,
    gradient_combine,
    vector_empty,
    wp.vec4,
)
COLOR = Evaluator(
    color_leaf,
    color_direct,
    profiled_color_leaf,
    color_pullback_affine,
    color_pullback_warp,
    constant_speed,
    color_combine,
    vector_empty,
    wp.vec4,
)
