"""Tracing of rays through sparse cells, in steps with a proven bound: no step passes through the surface.

A ray skips blocks without surface. In the other blocks it reads the pruned tape of the block. At a point the
tape gives the value f and a bound L on its slope over the next segment of the ray, of length r. The segment
is free of surface up to min(r, (ISO − f) / L). This is sphere tracing (Hart 1996) with the slope along the
ray in place of a global Lipschitz constant (segment tracing, Galin et al. 2020). The next segment has twice
the length of the last step, so rays accelerate through empty space. Near the surface L tends to the slope
itself, and a ray converges as in Newton's method.
"""

import warp as wp

from blobtree.cells.refine_kernels import SURELY_INSIDE
from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.interpreter import field_bound, field_gradient
from blobtree.texels import Texels
from blobtree.transpile.glsl import uniform_struct

wp.set_module_options(KERNEL_OPTIONS)

MAX_STEPS = 512
"""More steps than cross any block, so that every ray leaves its block.

Blocks are 64 along the longest side of a box, and a tolerance is 1e-5 of its diagonal, so a block is at most
2,707 tolerances long. Steps grow as STEPS_PER_TOLERANCE states, and 416 of the shortest cross a block."""

STEPS_PER_TOLERANCE = 32.0
"""Steps in a block after which the shortest step is longer by a tolerance, 13 tolerances at most."""

MISS = -1.0

MAX_BLOCKS = 32768
"""More blocks than any ray can cross."""

MAX_DISTANCE = 1e30
"""A distance beyond all boxes, and the largest magnitude of a `reciprocal`."""

EMPTY = -3
"""Entry of an empty block in the table, less the number of layers of empty blocks around it.

The entry of another block is SURELY_INSIDE, or the texel in front of its tape, which is not negative."""

GRAZING_STEPS, LONGEST_WAY = 2, 1000.0
"""Most steps along a ray that grazes the surface, and the longest of them, in tolerances."""

ARRIVED = 0.02
"""Share of the first distance from the surface, below which such a ray has arrived there."""

HIT_STEPS = 4
HIT_GAP = 1e-3
"""Field values from the surface at which Newton's method ends, and its most steps, for a hit."""

BLOCK_OVERLAP = 0.1
"""Distance behind the boundary of two blocks, in tolerances, at which a ray is in the next one."""


@uniform_struct(
    lower="grid_lower",
    block_size="block_size",
    counts="grid_counts",
    tolerance="tolerance",
    tape="tape",
    start="tape_start",
    blocks="blocks",
)
class RayCells:
    """`tree_cells.TracingCells` on one device; ``shaders/trace.glsl`` declares the fields as uniforms."""

    lower: wp.vec3
    block_size: wp.float32
    counts: wp.vec3i
    tolerance: wp.float32
    tape: Texels
    start: wp.int32
    blocks: wp.array(dtype=wp.int32)


@wp.func
def block_at(place: wp.vec3, cells: RayCells) -> wp.int32:
    """Return the entry of the block at a place, in blocks from the grid's corner; EMPTY beyond the grid."""
    counts = cells.counts
    x = int(wp.floor(place[0]))
    y = int(wp.floor(place[1]))
    z = int(wp.floor(place[2]))
    if x < 0 or y < 0 or z < 0 or x >= counts[0] or y >= counts[1] or z >= counts[2]:
        return EMPTY
    return cells.blocks[(x * counts[1] + y) * counts[2] + z]


@wp.func
def tape_of_block(block: wp.int32, cells: RayCells) -> wp.vec2i:
    """Return the first texel of the tape of a block with this entry, and one past its last."""
    return wp.vec2i(block + 1, block + 1 + int(cells.tape[block][0]))


@wp.func
def whole_tape(cells: RayCells) -> wp.vec2i:
    """Return the first texel of the tape of the whole model, and one past its last."""
    return wp.vec2i(cells.start + 1, cells.start + 1 + int(cells.tape[cells.start][0]))


