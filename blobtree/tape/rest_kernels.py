"""Rest coordinates: the point in the space of each primitive, blended with the weights of colours."""

from dataclasses import replace

import warp as wp

from blobtree.formulas.falloff import falloff
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.codes import REGISTERS
from blobtree.tape.dispatch import direct_value_gradient
from blobtree.tape.evaluators import COLOR, squared_distance
from blobtree.tape.interpreter import make_interpreter

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def rest_leaf(
    q: wp.vec3, c: wp.vec4, color: wp.vec4, direction: wp.vec3, reach: wp.float32, rate: wp.float32
) -> wp.vec4:
    """Return (value, the point in the primitive's space)."""
    return wp.vec4(falloff(squared_distance(q, c)), q[0], q[1], q[2])


@wp.func
def rest_direct(
    kind: wp.int32,
    q: wp.vec3,
    tape: wp.array(dtype=wp.vec4),
    at: wp.int32,
    color: wp.vec4,
    direction: wp.vec3,
    reach: wp.float32,
    speed: wp.float32,
) -> wp.vec4:
    """Return (value, the point in the space of a direct field)."""
    return wp.vec4(direct_value_gradient(kind, q, tape, at)[0], q[0], q[1], q[2])


REST = replace(COLOR, leaf=rest_leaf, direct=rest_direct)
"""The evaluator: maps and warps leave rest coordinates as they are, and operators mix them as colours."""

_Registers = wp.types.matrix(shape=(REGISTERS, 4), dtype=wp.float32)

interpret_rest_coordinates = make_interpreter(REST, _Registers)


@wp.kernel
def evaluate_rest_coordinates(
    points: wp.array(dtype=wp.vec3),
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec4),
) -> None:
    """Write (value, rest coordinates) at each point."""
    i = wp.tid()
    out[i] = interpret_rest_coordinates(points[i], wp.vec3(), 0.0, tape, span)
