"""A tree as a field: its program, its tape, and values, gradients and colours."""

import reprlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array
from blobtree.errors import InvalidNode
from blobtree.kernels import loaded
from blobtree.lazy import Lazy
from blobtree.tape.bounds import is_endless, leaf_boxes, support_box
from blobtree.tape.evaluate_kernels import evaluate_colors, evaluate_gradients, evaluate_values
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
        """Lower and upper corner, float32[3] each, of a box outside which the field is exactly 0.

        A tree without an end, such as an `EndlessRepeat`, has none, and raises `InvalidNode`.
        """
        if is_endless(self.field_box):
            raise InvalidNode(
                "tree: expected one that ends, got one with endless repeats; intersect it with a finite "
                "solid, as in `tree & Box((0, 0, 0), (4, 4, 4), radius=0)`, or trace rays with `far=`"
            )
        return self.field_box

    @Lazy
    def _leaf_size(self) -> float:
        """Length of a usual primitive with its influence: the median of the longest sides of their boxes."""
        lower, upper = leaf_boxes(self._program)
        return float(np.median((upper - lower).max(axis=1)))

    @Lazy
    def field_box(self) -> tuple[Float32Array, Float32Array]:
        """Lower and upper corner as of `support`, at ±`ENDLESS` where the tree has no end."""
        return support_box(self._program)

    def __call__(self, points: ArrayLike) -> Float32Array:
        """Return the field values at points.

        Parameters
        ----------
        points : array-like (n, 3) or (3,)
            Points in the world, or one point, in model units.

        Returns
        -------
        numpy.ndarray
            float32[n], or one number at one point: 0 outside every influence, 0.5 on the surface, more
            inside.

        Raises
        ------
        InvalidPoints
            The points are not n rows of three finite numbers.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=1.0)([[0, 0, 0], [1, 0, 0]]).round(3).tolist()
        [1.0, 0.5]
        >>> float(Point((0, 0, 0), radius=1.0)([0, 0, 0]))
        1.0
        """
        return one_or_rows(points, lambda rows: values_at(self.tape, rows))

    def gradient(self, points: ArrayLike) -> Float32Array:
        """Return the exact gradients of the field at points.

        Parameters
        ----------
        points : array-like (n, 3) or (3,)
            Points in the world, or one point, in model units.

        Returns
        -------
        numpy.ndarray
            float32[n, 3], or float32[3] at one point, per model unit; they point into the model.

        Raises
        ------
        InvalidPoints
            The points are not n rows of three finite numbers.

        Examples
        --------
        >>> from blobtree import Point
        >>> bool(Point((0, 0, 0), radius=1.0).gradient([[1, 0, 0]])[0, 0] < 0)
        True
        """
        return one_or_rows(points, lambda rows: gradients_at(self.tape, rows)[:, 1:])

    def colors(self, points: ArrayLike) -> Float32Array:
        """Return the blended colours at points.

        Parameters
        ----------
        points : array-like (n, 3) or (3,)
            Points in the world, or one point, in model units.

        Returns
        -------
        numpy.ndarray
            float32[n, 3], or float32[3] at one point: red, green and blue, black outside every influence.

        Raises
        ------
        InvalidPoints
            The points are not n rows of three finite numbers.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=1.0, color=(1, 0, 0)).colors([[0, 0, 0]]).tolist()
        [[1.0, 0.0, 0.0]]
        """
        return one_or_rows(points, lambda rows: colors_at(self.tape, rows))


def one_or_rows(points: ArrayLike, evaluate: Callable[[Float32Array], NDArray[Any]]) -> NDArray[Any]:
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
    return evaluate(evaluate_values, tape, points, wp.float32)


def gradients_at(tape: Tape, points: ArrayLike) -> Float32Array:
    """Return the values and exact gradients (n, 4) at `points` (n, 3)."""
    return evaluate(evaluate_gradients, tape, points)


def colors_at(tape: Tape, points: ArrayLike) -> Float32Array:
    """Return the blended colours (n, 3) at `points` (n, 3)."""
    return evaluate(evaluate_colors, tape, points)[:, 1:]


def evaluate(
    kernel: wp.Kernel, tape: Tape, points: ArrayLike, dtype: Any = wp.vec4, more: Sequence[Any] = ()
) -> Float32Array:
    """Return what a kernel of points, `more` arrays and a tape computes at `points` (n, 3)."""
    uploaded, rows = tape.on(), point_array(points)
    out: wp.array[Any] = wp.empty(len(rows), dtype=dtype)
    inputs = [wp.array(rows, dtype=wp.vec3), *more, uploaded.data, uploaded.span]
    instance = loaded(tape.instruction_set.kernel_for(kernel))
    wp.launch(instance, dim=len(rows), inputs=inputs, outputs=[out])
    result: Float32Array = out.numpy()
    return result
