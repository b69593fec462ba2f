"""Kernels that evaluate a tape at many points, and the projection of a point onto the surface."""

import warp as wp

from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.interpreter import field_color, field_gradient, field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

NEWTON_STEPS = 8

CONVERGED = 1e-6
"""Field error, in units of ISO, at which a point is on the surface as exactly as float32 can tell."""

STALLED = 1e-4
"""Field error, in units of ISO, below which a step that does not halve it has met float32's rounding."""

GOES_ON, ARRIVED, WORSE = wp.constant(0), wp.constant(1), wp.constant(2)
"""What comes of a point of `newton_step`."""


@wp.func
def newton_step(
    f: wp.vec4, gap_before: wp.float32, step: wp.int32, longest_step: wp.float32
) -> tuple[wp.vec3, wp.int32]:
    """Return a step of Newton's method for f = ISO from a point with (f, ∇f), and what comes of the point.

    It is GOES_ON, ARRIVED if no step is left to make, or WORSE if rounding took the point away from the
    surface. `gap_before` is ISO − f at the point before, where `step` > 0.
    """
    gap = ISO - f[0]
    stalled = step > 0 and wp.abs(gap_before) <= STALLED * ISO and wp.abs(gap) > 0.5 * wp.abs(gap_before)
    if stalled and wp.abs(gap) > wp.abs(gap_before):
        return wp.vec3(), WORSE
    g = wp.vec3(f[1], f[2], f[3])
    steepness = wp.length(g)
    if stalled or wp.abs(gap) <= CONVERGED * ISO or steepness == 0.0:
        return wp.vec3(), ARRIVED
    return g * (wp.clamp(gap / steepness, -longest_step, longest_step) / steepness), GOES_ON


@wp.func
def project_to_surface(
    p: wp.vec3, longest_step: wp.float32, tape: Texels, span: wp.vec2i
) -> tuple[wp.vec3, wp.vec4]:
    """Return the point that Newton's method for f = ISO reaches from p, and (f, ∇f) there.

    No step is longer than `longest_step`. A point where the field is flat (its gradient 0) stays there.
    """
    best = p
    f_best = wp.vec4()
    gap = float(0.0)
    q = p
    for step in range(NEWTON_STEPS + 1):  # one call for all steps: a copy of it compiles as long again
        f = field_gradient(q, tape, span)
        way, state = newton_step(f, gap, step, longest_step)
        if state == WORSE:
            break
        gap = ISO - f[0]
        best = q
        f_best = f
        if state == ARRIVED:
            break
        q += way
    return best, f_best


@wp.kernel
def evaluate_values(
    points: wp.array(dtype=wp.vec3), tape: Texels, span: wp.vec2i, out: wp.array(dtype=wp.float32)
) -> None:
    """Write `field_value` at each point."""
    i = wp.tid()
    out[i] = field_value(points[i], tape, span)


@wp.kernel
def evaluate_gradients(
    points: wp.array(dtype=wp.vec3), tape: Texels, span: wp.vec2i, out: wp.array(dtype=wp.vec4)
) -> None:
    """Write `field_gradient` at each point."""
    i = wp.tid()
    out[i] = field_gradient(points[i], tape, span)


@wp.kernel
def evaluate_colors(
    points: wp.array(dtype=wp.vec3), tape: Texels, span: wp.vec2i, out: wp.array(dtype=wp.vec4)
) -> None:
    """Write `field_color` at each point."""
    i = wp.tid()
    out[i] = field_color(points[i], tape, span)
