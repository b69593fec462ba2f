"""The kernel of derivatives of gradients by parameters; it compiles at its first use."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.dispatch import core_tables
from blobtree.tape.interpreter import field_gradient
from blobtree.texels import Texels
from blobtree.transpile.derivative import directional_derivative

wp.set_module_options(KERNEL_OPTIONS)

core_tables()  # fills the functions that are derived here

gradient_derivative = directional_derivative(field_gradient, ["tape"])


@wp.kernel
def evaluate_gradient_sensitivities(
    points: wp.array(dtype=wp.vec3),
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    tape: Texels,
    tangents: wp.array2d(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec4),
) -> None:
    """Write the derivative of (value, ∇f) at points[rows[k]] by the number whose tangent is [columns[k]]."""
    k = wp.tid()
    _value, change = gradient_derivative(points[rows[k]], tape, tangents[columns[k]], span)
    out[k] = change
