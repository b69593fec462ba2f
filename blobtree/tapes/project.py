"""Points taken onto the surface along the exact gradient of the field."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.tapes.evaluate import field_gradient
from blobtree.tapes.tape import Tape
from blobtree.validation import point_array

wp.set_module_options(KERNEL_OPTIONS)

NEWTON_STEPS = 8
CONVERGED = 1e-6
"""Field error, in units of ISO, at which a point is on the surface as far as float32 can tell."""

STALLED = 1e-4
"""Field error, in units of ISO, below which a step that does not halve it has met float32's rounding."""


@wp.func
def project_to_surface(
    p: wp.vec3, longest_step: wp.float32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
) -> tuple[wp.vec3, wp.vec4]:
    """Newton's method for f = ISO from p, no step longer than `longest_step`: the place, and (f, ∇f) there.

    Where the field is flat (its gradient 0) the point stays where it is.
    """
    kept = p
    at_kept = field_gradient(p, tape, span)
    gap = ISO - at_kept[0]
    q = p
    f = at_kept
    for _step in range(NEWTON_STEPS):
        g = wp.vec3(f[1], f[2], f[3])
        steepness = wp.length(g)
        if wp.abs(gap) <= CONVERGED * ISO or steepness == 0.0:
            break
        q += g * (wp.clamp(gap / steepness, -longest_step, longest_step) / steepness)
        f = field_gradient(q, tape, span)
        stalled = wp.abs(gap) <= STALLED * ISO and wp.abs(ISO - f[0]) > 0.5 * wp.abs(gap)
        gap = ISO - f[0]
        if stalled and wp.abs(gap) > wp.abs(ISO - at_kept[0]):
            break
        kept = q
        at_kept = f
        if stalled:
            break
    return kept, at_kept


@wp.kernel
def _project(
    points: wp.array(dtype=wp.vec3),
    longest_step: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
) -> None:
    i = wp.tid()
    p, f = project_to_surface(points[i], longest_step, tape, span)
    positions[i] = p
    normals[i] = -wp.normalize(wp.vec3(f[1], f[2], f[3]))


def project(
    tape: Tape, points: ArrayLike, longest_step: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Surface points (n, 3) near `points` (n, 3) and the outward unit normals (n, 3) there.

    Points where the field is flat stay where they are, with the normal 0.
    """
    uploaded = tape.on()
    start: wp.array[Any] = wp.array(point_array(points), dtype=wp.vec3)
    positions, normals = wp.empty_like(start), wp.empty_like(start)
    wp.launch(
        tape.vocabulary.kernel(_project),
        dim=len(start),
        inputs=[start, longest_step, uploaded.data, uploaded.span],
        outputs=[positions, normals],
    )
    return positions.numpy(), normals.numpy()
