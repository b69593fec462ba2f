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
"""Largest relative difference of whole tapes, in which the rounding of all instructions adds up.

The gradient and the slope bound of one primitive change by some 1e-6 if a point moves by float32's rounding.
Operators magnify that, in exact arithmetic too. In a Ricci blend F of exponent n below 2, the derivative by
an operand b changes by (n − 1) (b / F)^(n − 2) / F per unit of b, which grows without bound as b fades out:
ten times as much in a blend of 0.066 and 0.009 with n = 1.5. Differences and twists multiply slopes too.
About 1e-5 is seen in random trees, so a smaller limit would test such points, not code.
"""


def padded(points: Array) -> Array:
    return np.pad(points, ((0, 0), (0, 4 - points.shape[1]))).astype(np.float32)


def assert_close(seen: Array, expected: Array, agreement: float = TAPE_AGREEMENT) -> None:
    error = np.abs(seen - expected) / np.maximum(1.0, np.abs(expected))
    assert error.max(initial=0.0) <= agreement, f"largest error: {error.max()}"


@dataclass(frozen=True, eq=False)
class Model:
    """A tree in a scene: all that the renderer asks of one."""

    tree: Node
