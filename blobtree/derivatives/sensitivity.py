"""Derivatives of field values where the numbers on a tape change."""

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, IndexArray
from blobtree.kernels import loaded
from blobtree.tape.tape import Tape


def sensitivities_at(
    tape: Tape, tangents: NDArray[np.float32], points: Float32Array, rows: IndexArray, columns: IndexArray
) -> Float32Array:
    """Return the derivatives (k,) at points[rows] where the tape moves along tangents[columns].

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
    from blobtree.derivatives.sensitivity_kernels import evaluate_sensitivities  # made at the first use

    uploaded = tape.on()
    out: wp.array[wp.float32] = wp.empty(len(rows), dtype=wp.float32)
    wp.launch(
        loaded(tape.instruction_set.kernel_for(evaluate_sensitivities)),
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
