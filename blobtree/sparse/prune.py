"""Pruning a tape to a cell: the same interpreter loop over intervals, writing down what still matters.

Over a cube every primitive has a smallest and a largest value, every operator the range of its result, and
often a result that depends on one operand alone (`Operator.choice`). The loop copies the instructions that
matter to a new tape and rolls back what a later choice makes irrelevant, so the pruned tape gives the same
value, gradient and colour as the whole one at every point of the cube.
"""

import warp as wp

from blobtree.formulas.kernels import falloff_range
from blobtree.formulas.operators import KEEP_BOTH, KEEP_LEFT, KEEP_NONE, KEEP_RIGHT, OPERATORS, SUM
from blobtree.formulas.skeletons import HALF_DIAGONAL, SKELETONS, squared_distances_to_ball
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.tapes.dispatch import closest, slimmest, stride, warp_forward, warp_stretch
from blobtree.tapes.readings import to_local
from blobtree.tapes.tape import POP, PREFIX, PUSH, REGISTERS, STRETCHED, UNWARP, WARP, WARP_REGISTERS
from blobtree.typed.unroll import unrolled

wp.set_module_options(KERNEL_OPTIONS)

SUM_CODE = wp.constant(OPERATORS.index(SUM))

ROUNDING = wp.constant(2e-6)
"""Ranges are widened by this, so that float32 never rounds a value out of them."""

_Ranges = wp.types.matrix(shape=(REGISTERS, 2), dtype=wp.float32)
_Starts = wp.types.vector(length=REGISTERS, dtype=wp.int32)
_Places = wp.types.matrix(shape=(WARP_REGISTERS, 3), dtype=wp.float32)
_Balls = wp.types.vector(length=WARP_REGISTERS, dtype=wp.float32)
_OuterStarts = wp.types.vector(length=WARP_REGISTERS, dtype=wp.int32)


@wp.func
def widened(r: wp.vec2) -> wp.vec2:
    """A range with room for rounding; 0 stays 0."""
    if r[1] <= 0.0:
        return wp.vec2(0.0, 0.0)
    return wp.vec2(wp.max(r[0] - ROUNDING, 0.0), r[1] + ROUNDING)


@unrolled
def primitive_range(
    kind: wp.int32, center: wp.vec3, half: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec2:
    """Range of a primitive over the cube center ± half."""
    distances = wp.vec2()
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            distances = wp.static(SKELETONS[code].box_distances)(center, half, tape, at)
    return widened(falloff_range(distances[0], distances[1]))


@wp.func
def range_in_ball(
    kind: wp.int32, center: wp.vec3, radius: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec2:
    """Range of a primitive over a ball."""
    c = closest(kind, center, tape, at)
    distances = squared_distances_to_ball(center, radius, c, slimmest(kind, tape, at))
    return widened(falloff_range(distances[0], distances[1]))


@unrolled
def operator_range(operator: wp.int32, a: wp.vec2, b: wp.vec2, parameter: wp.float32) -> wp.vec2:
    """Range of any operator's result."""
    result = wp.vec2()
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].range)(a, b, parameter)
    return result


@unrolled
def operator_choice(operator: wp.int32, a: wp.vec2, b: wp.vec2) -> wp.int32:
    """What any operator's result depends on."""
    result = int(KEEP_BOTH)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].choice)(a, b)
    return result


@unrolled
def first_operator(operator: wp.int32) -> wp.int32:
    """The operator that folds a first operand into the empty field, `operator` itself where it can."""
    result = int(SUM_CODE)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code and wp.static(OPERATORS[code].starts_from_zero):
            result = operator
    return result


