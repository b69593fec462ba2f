"""Kernels of gaps: the primitives to which samples belong, and edges between two that cross the outside."""

import warp as wp

from blobtree.cells.block_kernels import LevelBlocks, grid_point
from blobtree.cells.grid import BRANCHING
from blobtree.formulas.falloff import ISO, RIM
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.dual_kernels import SAMPLES, SAMPLES_PER_SIDE, may_bridge, sample_index
from blobtree.meshing.part_kernels import UNLIMITED
from blobtree.tape.codes import FIELD, PREFIX, STRETCHED, UNWARP, WARP, WARP_REGISTERS
from blobtree.tape.dispatch import closest, direct_stride, stride, warp_forward
from blobtree.tape.evaluators import to_local
from blobtree.tape.interpreter import field_bound, field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

OWNER_HALVINGS = 16
"""Halvings until the place is known where the nearest primitive changes."""

PROOFS = wp.constant(4)
"""Halvings from one bound of the field to the next; these prove for most edges that they stay inside."""

ROUNDING = wp.constant(1e-5)
"""Relative error of the field in float32, which a proof allows for."""

DIRECTIONS = 9
"""Edges of a sample: along each axis, and the diagonals of the three faces that begin there."""

UNKNOWN = wp.constant(-2)
"""Mark of a sample whose nearest primitive is not known."""

HALF_BLOCK = wp.constant(0.5 * BRANCHING)
"""Half the side of a block, in cells."""

BELOW, DEEPEST = wp.constant(0.75), wp.constant(4.0)
"""Cells from the bottom of a crease down to an edge that joins its sides, and most from an edge across it."""

SIDE_HALVINGS = 12
"""Halvings until a side of a gap is known."""

TOUCHING = wp.constant(4e-6)
"""Width of a gap over the largest coordinate, below which its sides touch in float32."""

STRIDES = wp.constant(wp.vec3i(SAMPLES_PER_SIDE**2, SAMPLES_PER_SIDE, 1))
"""Distance of neighbours along each axis in the numbers of samples."""

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


