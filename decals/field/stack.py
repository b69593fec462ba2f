"""The order in which decals are drawn: by rank, then by number. Lists of the index are in this order.

A rank is four times a layer, counted from the lowest that there is, plus the decal's `Interaction`.
"""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from decals.grid.lookup import cell_range
from decals.records import is_sheet, rank_of

wp.set_module_options({"enable_backward": False})

ABOVE_ALL = 1 << 23
"""Above every rank."""


@wp.func
def end_of_lower(
    span: wp.vec2i,
    rank: wp.int32,
    decal: wp.int32,
    decals: wp.array(dtype=wp.vec4),
    ids: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Place in a list just after the last that is drawn before (rank, decal)."""
    low = span[0]
    high = span[1]
    while low < high:
        middle = (low + high) >> 1
        other = rank_of(ids[middle], decals)
        if other < rank or (other == rank and ids[middle] < decal):
            low = middle + 1
        else:
            high = middle
    return low


@wp.func
def sheet_range(
    q: wp.vec3,
    rank: wp.int32,
    layered: wp.bool,
    level: wp.int32,
    decals: wp.array(dtype=wp.vec4),
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.vec2i:
    """(first, past last) place in ids of the decals of one level and one rank that may reach q.

    Where decals are not layered, these are all.
    """
    if layered and (int(levels[level][2]) > rank or int(levels[level][3]) < rank):
        return wp.vec2i(0, 0)
    span = cell_range(q, level, levels, table, mask, ids)
    first = span[0]
    last = span[1]
    if layered:
        if int(levels[level][2]) < rank:
            first = end_of_lower(span, rank, 0, decals, ids)
        if int(levels[level][3]) > rank:
            last = end_of_lower(wp.vec2i(first, last), rank + 1, 0, decals, ids)
    return wp.vec2i(first, last)


@wp.func
def number_below(owner: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.int32:
    """Number from which `owner_below` goes on after a decal: the rest of its sheet does not show."""
    if is_sheet(rank_of(owner, decals)):
        return 0
    return owner
