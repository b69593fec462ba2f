"""The kernel of Hessians; it compiles at its first use."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.dispatch import core_tables
from blobtree.tape.interpreter import field_gradient
from blobtree.texels import Texels
from blobtree.transpile.derivative import directional_derivative

wp.set_module_options(KERNEL_OPTIONS)

core_tables()  # fills the functions that are derived here

gradient_derivative = directional_derivative(field_gradient, ["q"])


@wp.kernel
def evaluate_hessians(
    points: wp.array(dtype=wp.vec3),
    tape: Texels,
    span: wp.vec2i,
    gradients: wp.array(dtype=wp.vec4),
    hessians: wp.array2d(dtype=wp.vec4),
) -> None:
    """Write (value, ∇f) at each point, and as row k of the Hessian (∂f/∂xₖ, ∂∇f/∂xₖ)."""
    i, k = wp.tid()  # type: ignore[misc]  # it has as many results as the launch has dimensions
    direction = wp.vec3()
    direction[k] = 1.0
    f, change = gradient_derivative(points[i], direction, tape, span)
    hessians[i, k] = change
    if k == 0:
        gradients[i] = f
