"""Radial contact (`radial`) through the index: whose cell holds a point, where on a ray it ends.

Where decals are not layered, all have one rank, and none is asked for.
"""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from decals.field.contact import field_complement
from decals.field.radial import are_stacked, plane_distance, power
from decals.field.stack import sheet_range
from decals.records import RECORD, RIM_RADIUS, apart, complement_of, faces, rank_of, visible_radius, xyz

wp.set_module_options({"enable_backward": False})

RIM_SQUARED = RIM_RADIUS * RIM_RADIUS
NOBODY = -1


@wp.func
def power_of(q: wp.vec3, decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.float32:
    """|q − p|² − ρ² of a decal."""
    return power(q - xyz(decals[RECORD * decal]), visible_radius(decal, decals))


@wp.func
def lies_over(decal: wp.int32, other: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.bool:
    """Whether of two decals, if they are stacked, the first is the upper one."""
    size = decals[RECORD * decal][3]
    other_size = decals[RECORD * other][3]
    return size < other_size or (size == other_size and decal < other)


@wp.func
def stacked(decal: wp.int32, other: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.bool:
    """Whether two contact decals lie over each other in place of pushing."""
    return are_stacked(
        apart(decal, other, decals), visible_radius(decal, decals), visible_radius(other, decals)
    )


@wp.func
def in_cell(
    q: wp.vec3,
    n_q: wp.vec3,
    decal: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.bool:
    """Whether q, inside the rim of a contact decal, is on its side of all planes to its neighbours."""
    rank = wp.int32(0)
    if layered:
        rank = rank_of(decal, decals)
    own = power_of(q, decal, decals)
    for level in range(level_count):
        span = sheet_range(q, rank, layered, level, decals, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            if complement_of(q, n_q, ids[j], decals) <= 0.5 and power_of(q, ids[j], decals) < own:
                if not stacked(decal, ids[j], decals):
                    return False
    return True


@wp.func
def uppermost_over(
    q: wp.vec3,
    n_q: wp.vec3,
    decal: wp.int32,
    above: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Uppermost of those stacked over a decal whose rims hold q; if `above` is one, of those below it."""
    rank = wp.int32(0)
    if layered:
        rank = rank_of(decal, decals)
    upper = wp.int32(NOBODY)
    for level in range(level_count):
        span = sheet_range(q, rank, layered, level, decals, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            if lies_over(ids[j], decal, decals) and complement_of(q, n_q, ids[j], decals) <= 0.5:
                if upper < 0 or lies_over(ids[j], upper, decals):
                    if above < 0 or lies_over(above, ids[j], decals):
                        if stacked(ids[j], decal, decals):
                            upper = ids[j]
    return upper


@wp.func
def cell_owner(
    q: wp.vec3,
    n_q: wp.vec3,
    rank: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Uppermost of the contact decals of one rank whose cells hold q; NOBODY outside all rims."""
    owner = wp.int32(NOBODY)
    least = wp.float32(0.0)
    holders = wp.int32(0)
    for level in range(level_count):
        span = sheet_range(q, rank, layered, level, decals, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            if complement_of(q, n_q, ids[j], decals) <= 0.5:
                holders += 1
                own = power_of(q, ids[j], decals)
                if owner < 0 or own < least or (own == least and lies_over(ids[j], owner, decals)):
                    least = own
                    owner = ids[j]
    if holders < 2:
        return owner
    # Whoever shares q with the nearest cell is stacked with it: from the uppermost down, who does?
    upper = uppermost_over(q, n_q, owner, NOBODY, layered, decals, level_count, levels, table, mask, ids)
    while upper >= 0:
        if in_cell(q, n_q, upper, layered, decals, level_count, levels, table, mask, ids):
            return upper
        upper = uppermost_over(q, n_q, owner, upper, layered, decals, level_count, levels, table, mask, ids)
    return owner


@wp.func
def radial_complement(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.float32:
    """E = 1 − F of a contact decal at q, stretched along the ray so that its rim lies where its cell ends.

    A convex cell is left before the rim only through planes to those that hold the ray's point on the rim,
    and these are in the index's list there.
    """
    rank = wp.int32(0)
    if layered:
        rank = rank_of(owner, decals)
    centre = xyz(decals[RECORD * owner])
    radius = visible_radius(owner, decals)
    distance = wp.length(q - centre)
    if distance == 0.0:
        return 0.0
    ray = (q - centre) / distance
    edge = centre + radius * ray
    end = radius
    for level in range(level_count):
        span = sheet_range(edge, rank, layered, level, decals, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            if ids[j] != owner and faces(n_q, ids[j], decals):
                if not stacked(owner, ids[j], decals):
                    other = visible_radius(ids[j], decals)
                    end = wp.min(end, plane_distance(ray, apart(owner, ids[j], decals), radius, other))
    x = wp.min(distance / end, 1.0)
    return field_complement(x * x * RIM_SQUARED)
