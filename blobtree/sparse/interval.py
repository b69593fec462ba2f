"""Bounds on a field over a box, by the interval arithmetic that prunes cells."""

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree.errors import InvalidPoints
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.sparse.prune import prune
from blobtree.tapes.tape import Tape
from blobtree.validation import point_array

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def _range(
    center: wp.vec3,
    half: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec4),
) -> None:
    out[0] = prune(center, half, tape, span, tape, 0, False)


def range_over(tape: Tape, lower: ArrayLike, upper: ArrayLike) -> tuple[float, float]:
    """Numbers that the field is never below and never above in the box from `lower` (3,) to `upper` (3,).

    They hold for the cube around the box too, so a box of equal sides gives the closest ones.

    Raises
    ------
    InvalidPoints
        A corner is not three finite numbers, or the lower one lies above the upper one.
    """
    corners = point_array([lower, upper]).astype(np.float64)
    if (corners[0] > corners[1]).any():
        raise InvalidPoints(f"box: expected lower ≤ upper, got {lower!r} and {upper!r}")
    center, half = corners.mean(axis=0), float((corners[1] - corners[0]).max()) / 2.0
    pad = float(np.abs(corners).max()) * 2.0**-21
    uploaded = tape.on("cpu")
    out = wp.empty(1, dtype=wp.vec4, device="cpu")
    inputs = [wp.vec3(*center), half + pad, uploaded.data, uploaded.span]
    wp.launch(tape.vocabulary.kernel(_range), dim=1, inputs=inputs, outputs=[out], device="cpu")
    smallest, largest, _, _ = out.numpy()[0].tolist()
    return smallest, largest
