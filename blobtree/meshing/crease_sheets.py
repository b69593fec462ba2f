"""The sheets of a patch: the smooth branches on which its exact edge crossings lie."""

from typing import Any

import warp as wp

from blobtree.formulas.falloff import ISO
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.meshing.crease_branches import branch_at
from blobtree.meshing.crease_intersections import MAX_BRANCHES, MIN_SINE
from blobtree.meshing.vertex_kernels import EDGE_FIRST, EDGE_LAST
from blobtree.tape.interpreter import field_value
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

ROOT_STEPS = 12

CONVERGED_ERROR = wp.constant(1e-6)
"""Field error at which a crossing is found."""

MAX_SHEETS = 8
"""Most labels of a patch's crossings, before duplicates are removed."""

MAX_SHEET_DISTANCE = 2e-3
"""Distance in cells between two branches at a crossing up to which they may be one sheet."""

CornerValues: Any = wp.types.vector(length=8, dtype=wp.float32)
_Points: Any = wp.types.matrix(shape=(MAX_SHEETS, 3), dtype=wp.float32)
_Numbers: Any = wp.types.vector(length=MAX_SHEETS, dtype=wp.int32)


@wp.struct
class Sheets:
    """The branches on which the edge crossings of a patch lie, and the crossings on each."""

    count: wp.int32
    labels: _Numbers
    references: _Points
    """One crossing on each."""
    sums: _Points
    """Sums of the crossings on each."""
    hits: _Numbers
    """Numbers of the crossings on each."""


@wp.func
def cell_corner(low: wp.vec3, cell: wp.float32, corner: wp.int32) -> wp.vec3:
    """Return a corner of the cell whose lowest corner is `low`."""
    return low + wp.vec3(float(corner & 1), float((corner >> 1) & 1), float(corner >> 2)) * cell


@wp.func
def edge_crossing(
    a: wp.vec3, b: wp.vec3, value_a: wp.float32, value_b: wp.float32, tape: Texels, span: wp.vec2i
) -> wp.vec3:
    """Return where an edge crosses the surface, by the Illinois variant of regula falsi."""
    low = float(0.0)
    high = float(1.0)
    gap_low = value_a - ISO
    gap_high = value_b - ISO
    t = float(0.5)
    last = int(0)
    for _step in range(ROOT_STEPS):
        t = low + (high - low) * gap_low / (gap_low - gap_high)
        gap = field_value(a + (b - a) * t, tape, span) - ISO
        if wp.abs(gap) <= CONVERGED_ERROR:
            break
        if (gap > 0.0) == (gap_low > 0.0):
            low = t
            gap_low = gap
            if last == 1:
                gap_high = 0.5 * gap_high
            last = 1
        else:
            high = t
            gap_high = gap
            if last == 2:
                gap_low = 0.5 * gap_low
            last = 2
    return a + (b - a) * t


@wp.func
def row_of(points: _Points, k: wp.int32) -> wp.vec3:
    """Return one of several points."""
    return wp.vec3(points[k, 0], points[k, 1], points[k, 2])


@wp.func
def gather_sheets(
    patch: wp.int32,
    row: wp.int32,
    patch_of_edge: wp.array(dtype=wp.int8),
    low: wp.vec3,
    cell: wp.float32,
    values: CornerValues,
    tape: Texels,
    span: wp.vec2i,
) -> Sheets:
    """Return the sheets of a patch, one per label of its crossings."""
    sheets = Sheets()
    for edge in range(12):
        if int(patch_of_edge[row * 12 + edge]) == patch:
            a = EDGE_FIRST[edge]
            b = EDGE_LAST[edge]
            start = cell_corner(low, cell, a)
            r = edge_crossing(start, cell_corner(low, cell, b), values[a], values[b], tape, span)
            label = int(branch_at(r, r, tape, span)[1])
            slot = int(0)
            while slot < sheets.count and sheets.labels[slot] != label:
                slot += 1
            if slot < MAX_SHEETS:
                if slot == sheets.count:
                    sheets.labels[slot] = label
                    sheets.references[slot] = r
                    sheets.count += 1
                sheets.sums[slot] = row_of(sheets.sums, slot) + r
                sheets.hits[slot] = sheets.hits[slot] + 1
    return sheets


@wp.func
def continues(reference: wp.vec3, r: wp.vec3, cell: wp.float32, tape: Texels, span: wp.vec2i) -> wp.bool:
    """Return True if the branch of `reference` continues through the crossing r as the surface does there."""
    active = branch_at(r, r, tape, span)
    other = branch_at(r, reference, tape, span)
    gradient = wp.vec3(active[3], active[4], active[5])
    steepness = wp.length(gradient)
    tilt = wp.length(wp.cross(wp.normalize(gradient), wp.normalize(wp.vec3(other[3], other[4], other[5]))))
    return wp.abs(active[2] - other[2]) <= MAX_SHEET_DISTANCE * cell * steepness and tilt <= MIN_SINE


@wp.func
def without_duplicates(sheets: Sheets, cell: wp.float32, tape: Texels, span: wp.vec2i) -> Sheets:
    """Return the sheets that no other one continues: labels also differ where an operand fades to 0."""
    kept = Sheets()
    for step in range(sheets.count):
        k = sheets.count - 1 - step
        r = row_of(sheets.references, k)
        needed = bool(True)
        for other in range(k):
            if needed and continues(row_of(sheets.references, other), r, cell, tape, span):
                needed = False
        for other in range(kept.count):
            if needed and continues(row_of(kept.references, other), r, cell, tape, span):
                needed = False
        if needed:
            kept.references[kept.count] = r
            kept.sums[kept.count] = row_of(sheets.sums, k)
            kept.hits[kept.count] = sheets.hits[k]
            kept.count += 1
    kept.count = wp.min(kept.count, MAX_BRANCHES)
    return kept
