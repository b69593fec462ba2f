"""Evaluation of trees with operators that read the gradients of their operands (`Operator.gradients`).

Every result has a *direction* beside its value. That of a leaf is its gradient. An operator combines the
directions of its operands with its partial derivatives for fixed directions. So the direction is the gradient
itself below the first operator that reads gradients, and above it the gradient with fixed openings. The order
of derivatives does not grow with the depth of a tree.

The gradient of the field is exact: it is the derivative of the value, in which forward mode
(`transpile.derivative`) follows the change of the directions too. An instruction set with such an operator
evaluates with `DIRECTED_EVALUATIONS` in place of the usual functions.

A slope bound needs to know how fast directions turn. `bend` bounds their change per unit of the way ahead. It
is known for sums of plain convex primitives, and `UNBOUNDED` elsewhere; rays then take shorter steps.
"""

from dataclasses import replace
from typing import Any

import warp as wp

from blobtree.declare.claims import UNBOUNDED
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.codes import OPERATORS
from blobtree.tape.dispatch import (
    core_tables,
    directed_partials,
    directed_slope,
    is_monotone,
    reads_gradients,
)
from blobtree.tape.evaluators import (
    BOUND,
    COLOR,
    GRADIENT,
    bound_direct,
    bound_leaf,
    direct_value_gradient,
    gradient_leaf,
    gradient_pullback_affine,
    gradient_pullback_warp,
    profiled_bound_leaf,
    profiled_gradient_leaf,
    second_share,
)
from blobtree.tape.interpreter import (
    field_bound,
    field_color,
    field_gradient,
    field_value,
    make_interpreter,
)
from blobtree.tape.rest_kernels import interpret_rest_coordinates, own_position
from blobtree.texels import Texels
from blobtree.transpile.derivative import directional_derivative

wp.set_module_options(KERNEL_OPTIONS)

core_tables()  # fills the functions that are derived here

SUM_CODE = wp.constant(OPERATORS.index("sum"))

STEEPEST_TURN = wp.constant(6.0)
"""Largest second derivative of (1 − d²)³, which |g'(d)| / d does not exceed either."""

Directed: Any = wp.types.vector(length=8, dtype=wp.float32)
"""Four numbers, then the direction and one number more; in shaders two vectors of four."""


@wp.func
def direction_of(f: wp.vec4) -> wp.vec3:
    """Return the direction of (value, direction)."""
    return wp.vec3(f[1], f[2], f[3])


@wp.func
def later_direction(f: Directed) -> wp.vec3:
    """Return the direction of numbers whose direction comes later."""
    return wp.vec3(f[4], f[5], f[6])


@wp.func
def directed_empty() -> Directed:
    """Return the empty field."""
    return Directed()


# -- value and direction --------------------------------------------------------------------------------


@wp.func
def directed_combine(
    operator: wp.int32, a: wp.vec4, b: wp.vec4, reach: wp.float32, parameter: wp.float32, tape: Texels
) -> wp.vec4:
    """Return F and its direction."""
    p = directed_partials(operator, a[0], b[0], parameter, tape, direction_of(a), direction_of(b))
    d = a * p[1] + b * p[2]
    return wp.vec4(p[0], d[1], d[2], d[3])


DIRECTED = replace(GRADIENT, combine=directed_combine)

interpret_directed = make_interpreter(DIRECTED)


