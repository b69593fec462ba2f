"""The tape's interpreter in Warp, in four readings: value, gradient, colour, and bound over a ball.

One loop serves all four; `shaders/interpreter.glsl` is the same loop in GLSL, closed over the same functions.
"""

from dataclasses import dataclass
from typing import Any

import warp as wp

from .kernel_options import KERNEL_OPTIONS
from .kernels import falloff, falloff_derivative, falloff_slope_bound
from .operators import OPERATORS
from .skeletons import SKELETONS
from .tape import POP, POP_SWAPPED, PREFIX, PUSH, REGISTERS, STRETCHED

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def closest(kind: wp.int32, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """Closest point and influence of a skeleton of any kind."""
    result = wp.vec4()
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = wp.static(SKELETONS[code].closest)(q, tape, at)
    return result


@wp.func
def stride(kind: wp.int32) -> wp.int32:
    """Texels of a primitive of any kind: its parameters and its colour."""
    result = int(0)
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = wp.static(SKELETONS[code].parameters + 1)
    return result


@wp.func
def partials(operator: wp.int32, a: wp.float32, b: wp.float32, parameter: wp.float32) -> wp.vec3:
    """Value and partial derivatives of any operator."""
    result = wp.vec3()
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].partials)(a, b, parameter)
    return result


@wp.func
def slope(
    operator: wp.int32,
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
) -> wp.float32:
    """Bound on the slope of any operator."""
    result = float(0.0)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].slope)(slope_a, slope_b, max_a, max_b, parameter)
    return result


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


# -- readings -----------------------------------------------------------------------------------------
# leaf(q, c, reach, color): what a primitive with closest point c contributes at q
# unstretch(f, tape, at):   that contribution, computed in the primitive's own space, in the world's
# combine(operator, a, b, reach, parameter)


@wp.func
def value_empty() -> wp.float32:
    """The empty field."""
    return 0.0


@wp.func
def value_leaf(q: wp.vec3, c: wp.vec4, reach: wp.float32, color: wp.vec4) -> wp.float32:
    """Field of one primitive."""
    return falloff(squared_distance(q, c))


@wp.func
def value_unstretch(f: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.float32:
    """A value is the same in every space."""
    return f


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
def bound_leaf(q: wp.vec3, c: wp.vec4, reach: wp.float32, color: wp.vec4) -> wp.vec2:
    """(value at q, bound on |∇f| over the ball of radius `reach` about q)."""
    z = squared_distance(q, c)
    return wp.vec2(falloff(z), falloff_slope_bound(wp.sqrt(z), reach / c[3]) / c[3])


@wp.func
def bound_unstretch(f: wp.vec2, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec2:
    """Slopes grow by the largest stretch of the map."""
    return wp.vec2(f[0], f[1] * tape[at + 3][0])


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
def gradient_leaf(q: wp.vec3, c: wp.vec4, reach: wp.float32, color: wp.vec4) -> wp.vec4:
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
def gradient_combine(
    operator: wp.int32, a: wp.vec4, b: wp.vec4, reach: wp.float32, parameter: wp.float32
) -> wp.vec4:
    """The chain rule."""
    p = partials(operator, a[0], b[0], parameter)
    g = a * p[1] + b * p[2]
    return wp.vec4(p[0], g[1], g[2], g[3])


@wp.func
def color_leaf(q: wp.vec3, c: wp.vec4, reach: wp.float32, color: wp.vec4) -> wp.vec4:
    """(value, red, green, blue) of one primitive."""
    return wp.vec4(falloff(squared_distance(q, c)), color[0], color[1], color[2])


@wp.func
def color_unstretch(f: wp.vec4, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
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


# -- the loop -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Reading:
    """One way to read a tape: the functions that the interpreter's loop is closed over."""

    leaf: wp.Function
    unstretch: wp.Function
    combine: wp.Function
    empty: wp.Function
    type: Any


VALUE = Reading(value_leaf, value_unstretch, value_combine, value_empty, wp.float32)
BOUND = Reading(bound_leaf, bound_unstretch, bound_combine, bound_empty, wp.vec2)
GRADIENT = Reading(gradient_leaf, gradient_unstretch, gradient_combine, vector_empty, wp.vec4)
COLOR = Reading(color_leaf, color_unstretch, color_combine, vector_empty, wp.vec4)


def make_interpreter(reading: Reading, registers_type: Any) -> wp.Function:
    """The interpreter of one reading: (q, reach, tape, span), span being (first texel, one past the last)."""
    leaf, unstretch, combine, empty = reading.leaf, reading.unstretch, reading.combine, reading.empty
    contribution = reading.type

    @wp.func
    def interpret(
        q: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
    ) -> contribution:
        accumulator = empty()
        registers = registers_type()
        at = span[0]
        while at < span[1]:
            header = tape[at]
            code = int(header[0])
            operator = int(header[1])
            count = int(header[2])
            parameter = header[3]
            at += 1
            if code >= STRETCHED:
                kind = code - STRETCHED
                for _i in range(count):
                    local = to_local(q, tape, at)
                    c = closest(kind, local, tape, at + PREFIX)
                    next_at = at + PREFIX + stride(kind)
                    f = unstretch(leaf(local, c, reach * tape[at + 3][0], tape[next_at - 1]), tape, at)
                    accumulator = combine(operator, accumulator, f, reach, parameter)
                    at = next_at
            elif code >= 0:
                for _i in range(count):
                    c = closest(code, q, tape, at)
                    at += stride(code)
                    accumulator = combine(
                        operator, accumulator, leaf(q, c, reach, tape[at - 1]), reach, parameter
                    )
            elif code == PUSH:
                registers[count] = accumulator
                accumulator = empty()
            elif code == POP:
                accumulator = combine(operator, registers[count], accumulator, reach, parameter)
            elif code == POP_SWAPPED:
                accumulator = combine(operator, accumulator, registers[count], reach, parameter)
        return accumulator

    return interpret


_Registers1 = wp.types.vector(length=REGISTERS, dtype=wp.float32)
_Registers2 = wp.types.matrix(shape=(REGISTERS, 2), dtype=wp.float32)
_Registers4 = wp.types.matrix(shape=(REGISTERS, 4), dtype=wp.float32)

interpret_value = make_interpreter(VALUE, _Registers1)
interpret_bound = make_interpreter(BOUND, _Registers2)
interpret_gradient = make_interpreter(GRADIENT, _Registers4)
interpret_color = make_interpreter(COLOR, _Registers4)
