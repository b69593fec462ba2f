"""Derivatives of field values where the numbers on a tape change."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, IndexArray
from blobtree.kernels import loaded
from blobtree.progress import reporting
from blobtree.tape.tape import Tape


def sensitivities_at(
    tape: Tape,
    tangents: NDArray[np.float32],
    points: Float32Array,
    rows: IndexArray,
    columns: IndexArray,
    *,
    gradients: bool = False,
) -> Float32Array:
    """Return the derivatives at points[rows] where the tape moves along tangents[columns].

    They are those of the value (k,), or with `gradients` those of value and gradient (k, 4).

    Parameters
    ----------
    tape
        A tape of m texels.
    tangents
        float32[p, m, 4]: the derivative of its texels by each of p parameters.
    points
        float32[n, 3].
    rows, columns
        int[k]: pairs of a point and a parameter.
    """
    with reporting() as report:
        report("deriving the formulas", 0.0)
        kernel, dtype = _gradient_kernel() if gradients else _value_kernel()
        kernel = loaded(tape.instruction_set.kernel_for(kernel))
    uploaded = tape.on()
    out: wp.array[Any] = wp.empty(len(rows), dtype=dtype)
    wp.launch(
        kernel,
        dim=len(rows),
        inputs=[
            wp.array(points, dtype=wp.vec3),
            wp.array(rows.astype(np.int32), dtype=wp.int32),
            wp.array(columns.astype(np.int32), dtype=wp.int32),
            uploaded.data,
            wp.array(tangents, dtype=wp.vec4),
            uploaded.span,
        ],
        outputs=[out],
    )
    result: Float32Array = out.numpy()
    return result


def _value_kernel() -> tuple[wp.Kernel, Any]:
    from blobtree.derivatives.sensitivity_kernels import evaluate_sensitivities  # made at the first use

    return evaluate_sensitivities, wp.float32


def _gradient_kernel() -> tuple[wp.Kernel, Any]:
    from blobtree.derivatives.gradient_sensitivity_kernels import evaluate_gradient_sensitivities

    return evaluate_gradient_sensitivities, wp.vec4
