"""Reading the decal index, laid out in `index`: which list of decals belongs to a point on one level."""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

wp.set_module_options({"enable_backward": False})

HALF_RANGE = 8388608.0
"""Cell coordinates lie in [−2²³, 2²³): as far as float32 tells whole numbers and halves apart."""

MIX_X = wp.constant(wp.uint32(0x1B873593))
MIX_Y = wp.constant(wp.uint32(0x27D4EB2F))
MIX_Z = wp.constant(wp.uint32(0x165667B1))
MIX_ALL = wp.constant(wp.uint32(0x2C1B3C6D))


@wp.func
def cell_coordinate(x: wp.float32, cells_per_unit: wp.float32) -> wp.int32:
    """Cell of a coordinate, counted from 0; no rounding at all, because cells_per_unit is a power of two."""
    c = wp.clamp(wp.floor(x * cells_per_unit), -HALF_RANGE, HALF_RANGE - 1.0)
    return int(c + HALF_RANGE)


@wp.func
def cell_hash(x: wp.int32, y: wp.int32, z: wp.int32) -> wp.uint32:
    """32 well mixed bits of a cell's key."""
    h = (wp.uint32(x) * MIX_X) ^ (wp.uint32(y) * MIX_Y) ^ (wp.uint32(z) * MIX_Z)
    h = (h ^ (h >> wp.uint32(15))) * MIX_ALL
    return h ^ (h >> wp.uint32(13))


@wp.func
def cell_range(
    q: wp.vec3,
    level: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.vec2i:
    """(first, past last) place in ids of the decals of one level that may reach q; equal for none.

    They are in the order in which they are drawn. Open addressing with linear probing: a slot holds the whole
    key, so no other cell's list is ever taken.
    """
    cells_per_unit = levels[level][0]
    x = cell_coordinate(q[0], cells_per_unit) + (level << 24)
    y = cell_coordinate(q[1], cells_per_unit)
    z = cell_coordinate(q[2], cells_per_unit)
    slot = int(cell_hash(x, y, z) & wp.uint32(mask))
    entry = table[slot]
    while entry[0] >= 0:
        if entry[0] == x and entry[1] == y and entry[2] == z:
            return wp.vec2i(entry[3] + 1, entry[3] + 1 + ids[entry[3]])
        slot = (slot + 1) & mask
        entry = table[slot]
    return wp.vec2i(0, 0)


@wp.kernel
def count_candidates(
    points: wp.array(dtype=wp.vec3),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
):
    """Number of candidates at each point, over all levels."""
    i = wp.tid()
    total = wp.int32(0)
    for level in range(level_count):
        span = cell_range(points[i], level, levels, table, mask, ids)
        total += span[1] - span[0]
    counts[i] = total


@wp.kernel
def list_candidates(
    points: wp.array(dtype=wp.vec3),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
    offsets: wp.array(dtype=wp.int32),
    candidates: wp.array(dtype=wp.int32),
):
    """The candidates of each point, level after level, from its offset on."""
    i = wp.tid()
    place = offsets[i]
    for level in range(level_count):
        span = cell_range(points[i], level, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            candidates[place] = ids[j]
            place += 1
