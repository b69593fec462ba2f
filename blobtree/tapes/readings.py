"""Four readings of a tape: value, slope bound, gradient, colour.

Each is the functions that the interpreter's loop is closed over:

* `leaf(q, aim, speed, reach, c, slim, color)`: what a primitive contributes, c being its closest point and
  influence there, slim the smallest influence on it;
* `unstretch(f, tape, at)`: that, computed behind the map at tape[at], as seen in front of it;
* `unwarp(kind, f, q, tape, at)`: the same for a subtree behind a warp and the map at tape[at];
* `hasten(kind, q, speed, reach, p)`: how fast, behind a warp, that moves at most which moves with `speed` in
  front of it;
* `combine(operator, a, b, reach, parameter)`, and the `empty` field.

Slopes are bounded along a ray (segment tracing: Galin, Guérin, Paris and Peytavie 2020): q + u · aim for u
from 0 to `reach`, per unit of u. Behind an affine map the ray is a line still, and `aim` says which; behind a
warp it is bent, and for a skeleton that is not convex the line tells little: then `aim` is 0, and all that is
known is that the point moves at most as fast as `speed`. With aim 0 from the start, bounds hold in all
directions.
"""

from dataclasses import dataclass
from typing import Any

import warp as wp

from blobtree.formulas.kernels import (
    falloff,
    falloff_derivative,
    falloff_shallowest,
    falloff_slope_bound,
    falloff_steepest,
)
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.tapes.dispatch import partials, rises, slope, warp_pullback, warp_stretch

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def to_local(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec3:
    """`q` in the space of the stretched primitive whose map starts at `at`."""
    x = wp.vec4(q[0], q[1], q[2], 1.0)
    return wp.vec3(wp.dot(tape[at], x), wp.dot(tape[at + 1], x), wp.dot(tape[at + 2], x))


@wp.func
def turned_to_local(v: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec3:
    """A direction in the space of the stretched primitive whose map starts at `at`."""
    x = wp.vec4(v[0], v[1], v[2], 0.0)
    return wp.vec3(wp.dot(tape[at], x), wp.dot(tape[at + 1], x), wp.dot(tape[at + 2], x))


@wp.func
def squared_distance(q: wp.vec3, c: wp.vec4) -> wp.float32:
    """(|q − c| / influence)² for c = (closest point, influence)."""
    w = q - wp.vec3(c[0], c[1], c[2])
    return wp.dot(w, w) / (c[3] * c[3])


@wp.func
def value_empty() -> wp.float32:
    """The empty field."""
    return 0.0


@wp.func
def value_leaf(
    q: wp.vec3,
    aim: wp.vec3,
    speed: wp.float32,
    reach: wp.float32,
    c: wp.vec4,
    slim: wp.float32,
    color: wp.vec4,
) -> wp.float32:
    """Field of one primitive."""
    return falloff(squared_distance(q, c))


@wp.func
def value_unstretch(f: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.float32:
    """A value is the same in every space."""
    return f


@wp.func
def value_unwarp(
    kind: wp.int32, f: wp.float32, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.float32:
    """A value is the same in every space."""
    return f


@wp.func
def pointwise_hasten(
    kind: wp.int32, q: wp.vec3, speed: wp.float32, reach: wp.float32, p: wp.vec4
) -> wp.float32:
    """What holds at a point alone does not ask."""
    return speed


@wp.func
def value_combine(
    operator: wp.int32, a: wp.float32, b: wp.float32, reach: wp.float32, parameter: wp.float32
) -> wp.float32:
    """F(a, b)."""
    return partials(operator, a, b, parameter)[0]


@wp.func
def bound_empty() -> wp.vec3:
    """The empty field is 0 and flat."""
    return wp.vec3(0.0, 0.0, 0.0)


@wp.func
def bound_leaf(
    q: wp.vec3,
    aim: wp.vec3,
    speed: wp.float32,
    reach: wp.float32,
    c: wp.vec4,
    slim: wp.float32,
    color: wp.vec4,
) -> wp.vec3:
    """(value at q, how fast it rises at most on the way ahead, how fast it falls at most).

    The distance d from a convex skeleton is a convex function along a line: nowhere ahead does it grow less
    fast, or shrink faster, than here. Where it shrinks, that bounds how fast the field rises, and how near to
    the skeleton the way leads. Where it grows, the field falls, and the first number is not above 0.
    """
    z = squared_distance(q, c)
    d = wp.sqrt(z)
    most = speed / slim
    if wp.dot(aim, aim) == 0.0:
        either = most * falloff_slope_bound(d, reach * most)
        return wp.vec3(falloff(z), either, either)
    growing = most
    if d > 0.0:
        w = q - wp.vec3(c[0], c[1], c[2])
        growing = wp.dot(w, aim) / (d * c[3] * c[3])
    nearest = wp.max(d + wp.min(growing, 0.0) * reach, 0.0)
    farthest = d + most * reach
    rise = -growing * falloff_steepest(nearest, d)
    if growing > 0.0:
        rise = -growing * falloff_shallowest(d, farthest)
    return wp.vec3(falloff(z), rise, most * falloff_steepest(nearest, farthest))


@wp.func
def bound_unstretch(f: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec3:
    """Slopes along the ray are the same in every space."""
    return f


@wp.func
def bound_unwarp(
    kind: wp.int32, f: wp.vec3, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec3:
    """Slopes along the ray are the same in every space."""
    return f


@wp.func
def bound_hasten(kind: wp.int32, q: wp.vec3, speed: wp.float32, reach: wp.float32, p: wp.vec4) -> wp.float32:
    """Faster by the warp's largest stretch in the ball that can be reached."""
    return speed * warp_stretch(kind, q, reach * speed, p)


@wp.func
def bound_combine(
    operator: wp.int32, a: wp.vec3, b: wp.vec3, reach: wp.float32, parameter: wp.float32
) -> wp.vec3:
    """Ahead, an operand exceeds its value at q by at most reach · how fast it rises.

    An operator's `slope` bounds what its result rises by what its operands rise, if they never make it fall.
    """
    value = partials(operator, a[0], b[0], parameter)[0]
    max_a = a[0] + reach * wp.max(a[1], 0.0)
    max_b = b[0] + reach * wp.max(b[1], 0.0)
    if rises(operator):
        rise = slope(operator, a[1], b[1], max_a, max_b, parameter)
        return wp.vec3(value, rise, slope(operator, a[2], b[2], max_a, max_b, parameter))
    either = slope(operator, wp.max(a[1], a[2]), wp.max(b[1], b[2]), max_a, max_b, parameter)
    return wp.vec3(value, either, either)


@wp.func
def vector_empty() -> wp.vec4:
    """The empty field with its gradient, or its colour."""
    return wp.vec4(0.0, 0.0, 0.0, 0.0)


@wp.func
def gradient_leaf(
    q: wp.vec3,
    aim: wp.vec3,
    speed: wp.float32,
    reach: wp.float32,
    c: wp.vec4,
    slim: wp.float32,
    color: wp.vec4,
) -> wp.vec4:
    """(value, ∇f) of one primitive."""
    z = squared_distance(q, c)
    g = (q - wp.vec3(c[0], c[1], c[2])) * (2.0 * falloff_derivative(z) / (c[3] * c[3]))
    return wp.vec4(falloff(z), g[0], g[1], g[2])


@wp.func
def gradient_unstretch(f: wp.vec4, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """Gradients pull back by the transposed map."""
    g = tape[at] * f[1] + tape[at + 1] * f[2] + tape[at + 2] * f[3]
    return wp.vec4(f[0], g[0], g[1], g[2])


@wp.func
def gradient_unwarp(
    kind: wp.int32, f: wp.vec4, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec4:
    """Gradients pull back by the warp's transposed Jacobian, then by the transposed map."""
    p = tape[at + 3]
    g = warp_pullback(kind, to_local(q, tape, at), wp.vec3(f[1], f[2], f[3]), p)
    return gradient_unstretch(wp.vec4(f[0], g[0], g[1], g[2]), tape, at)


@wp.func
def gradient_combine(
    operator: wp.int32, a: wp.vec4, b: wp.vec4, reach: wp.float32, parameter: wp.float32
) -> wp.vec4:
    """The chain rule."""
    p = partials(operator, a[0], b[0], parameter)
    g = a * p[1] + b * p[2]
    return wp.vec4(p[0], g[1], g[2], g[3])


@wp.func
def color_leaf(
    q: wp.vec3,
    aim: wp.vec3,
    speed: wp.float32,
    reach: wp.float32,
    c: wp.vec4,
    slim: wp.float32,
    color: wp.vec4,
) -> wp.vec4:
    """(value, red, green, blue) of one primitive."""
    return wp.vec4(falloff(squared_distance(q, c)), color[0], color[1], color[2])


@wp.func
def color_unstretch(f: wp.vec4, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """Colours are the same in every space."""
    return f


@wp.func
def color_unwarp(
    kind: wp.int32, f: wp.vec4, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec4:
    """Colours are the same in every space."""
    return f


@wp.func
def color_combine(
    operator: wp.int32, a: wp.vec4, b: wp.vec4, reach: wp.float32, parameter: wp.float32
) -> wp.vec4:
    """Colours weighted by |∂F/∂a|·a and |∂F/∂b|·b, the stronger operand's where both vanish."""
    p = partials(operator, a[0], b[0], parameter)
    weight_a = wp.abs(p[1]) * a[0]
    weight_b = wp.abs(p[2]) * b[0]
    share = float(0.0)
    if b[0] > a[0]:
        share = 1.0
    if weight_a + weight_b > 0.0:
        share = weight_b / (weight_a + weight_b)
    mixed = a * (1.0 - share) + b * share
    return wp.vec4(p[0], mixed[1], mixed[2], mixed[3])


@dataclass(frozen=True)
class Reading:
    """One way to read a tape: the functions that the interpreter's loop is closed over."""

    leaf: wp.Function
    unstretch: wp.Function
    unwarp: wp.Function
    hasten: wp.Function
    combine: wp.Function
    empty: wp.Function
    type: Any


VALUE = Reading(
    value_leaf, value_unstretch, value_unwarp, pointwise_hasten, value_combine, value_empty, wp.float32
)
BOUND = Reading(bound_leaf, bound_unstretch, bound_unwarp, bound_hasten, bound_combine, bound_empty, wp.vec3)
GRADIENT = Reading(
    gradient_leaf,
    gradient_unstretch,
    gradient_unwarp,
    pointwise_hasten,
    gradient_combine,
    vector_empty,
    wp.vec4,
)
COLOR = Reading(
    color_leaf, color_unstretch, color_unwarp, pointwise_hasten, color_combine, vector_empty, wp.vec4
)
