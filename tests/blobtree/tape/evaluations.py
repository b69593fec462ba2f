"""Slope bounds and projections at many points."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree import Tape
from blobtree._typing import Float32Array
from blobtree.conformance.bound_kernels import evaluate_bounds
from blobtree.kernels import loaded
from blobtree.tape.model import evaluate
from blobtree.validation import point_array
from tests.blobtree.tape.evaluation_kernels import project_points


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
    more: list[Any] = [
        wp.array(point_array(directions), dtype=wp.vec3),
        wp.array(reaches, dtype=wp.float32),
    ]
    return evaluate(evaluate_bounds, tape, array, wp.vec3, more)


def project(tape: Tape, points: ArrayLike, longest_step: float) -> tuple[Float32Array, Float32Array]:
    """Return surface points (n, 3) near `points` (n, 3), and the outward unit normals (n, 3) there.

    Newton's method follows the exact gradient in steps of at most `longest_step`. Points where the field is
    flat keep their position and get the normal 0.
    """
    uploaded = tape.on()
    start: wp.array[Any] = wp.array(point_array(points), dtype=wp.vec3)
    positions, normals = wp.empty_like(start), wp.empty_like(start)
    wp.launch(
        loaded(tape.instruction_set.kernel_for(project_points)),
        dim=len(start),
        inputs=[start, longest_step, uploaded.data, uploaded.span],
        outputs=[positions, normals],
    )
    return positions.numpy(), normals.numpy()
