"""Four readings of a tape: value, slope bound over a ball, gradient, colour.

Each is the functions that the interpreter's loop is closed over:

* `leaf(q, c, slim, reach, color)`: what a primitive contributes, c being its closest point and influence
  there, slim the smallest influence on it;
* `unstretch(f, tape, at)`: that, computed behind the map at tape[at], as seen in front of it;
* `unwarp(kind, f, q, reach, tape, at)`: the same for a subtree behind a warp and the map at tape[at];
* `widen(kind, q, reach, p)`: the radius behind a warp of the ball of radius `reach` about q, where the
  reading looks at it;
* `combine(operator, a, b, reach, parameter)`, and the `empty` field.
"""

from dataclasses import dataclass
from typing import Any

import warp as wp

from .dispatch import partials, slope, warp_pullback, warp_stretch
from .kernel_options import KERNEL_OPTIONS
from .kernels import falloff, falloff_derivative, falloff_slope_bound

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def to_local(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec3:
    """`q` in the space of the stretched primitive whose map starts at `at`."""
    x = wp.vec4(q[0], q[1], q[2], 1.0)
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
def value_leaf(q: wp.vec3, c: wp.vec4, slim: wp.float32, reach: wp.float32, color: wp.vec4) -> wp.float32:
    """Field of one primitive."""
    return falloff(squared_distance(q, c))


@wp.func
def value_unstretch(f: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.float32:
    """A value is the same in every space."""
    return f


@wp.func
def value_unwarp(
    kind: wp.int32, f: wp.float32, q: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.float32:
    """A value is the same in every space."""
    return f


@wp.func
def pointwise_widen(kind: wp.int32, q: wp.vec3, reach: wp.float32, p: wp.vec4) -> wp.float32:
    """What holds at a point alone looks at no ball: it is handed through."""
    return reach


@wp.func
def value_combine(
    operator: wp.int32, a: wp.float32, b: wp.float32, reach: wp.float32, parameter: wp.float32
) -> wp.float32:
    """F(a, b)."""
    return partials(operator, a, b, parameter)[0]


@wp.func
def bound_empty() -> wp.vec2:
    """The empty field is 0 and flat."""
    return wp.vec2(0.0, 0.0)


@wp.func
def bound_leaf(q: wp.vec3, c: wp.vec4, slim: wp.float32, reach: wp.float32, color: wp.vec4) -> wp.vec2:
    """(value at q, bound on |∇f| over the ball of radius `reach` about q)."""
    z = squared_distance(q, c)
    return wp.vec2(falloff(z), falloff_slope_bound(wp.sqrt(z), reach / slim) / slim)


@wp.func
def bound_unstretch(f: wp.vec2, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec2:
    """Slopes grow by the largest stretch of the map."""
    return wp.vec2(f[0], f[1] * tape[at + 3][0])


@wp.func
def bound_unwarp(
    kind: wp.int32, f: wp.vec2, q: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec2:
    """Slopes grow by the largest stretch of the warp behind the map."""
    p = tape[at + 3]
    stretch = warp_stretch(kind, to_local(q, tape, at), reach * p[0], p)
    return wp.vec2(f[0], f[1] * p[0] * stretch)


@wp.func
def bound_widen(kind: wp.int32, q: wp.vec3, reach: wp.float32, p: wp.vec4) -> wp.float32:
    """A ball's image lies in the ball that the warp's largest stretch makes of it."""
    return reach * warp_stretch(kind, q, reach, p)


@wp.func
def bound_combine(
    operator: wp.int32, a: wp.vec2, b: wp.vec2, reach: wp.float32, parameter: wp.float32
) -> wp.vec2:
    """Within `reach`, an operand exceeds its value at q by at most reach · slope."""
    value = partials(operator, a[0], b[0], parameter)[0]
    return wp.vec2(value, slope(operator, a[1], b[1], a[0] + reach * a[1], b[0] + reach * b[1], parameter))


@wp.func
def vector_empty() -> wp.vec4:
    """The empty field with its gradient, or its colour."""
    return wp.vec4(0.0, 0.0, 0.0, 0.0)


@wp.func
def gradient_leaf(q: wp.vec3, c: wp.vec4, slim: wp.float32, reach: wp.float32, color: wp.vec4) -> wp.vec4:
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
    kind: wp.int32, f: wp.vec4, q: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
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
def color_leaf(q: wp.vec3, c: wp.vec4, slim: wp.float32, reach: wp.float32, color: wp.vec4) -> wp.vec4:
    """(value, red, green, blue) of one primitive."""
    return wp.vec4(falloff(squared_distance(q, c)), color[0], color[1], color[2])


@wp.func
def color_unstretch(f: wp.vec4, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """Colours are the same in every space."""
    return f


@wp.func
def color_unwarp(
    kind: wp.int32, f: wp.vec4, q: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
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
    widen: wp.Function
    combine: wp.Function
    empty: wp.Function
    type: Any


VALUE = Reading(
    value_leaf, value_unstretch, value_unwarp, pointwise_widen, value_combine, value_empty, wp.float32
)
BOUND = Reading(bound_leaf, bound_unstretch, bound_unwarp, bound_widen, bound_combine, bound_empty, wp.vec2)
GRADIENT = Reading(
    gradient_leaf,
    gradient_unstretch,
    gradient_unwarp,
    pointwise_widen,
    gradient_combine,
    vector_empty,
    wp.vec4,
)
COLOR = Reading(
    color_leaf, color_unstretch, color_unwarp, pointwise_widen, color_combine, vector_empty, wp.vec4
)
