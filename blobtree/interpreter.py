"""The tape's interpreter in Warp: one loop, closed over a reading.

`shaders/interpreter.glsl` is the same loop in GLSL, closed over the same functions.
"""

from typing import Any

import warp as wp

from .dispatch import closest, slimmest, stride, warp_forward
from .kernel_options import KERNEL_OPTIONS
from .readings import BOUND, COLOR, GRADIENT, VALUE, Reading, to_local
from .tape import (
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

wp.set_module_options(KERNEL_OPTIONS)

_Places = wp.types.matrix(shape=(WARP_REGISTERS, 3), dtype=wp.float32)
_Balls = wp.types.vector(length=WARP_REGISTERS, dtype=wp.float32)


def make_interpreter(reading: Reading, registers_type: Any) -> wp.Function:
    """The interpreter of one reading: (q, reach, tape, span), span being (first texel, one past the last)."""
    leaf, combine, empty = reading.leaf, reading.combine, reading.empty
    unstretch, unwarp, widen = reading.unstretch, reading.unwarp, reading.widen
    contribution = reading.type

    @wp.func
    def interpret(
        q: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
    ) -> contribution:
        accumulator = empty()
        registers = registers_type()
        place = q
        ball = reach
        places = _Places()
        balls = _Balls()
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
                    local = to_local(place, tape, at)
                    c = closest(kind, local, tape, at + PREFIX)
                    slim = slimmest(kind, tape, at + PREFIX)
                    end = at + PREFIX + stride(kind)
                    f = unstretch(leaf(local, c, slim, ball * tape[at + 3][0], tape[end - 1]), tape, at)
                    accumulator = combine(operator, accumulator, f, ball, parameter)
                    at = end
            elif code >= 0:
                for _i in range(count):
                    c = closest(code, place, tape, at)
                    slim = slimmest(code, tape, at)
                    at += stride(code)
                    f = leaf(place, c, slim, ball, tape[at - 1])
                    accumulator = combine(operator, accumulator, f, ball, parameter)
            elif code == PUSH:
                registers[count] = accumulator
                accumulator = empty()
            elif code == POP:
                accumulator = combine(operator, registers[count], accumulator, ball, parameter)
            elif code == POP_SWAPPED:
                accumulator = combine(operator, accumulator, registers[count], ball, parameter)
            elif code == WARP:
                places[count] = place
                balls[count] = ball
                p = tape[at + 3]
                local = to_local(place, tape, at)
                ball = widen(operator, local, ball * p[0], p)
                place = warp_forward(operator, local, p)
                at += PREFIX
            elif code == UNWARP:
                place = places[count]
                ball = balls[count]
                accumulator = unwarp(operator, accumulator, place, ball, tape, at)
                at += PREFIX
        return accumulator

    return interpret


_Registers1 = wp.types.vector(length=REGISTERS, dtype=wp.float32)
_Registers2 = wp.types.matrix(shape=(REGISTERS, 2), dtype=wp.float32)
_Registers4 = wp.types.matrix(shape=(REGISTERS, 4), dtype=wp.float32)

interpret_value = make_interpreter(VALUE, _Registers1)
interpret_bound = make_interpreter(BOUND, _Registers2)
interpret_gradient = make_interpreter(GRADIENT, _Registers4)
interpret_color = make_interpreter(COLOR, _Registers4)
