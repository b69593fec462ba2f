"""Which decals show at a surface point, how neighbours deform them, and where in its image each is read.

The whole decal pass in four calls, for every backend: `owner_at` gives the topmost decal, `complement_at` and
`uv_at` what it shows, `owner_below` the next one under it, until there is none. Their arrays are those of
`Decals.packed` and of the index, in its order (`DeviceIndex.arguments`). Where all decals are contact decals
of one layer (`Decals.layered` is False), `layered` may be False, and ranks are not asked for: shaders have
contact mode and `layered` as constants, so that compilers leave out what is not used.
"""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from decals.field.cells import NOBODY as CELL_NOBODY
from decals.field.cells import cell_owner, radial_complement
from decals.field.contact import Contact, add_push, contact_complement, contact_push, contact_uv, rim_distance
from decals.field.mapping import Mapping, drawn_distance, tangent_coordinates, unrolled
from decals.field.stack import ABOVE_ALL, end_of_lower, sheet_range
from decals.grid.lookup import cell_range
from decals.records import RECORD, complement_of, is_sheet, rank_of, visible_radius, xyz

wp.set_module_options({"enable_backward": False})

NOBODY = CELL_NOBODY
"""Owner of a point outside all rims."""


@wp.func
def owner_below(
    q: wp.vec3,
    n_q: wp.vec3,
    rank: wp.int32,
    decal: wp.int32,
    contact: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Topmost decal that shows at q below (rank, decal) in the stack; NOBODY where there is none.

    Of a sheet it is the decal of highest field, the lowest number among equals (in radial contact, the
    uppermost whose cell holds q).
    """
    if contact == Contact.RADIAL:
        if not layered:
            return cell_owner(q, n_q, 0, False, decals, level_count, levels, table, mask, ids)
    owner = wp.int32(NOBODY)
    top = wp.int32(-1)
    least = wp.float32(0.5)
    for level in range(level_count):
        lowest = wp.int32(1)
        highest = wp.int32(1)
        if layered:
            lowest = int(levels[level][2])
            highest = int(levels[level][3])
        if (lowest < rank or (lowest == rank and decal > 0)) and highest >= top:
            span = cell_range(q, level, levels, table, mask, ids)
            end = span[1]
            if layered and highest >= rank:
                end = end_of_lower(span, rank, decal, decals, ids)
            for back in range(1, end - span[0] + 1):
                j = end - back
                other = lowest
                if layered and lowest != highest:
                    other = rank_of(ids[j], decals)
                if other < top:
                    break
                e = complement_of(q, n_q, ids[j], decals)
                if is_sheet(other):
                    closer = e < least or (e == least and (owner < 0 or ids[j] < owner))
                    if closer or (other > top and e <= 0.5):
                        least = e
                        owner = ids[j]
                        top = other
                else:
                    if e <= 0.5:
                        if other > top or ids[j] > owner:
                            owner = ids[j]
                            top = other
                        break
    if contact == Contact.RADIAL and owner >= 0:
        if is_sheet(top):
            return cell_owner(
                q, n_q, rank_of(owner, decals), True, decals, level_count, levels, table, mask, ids
            )
    return owner


@wp.func
def owner_at(
    q: wp.vec3,
    n_q: wp.vec3,
    contact: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Topmost decal that shows at q; NOBODY outside all rims."""
    return owner_below(q, n_q, ABOVE_ALL, 0, contact, layered, decals, level_count, levels, table, mask, ids)


@wp.func
def pushed_complement(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    contact: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.float32:
    """E = 1 − F of a contact decal at q, pushed by all its neighbours (paper, equation 5)."""
    rank = wp.int32(1)
    if layered:
        rank = rank_of(owner, decals)
    least = complement_of(q, n_q, owner, decals)
    push = wp.float32(0.0)
    for level in range(level_count):
        span = sheet_range(q, rank, layered, level, decals, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            if ids[j] != owner:
                phi = contact_push(complement_of(q, n_q, ids[j], decals), least)
                push = add_push(push, phi, contact)
    return contact_complement(least, push)


@wp.func
def complement_at(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    contact: wp.int32,
    layered: wp.bool,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.float32:
    """E = 1 − F of a decal that shows at q; neighbours push contact decals alone."""
    if layered:
        if not is_sheet(rank_of(owner, decals)):
            return complement_of(q, n_q, owner, decals)
    if contact == Contact.RADIAL:
        return radial_complement(q, n_q, owner, layered, decals, level_count, levels, table, mask, ids)
    return pushed_complement(q, n_q, owner, contact, layered, decals, level_count, levels, table, mask, ids)


@wp.func
def uv_at(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    complement: wp.float32,
    mapping: wp.int32,
    decals: wp.array(dtype=wp.vec4),
) -> wp.vec2:
    """Image coordinates in the owner's image: ½ at its centre, ½ from there on its rim (`in_image`)."""
    centre = xyz(decals[RECORD * owner])
    normal = xyz(decals[RECORD * owner + 1])
    tangent = xyz(decals[RECORD * owner + 2])
    w = q - centre
    rim = rim_distance(complement)
    if mapping == Mapping.CHORD:
        return contact_uv(tangent_coordinates(w, normal, tangent), rim)
    small = w / visible_radius(owner, decals)
    arc = unrolled(small, normal, n_q)
    drawn = drawn_distance(rim, wp.length(small), arc[3])
    return contact_uv(tangent_coordinates(xyz(arc), normal, tangent), drawn)
