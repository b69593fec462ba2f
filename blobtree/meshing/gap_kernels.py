"""Kernels of gaps: the primitives to which samples belong, and edges between two that cross the outside."""

import warp as wp

from blobtree.cells.block_kernels import LevelBlocks, grid_point
from blobtree.cells.grid import BRANCHING
from blobtree.formulas.falloff import ISO, RIM
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.dual_kernels import SAMPLES, SAMPLES_PER_SIDE, sample_index
from blobtree.meshing.part_kernels import UNLIMITED
from blobtree.tape.codes import FIELD, PREFIX, STRETCHED, UNWARP, WARP, WARP_REGISTERS
from blobtree.tape.dispatch import closest, direct_stride, stride, warp_forward
from blobtree.tape.evaluators import to_local
from blobtree.tape.interpreter import field_bound, field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

OWNER_HALVINGS = 16
"""Halvings until the place is known where the nearest primitive changes."""

PROOF = 1
"""Halvings before a bound of the field, which proves for most edges that they stay inside."""

ROUNDING = wp.constant(1e-5)
"""Relative error of the field in float32, which a proof allows for."""

HALF_BLOCK = wp.constant(0.5 * BRANCHING)
"""Half the side of a block, in cells."""

SIDE_HALVINGS = 12
"""Halvings until a side of a gap is known."""

TOUCHING = wp.constant(4e-6)
"""Width of a gap over the largest coordinate, below which its sides touch in float32."""

_Points = wp.types.matrix(shape=(WARP_REGISTERS, 3), dtype=wp.float32)


