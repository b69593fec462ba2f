"""A tree as a field: its program, its tape, and values, gradients, slope bounds, colours and projections."""

import reprlib
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array
from blobtree.errors import InvalidNode
from blobtree.kernels import loaded
from blobtree.lazy import Lazy
from blobtree.tape.bounds import support_box
from blobtree.tape.evaluate_kernels import (
    evaluate_bounds,
    evaluate_colors,
    evaluate_gradients,
    evaluate_values,
    project_points,
)
from blobtree.tape.program import Instruction, ProgramNode, compile_program
from blobtree.tape.tape import Tape, compile_tape
from blobtree.validation import point_array, points_or_point


class ImplicitModel(ProgramNode):
    """A field that is 0 far away and larger than ISO inside; `blobtree.Node` is the class to use.

    Sparse cells, meshing, tracing and views take any such model, so they need no class of nodes.
    """

    @Lazy
    def _program(self) -> list[Instruction]:
        return compile_program(self)

    @Lazy
    def tape(self) -> Tape:
        """Return the flat form of this tree that every evaluator reads."""
        return compile_tape(self._program)

    @Lazy
    def support(self) -> tuple[Float32Array, Float32Array]:
        """Lower and upper corner, float32[3] each, of a box outside which the field is exactly 0."""
        return support_box(self._program)

    def __call__(self, points: ArrayLike) -> Float32Array:
        """Return the field values (n,) at `points` (n, 3), or one value at one point (3,)."""
        return _one_or_rows(points, lambda rows: values_at(self.tape, rows))

    def gradient(self, points: ArrayLike) -> Float32Array:
        """Return the exact field gradients (n, 3) at `points` (n, 3), or one at one point (3,)."""
        return _one_or_rows(points, lambda rows: gradients_at(self.tape, rows)[:, 1:])

    def colors(self, points: ArrayLike) -> Float32Array:
        """Return the blended colours (n, 3) at `points` (n, 3), or one at one point (3,).

        It is black outside every primitive's influence.
        """
        return _one_or_rows(points, lambda rows: colors_at(self.tape, rows))


def _one_or_rows(points: ArrayLike, evaluate: Callable[[ArrayLike], Float32Array]) -> Float32Array:
    """Return a function's rows at points (n, 3), or its only row at one point (3,)."""
    array, single = points_or_point(points)
    rows = evaluate(array)
    return rows[0] if single else rows


def checked_tree(tree: object) -> ImplicitModel:
    """Return `tree` if it is a model; raise `InvalidNode` otherwise."""
    if not isinstance(tree, ImplicitModel):
        raise InvalidNode(f"tree: expected a BlobTree node such as Point(...), got {reprlib.repr(tree)}")
    return tree


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
        loaded(tape.instruction_set.kernel_for(project_points)),
        dim=len(start),
        inputs=[start, longest_step, uploaded.data, uploaded.span],
        outputs=[positions, normals],
    )
    return positions.numpy(), normals.numpy()


def evaluate(kernel: wp.Kernel, tape: Tape, points: ArrayLike) -> Float32Array:
    """Return the vectors (n, 4) that a kernel computes at `points` (n, 3)."""
    return _evaluate(kernel, tape, point_array(points), [], wp.vec4)


def _evaluate(
    kernel: wp.Kernel, tape: Tape, points: Float32Array, extra: list[Any], dtype: Any
) -> Float32Array:
    """Return the results of `kernel` at `points` (n, 3) as a NumPy array."""
    uploaded = tape.on()
    out: wp.array[Any] = wp.empty(len(points), dtype=dtype)
    inputs = [wp.array(points, dtype=wp.vec3), *extra, uploaded.data, uploaded.span]
    instance = loaded(tape.instruction_set.kernel_for(kernel))
    wp.launch(instance, dim=len(points), inputs=inputs, outputs=[out])
    result: Float32Array = out.numpy()
    return result
