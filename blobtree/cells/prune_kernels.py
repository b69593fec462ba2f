"""Pruning: the interpreter's loop over intervals, which writes the part of a tape that acts in a cube.

Over a cube each primitive has a smallest and a largest value, and each operator a range of results. Often a
result depends on one operand alone (`Operator.choice`). `prune` copies the instructions that matter to a new
tape and drops those that a later choice makes irrelevant. At every point of the cube, the pruned tape gives
the same value, gradient and colour as the whole one.
"""

import warp as wp

from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE, KEEP_RIGHT
from blobtree.formulas.falloff import falloff_range
from blobtree.formulas.skeletons import (
    HALF_DIAGONAL,
    box_to_point,
    squared_distances_to_ball,
)
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.codes import (
    FIELD,
    OPERATORS,
    POP_SWAPPED,
    PREFIX,
    PUSH,
    REGISTERS,
    SKELETONS,
    STRETCHED,
    UNWARP,
    WARP,
    WARP_REGISTERS,
)
from blobtree.tape.dispatch import (
    closest,
    depth,
    direct_stride,
    has_distances,
    influence_around,
    is_convex,
    operator_choice,
    operator_range,
    starts_from_zero,
    stride,
    warp_extent,
    warp_forward,
    warp_stretch,
    warp_texel,
)
from blobtree.tape.evaluators import direct_bounds, direct_within, profile_value, to_local
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

SUM_CODE = wp.constant(OPERATORS.index("sum"))

RANGE_MARGIN = wp.constant(2e-6)
"""Widening of ranges, so that float32 rounds no value out of them."""

_Ranges = wp.types.matrix(shape=(REGISTERS, 2), dtype=wp.float32)
_Starts = wp.types.vector(length=REGISTERS, dtype=wp.int32)
_Points = wp.types.matrix(shape=(WARP_REGISTERS, 3), dtype=wp.float32)
_Balls = wp.types.vector(length=WARP_REGISTERS, dtype=wp.float32)
POINT_CODE = SKELETONS.index("point")

_OuterStarts = wp.types.vector(length=WARP_REGISTERS, dtype=wp.int32)


@wp.func
def widened(r: wp.vec2) -> wp.vec2:
    """Return a range widened for rounding; 0 stays 0."""
    if r[1] <= 0.0:
        return wp.vec2(0.0, 0.0)
    return wp.vec2(wp.max(r[0] - RANGE_MARGIN, 0.0), r[1] + RANGE_MARGIN)


@wp.func
def ball_range(kind: wp.int32, center: wp.vec3, half: wp.float32, tape: Texels, at: wp.int32) -> wp.vec2:
    """Return the range of a primitive over the ball around the cube center ± half."""
    c = closest(kind, center, tape, at)
    inside = depth(kind, center, tape, at)
    radius = half * HALF_DIAGONAL
    smallest = influence_around(kind, tape, at, center, c)
    distances = squared_distances_to_ball(center, radius, c, smallest, inside)
    return falloff_range(distances[0], distances[1])


@wp.func
def primitive_range(kind: wp.int32, center: wp.vec3, half: wp.float32, tape: Texels, at: wp.int32) -> wp.vec2:
    """Return the range of a primitive over the cube center ± half."""
    if kind == POINT_CODE:
        distances = box_to_point(center, half, tape, at)
        return widened(falloff_range(distances[0], distances[1]))
    return widened(ball_range(kind, center, half, tape, at))


