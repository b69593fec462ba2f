"""Draw order of decals: by rank, then by number. The lists of the index are in this order.

The rank of a decal is four times its layer, counted from the lowest possible one, plus its `Interaction`.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.index.lookup import IndexedDecals, cell_range
from decals.record import is_contact_rank, rank_of

wp.set_module_options({"enable_backward": False})

ABOVE_ALL = 1 << 23
"""Above every rank."""


@wp.func
def end_of_lower(
    span: wp.vec2i,
    rank: wp.int32,
    decal: wp.int32,
    index: IndexedDecals,
) -> wp.int32:
    """Return the position in a list after the last decal that is drawn before (rank, decal)."""
    low = span[0]
    high = span[1]
    while low < high:
        middle = (low + high) >> 1
        other = rank_of(index.ids[middle], index.records)
        if other < rank or (other == rank and index.ids[middle] < decal):
            low = middle + 1
        else:
            high = middle
    return low


@wp.func
def rank_range(
    q: wp.vec3,
    rank: wp.int32,
    level: wp.int32,
    index: IndexedDecals,
) -> wp.vec2i:
    """Return the range (first, past last) in ids of the decals of one level and rank that may reach q.

    The rank is ignored if the decals are not layered.
    """
    if index.layered and (int(index.levels[level][2]) > rank or int(index.levels[level][3]) < rank):
        return wp.vec2i(0, 0)
    span = cell_range(q, level, index)
    first = span[0]
    last = span[1]
    if index.layered:
        if int(index.levels[level][2]) < rank:
            first = end_of_lower(span, rank, 0, index)
        if int(index.levels[level][3]) > rank:
            last = end_of_lower(wp.vec2i(first, last), rank + 1, 0, index)
    return wp.vec2i(first, last)


@wp.func
def next_number_below(owner: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.int32:
    """Return the number from which `owner_below` continues; it skips all contact decals of one rank."""
    if is_contact_rank(rank_of(owner, decals)):
        return 0
    return owner
