"""Field, gradient and colour of a tape at many points, through Warp."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.tapes.interpreter import interpret_bound, interpret_color, interpret_gradient, interpret_value
from blobtree.tapes.tape import Tape
from blobtree.validation import point_array

wp.set_module_options(KERNEL_OPTIONS)


@wp.func
def field_value(q: wp.vec3, tape: wp.array(dtype=wp.vec4), span: wp.vec2i) -> wp.float32:
    """Field at q."""
    return interpret_value(q, wp.vec3(), 0.0, tape, span)


@wp.func
def field_gradient(q: wp.vec3, tape: wp.array(dtype=wp.vec4), span: wp.vec2i) -> wp.vec4:
    """(value, ∂x, ∂y, ∂z) of the field at q."""
    return interpret_gradient(q, wp.vec3(), 0.0, tape, span)


@wp.func
def field_bound(
    q: wp.vec3, heading: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
) -> wp.vec3:
    """(value at q, how fast it rises at most, how fast it falls) on the way along `heading`, `reach` far.

    Where `heading` is 0, in all directions: a bound on |∇f| over the ball of radius `reach` about q.
    """
    return interpret_bound(q, heading, reach, tape, span)


@wp.func
def field_color(q: wp.vec3, tape: wp.array(dtype=wp.vec4), span: wp.vec2i) -> wp.vec4:
    """(value, red, green, blue) of the field at q."""
    return interpret_color(q, wp.vec3(), 0.0, tape, span)


@wp.kernel
def _values(
    points: wp.array(dtype=wp.vec3),
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.float32),
) -> None:
    i = wp.tid()
    out[i] = field_value(points[i], tape, span)


@wp.kernel
def _gradients(
    points: wp.array(dtype=wp.vec3),
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec4),
) -> None:
    i = wp.tid()
    out[i] = field_gradient(points[i], tape, span)


@wp.kernel
def _bounds(
    points: wp.array(dtype=wp.vec3),
    headings: wp.array(dtype=wp.vec3),
    reach: wp.array(dtype=wp.float32),
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec3),
) -> None:
    i = wp.tid()
    out[i] = field_bound(points[i], headings[i], reach[i], tape, span)


@wp.kernel
def _colors(
    points: wp.array(dtype=wp.vec3),
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec4),
) -> None:
    i = wp.tid()
    out[i] = field_color(points[i], tape, span)


def values_at(tape: Tape, points: ArrayLike) -> NDArray[np.float32]:
    """Field values (n,) at `points` (n, 3)."""
    return _launch(_values, tape, point_array(points), [], wp.float32)


def gradients_at(tape: Tape, points: ArrayLike) -> NDArray[np.float32]:
    """Values and exact gradients (n, 4) at `points` (n, 3)."""
    return _launch(_gradients, tape, point_array(points), [], wp.vec4)


def bounds_at(tape: Tape, points: ArrayLike, reach: ArrayLike) -> NDArray[np.float32]:
    """Values and slope bounds (n, 2) over the balls of radius `reach` (n,) about `points` (n, 3)."""
    array = point_array(points)
    return bounds_along(tape, array, np.zeros_like(array), reach)[:, :2]


def bounds_along(tape: Tape, points: ArrayLike, headings: ArrayLike, reach: ArrayLike) -> NDArray[np.float32]:
    """Values, and how fast they rise and fall at most (n, 3), from `points` (n, 3) along `headings` (n, 3).

    Headings are unit, or 0 for all directions; `reach` (n,) is how far the bounds hold.
    """
    array = point_array(points)
    reaches = np.broadcast_to(np.asarray(reach, np.float32), len(array))
    extra: list[Any] = [wp.array(point_array(headings), dtype=wp.vec3), wp.array(reaches, dtype=wp.float32)]
    return _launch(_bounds, tape, array, extra, wp.vec3)


def colors_at(tape: Tape, points: ArrayLike) -> NDArray[np.float32]:
    """Blended colours (n, 3) at `points` (n, 3)."""
    return _launch(_colors, tape, point_array(points), [], wp.vec4)[:, 1:]


def _launch(
    kernel: wp.Kernel, tape: Tape, points: NDArray[np.float32], extra: list[Any], dtype: Any
) -> NDArray[np.float32]:
    """`kernel` over `points`, its result as NumPy array."""
    uploaded = tape.on()
    out: wp.array[Any] = wp.empty(len(points), dtype=dtype)
    inputs = [wp.array(points, dtype=wp.vec3), *extra, uploaded.data, uploaded.span]
    wp.launch(tape.vocabulary.kernel(kernel), dim=len(points), inputs=inputs, outputs=[out])
    result: NDArray[np.float32] = out.numpy()
    return result
