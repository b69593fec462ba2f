"""Look-up of decals in the index: the arrays that it reads, typed functions for Warp and GLSL, and kernels.

Decals are drawn by rank, then by number; the lists of the index are in this order. The rank of a decal is
four times its layer, counted from the lowest possible one, plus its `Interaction`.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.transpile.glsl import uniform_struct
from decals.record import RECORD, RIM_RADIUS, apart, balls_nested, is_contact_rank, rank_of, xyz

wp.set_module_options(KERNEL_OPTIONS)

HALF_RANGE = 8388608.0
"""Cell coordinates lie in [−2²³, 2²³), where float32 represents multiples of ½ exactly."""

ABOVE_ALL = 1 << 23
"""Above every rank."""

NESTING_SLACK = 1.0e-5
"""Relative enlargement of the larger of two decals that may be nested, above the rounding of all devices."""

MAX_TESTED = 1000
"""Most candidates in a cell that are tested for nesting; the time of more would grow with their square."""

MIX_X = wp.constant(wp.uint32(0x1B873593))
MIX_Y = wp.constant(wp.uint32(0x27D4EB2F))
MIX_Z = wp.constant(wp.uint32(0x165667B1))
MIX_ALL = wp.constant(wp.uint32(0x2C1B3C6D))


@uniform_struct(
    records="decal_records",
    layered="decal_layered",
    level_count="index_level_count",
    levels="index_levels",
    table="index_table",
    mask="index_mask",
    ids="index_ids",
    stiffness="decal_stiffness",
    nested="decal_nested",
    limited="decal_limited",
    limits="decal_limits",
    surface="surface_receivers",
    mapping="decal_mapping",
    walked="decal_walked",
    walks="decal_walks",
)
class IndexedDecals:
    """Records and index of a set of decals on one device; ``shaders/decals.glsl`` has them as uniforms.

    Attributes
    ----------
    records
        `decals.model.Decals.packed`.
    layered
        `decals.model.Decals.layered`. Ranks are not read where it is False.
    level_count, levels, table, mask, ids
        Arrays of the index, as `decals.index.index` describes them; the table has ``mask + 1`` slots.
    stiffness
        Stiffness of elastic contact (`decals.field.elastic`).
    nested
        True if contact decals may be nested; always True in Warp.
    limited, limits
        `decals.model.Decals.limited` and `decals.model.Decals.limits`, which are read where it is True.
    surface
        Mask of the surface, see `decals.receivers.surface_mask`.
    mapping
        Image mapping, a `decals.field.mapping.ImageMapping`; 0, CHORD, by default.
    walked, walks
        True in the image mapping WALKED, and `decals.field.walks.Walks.texels`, which are read in it alone.
    """

    records: wp.array(dtype=wp.vec4)
    layered: wp.bool
    level_count: wp.int32
    levels: wp.array(dtype=wp.vec4)
    table: wp.array(dtype=wp.vec4i)
    mask: wp.int32
    ids: wp.array(dtype=wp.int32)
    stiffness: wp.float32
    nested: wp.bool
    limited: wp.bool
    limits: wp.array(dtype=wp.vec4)
    surface: wp.int32
    mapping: wp.int32
    walked: wp.bool
    walks: wp.array(dtype=wp.vec4)


@wp.func
def cell_coordinate(x: wp.float32, cells_per_unit: wp.float32) -> wp.int32:
    """Return the cell of a coordinate, counted from 0. It is exact: cells_per_unit is a power of two."""
    c = wp.clamp(wp.floor(x * cells_per_unit), -HALF_RANGE, HALF_RANGE - 1.0)
    return int(c + HALF_RANGE)


@wp.func
def cell_hash(x: wp.int32, y: wp.int32, z: wp.int32) -> wp.uint32:
    """Return a 32-bit hash of a cell."""
    h = (wp.uint32(x) * MIX_X) ^ (wp.uint32(y) * MIX_Y) ^ (wp.uint32(z) * MIX_Z)
    h = (h ^ (h >> wp.uint32(15))) * MIX_ALL
    return h ^ (h >> wp.uint32(13))


@wp.func
def cell_range(
    q: wp.vec3,
    level: wp.int32,
    index: IndexedDecals,
) -> wp.vec2i:
    """Return the range (first, past last) in ids of the decals of one level that may reach q.

    The decals are in draw order. The table uses open addressing with linear probing, and a slot holds the
    whole key of its cell.
    """
    cells_per_unit = index.levels[level][0]
    x = cell_coordinate(q[0], cells_per_unit) + (level << 24)
    y = cell_coordinate(q[1], cells_per_unit)
    z = cell_coordinate(q[2], cells_per_unit)
    slot = int(cell_hash(x, y, z) & wp.uint32(index.mask))
    entry = index.table[slot]
    while entry[0] >= 0:
        if entry[0] == x and entry[1] == y and entry[2] == z:
            return wp.vec2i(entry[3] + 1, entry[3] + 1 + index.ids[entry[3]])
        slot = (slot + 1) & index.mask
        entry = index.table[slot]
    return wp.vec2i(0, 0)


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


@wp.kernel
def count_candidates(
    points: wp.array(dtype=wp.vec3),
    index: IndexedDecals,
    counts: wp.array(dtype=wp.int32),
):
    """Write the number of candidates at each point, over all levels."""
    i = wp.tid()
    total = wp.int32(0)
    for level in range(index.level_count):
        span = cell_range(points[i], level, index)
        total += span[1] - span[0]
    counts[i] = total


@wp.kernel
def list_candidates(
    points: wp.array(dtype=wp.vec3),
    index: IndexedDecals,
    offsets: wp.array(dtype=wp.int32),
    candidates: wp.array(dtype=wp.int32),
):
    """Write the candidates of each point from its offset on, level after level."""
    i = wp.tid()
    slot = offsets[i]
    for level in range(index.level_count):
        span = cell_range(points[i], level, index)
        for j in range(span[0], span[1]):
            candidates[slot] = index.ids[j]
            slot += 1


@wp.func
def are_nested_contact(decal: wp.int32, other: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.bool:
    """Return True if two decals are nested contact decals of one rank, or nearly so."""
    rank = rank_of(decal, decals)
    if decal == other or not is_contact_rank(rank) or rank_of(other, decals) != rank:
        return False
    size = decals[RECORD * decal][3]
    other_size = decals[RECORD * other][3]
    larger = (1.0 + NESTING_SLACK) * RIM_RADIUS * wp.max(size, other_size)
    return balls_nested(apart(decal, other, decals), RIM_RADIUS * wp.min(size, other_size), larger)


@wp.kernel
def find_nested(index: IndexedDecals, found: wp.array(dtype=wp.int32)):
    """Write 1 if two contact decals are nested, or if a decal has more than MAX_TESTED candidates.

    By `balls_nested`, with radii a ≤ b, the distance of their centres is at most b/√(1 − MIN_KEPT_RADIUS²) =
    1.023 b. The larger one reaches 1.266 b, so the index lists it at the centre of the smaller one.
    """
    i = wp.tid()
    if found[0] != 0:
        return
    for level in range(index.level_count):
        span = cell_range(xyz(index.records[RECORD * i]), level, index)
        if span[1] - span[0] > MAX_TESTED:
            found[0] = 1
            return
        for j in range(span[0], span[1]):
            if are_nested_contact(i, index.ids[j], index.records):
                found[0] = 1