@wp.func
def field_direction(q: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.vec4:
    """Return (value, direction) of the field at q."""
    return interpret_directed(q, wp.vec3(), 0.0, tape, span)


direction_along = directional_derivative(field_direction, ["q"])


@wp.func
def directed_value(q: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.float32:
    """Return the field at q."""
    return field_direction(q, tape, span)[0]


@wp.func
def directed_gradient(q: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.vec4:
    """Return (value, ∂x, ∂y, ∂z) of the field at q."""
    f, by_x = direction_along(q, wp.vec3(1.0, 0.0, 0.0), tape, span)
    f, by_y = direction_along(q, wp.vec3(0.0, 1.0, 0.0), tape, span)
    f, by_z = direction_along(q, wp.vec3(0.0, 0.0, 1.0), tape, span)
    return wp.vec4(f[0], by_x[0], by_y[0], by_z[0])


# -- slope bound: (value, rise, fall, bend), direction ---------------------------------------------------


@wp.func
def with_direction(bound: wp.vec3, bend: wp.float32, f: wp.vec4) -> Directed:
    """Return bounds with the direction of f."""
    return Directed(bound[0], bound[1], bound[2], bend, f[1], f[2], f[3], 0.0)


@wp.func
def directed_bound_leaf(q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32) -> Directed:
    """Return the bounds and the direction of a primitive.

    The gradient of g(d / s), d the distance from a convex skeleton, changes by 6 / s² per unit at most.
    """
    bend = float(UNBOUNDED)
    direction = wp.vec3(ahead[0], ahead[1], ahead[2])
    if wp.dot(direction, direction) > 0.0:
        bend = STEEPEST_TURN * rate * rate
    f = gradient_leaf(q, c, color, ahead, rate)
    return with_direction(bound_leaf(q, c, color, ahead, rate), bend, f)


@wp.func
def directed_bound_direct(
    kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32, color: wp.vec4, ahead: wp.vec4, speed: wp.float32
) -> Directed:
    """Return the bounds and the direction of a direct field."""
    bound = bound_direct(kind, q, tape, at, color, ahead, speed)
    return with_direction(bound, UNBOUNDED, direct_value_gradient(kind, q, tape, at))


@wp.func
def directed_profiled_bound_leaf(
    q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32, profile: wp.vec4
) -> Directed:
    """Return the bounds and the direction of a primitive with a profile."""
    f = profiled_gradient_leaf(q, c, color, ahead, rate, profile)
    bound = profiled_bound_leaf(q, c, color, ahead, rate, profile)
    return with_direction(bound, UNBOUNDED, f)


@wp.func
def directed_pullback_affine(f: Directed, tape: Texels, at: wp.int32) -> Directed:
    """Return `f` with its direction pulled back by the transposed map."""
    g = gradient_pullback_affine(wp.vec4(0.0, f[4], f[5], f[6]), tape, at)
    return Directed(f[0], f[1], f[2], f[3], g[1], g[2], g[3], 0.0)


@wp.func
def directed_pullback_warp(kind: wp.int32, f: Directed, q: wp.vec3, tape: Texels, at: wp.int32) -> Directed:
    """Return `f` with its direction pulled back by a warp."""
    g = gradient_pullback_warp(kind, wp.vec4(0.0, f[4], f[5], f[6]), q, tape, at)
    return Directed(f[0], f[1], f[2], f[3], g[1], g[2], g[3], 0.0)


@wp.func
def directed_bound_pullback_warp(
    kind: wp.int32, f: Directed, q: wp.vec3, tape: Texels, at: wp.int32
) -> Directed:
    """Return `f` with its direction pulled back by a warp, which turns directions by an unknown amount."""
    g = gradient_pullback_warp(kind, wp.vec4(0.0, f[4], f[5], f[6]), q, tape, at)
    return Directed(f[0], f[1], f[2], UNBOUNDED, g[1], g[2], g[3], 0.0)


@wp.func
def turning(f: Directed, reach: wp.float32) -> wp.float32:
    """Return a bound on the angle by which a direction turns per unit ahead."""
    shortest = wp.length(later_direction(f)) - reach * f[3]
    if shortest <= 0.0:
        return UNBOUNDED
    return wp.min(f[3] / shortest, UNBOUNDED)


@wp.func
def directed_bound_combine(
    operator: wp.int32, a: Directed, b: Directed, reach: wp.float32, parameter: wp.float32, tape: Texels
) -> Directed:
    """Return the bounds of F(a, b) as `evaluators.bound_combine` does, and its direction."""
    p = directed_partials(operator, a[0], b[0], parameter, tape, later_direction(a), later_direction(b))
    d = later_direction(a) * p[1] + later_direction(b) * p[2]
    max_a = a[0] + reach * wp.max(a[1], 0.0)
    max_b = b[0] + reach * wp.max(b[1], 0.0)
    rise = float(0.0)
    fall = float(0.0)
    if is_monotone(operator):
        rise = directed_slope(operator, a[1], b[1], max_a, max_b, parameter, tape, 0.0)
        fall = directed_slope(operator, a[2], b[2], max_a, max_b, parameter, tape, 0.0)
    else:
        turn = float(0.0)
        slope_a = wp.max(a[1], a[2])
        slope_b = wp.max(b[1], b[2])
        if reads_gradients(operator):
            slope_a = wp.max(slope_a, 0.0)
            slope_b = wp.max(slope_b, 0.0)
            turn = wp.min(turning(a, reach) + turning(b, reach), UNBOUNDED)
        rise = directed_slope(operator, slope_a, slope_b, max_a, max_b, parameter, tape, turn)
        fall = rise
    bend = float(UNBOUNDED)
    if operator == SUM_CODE:
        bend = wp.min(a[3] + b[3], UNBOUNDED)
    return Directed(p[0], rise, fall, bend, d[0], d[1], d[2], 0.0)


DIRECTED_BOUND = replace(
    BOUND,
    leaf=directed_bound_leaf,
    direct=directed_bound_direct,
    profiled_leaf=directed_profiled_bound_leaf,
    pullback_affine=directed_pullback_affine,
    pullback_warp=directed_bound_pullback_warp,
    combine=directed_bound_combine,
    empty=directed_empty,
    type=Directed,
)

interpret_directed_bound = make_interpreter(DIRECTED_BOUND)


@wp.func
def directed_bound(
    q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, span: wp.vec2i
) -> wp.vec3:
    """Return (value at q, bound on the rise of the field, bound on its fall), see `field_bound`."""
    f = interpret_directed_bound(q, direction, reach, tape, span)
    return wp.vec3(f[0], f[1], f[2])


# -- colour, and rest coordinates: (value, three numbers), direction --------------------------------------


@wp.func
def painted(f: wp.vec4, x: wp.float32, y: wp.float32, z: wp.float32) -> Directed:
    """Return the value of f, three numbers, and the direction of f."""
    return Directed(f[0], x, y, z, f[1], f[2], f[3], 0.0)


@wp.func
def directed_color_leaf(q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32) -> Directed:
    """Return the colour and the direction of a primitive."""
    return painted(gradient_leaf(q, c, color, ahead, rate), color[0], color[1], color[2])


@wp.func
def directed_color_direct(
    kind: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32, color: wp.vec4, ahead: wp.vec4, speed: wp.float32
) -> Directed:
    """Return the colour and the direction of a direct field."""
    return painted(direct_value_gradient(kind, q, tape, at), color[0], color[1], color[2])


@wp.func
def directed_profiled_color_leaf(
    q: wp.vec3, c: wp.vec4, color: wp.vec4, ahead: wp.vec4, rate: wp.float32, profile: wp.vec4
) -> Directed:
    """Return the colour and the direction of a primitive with a profile."""
    f = profiled_gradient_leaf(q, c, color, ahead, rate, profile)
    return painted(f, color[0], color[1], color[2])


@wp.func
def directed_color_combine(
    operator: wp.int32, a: Directed, b: Directed, reach: wp.float32, parameter: wp.float32, tape: Texels
) -> Directed:
    """Return F, the blended colour, and the direction."""
    p = directed_partials(operator, a[0], b[0], parameter, tape, later_direction(a), later_direction(b))
    d = later_direction(a) * p[1] + later_direction(b) * p[2]
    t = second_share(operator, p, a[0], b[0])
    mixed = a * (1.0 - t) + b * t
    return Directed(p[0], mixed[1], mixed[2], mixed[3], d[0], d[1], d[2], 0.0)


DIRECTED_COLOR = replace(
    COLOR,
    leaf=directed_color_leaf,
    direct=directed_color_direct,
    profiled_leaf=directed_profiled_color_leaf,
    pullback_affine=directed_pullback_affine,
    pullback_warp=directed_pullback_warp,
    combine=directed_color_combine,
    empty=directed_empty,
    type=Directed,
)

interpret_directed_color = make_interpreter(DIRECTED_COLOR)


@wp.func
def directed_color(q: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.vec4:
    """Return (value, red, green, blue) of the field at q."""
    f = interpret_directed_color(q, wp.vec3(), 0.0, tape, span)
    return wp.vec4(f[0], f[1], f[2], f[3])


DIRECTED_REST = replace(DIRECTED_COLOR, paint=own_position)

interpret_directed_rest = make_interpreter(DIRECTED_REST)


@wp.func
def directed_rest(q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, span: wp.vec2i) -> wp.vec4:
    """Return (value, rest coordinates) at q."""
    f = interpret_directed_rest(q, direction, reach, tape, span)
    return wp.vec4(f[0], f[1], f[2], f[3])


DIRECTED_EVALUATIONS: dict[Any, Any] = {
    field_value: directed_value,
    field_gradient: directed_gradient,
    field_bound: directed_bound,
    field_color: directed_color,
    interpret_rest_coordinates: directed_rest,
}
"""Evaluations of trees with operators that read gradients, by those of other trees."""
