"""Sphere tracing with a proven step bound: a ray never passes through the surface unseen.

At each place the tape gives the value f and a bound L on the slope over a ball of radius r. Within the ball
the field can rise by at most L · distance, so the ray is free for min(r, (ISO − f) / L) (Hart 1996, with the
global Lipschitz constant replaced by one of the ball ahead, after Galin et al. 2020). The ball then takes
twice the length of the last step, so rays speed up through empty space and slow down near the surface.
"""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from .errors import InvalidPoints
from .evaluate import field_bound, field_gradient
from .kernels import ISO
from .tape import Tape
from .validation import point_array

wp.set_module_options({"enable_backward": False})

MAX_STEPS = 1024
"""A ray that grazes the surface for longer than this is a miss."""

DEFAULT_TOLERANCE = 1e-5
"""Distance to the surface, relative to the model's size, at which a ray has arrived."""

MISS = -1.0


@wp.func
def first_hit(
    origin: wp.vec3,
    direction: wp.vec3,
    t_min: wp.float32,
    t_max: wp.float32,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> wp.float32:
    """Distance along the unit `direction` to the first point inside within [t_min, t_max], else MISS.

    A ray that starts inside hits at t_min.
    """
    t = t_min
    reach = wp.max((t_max - t_min) * 0.125, 4.0 * tolerance)
    for _step in range(MAX_STEPS):
        if t > t_max:
            return MISS
        bound = field_bound(origin + direction * t, reach, tape, span)
        gap = ISO - bound[0]
        free = reach
        if bound[1] * reach > gap:
            free = gap / bound[1]
            if free <= tolerance:
                return refine_hit(origin, direction, t, tolerance, tape, span)
        t += free
        reach = 2.0 * free
    return MISS


@wp.func
def refine_hit(
    origin: wp.vec3,
    direction: wp.vec3,
    t: wp.float32,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> wp.float32:
    """One Newton step along the ray from a point within tolerance of the surface, 2 tolerances at most."""
    f = field_gradient(origin + direction * t, tape, span)
    rise = f[1] * direction[0] + f[2] * direction[1] + f[3] * direction[2]
    gap = ISO - f[0]
    if gap <= 0.0 or rise * tolerance * 2.0 <= gap:
        return t
    return t + gap / rise


@wp.func
def box_interval(origin: wp.vec3, direction: wp.vec3, lower: wp.vec3, upper: wp.vec3) -> wp.vec2:
    """Where a ray is inside a box: (t_enter ≥ 0, t_leave), t_leave < t_enter where it misses."""
    enter = float(0.0)
    leave = float(1e30)
    for axis in range(3):
        if direction[axis] == 0.0:
            if origin[axis] < lower[axis] or origin[axis] > upper[axis]:
                leave = -1.0
        else:
            near = (lower[axis] - origin[axis]) / direction[axis]
            far = (upper[axis] - origin[axis]) / direction[axis]
            enter = wp.max(enter, wp.min(near, far))
            leave = wp.min(leave, wp.max(near, far))
    return wp.vec2(enter, leave)


@wp.func
def trace_ray(
    origin: wp.vec3,
    direction: wp.vec3,
    lower: wp.vec3,
    upper: wp.vec3,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> wp.float32:
    """first_hit within the box of influence of a tree."""
    inside = box_interval(origin, direction, lower, upper)
    if inside[1] < inside[0]:
        return MISS
    return first_hit(origin, direction, inside[0], inside[1], tolerance, tape, span)


@wp.kernel
def _trace(
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    lower: wp.vec3,
    upper: wp.vec3,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.float32),
) -> None:
    i = wp.tid()
    t = trace_ray(origins[i], wp.normalize(directions[i]), lower, upper, tolerance, tape, span)
    if t < 0.0:
        t = wp.inf
    out[i] = t


Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]


def trace_tolerance(bounds: Bounds) -> float:
    """Distance to the surface at which a ray has arrived, for a tree of these bounds."""
    return DEFAULT_TOLERANCE * float(np.linalg.norm(bounds[1] - bounds[0]))


def trace(tape: Tape, bounds: Bounds, origins: ArrayLike, directions: ArrayLike) -> NDArray[np.float32]:
    """Distances (n,) from `origins` (n, 3) along `directions` (n, 3) to the surface, inf where a ray misses.

    Raises
    ------
    InvalidPoints
        Origins and directions differ in number, or a direction has no length.
    """
    starts, headings = point_array(origins), point_array(directions)
    if starts.shape != headings.shape:
        raise InvalidPoints(f"directions: expected one per origin, {len(starts)}, got {len(headings)}")
    if not (np.abs(headings).max(axis=1, initial=0.0) > 0.0).all():
        raise InvalidPoints("directions: expected vectors with a length, got a zero vector")
    uploaded = tape.on()
    out = wp.empty(len(starts), dtype=wp.float32)
    inputs: list[Any] = [wp.array(array, dtype=wp.vec3) for array in (starts, headings)]
    inputs += [wp.vec3(*corner.tolist()) for corner in bounds]
    wp.launch(
        _trace,
        dim=len(starts),
        inputs=[*inputs, trace_tolerance(bounds), uploaded.data, uploaded.span],
        outputs=[out],
    )
    distances: NDArray[np.float32] = out.numpy()
    return distances
