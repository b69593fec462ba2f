"""Owner of a surface point, its field after contact, and its image coordinates: the decal pass in four calls.

`owner_at` returns the topmost decal, `contact_at` and `uv_at` its field and image coordinates, and
`owner_below` the next decal below, until NO_OWNER. Shaders have the contact mode and `IndexedDecals.layered`
as constants, so that compilers remove the branches that are not used.

If all decals are contact decals of one layer, `single_layer_at` finds owner and field in one traversal of the
index. It keeps the complements of all candidates, so that the pushes of neighbours need no second traversal.
Shaders keep them in two vectors, which are registers. An indexed array would be memory.
"""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.contact import (
    MIN_COMPLEMENT,
    MIN_SPAN,
    add_push,
    add_pushes,
    contact_complement,
    contact_push,
    contact_uv,
    rim_distance,
)
from decals.field.elastic import MAX_KEPT, elastic_contact, single_layer_elastic
from decals.field.image_place import image_place
from decals.field.mapping import ImageMapping, image_distance, tangent_coordinates
from decals.field.radial import NO_OWNER as CELL_NO_OWNER
from decals.field.radial import cell_owner, radial_complement
from decals.field.receivers import complement_of
from decals.index.lookup import ABOVE_ALL, IndexedDecals, cell_range, end_of_lower, rank_range
from decals.record import (
    NO_FIELD,
    RECORD,
    Contact,
    has_cells,
    is_contact_rank,
    rank_of,
    visible_radius,
    xyz,
)

wp.set_module_options({"enable_backward": False})

NO_OWNER = CELL_NO_OWNER
"""Owner of a point outside all rims."""


@wp.func
def owner_below(
    q: wp.vec3,
    n_q: wp.vec3,
    rank: wp.int32,
    decal: wp.int32,
    contact: wp.int32,
    index: IndexedDecals,
) -> wp.int32:
    """Return the topmost decal that shows at q below (rank, decal) in the draw order, or NO_OWNER.

    Among contact decals of one rank it is the decal of highest field, and among equals that of lowest number.
    In radial and elastic contact it is the topmost decal whose cell contains q.
    """
    if has_cells(contact):
        if not index.layered:
            return cell_owner(q, n_q, 0, index)
    owner = wp.int32(NO_OWNER)
    top = wp.int32(-1)
    least = wp.float32(0.5)
    for level in range(index.level_count):
        lowest = wp.int32(1)
        highest = wp.int32(1)
        if index.layered:
            lowest = int(index.levels[level][2])
            highest = int(index.levels[level][3])
        if (lowest < rank or (lowest == rank and decal > 0)) and highest >= top:
            span = cell_range(q, level, index)
            end = span[1]
            if index.layered and highest >= rank:
                end = end_of_lower(span, rank, decal, index)
            for back in range(1, end - span[0] + 1):
                j = end - back
                other = lowest
                if index.layered and lowest != highest:
                    other = rank_of(index.ids[j], index.records)
                if other < top:
                    break
                e = complement_of(q, n_q, index.ids[j], index)
                if is_contact_rank(other):
                    closer = e < least or (e == least and (owner < 0 or index.ids[j] < owner))
                    if closer or (other > top and e <= 0.5):
                        least = e
                        owner = index.ids[j]
                        top = other
                else:
                    if e <= 0.5:
                        if other > top or index.ids[j] > owner:
                            owner = index.ids[j]
                            top = other
                        break
    if has_cells(contact) and owner >= 0:
        if is_contact_rank(top):
            return cell_owner(q, n_q, rank_of(owner, index.records), index)
    return owner


@wp.func
def owner_at(
    q: wp.vec3,
    n_q: wp.vec3,
    contact: wp.int32,
    index: IndexedDecals,
) -> wp.int32:
    """Return the topmost decal that shows at q; NO_OWNER outside all rims."""
    return owner_below(q, n_q, ABOVE_ALL, 0, contact, index)


@wp.func
def pushed_complement(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    contact: wp.int32,
    index: IndexedDecals,
) -> wp.float32:
    """Return E = 1 − F of a contact decal at q, pushed by all its neighbours (paper, equation 5)."""
    rank = wp.int32(1)
    if index.layered:
        rank = rank_of(owner, index.records)
    least = complement_of(q, n_q, owner, index)
    push = wp.float32(0.0)
    for level in range(index.level_count):
        span = rank_range(q, rank, level, index)
        for j in range(span[0], span[1]):
            if index.ids[j] != owner:
                phi = contact_push(complement_of(q, n_q, index.ids[j], index), least)
                push = add_push(push, phi, contact)
    return contact_complement(least, push)


