"""The field of a tape at many points: values, gradients, slope bounds, colours and projections."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array
from blobtree.tape.evaluate_kernels import (
    evaluate_bounds,
    evaluate_colors,
    evaluate_gradients,
    evaluate_values,
    project_points,
)
from blobtree.tape.tape import Tape
from blobtree.validation import point_array


def values_at(tape: Tape, points: ArrayLike) -> Float32Array:
    """Return the field values (n,) at `points` (n, 3)."""
    return _evaluate(evaluate_values, tape, point_array(points), [], wp.float32)


def gradients_at(tape: Tape, points: ArrayLike) -> Float32Array:
    """Return the values and exact gradients (n, 4) at `points` (n, 3)."""
    return _evaluate(evaluate_gradients, tape, point_array(points), [], wp.vec4)


def bounds_at(tape: Tape, points: ArrayLike, reach: ArrayLike) -> Float32Array:
    """Return the values at `points` (n, 3), and slope bounds over balls of radius `reach` (n,), as (n, 2)."""
    array = point_array(points)
    return bounds_along(tape, array, np.zeros_like(array), reach)[:, :2]


def bounds_along(tape: Tape, points: ArrayLike, directions: ArrayLike, reach: ArrayLike) -> Float32Array:
    """Return the values at `points` (n, 3), and bounds on rise and fall along `directions`, as (n, 3).

    Directions (n, 3) are unit vectors, or 0 for all directions. The bounds hold up to the distances `reach`
    (n,).
    """
    array = point_array(points)
    reaches = np.broadcast_to(np.asarray(reach, np.float32), len(array))
    extra: list[Any] = [
        wp.array(point_array(directions), dtype=wp.vec3),
        wp.array(reaches, dtype=wp.float32),
    ]
    return _evaluate(evaluate_bounds, tape, array, extra, wp.vec3)


def colors_at(tape: Tape, points: ArrayLike) -> Float32Array:
    """Return the blended colours (n, 3) at `points` (n, 3)."""
    return _evaluate(evaluate_colors, tape, point_array(points), [], wp.vec4)[:, 1:]


def project(tape: Tape, points: ArrayLike, longest_step: float) -> tuple[Float32Array, Float32Array]:
    """Return surface points (n, 3) near `points` (n, 3), and the outward unit normals (n, 3) there.

    Newton's method follows the exact gradient in steps of at most `longest_step`. Points where the field is
    flat keep their position and get the normal 0.
    """
    uploaded = tape.on()
    start: wp.array[Any] = wp.array(point_array(points), dtype=wp.vec3)
    positions, normals = wp.empty_like(start), wp.empty_like(start)
    wp.launch(
        tape.instruction_set.kernel_for(project_points),
        dim=len(start),
        inputs=[start, longest_step, uploaded.data, uploaded.span],
        outputs=[positions, normals],
    )
    return positions.numpy(), normals.numpy()


def _evaluate(
    kernel: wp.Kernel, tape: Tape, points: Float32Array, extra: list[Any], dtype: Any
) -> Float32Array:
    """Return the results of `kernel` at `points` (n, 3) as a NumPy array."""
    uploaded = tape.on()
    out: wp.array[Any] = wp.empty(len(points), dtype=dtype)
    inputs = [wp.array(points, dtype=wp.vec3), *extra, uploaded.data, uploaded.span]
    wp.launch(tape.instruction_set.kernel_for(kernel), dim=len(points), inputs=inputs, outputs=[out])
    result: Float32Array = out.numpy()
    return result
