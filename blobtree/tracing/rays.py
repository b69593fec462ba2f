"""Rays through sparse cells, with a proven step bound: none passes through the surface unseen.

A ray leaps over blocks that hold no surface; in the others it reads their pruned tapes alone. At each place
the tape gives the value f and a bound L on how fast it rises over the next stretch of the ray, r long. So
the ray is free for min(r, (ISO − f) / L): sphere tracing (Hart 1996) with the slope along the ray in place of
a global Lipschitz constant (segment tracing, Galin et al. 2020). The next stretch takes twice the length of
the last step, so rays speed up through empty space; near the surface L tends to the slope itself, and they
arrive as by Newton's method.
"""

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.sparse.refine import SURELY_INSIDE
from blobtree.tapes.evaluate import field_bound, field_gradient

wp.set_module_options(KERNEL_OPTIONS)

MAX_STEPS = 1024
"""A ray that grazes the surface for longer than this is a miss."""

MISS = -1.0

MAX_BLOCKS = 4096
"""More than any ray can cross."""

FARTHEST = 1e30
"""Farther than any ray goes, and the largest number that is taken for 1 / 0."""

EMPTY = -3
"""An empty block is known by this, less the layers of blocks around it that are empty too; other blocks by
SURELY_INSIDE, or by the first texel of their tape."""

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
def reciprocal(direction: wp.vec3) -> wp.vec3:
    """1 / each component, 0 where that is 0."""
    inverse = wp.vec3()
    for axis in range(3):
        if direction[axis] != 0.0:
            inverse[axis] = wp.clamp(1.0 / direction[axis], -FARTHEST, FARTHEST)
    return inverse


@wp.func
def way_out(origin: wp.vec3, inverse: wp.vec3, lower: wp.vec3, upper: wp.vec3) -> wp.float32:
    """Where a ray that is inside a box leaves it, `inverse` being the `reciprocal` of its direction."""
    leave = float(FARTHEST)
    for axis in range(3):
        if inverse[axis] > 0.0:
            leave = wp.min(leave, (upper[axis] - origin[axis]) * inverse[axis])
        elif inverse[axis] < 0.0:
            leave = wp.min(leave, (lower[axis] - origin[axis]) * inverse[axis])
    return leave


@wp.func
def trace_ray(
    origin: wp.vec3,
    direction: wp.vec3,
    lower: wp.vec3,
    block_size: wp.float32,
    counts: wp.vec3i,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    blocks: wp.array(dtype=wp.int32),
) -> wp.vec3:
    """First hit of a ray: (distance or MISS, first texel of the tape that holds there, one past the last)."""
    extent = block_size * wp.vec3(float(counts[0]), float(counts[1]), float(counts[2]))
    inside = box_interval(origin, direction, lower, lower + extent)
    entry = origin + direction * inside[0]  # distances are counted from here: an eye may be far away
    last = inside[1] - inside[0]
    inverse = reciprocal(direction)
    t = float(0.0)
    for _block in range(MAX_BLOCKS):
        if t > last:
            return wp.vec3(MISS, 0.0, 0.0)
        p = (entry + direction * t - lower) / block_size
        x = wp.clamp(int(wp.floor(p[0])), 0, counts[0] - 1)
        y = wp.clamp(int(wp.floor(p[1])), 0, counts[1] - 1)
        z = wp.clamp(int(wp.floor(p[2])), 0, counts[2] - 1)
        known = blocks[(x * counts[1] + y) * counts[2] + z]
        around = wp.max(EMPTY - known, 0)
        corner = lower + block_size * wp.vec3(float(x - around), float(y - around), float(z - around))
        size = block_size * float(2 * around + 1)
        leave = way_out(entry, inverse, corner, corner + wp.vec3(size, size, size))
        leave = wp.max(leave, t) + BLOCK_OVERLAP * tolerance
        if known == SURELY_INSIDE:
            return wp.vec3(inside[0] + t, 1.0, 1.0 + tape[0][0])
        if known >= 0:
            span = wp.vec2i(known + 1, known + 1 + int(tape[known][0]))
            hit = first_hit(entry, direction, t, leave, tolerance, tape, span)
            if hit >= 0.0:
                return wp.vec3(inside[0] + hit, float(span[0]), float(span[1]))
        t = leave
    return wp.vec3(MISS, 0.0, 0.0)