@wp.func
def contact_at(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    contact: wp.int32,
    index: IndexedDecals,
) -> wp.vec3:
    """Return (E, shift) of a decal that shows at q: E = 1 − F, and the displacement of its image.

    Neighbours push only contact decals. Only elastic contact displaces images, where decals are nested.
    """
    if index.layered:
        if not is_contact_rank(rank_of(owner, index.records)):
            return wp.vec3(complement_of(q, n_q, owner, index), 0.0, 0.0)
    if contact == Contact.RADIAL:
        return wp.vec3(radial_complement(q, n_q, owner, index), 0.0, 0.0)
    if contact == Contact.ELASTIC:
        return elastic_contact(q, n_q, owner, index)
    return wp.vec3(pushed_complement(q, n_q, owner, contact, index), 0.0, 0.0)


@wp.func
def uv_at(
    q: wp.vec3,
    n_q: wp.vec3,
    owner: wp.int32,
    pushed: wp.vec3,
    index: IndexedDecals,
) -> wp.vec2:
    """Return image coordinates in the owner's image, a disc of radius ½ around (½, ½) (`in_image`).

    `pushed` is that of `contact_at`. The displacement fades toward the rim, where no image moves.
    """
    w = q - xyz(index.records[RECORD * owner])
    drawn = rim_distance(pushed[0])
    place = wp.vec2(0.0, 0.0)
    if index.mapping == ImageMapping.CHORD:
        normal = xyz(index.records[RECORD * owner + 1])
        place = tangent_coordinates(w, normal, xyz(index.records[RECORD * owner + 2]))
    else:
        small = w / visible_radius(owner, index.records)
        unrolled = image_place(small, n_q, owner, index)
        place = wp.vec2(unrolled[0], unrolled[1])
        drawn = image_distance(drawn, wp.length(small), unrolled[2])
    uv = contact_uv(place, drawn)
    if index.nested:
        uv += 0.5 * wp.max(1.0 - drawn * drawn, 0.0) * wp.vec2(pushed[1], pushed[2])
    return uv


@wp.func
def single_layer_at(
    q: wp.vec3,
    n_q: wp.vec3,
    contact: wp.int32,
    index: IndexedDecals,
) -> wp.vec4:
    """Return (owner, E, shift) at q in all contact modes but RADIAL; (NO_OWNER, 0) outside all rims.

    They are those of `owner_at` and `contact_at`. The decals must not be layered.
    """
    if contact == Contact.ELASTIC:
        return single_layer_elastic(q, n_q, index)
    owner = wp.int32(NO_OWNER)
    least = wp.float32(0.5)
    ties = wp.int32(0)
    count = wp.int32(0)
    a = wp.vec4(NO_FIELD, NO_FIELD, NO_FIELD, NO_FIELD)
    b = wp.vec4(NO_FIELD, NO_FIELD, NO_FIELD, NO_FIELD)
    for level in range(index.level_count):
        span = cell_range(q, level, index)
        for j in range(span[0], span[1]):
            decal = index.ids[j]
            e = complement_of(q, n_q, decal, index)
            if e < 1.0:
                b = wp.vec4(a[3], b[0], b[1], b[2])
                a = wp.vec4(e, a[0], a[1], a[2])
                count += 1
                if e < least:
                    ties = 0
                if e <= least:
                    ties += 1
                    if e < least or owner < 0 or decal < owner:
                        owner = decal
                    least = e
    if owner < 0:
        return wp.vec4(float(NO_OWNER), 0.0, 0.0, 0.0)
    if count > MAX_KEPT:
        deformed = pushed_complement(q, n_q, owner, contact, index)
        return wp.vec4(float(owner), deformed, 0.0, 0.0)
    per_span = 1.0 / wp.max(1.0 - 2.0 * least, MIN_SPAN)
    per_least = 1.0 / wp.max(least, MIN_COMPLEMENT)
    push = wp.float32(0.0)
    push = add_pushes(push, a, least, per_span, per_least, contact)
    if count > 4:
        push = add_pushes(push, b, least, per_span, per_least, contact)
    if ties > 1:  # on a contact line
        push = 1.0
    return wp.vec4(float(owner), contact_complement(least, push), 0.0, 0.0)
