"""Rest coordinates: the point in the space of each primitive, blended with the weights of colours."""

from dataclasses import replace

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.evaluators import COLOR, squared_distance, to_local
from blobtree.tape.interpreter import make_interpreter
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def own_position(q: wp.vec3, c: wp.vec4, color: wp.vec4, tape: Texels) -> wp.vec4:
    """Return the point in the space of a leaf in place of a colour, if the leaf's field reaches it.

    `color` holds the index of the texels with the map to that space, or −1 if q is in it already.
    """
    p = q
    if color[0] >= 0.0 and squared_distance(q, c) < 1.0:
        p = to_local(q, tape, int(color[0]))
    return wp.vec4(p[0], p[1], p[2], 0.0)


REST = replace(COLOR, paint=own_position)
"""The evaluator: maps and warps leave rest coordinates as they are, and operators mix them as colours."""

interpret_rest_coordinates = make_interpreter(REST)


@wp.kernel
def evaluate_rest_coordinates(
    points: wp.array(dtype=wp.vec3), tape: Texels, span: wp.vec2i, out: wp.array(dtype=wp.vec4)
) -> None:
    """Write (value, rest coordinates) at each point, NaN where the field is 0."""
    i = wp.tid()
    f = interpret_rest_coordinates(points[i], wp.vec3(), 0.0, tape, span)
    if f[0] == 0.0:
        f = wp.vec4(0.0, wp.NAN, wp.NAN, wp.NAN)
    out[i] = f
