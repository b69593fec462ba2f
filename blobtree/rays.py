"""Rays through sparse cells, with a proven step bound: none passes through the surface unseen.

A ray leaps over blocks that hold no surface; in the others it reads their pruned tapes alone. At each place
the tape gives the value f and a bound L on how fast it rises over the next stretch of the ray, r long. So
the ray is free for min(r, (ISO − f) / L): sphere tracing (Hart 1996) with the slope along the ray in place of
a global Lipschitz constant (segment tracing, Galin et al. 2020). The next stretch takes twice the length of
the last step, so rays speed up through empty space; near the surface L tends to the slope itself, and they
arrive as by Newton's method.
"""

import warp as wp

from .evaluate import field_bound, field_gradient
from .grid import BRANCHING, BRANCHING_BITS, CHILDREN
from .kernel_options import KERNEL_OPTIONS
from .kernels import ISO
from .refine import SURELY_INSIDE

wp.set_module_options(KERNEL_OPTIONS)

MAX_STEPS = 1024
"""A ray that grazes the surface for longer than this is a miss."""

MISS = -1.0

MAX_BLOCKS = 4096
"""More than any ray can cross."""

BLOCK_OVERLAP = 0.1
"""How far a ray reaches into the next block before it asks which one that is, in tolerances."""


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
    reach = wp.max(t_max - t_min, 4.0 * tolerance)
    for _step in range(MAX_STEPS):
        if t > t_max:
            return MISS
        bound = field_bound(origin + direction * t, direction, reach, tape, span)
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
def find_node(place: wp.vec3i, depth: wp.int32, nodes: wp.array(dtype=wp.int32)) -> wp.vec2i:
    """(what is known of the finest block at `place`, log₂ of the size of the block that it is known of).

    Known is the first texel of a block's tape, or SURELY_OUTSIDE, SURELY_INSIDE.
    """
    node = int(0)
    shift = BRANCHING_BITS * depth
    for _level in range(depth):
        shift -= BRANCHING_BITS
        x = (place[0] >> shift) & (BRANCHING - 1)
        y = (place[1] >> shift) & (BRANCHING - 1)
        z = (place[2] >> shift) & (BRANCHING - 1)
        node = nodes[node * CHILDREN + (x << (2 * BRANCHING_BITS)) + (y << BRANCHING_BITS) + z]
        if node < 0:
            return wp.vec2i(node, shift)
    return wp.vec2i(node, shift)


@wp.func
def trace_ray(
    origin: wp.vec3,
    direction: wp.vec3,
    lower: wp.vec3,
    block_size: wp.float32,
    depth: wp.int32,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    nodes: wp.array(dtype=wp.int32),
) -> wp.vec3:
    """First hit of a ray: (distance or MISS, first texel of the tape that holds there, one past the last)."""
    side = 1 << (BRANCHING_BITS * depth)
    extent = block_size * float(side)
    inside = box_interval(origin, direction, lower, lower + wp.vec3(extent, extent, extent))
    entry = origin + direction * inside[0]  # distances are counted from here: an eye may be far away
    last = inside[1] - inside[0]
    t = float(0.0)
    for _block in range(MAX_BLOCKS):
        if t > last:
            return wp.vec3(MISS, 0.0, 0.0)
        p = (entry + direction * t - lower) / block_size
        place = wp.vec3i(
            wp.clamp(int(wp.floor(p[0])), 0, side - 1),
            wp.clamp(int(wp.floor(p[1])), 0, side - 1),
            wp.clamp(int(wp.floor(p[2])), 0, side - 1),
        )
        known = find_node(place, depth, nodes)
        size = block_size * float(1 << known[1])
        corner = lower + size * wp.vec3(
            float(place[0] >> known[1]), float(place[1] >> known[1]), float(place[2] >> known[1])
        )
        leave = box_interval(entry, direction, corner, corner + wp.vec3(size, size, size))[1]
        leave = wp.max(leave, t) + BLOCK_OVERLAP * tolerance
        if known[0] == SURELY_INSIDE:
            return wp.vec3(inside[0] + t, 1.0, 1.0 + tape[0][0])
        if known[0] >= 0:
            span = wp.vec2i(known[0] + 1, known[0] + 1 + int(tape[known[0]][0]))
            hit = first_hit(entry, direction, t, leave, tolerance, tape, span)
            if hit >= 0.0:
                return wp.vec3(inside[0] + hit, float(span[0]), float(span[1]))
        t = leave
    return wp.vec3(MISS, 0.0, 0.0)