@wp.func
def distances_in_box(
    kind: wp.int32, center: wp.vec3, half: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec2:
    """Bounds on |x − skeleton| / influence over what a ball and the box center ± half have in common.

    A convex skeleton lies behind the plane through its closest point across the way to it.
    """
    c = closest(kind, center, tape, at)
    smallest = influence_around(kind, tape, at, center, c)
    away = wp.abs(center - wp.vec3(c[0], c[1], c[2]))
    distance = wp.length(away)
    toward = radius
    if is_convex(kind) and distance > 0.0:
        toward = wp.min(radius, wp.dot(away, half) / distance)
    outside = wp.max(radius - wp.max(depth(kind, center, tape, at), 0.0), 0.0)
    farthest = wp.min(distance / c[3] + outside / smallest, wp.length(away + half) / c[3])
    return wp.vec2(wp.max(distance / c[3] - toward / smallest, 0.0), farthest)


@wp.func
def direct_range(
    kind: wp.int32, center: wp.vec3, extent: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec2:
    """Return the range of a direct field in front of its map, which is at tape[at].

    It holds where a ball and the box center ± extent meet.
    """
    local = to_local(center, tape, at)
    bounds = wp.vec2()
    if has_distances(kind):
        bounds = direct_within(kind, local, extent_to_local(extent, tape, at), tape, at + PREFIX)
    else:
        around = direct_bounds(kind, local, radius * tape[at + 3][0], tape, at + PREFIX)
        bounds = wp.vec2(around[0], around[1])
    profile = tape[at + 3]
    margin = RANGE_MARGIN * (1.0 + profile[2]) * wp.abs(profile[3])
    if bounds[0] == 0.0 and bounds[1] == 0.0:
        return wp.vec2(0.0, 0.0)
    if profile[3] < 0.0:
        return wp.vec2(bounds[0] - margin, wp.min(bounds[1] + margin, 0.0))
    return wp.vec2(wp.max(bounds[0] - margin, 0.0), bounds[1] + margin)


@wp.func
def absent(r: wp.vec2) -> wp.bool:
    """Return True if a field of this range is 0 everywhere."""
    return r[1] <= 0.0 and r[0] >= 0.0


@wp.func
def stretched_range(
    kind: wp.int32, point: wp.vec3, extent: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec2:
    """Return the range of a primitive with a map, and maybe a profile, at tape[at]; see `range_anywhere`."""
    profile = tape[at + 3]
    center = to_local(point, tape, at)
    half = extent_to_local(extent, tape, at)
    distances = distances_in_box(kind, center, half, radius * profile[0], tape, at + PREFIX)
    if profile[2] == 0.0:
        return widened(falloff_range(distances[0] * distances[0], distances[1] * distances[1]))
    largest = profile_value(distances[0], profile)
    if largest <= 0.0:
        return wp.vec2(0.0, 0.0)
    margin = RANGE_MARGIN * (1.0 + profile[2])
    smallest = wp.max(profile_value(distances[1], profile) - margin, 0.0)
    largest += margin
    if profile[3] < 0.0:
        return wp.vec2(largest, smallest) * profile[3]
    return wp.vec2(smallest, largest) * profile[3]


@wp.func
def extent_to_local(half: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return half the size of the box around a box behind the map at tape[at]."""
    return wp.vec3(row_extent(tape[at], half), row_extent(tape[at + 1], half), row_extent(tape[at + 2], half))


@wp.func
def row_extent(row: wp.vec4, half: wp.vec3) -> wp.float32:
    """Return the largest change of a row of a map over a box of this half size."""
    return wp.abs(row[0]) * half[0] + wp.abs(row[1]) * half[1] + wp.abs(row[2]) * half[2]


@wp.func
def first_operator(operator: wp.int32) -> wp.int32:
    """Return the operator that folds a first operand into the empty field: `operator` itself if it can."""
    if starts_from_zero(operator):
        return operator
    return SUM_CODE


@wp.func
def range_anywhere(
    kind: wp.int32,
    stretched: wp.bool,
    warped: wp.bool,
    point: wp.vec3,
    half: wp.float32,
    extent: wp.vec3,
    ball: wp.float32,
    tape: Texels,
    at: wp.int32,
) -> wp.vec2:
    """Return the range of a primitive over the cube point ± half.

    A map or a warp takes the cube to a shape that only a ball, and the box point ± extent, bound.
    """
    if stretched:
        return stretched_range(kind, point, extent, ball, tape, at)
    if warped:
        distances = distances_in_box(kind, point, extent, ball, tape, at)
        return widened(falloff_range(distances[0] * distances[0], distances[1] * distances[1]))
    return primitive_range(kind, point, half, tape, at)


@wp.func
def copy_texels(source: Texels, first: wp.int32, count: wp.int32, target: Texels, at: wp.int32) -> None:
    """Copy texels source[first : first + count] to target[at :], in ascending order."""
    for k in range(count):
        target[at + k] = source[first + k]


@wp.func
def fold_range(
    header: wp.vec4,
    r: wp.vec2,
    accumulator: wp.vec2,
    accumulator_start: wp.int32,
    end: wp.int32,
    run_at: wp.int32,
    run: wp.vec4,
    tape: Texels,
) -> tuple[wp.vec2, wp.int32, wp.int32, wp.vec4, wp.bool]:
    """Fold a primitive of range `r` into the accumulator.

    Return (accumulator, end, run_at, run) after that, see `prune`, and True if the primitive matters.
    """
    operator = int(header[1])
    choice = operator_choice(operator, accumulator, r, header[3], tape)
    if choice == KEEP_NONE:
        return wp.vec2(0.0, 0.0), accumulator_start, -1, run, False
    if choice == KEEP_LEFT:
        return accumulator, end, run_at, run, False
    result = r
    first = wp.vec4(header[0], header[1], 1.0, header[3])  # header of a run of this primitive alone
    if choice == KEEP_RIGHT:
        first[1] = float(first_operator(operator))
        if first_operator(operator) != operator:
            first[3] = 0.0
        return result, accumulator_start + 1, accumulator_start, first, True
    result = operator_range(operator, accumulator, r, header[3], tape)
    if run_at >= 0 and run[1] == first[1] and run[0] == first[0] and run[3] == first[3]:
        return result, end, run_at, wp.vec4(run[0], run[1], run[2] + 1.0, run[3]), True
    return result, end + 1, end, first, True


@wp.func
def pop_range(
    header: wp.vec4,
    left: wp.vec2,
    left_start: wp.int32,
    accumulator: wp.vec2,
    accumulator_start: wp.int32,
    end: wp.int32,
    tape: Texels,
    out: wp.array(dtype=wp.vec4),
    start: wp.int32,
    write: wp.bool,
) -> tuple[wp.vec2, wp.int32]:
    """Combine the range `left` of a register, computed from texel `left_start` on, with the accumulator.

    Return (accumulator, end) after that, see `prune`.
    """
    operator = int(header[1])
    swapped = int(header[0]) == POP_SWAPPED
    a = left
    b = accumulator
    if swapped:
        a = accumulator
        b = left
    choice = operator_choice(operator, a, b, header[3], tape)
    if choice == KEEP_NONE:
        return wp.vec2(0.0, 0.0), left_start
    if (choice == KEEP_LEFT and not swapped) or (choice == KEEP_RIGHT and swapped):
        return left, accumulator_start - 1
    if choice == KEEP_BOTH:
        if write:
            out[start + end] = header
        return operator_range(operator, a, b, header[3], tape), end + 1
    if write:
        copy_texels(out, start + accumulator_start, end - accumulator_start, out, start + left_start)
    return accumulator, left_start + end - accumulator_start


@wp.func
def prune(
    center: wp.vec3,
    half: wp.float32,
    tape: Texels,
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec4),
    start: wp.int32,
    write: wp.bool,
) -> wp.vec4:
    """Prune tape[span] to the cube center ± half.

    Return (smallest, largest field over the cube, texels that writing needs, texels of the result). Write the
    result to `out` from `start` on if `write` is true, else nothing. Texels of the result are counted from
    `start`. The state is in variables, because a struct of them makes the loop slower.
    """
    accumulator = wp.vec2(0.0, 0.0)  # its range
    accumulator_start = int(0)  # first texel of the instructions that compute it
    ranges = _Ranges()
    starts = _Starts()
    end = int(0)  # texels so far
    peak = int(0)  # most texels at any time, for later choices drop instructions again
    run_at = int(-1)  # header of the run that the next primitive may extend, or −1
    run = wp.vec4()
    point = center
    ball = half * HALF_DIAGONAL  # radius around `point`
    extent = wp.vec3(half, half, half)  # of a box around `point`
    warped = int(0)
    points = _Points()
    extents = _Points()
    balls = _Balls()
    outer_starts = _OuterStarts()
    at = span[0]
    while at < span[1]:
        header = tape[at]
        code = int(header[0])
        operator = int(header[1])
        count = int(header[2])
        at += 1
        if code >= 0:
            direct = code >= FIELD
            stretched = code >= STRETCHED and not direct
            kind = code
            size = int(0)
            if direct:
                kind = code - FIELD
                size = PREFIX + direct_stride(kind)
            elif stretched:
                kind = code - STRETCHED
                size = PREFIX + stride(kind)
            else:
                size = stride(kind)
            for _i in range(count):
                r = wp.vec2()
                if direct:
                    r = direct_range(kind, point, extent, ball, tape, at)
                else:
                    r = range_anywhere(kind, stretched, warped > 0, point, half, extent, ball, tape, at)
                accumulator, end, run_at, run, needed = fold_range(
                    header, r, accumulator, accumulator_start, end, run_at, run, tape
                )
                if needed:
                    if write:
                        out[start + run_at] = run
                        copy_texels(tape, at, size, out, start + end)
                    end += size
                    peak = wp.max(peak, end)
                at += size
        elif code == PUSH:
            ranges[count] = accumulator
            starts[count] = accumulator_start
            if write:
                out[start + end] = header
            end += 1
            peak = wp.max(peak, end)
            accumulator = wp.vec2(0.0, 0.0)
            accumulator_start = end
            run_at = -1
        elif code == WARP:
            local = to_local(point, tape, at)
            reach = ball * tape[at + 3][0]
            size = PREFIX + int(header[3])
            points[count] = point
            balls[count] = ball
            extents[count] = extent
            outer_starts[count] = accumulator_start
            point = warp_forward(operator, local, tape, at + 3)
            ball = reach * warp_stretch(operator, local, reach, tape, at + 3)
            extent = warp_extent(operator, local, extent_to_local(extent, tape, at), tape, at + 3)
            extent = wp.min(extent, wp.vec3(ball, ball, ball))
            warped += 1
            if write:
                copy_texels(tape, at - 1, PREFIX, out, start + end)
                for i in range(1 + int(header[3])):
                    kept = tape[at + PREFIX - 1 + i]
                    kept = warp_texel(operator, local, reach, kept, i, tape, at + PREFIX - 1)
                    out[start + end + PREFIX + i] = kept
            end += size + 1
            peak = wp.max(peak, end)
            accumulator_start = end
            run_at = -1
            at += size
        elif code == UNWARP:
            point = points[count]
            ball = balls[count]
            extent = extents[count]
            warped -= 1
            size = PREFIX + int(header[3])
            accumulator_start = outer_starts[count]
            if absent(accumulator):
                end = accumulator_start
            else:
                if write:
                    copy_texels(tape, at - 1, size + 1, out, start + end)
                end += size + 1
                peak = wp.max(peak, end)
            run_at = -1
            at += size
        else:
            accumulator, end = pop_range(
                header,
                ranges[count],
                starts[count],
                accumulator,
                accumulator_start,
                end,
                tape,
                out,
                start,
                write,
            )
            peak = wp.max(peak, end)
            accumulator_start = starts[count]
            run_at = -1
    return wp.vec4(accumulator[0], accumulator[1], float(peak), float(end))


@wp.kernel
def measure_range(
    center: wp.vec3, half: wp.float32, tape: Texels, span: wp.vec2i, out: wp.array(dtype=wp.vec4)
) -> None:
    """Write the range of the field over the cube center ± half, as the first two components."""
    out[0] = prune(center, half, tape, span, tape, 0, False)
