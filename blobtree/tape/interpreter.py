"""The interpreter of a tape in Warp: one loop, closed over an evaluator.

`shaders/interpreter.glsl` is the same loop in GLSL, closed over the same functions.
"""

from typing import Any

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.codes import (
    FIELD,
    POP,
    POP_SWAPPED,
    PREFIX,
    PUSH,
    REGISTERS,
    STRETCHED,
    UNWARP,
    WARP,
    WARP_REGISTERS,
)
from blobtree.tape.dispatch import (
    closest,
    direct_stride,
    influence_around,
    is_convex,
    stride,
    warp_forward,
)
from blobtree.tape.evaluators import (
    BOUND,
    COLOR,
    GRADIENT,
    VALUE,
    Evaluator,
    direction_to_local,
    to_local,
)
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

_Points = wp.types.matrix(shape=(WARP_REGISTERS, 3), dtype=wp.float32)
_Speeds = wp.types.vector(length=WARP_REGISTERS, dtype=wp.float32)


def _registers(result_type: Any) -> Any:
    """Return the type of the registers for results of a type: a vector, or a matrix with one in each row."""
    if result_type is wp.float32:
        return wp.types.vector(length=REGISTERS, dtype=wp.float32)
    return wp.types.matrix(shape=(REGISTERS, result_type._length_), dtype=wp.float32)