@wp.func
def nearest_primitive(q: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.int32:
    """Return the primitive on a tape nearest to q, or deepest around it; −1 if the tape has no other.

    It is given by its texel, counted from the first one.
    """
    nearest = int(-1)
    least = float(UNLIMITED)
    primitives = int(0)
    point = q
    points = _Points()
    at = span[0]
    while at < span[1]:
        header = tape[at]
        code = int(header[0])
        count = int(header[2])
        at += 1
        if code >= 0:
            for _i in range(count):
                own = at
                distance = float(0.0)
                if code >= FIELD:
                    at += PREFIX + direct_stride(code - FIELD)
                elif code >= STRETCHED:
                    kind = code - STRETCHED
                    local = to_local(point, tape, at)
                    c = closest(kind, local, tape, at + PREFIX)
                    distance = (wp.length(local - wp.vec3(c[0], c[1], c[2])) - RIM * c[3]) / tape[at + 3][0]
                    at += PREFIX + stride(kind)
                else:
                    c = closest(code, point, tape, at)
                    distance = wp.length(point - wp.vec3(c[0], c[1], c[2])) - RIM * c[3]
                    at += stride(code)
                primitives += 1
                if distance < least:
                    least = distance
                    nearest = own - span[0]
        elif code == WARP:
            points[count] = point
            point = warp_forward(int(header[1]), to_local(point, tape, at), tape, at + 3)
            at += PREFIX + int(header[3])
        elif code == UNWARP:
            point = points[count]
            at += PREFIX + int(header[3])
    if primitives < 2:
        return -1
    return nearest


@wp.kernel
def bound_slopes(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    level: LevelBlocks,
    base: wp.vec3i,
    corner: wp.vec3,
    cell: wp.float32,
    slopes: wp.array(dtype=wp.float32),
) -> None:
    """Write a Lipschitz bound of the field in listed blocks of a level."""
    i = first + wp.tid()
    block = listed[i]
    low = sample_index(base + level.blocks[block], 0, 0, 0)
    middle = grid_point(low, corner, cell) + wp.vec3(HALF_BLOCK * cell)
    reach = wp.sqrt(3.0) * HALF_BLOCK * cell
    bound = field_bound(middle, wp.vec3(0.0), reach, level.tape, level.spans[block])
    slopes[i] = wp.max(bound[1], bound[2])


@wp.func
def may_leave(
    i: wp.int32, place: wp.int32, stride: wp.int32, least: wp.float32, values: wp.array(dtype=wp.float32)
) -> wp.bool:
    """Return True if an edge of a sample along an axis has its ends inside with a sum of at most `least`."""
    for side in range(2):
        other = place + 2 * side - 1
        if other >= 0 and other < SAMPLES_PER_SIDE:
            value = values[i + (2 * side - 1) * stride]
            if value >= ISO and values[i] + value <= least:
                return True
    return False


@wp.kernel
def find_owners(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    level: LevelBlocks,
    base: wp.vec3i,
    corner: wp.vec3,
    cell: wp.float32,
    slopes: wp.array(dtype=wp.float32),
    values: wp.array(dtype=wp.float32),
    owners: wp.array(dtype=wp.int32),
) -> None:
    """Write the nearest primitive at samples of listed blocks of a level; −1 outside or without a second one.

    It is −1 as well where the slope of the field proves that no edge of the sample leaves the inside.
    """
    i = first + wp.tid()
    row = i // SAMPLES
    sample = i % SAMPLES
    owners[i] = -1
    if values[i] < ISO:
        return
    x = sample // (SAMPLES_PER_SIDE * SAMPLES_PER_SIDE)
    y = (sample // SAMPLES_PER_SIDE) % SAMPLES_PER_SIDE
    z = sample % SAMPLES_PER_SIDE
    least = 2.0 * ISO * (1.0 + ROUNDING) + slopes[row] * cell
    unproved = may_leave(i, x, SAMPLES_PER_SIDE * SAMPLES_PER_SIDE, least, values)
    unproved = unproved or may_leave(i, y, SAMPLES_PER_SIDE, least, values)
    if unproved or may_leave(i, z, 1, least, values):
        block = listed[row]
        index = sample_index(base + level.blocks[block], x, y, z)
        owners[i] = nearest_primitive(grid_point(index, corner, cell), level.tape, level.spans[block])


@wp.kernel
def measure_gaps(
    first: wp.int32,
    starts: wp.array(dtype=wp.vec3),
    steps: wp.array(dtype=wp.vec3),
    blocks: wp.array(dtype=wp.int32),
    spans: wp.array(dtype=wp.vec2i),
    tape: Texels,
    widths: wp.array(dtype=wp.float32),
    places: wp.array(dtype=wp.vec3),
) -> None:
    """Write the width of the gap that each edge crosses, and a place in the gap; 0 for edges without one.

    `steps` lead from the starts to the ends of edges. The ends belong to different primitives. A gap between
    these is where the nearest primitive changes, as its middle is as far from both.
    """
    i = first + wp.tid()
    span = spans[blocks[i]]
    owner = nearest_primitive(starts[i], tape, span)
    low = float(0.0)
    high = float(1.0)
    for halving in range(OWNER_HALVINGS):
        middle = 0.5 * (low + high)
        place = starts[i] + middle * steps[i]
        if halving == PROOF:
            reach = 0.5 * (high - low) * wp.length(steps[i])
            bound = field_bound(place, wp.vec3(0.0), reach, tape, span)
            if bound[0] - reach * bound[1] > ISO:
                return
        if nearest_primitive(place, tape, span) == owner:
            low = middle
        else:
            high = middle
    gap = 0.5 * (low + high)
    within = float(0.0)
    beyond = gap
    first_side = float(0.0)
    for turn in range(2 * SIDE_HALVINGS + 1):  # at the middle first, then to both sides
        t = gap
        if turn > 0:
            t = 0.5 * (within + beyond)
        if field_value(starts[i] + t * steps[i], tape, span) < ISO:
            beyond = t
        elif turn == 0:
            break
        else:
            within = t
        if turn == SIDE_HALVINGS:
            first_side = beyond
            within = 1.0
            beyond = gap
        elif turn == 2 * SIDE_HALVINGS:
            p = starts[i] + gap * steps[i]
            farthest = wp.max(wp.max(wp.abs(p[0]), wp.abs(p[1])), wp.abs(p[2]))
            width = (beyond - first_side) * wp.length(steps[i])
            if width > TOUCHING * farthest:
                widths[i] = width
                places[i] = p
