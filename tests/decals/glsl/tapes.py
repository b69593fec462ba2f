"""Whole tapes read by the tracing shader's own functions."""

from dataclasses import dataclass

import numpy as np

from blobtree import Node
from tests.decals.glsl.arguments import Array

MAIN = """
uniform sampler2D points; uniform ivec2 part; uniform int reading; uniform vec3 heading;
void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 q = texelFetch(points, here, 0);
    vec4 result = vec4(0.0);
    if (reading == 0) result.xyz = field_bound(q.xyz, heading, q.w, tape, part);
    if (reading == 1) result = field_gradient(q.xyz, tape, part);
    if (reading == 2) result = interpret_color(q.xyz, vec3(0.0), 0.0, tape, part);
    g_position = result;
}
"""

BOUND_AND_VALUE, GRADIENT, COLOR = range(3)

TAPE_AGREEMENT = 2e-5
"""Largest relative difference of whole tapes, in which the rounding of all instructions adds up."""


def padded(points: Array) -> Array:
    return np.pad(points, ((0, 0), (0, 4 - points.shape[1]))).astype(np.float32)


def assert_close(seen: Array, expected: Array) -> None:
    error = np.abs(seen - expected) / np.maximum(1.0, np.abs(expected))
    assert error.max(initial=0.0) <= TAPE_AGREEMENT, f"largest error: {error.max()}"


@dataclass(frozen=True, eq=False)
class Model:
    """A tree in a scene: all that the renderer asks of one."""

    tree: Node
