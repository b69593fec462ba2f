"""Which smooth branches of a field a patch of surface lies on: those of its edges' exact crossings."""

from typing import Any

import warp as wp

from blobtree.formulas.kernels import ISO
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.meshing.branches import branch_at
from blobtree.meshing.meeting import MOST_BRANCHES, SMALLEST_SINE
from blobtree.meshing.patches import EDGES
from blobtree.tapes.evaluate import field_value

wp.set_module_options(KERNEL_OPTIONS)

ROOT_STEPS = 12

ON_THE_SURFACE = wp.constant(1e-6)
"""Field error at which a crossing has been found."""

MOST_SHEETS = 8
"""Labels that are told apart among a patch's twelve crossings, before those that mean one sheet go."""

SAME = 2e-3
"""Distance in cells between two branches at a crossing up to which they may be one."""

_EDGE_FIRST = wp.types.vector(length=12, dtype=wp.int32)(*(a for a, _ in EDGES))
_EDGE_LAST = wp.types.vector(length=12, dtype=wp.int32)(*(b for _, b in EDGES))

CornerValues: Any = wp.types.vector(length=8, dtype=wp.float32)
_Points: Any = wp.types.matrix(shape=(MOST_SHEETS, 3), dtype=wp.float32)
_Numbers: Any = wp.types.vector(length=MOST_SHEETS, dtype=wp.int32)


@wp.struct
class Sheets:
    """The branches on which the edge crossings of a patch lie."""

    count: wp.int32
    labels: _Numbers
    references: _Points
    """One crossing of each."""
    sums: _Points
    """The sum of its crossings,"""
    hits: _Numbers
    """and their number."""


@wp.func
def cell_corner(low: wp.vec3, cell: wp.float32, corner: wp.int32) -> wp.vec3:
    """A corner of the cell whose lowest one is `low`."""
    return low + wp.vec3(float(corner & 1), float((corner >> 1) & 1), float(corner >> 2)) * cell


@wp.func
def edge_crossing(
    a: wp.vec3,
    b: wp.vec3,
    value_a: wp.float32,
    value_b: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> wp.vec3:
    """Where an edge crosses the surface: regula falsi, the end that stays being weighed down (Illinois)."""
    low = float(0.0)
    high = float(1.0)
    gap_low = value_a - ISO
    gap_high = value_b - ISO
    share = float(0.5)
    last = int(0)
    for _step in range(ROOT_STEPS):
        share = low + (high - low) * gap_low / (gap_low - gap_high)
        gap = field_value(a + (b - a) * share, tape, span) - ISO
        if wp.abs(gap) <= ON_THE_SURFACE:
            break
        if (gap > 0.0) == (gap_low > 0.0):
            low = share
            gap_low = gap
            if last == 1:
                gap_high = 0.5 * gap_high
            last = 1
        else:
            high = share
            gap_high = gap
            if last == 2:
                gap_low = 0.5 * gap_low
            last = 2
    return a + (b - a) * share


@wp.func
def row_of(points: _Points, k: wp.int32) -> wp.vec3:
    """One of several points."""
    return wp.vec3(points[k, 0], points[k, 1], points[k, 2])


@wp.func
def gather_sheets(
    patch: wp.int32,
    row: wp.int32,
    patch_of_edge: wp.array(dtype=wp.int8),
    low: wp.vec3,
    cell: wp.float32,
    values: CornerValues,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> Sheets:
    """The branches of a patch's crossings by their labels."""
    sheets = Sheets()
    for edge in range(12):
        if int(patch_of_edge[row * 12 + edge]) == patch:
            a = _EDGE_FIRST[edge]
            b = _EDGE_LAST[edge]
            start = cell_corner(low, cell, a)
            r = edge_crossing(start, cell_corner(low, cell, b), values[a], values[b], tape, span)
            label = int(branch_at(r, r, tape, span)[1])
            slot = int(0)
            while slot < sheets.count and sheets.labels[slot] != label:
                slot += 1
            if slot < MOST_SHEETS:
                if slot == sheets.count:
                    sheets.labels[slot] = label
                    sheets.references[slot] = r
                    sheets.count += 1
                sheets.sums[slot] = row_of(sheets.sums, slot) + r
                sheets.hits[slot] = sheets.hits[slot] + 1
    return sheets


@wp.func
def explains(
    reference: wp.vec3, r: wp.vec3, cell: wp.float32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
) -> wp.bool:
    """Whether the branch of `reference` goes on through the crossing r just as the surface does there."""
    own = branch_at(r, r, tape, span)
    other = branch_at(r, reference, tape, span)
    gradient = wp.vec3(own[3], own[4], own[5])
    steepness = wp.length(gradient)
    tilt = wp.length(wp.cross(wp.normalize(gradient), wp.normalize(wp.vec3(other[3], other[4], other[5]))))
    return wp.abs(own[2] - other[2]) <= SAME * cell * steepness and tilt <= SMALLEST_SINE


@wp.func
def without_doubles(
    sheets: Sheets, cell: wp.float32, tape: wp.array(dtype=wp.vec4), span: wp.vec2i
) -> Sheets:
    """The sheets that no other one explains: labels differ too where what they tell apart fades to 0."""
    kept = Sheets()
    for step in range(sheets.count):
        k = sheets.count - 1 - step
        r = row_of(sheets.references, k)
        needed = bool(True)
        for other in range(k):
            if needed and explains(row_of(sheets.references, other), r, cell, tape, span):
                needed = False
        for other in range(kept.count):
            if needed and explains(row_of(kept.references, other), r, cell, tape, span):
                needed = False
        if needed:
            kept.references[kept.count] = r
            kept.sums[kept.count] = row_of(sheets.sums, k)
            kept.hits[kept.count] = sheets.hits[k]
            kept.count += 1
    kept.count = wp.min(kept.count, MOST_BRANCHES)
    return kept
