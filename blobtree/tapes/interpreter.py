"""The tape's interpreter in Warp: one loop, closed over a reading.

`shaders/interpreter.glsl` is the same loop in GLSL, closed over the same functions.
"""

from typing import Any

import warp as wp

from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.tapes.dispatch import closest, convex, slimmest, stride, warp_forward
from blobtree.tapes.readings import BOUND, COLOR, GRADIENT, VALUE, Reading, to_local, turned_to_local
from blobtree.tapes.tape import (
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
_Speeds = wp.types.vector(length=WARP_REGISTERS, dtype=wp.float32)


def make_interpreter(reading: Reading, registers_type: Any) -> wp.Function:
    """The interpreter of one reading: (q, heading, reach, tape, span).

    Slopes are bounded on the way from q along `heading` (unit, or 0 for all directions), `reach` far; the
    tape is read from texel span[0] up to span[1].
    """
    leaf, combine, empty = reading.leaf, reading.combine, reading.empty
    unstretch, unwarp, hasten = reading.unstretch, reading.unwarp, reading.hasten
    contribution = reading.type

    @wp.func
    def fold(
        before: contribution,
        header: wp.vec4,
        place: wp.vec3,
        aim: wp.vec3,
        speed: wp.float32,
        reach: wp.float32,
        tape: wp.array(dtype=wp.vec4),
        first: wp.int32,
    ) -> contribution:
        accumulator = before
        code = int(header[0])
        operator = int(header[1])
        v = aim
        if not convex(code):
            v = wp.vec3()
        texels = stride(code)
        at = first
        for _i in range(int(header[2])):
            c = closest(code, place, tape, at)
            slim = slimmest(code, tape, at)
            at += texels
            f = leaf(place, v, speed, reach, c, slim, tape[at - 1])
            accumulator = combine(operator, accumulator, f, reach, header[3])
        return accumulator

    @wp.func
    def walk(
        q: wp.vec3, heading: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
    ) -> contribution:
        accumulator = empty()
        registers = registers_type()
        place = q
        aim = heading
        speed = float(1.0)
        places = _Places()
        speeds = _Speeds()
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
                    v = turned_to_local(aim, tape, at)
                    if not convex(kind):
                        v = wp.vec3()
                    c = closest(kind, local, tape, at + PREFIX)
                    slim = slimmest(kind, tape, at + PREFIX)
                    end = at + PREFIX + stride(kind)
                    f = leaf(local, v, speed * tape[at + 3][0], reach, c, slim, tape[end - 1])
                    accumulator = combine(operator, accumulator, unstretch(f, tape, at), reach, parameter)
                    at = end
            elif code >= 0:
                accumulator = fold(accumulator, header, place, aim, speed, reach, tape, at)
                at += count * stride(code)
            elif code == PUSH:
                registers[count] = accumulator
                accumulator = empty()
            elif code == POP:
                accumulator = combine(operator, registers[count], accumulator, reach, parameter)
            elif code == POP_SWAPPED:
                accumulator = combine(operator, accumulator, registers[count], reach, parameter)
            elif code == WARP:
                places[count] = place
                speeds[count] = speed
                p = tape[at + 3]
                local = to_local(place, tape, at)
                speed = hasten(operator, local, speed * p[0], reach, p)
                aim = wp.vec3()
                place = warp_forward(operator, local, p)
                at += PREFIX
            elif code == UNWARP:
                place = places[count]
                speed = speeds[count]
                if count == 0:
                    aim = heading  # behind another warp still there is none
                accumulator = unwarp(operator, accumulator, place, tape, at)
                at += PREFIX
        return accumulator

    @wp.func
    def interpret(
        q: wp.vec3, heading: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
    ) -> contribution:
        if span[0] < span[1]:  # a single run asks for no registers: on a GPU they cost more than the run
            header = tape[span[0]]
            code = int(header[0])
            end = span[0] + 1 + int(header[2]) * stride(code)
            if code >= 0 and code < STRETCHED and end == span[1]:
                return fold(empty(), header, q, heading, 1.0, reach, tape, span[0] + 1)
        return walk(q, heading, reach, tape, span)

    return interpret


_Registers1 = wp.types.vector(length=REGISTERS, dtype=wp.float32)
_Registers3 = wp.types.matrix(shape=(REGISTERS, 3), dtype=wp.float32)
_Registers4 = wp.types.matrix(shape=(REGISTERS, 4), dtype=wp.float32)

interpret_value = make_interpreter(VALUE, _Registers1)
interpret_bound = make_interpreter(BOUND, _Registers3)
interpret_gradient = make_interpreter(GRADIENT, _Registers4)
interpret_color = make_interpreter(COLOR, _Registers4)