@wp.func
def prune(
    center: wp.vec3,
    half: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
    out: wp.array(dtype=wp.vec4),
    start: wp.int32,
    write: wp.bool,
) -> wp.vec4:
    """Prune tape[span] to the cube center ± half.

    Returns (smallest, largest field over the cube, texels that writing needs, texels of the result). With
    `write` the result lies in `out` from `start` on; without, nothing is written.
    """
    accumulator = wp.vec2(0.0, 0.0)
    accumulator_start = int(0)
    ranges = _Ranges()
    starts = _Starts()
    end = int(0)
    peak = int(0)
    run_at = int(-1)
    run = wp.vec4()
    place = center
    ball = half * HALF_DIAGONAL  # what is looked at lies in this ball; behind a warp nothing better is known
    warped = int(0)
    places = _Places()
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
            stretched = code >= STRETCHED
            kind = code
            size = int(0)
            if stretched:
                kind = code - STRETCHED
                size = PREFIX
            size += stride(kind)
            for _i in range(count):
                r = wp.vec2()
                if stretched:
                    local = to_local(place, tape, at)
                    r = range_in_ball(kind, local, ball * tape[at + 3][0], tape, at + PREFIX)
                elif warped > 0:
                    r = range_in_ball(kind, place, ball, tape, at)
                else:
                    r = primitive_range(kind, place, half, tape, at)
                choice = operator_choice(operator, accumulator, r)
                if choice == KEEP_NONE:
                    end = accumulator_start
                    accumulator = wp.vec2(0.0, 0.0)
                    run_at = -1
                elif choice != KEEP_LEFT:
                    wanted = wp.vec4(header[0], header[1], 1.0, header[3])
                    if choice == KEEP_RIGHT:
                        end = accumulator_start
                        run_at = -1
                        accumulator = r
                        wanted[1] = float(first_operator(operator))
                        if first_operator(operator) != operator:
                            wanted[3] = 0.0
                    else:
                        accumulator = operator_range(operator, accumulator, r, header[3])
                    if run_at >= 0 and run[1] == wanted[1] and run[0] == wanted[0] and run[3] == wanted[3]:
                        run[2] = run[2] + 1.0
                    else:
                        run = wanted
                        run_at = end
                        end += 1
                    if write:
                        out[start + run_at] = run
                        for k in range(size):
                            out[start + end + k] = tape[at + k]
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
            p = tape[at + 3]
            local = to_local(place, tape, at)
            reach = ball * p[0]
            places[count] = place
            balls[count] = ball
            outer_starts[count] = accumulator_start
            place = warp_forward(operator, local, p)
            ball = reach * warp_stretch(operator, local, reach, p)
            warped += 1
            if write:
                for k in range(PREFIX + 1):
                    out[start + end + k] = tape[at - 1 + k]
            end += PREFIX + 1
            peak = wp.max(peak, end)
            accumulator_start = end
            run_at = -1
            at += PREFIX
        elif code == UNWARP:
            place = places[count]
            ball = balls[count]
            warped -= 1
            accumulator_start = outer_starts[count]
            if accumulator[1] <= 0.0:
                end = accumulator_start
            else:
                if write:
                    for k in range(PREFIX + 1):
                        out[start + end + k] = tape[at - 1 + k]
                end += PREFIX + 1
                peak = wp.max(peak, end)
            run_at = -1
            at += PREFIX
        else:
            kept = ranges[count]
            kept_start = starts[count]
            choice = int(0)
            result = wp.vec2()
            if code == POP:
                choice = operator_choice(operator, kept, accumulator)
                result = operator_range(operator, kept, accumulator, header[3])
            else:
                choice = operator_choice(operator, accumulator, kept)
                result = operator_range(operator, accumulator, kept, header[3])
                if choice == KEEP_LEFT:
                    choice = KEEP_RIGHT
                elif choice == KEEP_RIGHT:
                    choice = KEEP_LEFT
            if choice == KEEP_NONE:
                end = kept_start
                accumulator = wp.vec2(0.0, 0.0)
            elif choice == KEEP_LEFT:
                end = accumulator_start - 1
                accumulator = kept
            elif choice == KEEP_RIGHT:
                if write:
                    for k in range(end - accumulator_start):
                        out[start + kept_start + k] = out[start + accumulator_start + k]
                end = kept_start + end - accumulator_start
            else:
                if write:
                    out[start + end] = header
                end += 1
                peak = wp.max(peak, end)
                accumulator = result
            accumulator_start = kept_start
            run_at = -1
    return wp.vec4(accumulator[0], accumulator[1], float(peak), float(end))