@wp.func
def tape_at(q: wp.vec3, cells: RayCells) -> wp.vec2i:
    """Return the span of a tape that gives the field at q: that of the block around q, or the whole one."""
    if cells.counts[0] == 0:
        return whole_tape(cells)
    block = block_at((q - cells.lower) / cells.block_size, cells)
    if block >= 0:
        return tape_of_block(block, cells)
    return whole_tape(cells)


@wp.func
def passed_way(way: wp.float32, t: wp.float32) -> wp.float32:
    """Return t; up to `way` a ray is known to be free of surface.

    ``shaders/loop_guard.glsl`` has another function of this name, which keeps the way.
    """
    return t


@wp.func
def first_hit(
    origin: wp.vec3,
    direction: wp.vec3,
    t_min: wp.float32,
    t_max: wp.float32,
    tolerance: wp.float32,
    tape: Texels,
    span: wp.vec2i,
) -> wp.float32:
    """Return the distance along the unit `direction` to the first point inside in [t_min, t_max], or MISS.

    A point is a hit if it lies inside, or if Newton's method along the gradient takes it to the surface in
    few steps of at most a tolerance: ISO − f ≤ tolerance · |∇f|. One step is not enough, for a steep field
    may be flat behind it. A slope bound alone is no hit, because behind warps it may be far above the slope.
    A ray that starts inside hits at t_min.

    No step is shorter than a tolerance, or than several after many steps. So rays miss only parts in which
    they stay inside for less than such a step. A step that ends inside is cut by linear interpolation.
    """
    t = t_min
    reach = wp.max(t_max - t_min, 4.0 * tolerance)
    last_gap = float(1.0)
    last_step = float(0.0)
    for step in range(MAX_STEPS):
        t = passed_way(t - last_step, t)
        if t > t_max:
            return MISS
        bound = field_bound(origin + direction * t, direction, reach, tape, span)
        gap = ISO - bound[0]
        free = reach
        if gap <= 0.0:
            return t + last_step * gap / (last_gap - gap)
        if bound[1] * reach > gap:
            free = gap / bound[1]
            if free <= tolerance:
                q = origin + direction * t
                rise = float(0.0)
                at_surface = bool(False)
                for newton in range(HIT_STEPS):
                    f = field_gradient(q, tape, span)
                    slope = wp.vec3(f[1], f[2], f[3])
                    steepness = wp.length(slope)
                    if newton == 0:
                        rise = wp.dot(slope, direction)
                    if ISO - f[0] > tolerance * steepness:
                        break
                    if ISO - f[0] <= HIT_GAP:
                        at_surface = True
                        break
                    q += slope * ((ISO - f[0]) / (steepness * steepness))
                if at_surface:
                    return t + way_to_surface(
                        origin + direction * t, direction, gap, rise, tolerance, tape, span
                    )
            free = wp.max(free, tolerance * wp.max(1.0, float(step) / STEPS_PER_TOLERANCE))
        t += free
        last_gap = gap
        last_step = free
        reach = 2.0 * free
    return MISS


@wp.func
def way_to_surface(
    point: wp.vec3,
    direction: wp.vec3,
    gap: wp.float32,
    rise: wp.float32,
    tolerance: wp.float32,
    tape: Texels,
    span: wp.vec2i,
) -> wp.float32:
    """Return the way along a ray from a point within a tolerance of the surface to the surface.

    Newton's method finds it: by one step of less than 2 tolerances, or by `GRAZING_STEPS` longer ones. The
    way is 0 where these do not arrive, as on a ray that passes beside a round surface.
    """
    if gap < rise * tolerance * 2.0:
        return gap / rise
    way = float(0.0)
    left = gap
    slope = rise
    for _step in range(GRAZING_STEPS):
        if wp.abs(left) > slope * tolerance * LONGEST_WAY:
            return 0.0
        way += left / slope
        f = field_gradient(point + direction * way, tape, span)
        left = ISO - f[0]
        slope = wp.dot(wp.vec3(f[1], f[2], f[3]), direction)
        if wp.abs(left) <= ARRIVED * gap:
            return wp.max(way, 0.0)
    return 0.0