def make_interpreter(evaluator: Evaluator) -> wp.Function:
    """Return the interpreter of an evaluator: a function of (q, direction, reach, tape, span).

    Slopes are bounded from q along `direction` (unit, or 0 for all directions) as far as `reach`. The tape is
    read from texel span[0] up to span[1].
    """
    leaf, direct, combine, empty = evaluator.leaf, evaluator.direct, evaluator.combine, evaluator.empty
    profiled_leaf = evaluator.profiled_leaf
    pullback_affine, pullback_warp = evaluator.pullback_affine, evaluator.pullback_warp
    scale_speed, paint, way = evaluator.scale_speed, evaluator.paint, evaluator.way
    result_type = evaluator.type
    registers_type = _registers(result_type)

    @wp.func
    def fold(
        before: result_type,
        header: wp.vec4,
        point: wp.vec3,
        direction: wp.vec3,
        speed: wp.float32,
        reach: wp.float32,
        tape: Texels,
        first: wp.int32,
    ) -> result_type:
        """Combine the primitives of a run with the accumulator."""
        accumulator = before
        code = int(header[0])
        operator = int(header[1])
        v = direction
        if not is_convex(code):
            v = wp.vec3()
        ahead = wp.vec4(v[0], v[1], v[2], reach)
        texels = stride(code)
        at = first
        for _i in range(int(header[2])):
            c = closest(code, point, tape, at)
            rate = speed / influence_around(code, tape, at, point, c)
            outside = way(code, point, c, ahead, speed, tape, at)
            at += texels
            f = leaf(point, c, paint(point, c, tape[at - 1], tape), outside, rate)
            accumulator = combine(operator, accumulator, f, reach, header[3], tape)
        return accumulator

    @wp.func
    def fold_stretched(
        before: result_type,
        header: wp.vec4,
        point: wp.vec3,
        direction: wp.vec3,
        speed: wp.float32,
        reach: wp.float32,
        tape: Texels,
        first: wp.int32,
    ) -> result_type:
        """Do the same for a run of primitives that carry their own maps, and profiles."""
        accumulator = before
        kind = int(header[0]) - STRETCHED
        operator = int(header[1])
        at = first
        for _i in range(int(header[2])):
            local = to_local(point, tape, at)
            v = direction_to_local(direction, tape, at)
            if not is_convex(kind):
                v = wp.vec3()
            profile = tape[at + 3]
            ahead = wp.vec4(v[0], v[1], v[2], reach)
            c = closest(kind, local, tape, at + PREFIX)
            local_speed = speed * profile[0]
            ahead = way(kind, local, c, ahead, local_speed, tape, at + PREFIX)
            rate = local_speed / influence_around(kind, tape, at + PREFIX, local, c)
            end = at + PREFIX + stride(kind)
            color = paint(local, c, tape[end - 1], tape)
            f = empty()
            if profile[2] == 0.0:
                f = leaf(local, c, color, ahead, rate)
            else:
                f = profiled_leaf(local, c, color, ahead, rate, profile)
            accumulator = combine(operator, accumulator, pullback_affine(f, tape, at), reach, header[3], tape)
            at = end
        return accumulator

    @wp.func
    def fold_direct(
        before: result_type,
        header: wp.vec4,
        point: wp.vec3,
        direction: wp.vec3,
        speed: wp.float32,
        reach: wp.float32,
        tape: Texels,
        first: wp.int32,
    ) -> result_type:
        """Do the same for a run of direct fields, each behind its map."""
        accumulator = before
        kind = int(header[0]) - FIELD
        operator = int(header[1])
        at = first
        for _i in range(int(header[2])):
            local = to_local(point, tape, at)
            v = direction_to_local(direction, tape, at)
            ahead = wp.vec4(v[0], v[1], v[2], reach)
            end = at + PREFIX + direct_stride(kind)
            color = paint(local, wp.vec4(local[0], local[1], local[2], 1.0), tape[end - 1], tape)
            f = direct(kind, local, tape, at + PREFIX, color, ahead, speed * tape[at + 3][0])
            accumulator = combine(operator, accumulator, pullback_affine(f, tape, at), reach, header[3], tape)
            at = end
        return accumulator

    @wp.func
    def walk(q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, span: wp.vec2i) -> result_type:
        """Execute the instructions one after the other."""
        accumulator = empty()
        registers = registers_type()
        point = q
        local_direction = direction
        speed = float(1.0)
        points = _Points()
        speeds = _Speeds()
        at = span[0]
        while at < span[1]:
            header = tape[at]
            code = int(header[0])
            operator = int(header[1])
            count = int(header[2])
            at += 1
            if code >= FIELD:
                accumulator = fold_direct(accumulator, header, point, local_direction, speed, reach, tape, at)
                at += count * (PREFIX + direct_stride(code - FIELD))
            elif code >= STRETCHED:
                accumulator = fold_stretched(
                    accumulator, header, point, local_direction, speed, reach, tape, at
                )
                at += count * (PREFIX + stride(code - STRETCHED))
            elif code >= 0:
                accumulator = fold(accumulator, header, point, local_direction, speed, reach, tape, at)
                at += count * stride(code)
            elif code == PUSH:
                registers[count] = accumulator
                accumulator = empty()
            elif code == POP:
                accumulator = combine(operator, registers[count], accumulator, reach, header[3], tape)
            elif code == POP_SWAPPED:
                accumulator = combine(operator, accumulator, registers[count], reach, header[3], tape)
            elif code == WARP:
                points[count] = point
                speeds[count] = speed
                local = to_local(point, tape, at)
                speed = scale_speed(operator, local, speed * tape[at + 3][0], reach, tape, at + 3)
                local_direction = wp.vec3()
                point = warp_forward(operator, local, tape, at + 3)
                at += PREFIX + int(header[3])
            elif code == UNWARP:
                point = points[count]
                speed = speeds[count]
                if count == 0:
                    local_direction = direction  # between two warps it stays 0
                accumulator = pullback_warp(operator, accumulator, point, tape, at)
                at += PREFIX + int(header[3])
        return accumulator

    @wp.func
    def interpret(
        q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, span: wp.vec2i
    ) -> result_type:
        """Execute the tape, without registers if it is a single run: on a GPU they cost more than the run."""
        if span[0] < span[1]:
            header = tape[span[0]]
            code = int(header[0])
            end = span[0] + 1 + int(header[2]) * stride(code)
            if code >= 0 and code < STRETCHED and end == span[1]:
                return fold(empty(), header, q, direction, 1.0, reach, tape, span[0] + 1)
        return walk(q, direction, reach, tape, span)

    return interpret


interpret_value = make_interpreter(VALUE)
interpret_bound = make_interpreter(BOUND)
interpret_gradient = make_interpreter(GRADIENT)
interpret_color = make_interpreter(COLOR)


@wp.func
def field_value(q: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.float32:
    """Return the field at q."""
    return interpret_value(q, wp.vec3(), 0.0, tape, span)


@wp.func
def field_gradient(q: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.vec4:
    """Return (value, ∂x, ∂y, ∂z) of the field at q."""
    return interpret_gradient(q, wp.vec3(), 0.0, tape, span)


@wp.func
def field_bound(q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, span: wp.vec2i) -> wp.vec3:
    """Return (value at q, bound on the rise of the field, bound on its fall) along `direction` up to `reach`.

    With a direction of 0 both bound |f(x) − f(q)| / |x − q| for all x in the ball of radius `reach` about q.
    """
    return interpret_bound(q, direction, reach, tape, span)


@wp.func
def field_color(q: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.vec4:
    """Return (value, red, green, blue) of the field at q."""
    return interpret_color(q, wp.vec3(), 0.0, tape, span)
