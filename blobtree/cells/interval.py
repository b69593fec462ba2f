"""Bounds of the field over a box."""

from typing import Any, cast

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree.cells.prune_kernels import measure_range
from blobtree.errors import InvalidPoints
from blobtree.tape.tape import Tape
from blobtree.validation import point_array

COORDINATE_MARGIN = 2.0**-21
"""Margin around a box, over its largest coordinate, for the rounding of its centre."""


def range_over(tape: Tape, lower: ArrayLike, upper: ArrayLike) -> tuple[float, float]:
    """Return bounds of the field over the box from `lower` (3,) to `upper` (3,): (smallest, largest).

    The bounds hold for the cube around the box too, so a box of equal sides gives the tightest ones.

    Raises
    ------
    InvalidPoints
        A corner is not three finite numbers, or the lower one lies above the upper one.
    """
    corners = point_array(cast(Any, [lower, upper])).astype(np.float64)
    if (corners[0] > corners[1]).any():
        raise InvalidPoints(f"box: expected lower ≤ upper, got {lower!r} and {upper!r}")
    center, half = corners.mean(axis=0), float((corners[1] - corners[0]).max()) / 2.0
    pad = float(np.abs(corners).max()) * COORDINATE_MARGIN
    uploaded = tape.on("cpu")
    out = wp.empty(1, dtype=wp.vec4, device="cpu")
    inputs = [wp.vec3(*center), half + pad, uploaded.data, uploaded.span]
    wp.launch(
        tape.instruction_set.kernel_for(measure_range), dim=1, inputs=inputs, outputs=[out], device="cpu"
    )
    smallest, largest, _, _ = out.numpy()[0].tolist()
    return smallest, largest