@wp.func
def box_interval(origin: wp.vec3, direction: wp.vec3, lower: wp.vec3, upper: wp.vec3) -> wp.vec2:
    """Return the interval (t_enter ≥ 0, t_leave) of a ray in a box; t_leave < t_enter for a miss."""
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
    """Return 1 / each component, or 0 where the component is 0."""
    inverse = wp.vec3()
    for axis in range(3):
        if direction[axis] != 0.0:
            inverse[axis] = wp.clamp(1.0 / direction[axis], -MAX_DISTANCE, MAX_DISTANCE)
    return inverse


@wp.func
def exit_distance(origin: wp.vec3, inverse: wp.vec3, lower: wp.vec3, upper: wp.vec3) -> wp.float32:
    """Return the distance to the exit of a ray from a box; `inverse` is the `reciprocal` of its direction."""
    leave = float(MAX_DISTANCE)
    for axis in range(3):
        if inverse[axis] > 0.0:
            leave = wp.min(leave, (upper[axis] - origin[axis]) * inverse[axis])
        elif inverse[axis] < 0.0:
            leave = wp.min(leave, (lower[axis] - origin[axis]) * inverse[axis])
    return leave


@wp.func
def trace_ray(origin: wp.vec3, direction: wp.vec3, start: wp.float32, cells: RayCells) -> wp.vec3:
    """Return the first hit of a ray: (distance or MISS, first texel of the tape there, end of the tape).

    The ray is traced from the way `start` on. A way counts from where the ray enters the grid.
    """
    counts = cells.counts
    extent = cells.block_size * wp.vec3(float(counts[0]), float(counts[1]), float(counts[2]))
    interval = box_interval(origin, direction, cells.lower, cells.lower + extent)
    entry = origin + direction * interval[0]  # distances count from here, for the origin may be far away
    last = interval[1] - interval[0]
    inverse = reciprocal(direction)
    t = float(start)
    for _block in range(MAX_BLOCKS):
        if t > last:
            return wp.vec3(MISS, 0.0, 0.0)
        p = (entry + direction * t - cells.lower) / cells.block_size
        x = wp.clamp(int(wp.floor(p[0])), 0, counts[0] - 1)
        y = wp.clamp(int(wp.floor(p[1])), 0, counts[1] - 1)
        z = wp.clamp(int(wp.floor(p[2])), 0, counts[2] - 1)
        block = cells.blocks[(x * counts[1] + y) * counts[2] + z]
        layers = wp.max(EMPTY - block, 0)
        corner = cells.lower + cells.block_size * wp.vec3(
            float(x - layers), float(y - layers), float(z - layers)
        )
        size = cells.block_size * float(2 * layers + 1)
        leave = exit_distance(entry, inverse, corner, corner + wp.vec3(size, size, size))
        leave = wp.max(leave, t) + BLOCK_OVERLAP * cells.tolerance
        if block == SURELY_INSIDE:
            whole = float(cells.start + 1)
            return wp.vec3(interval[0] + t, whole, whole + cells.tape[cells.start][0])
        if block >= 0:
            span = tape_of_block(block, cells)
            hit = first_hit(entry, direction, t, leave, cells.tolerance, cells.tape, span)
            if hit >= 0.0:
                return wp.vec3(interval[0] + hit, float(span[0]), float(span[1]))
        t = leave
    return wp.vec3(MISS, 0.0, 0.0)


@wp.kernel
def trace_rays(
    first: wp.int32,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    cells: RayCells,
    distances: wp.array(dtype=wp.float32),
    spans: wp.array(dtype=wp.vec2i),
) -> None:
    """Write the distance to each ray's first hit, inf for a miss, and the span of the tape at the hit."""
    i = first + wp.tid()
    direction = wp.normalize(directions[i])
    hit = trace_ray(origins[i], direction, 0.0, cells)
    t = hit[0]
    if t < 0.0:
        t = wp.inf
    distances[i] = t
    spans[i] = wp.vec2i(int(hit[1]), int(hit[2]))
