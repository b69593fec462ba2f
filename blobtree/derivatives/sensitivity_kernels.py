"""The kernel of derivatives by parameters; it compiles at its first use."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.dispatch import core_tables
from blobtree.tape.interpreter import field_value
from blobtree.texels import Texels
from blobtree.transpile.derivative import directional_derivative

wp.set_module_options(KERNEL_OPTIONS)

core_tables()  # fills the functions that are derived here

value_derivative = directional_derivative(field_value, ["tape"])


@wp.kernel
def evaluate_sensitivities(
    points: wp.array(dtype=wp.vec3),
    rows: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    tape: Texels,
    tangents: wp.array2d(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.float32),
) -> None:
    """Write the derivative of the field at points[rows[k]] by the number whose tangent is [columns[k]]."""
    k = wp.tid()
    _value, change = value_derivative(points[rows[k]], tape, tangents[columns[k]], span)
    out[k] = change