@wp.func
def gap_at(start: wp.vec3, step: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.float32:
    """Return the share of an edge before a place in the gap that it crosses; −1 without one.

    The ends of the edge belong to different primitives. A gap between these is where the nearest primitive
    changes, as its middle is as far from both.
    """
    owner = nearest_primitive(start, tape, span)
    low = float(0.0)
    high = float(1.0)
    for halving in range(OWNER_HALVINGS):
        middle = 0.5 * (low + high)
        place = start + middle * step
        if halving % PROOFS == 1:
            reach = 0.5 * (high - low) * wp.length(step)
            bound = field_bound(place, wp.vec3(0.0), reach, tape, span)
            if bound[0] - reach * bound[1] > ISO:
                return -1.0
        if nearest_primitive(place, tape, span) == owner:
            low = middle
        else:
            high = middle
    gap = 0.5 * (low + high)
    if field_value(start + gap * step, tape, span) < ISO:
        return gap
    return -1.0


@wp.func
def gap_across(start: wp.vec3, step: wp.vec3, tape: Texels, span: wp.vec2i) -> wp.vec2:
    """Return the width of the gap that an edge crosses, 0 without one, and `gap_at`."""
    gap = gap_at(start, step, tape, span)
    if gap < 0.0:
        return wp.vec2(0.0, gap)
    within = float(0.0)
    beyond = gap
    first_side = float(0.0)
    for halving in range(2 * SIDE_HALVINGS):  # to one side, then to the other
        t = 0.5 * (within + beyond)
        if field_value(start + t * step, tape, span) < ISO:
            beyond = t
        else:
            within = t
        if halving == SIDE_HALVINGS - 1:
            first_side = beyond
            within = 1.0
            beyond = gap
    width = (beyond - first_side) * wp.length(step)
    p = start + gap * step
    if width <= TOUCHING * wp.max(wp.max(wp.abs(p[0]), wp.abs(p[1])), wp.abs(p[2])):
        width = 0.0
    return wp.vec2(width, gap)


@wp.func
def sample_place(sample: wp.int32) -> wp.vec3i:
    """Return the place of a sample in its block."""
    side = SAMPLES_PER_SIDE
    return wp.vec3i(sample // (side * side), (sample // side) % side, sample % side)


@wp.func
def root_of(i: wp.int32, labels: wp.array(dtype=wp.int32)) -> wp.int32:
    """Return the lowest known sample that is joined with a sample."""
    root = i
    while labels[root] != root:
        root = labels[root]
    labels[i] = root
    return root


@wp.func
def join(i: wp.int32, other: wp.int32, labels: wp.array(dtype=wp.int32)) -> None:
    """Join two samples."""
    a = root_of(i, labels)
    b = root_of(other, labels)
    labels[wp.max(a, b)] = wp.min(a, b)


@wp.func
def ends_of(i: wp.int32, direction: wp.int32, values: wp.array(dtype=wp.float32)) -> wp.vec2i:
    """Return the samples inside at the ends of an edge of a sample, see DIRECTIONS; −1 if one is outside.

    Diagonals count where the other corners of their face are outside.
    """
    place = sample_place(i % SAMPLES)
    ends = wp.vec2i(i, i + STRIDES[direction % 3])
    if direction < 3:
        if place[direction] == BRANCHING:
            return wp.vec2i(-1)
    else:
        u = (direction + 1) % 3
        v = (direction + 2) % 3
        if place[u] == BRANCHING or place[v] == BRANCHING:
            return wp.vec2i(-1)
        ends = wp.vec2i(i, i + STRIDES[u] + STRIDES[v])
        others = wp.vec2i(i + STRIDES[v], i + STRIDES[u])
        if direction >= 6:
            ends, others = others, ends
        if values[others[0]] >= ISO or values[others[1]] >= ISO:
            return wp.vec2i(-1)
    if values[ends[0]] < ISO or values[ends[1]] < ISO:
        return wp.vec2i(-1)
    return ends


@wp.func
def owner_of(
    i: wp.int32, q: wp.vec3, tape: Texels, span: wp.vec2i, owners: wp.array(dtype=wp.int32)
) -> wp.int32:
    """Return the nearest primitive of a sample at q, and keep it."""
    if owners[i] == UNKNOWN:
        owners[i] = nearest_primitive(q, tape, span)
    return owners[i]


@wp.kernel
def find_crossing_edges(
    first: wp.int32,
    listed: wp.array(dtype=wp.int32),
    level: LevelBlocks,
    base: wp.vec3i,
    corner: wp.vec3,
    cell: wp.float32,
    directions: wp.int32,
    values: wp.array(dtype=wp.float32),
    owners: wp.array(dtype=wp.int32),
    labels: wp.array(dtype=wp.int32),
    widths: wp.array(dtype=wp.float32),
    shares: wp.array(dtype=wp.float32),
) -> None:
    """Write the gaps that edges in listed blocks of a level cross, DIRECTIONS for each sample.

    They are 0 for edges whose ends are joined by edges of the block that stay inside: between samples whose
    values exceed what the slope of the field can take away, between samples of one primitive, or else by
    measure. `values` belong to the samples of these blocks; `owners` and `labels` are room to work in.
    """
    row = first + wp.tid()
    block = listed[row]
    low = base + level.blocks[block]
    span = level.spans[block]
    middle = grid_point(sample_index(low, 0, 0, 0), corner, cell) + wp.vec3(HALF_BLOCK * cell)
    bound = field_bound(middle, wp.vec3(0.0), wp.sqrt(3.0) * HALF_BLOCK * cell, level.tape, span)
    least = 2.0 * ISO * (1.0 + ROUNDING) + wp.max(bound[1], bound[2]) * cell
    for i in range(row * SAMPLES, (row + 1) * SAMPLES):
        owners[i] = UNKNOWN
        labels[i] = i
    left = int(1)
    for stage in range(4):
        if left == 0:
            return
        left = int(0)
        for i in range(row * SAMPLES, (row + 1) * SAMPLES):
            for direction in range(directions):
                ends = ends_of(i, direction, values)
                if ends[0] >= 0 and root_of(wp.max(ends[0], i), labels) != root_of(
                    wp.max(ends[1], i), labels
                ):
                    place = sample_place(ends[0] % SAMPLES)
                    start = grid_point(sample_index(low, place[0], place[1], place[2]), corner, cell)
                    place = sample_place(ends[1] % SAMPLES) - place
                    step = cell * wp.vec3(float(place[0]), float(place[1]), float(place[2]))
                    inside = direction < 3 and values[ends[0]] + values[ends[1]] > least
                    if stage == 1:
                        owner = owner_of(ends[0], start, level.tape, span, owners)
                        inside = owner == owner_of(ends[1], start + step, level.tape, span, owners)
                    elif stage == 2:
                        gap = gap_across(start, step, level.tape, span)
                        inside = gap[0] == 0.0
                        widths[directions * i + direction] = gap[0]
                        shares[directions * i + direction] = gap[1]
                    if inside:
                        join(ends[0], ends[1], labels)
                    else:
                        left += 1
                elif stage == 3:
                    widths[directions * i + direction] = 0.0


@wp.kernel
def mark_open(
    first: wp.int32,
    faces: wp.array(dtype=wp.vec3i),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    cell: wp.float32,
    blocks: wp.array(dtype=wp.int32),
    spans: wp.array(dtype=wp.vec2i),
    tape: Texels,
    opened: wp.array(dtype=wp.bool),
) -> None:
    """Mark triangles that may bridge a gap, but for those across creases, below which an edge is inside.

    The bottom of a crease is where the planes at both ends meet. `blocks` have the tapes that hold there.
    """
    i = first + wp.tid()
    for side in range(3):
        a = faces[i][side]
        b = faces[i][(side + 1) % 3]
        if a < b and may_bridge(a, b, positions, normals):
            step = positions[b] - positions[a]
            outward = normals[a] + normals[b]
            sine = 0.5 * wp.length(outward)
            depth = 0.5 * wp.length(step) * wp.sqrt(wp.max(1.0 - sine * sine, 0.0)) + BELOW * cell * sine
            if depth > DEEPEST * cell * sine:
                opened[i] = True
            else:
                start = positions[a] - depth / sine * wp.normalize(outward)
                if gap_at(start, step, tape, spans[blocks[i]]) >= 0.0:
                    opened[i] = True
