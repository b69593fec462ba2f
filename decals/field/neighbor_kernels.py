"""Warp kernel of `evaluate`: fields of all decals at points, pushes on owners, and which images show."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.field.contact import contact_push
from decals.field.elastic import plane_push
from decals.field.mapping import in_image
from decals.field.ownership import NO_OWNER, contact_at, owner_below, uv_at
from decals.field.radial import MIN_ADVANCE, are_nested, plane_distance
from decals.field.receivers import acts, complement_of
from decals.index.lookup import IndexedDecals, cell_range
from decals.record import (
    RECORD,
    Contact,
    apart,
    field_complement,
    has_cells,
    is_contact_rank,
    rank_of,
    visible_radius,
    xyz,
)

wp.set_module_options(KERNEL_OPTIONS)

MIN_REMAINDER = 1.0e-6
"""Smallest divisor 1 − t, which is 0 on the rim."""

SHOWS_ALONE, SHOWS_IN_LAYER = 1, 2
"""Bits of `shows_at`."""


@wp.func
def field_at(q: wp.vec3, n_q: wp.vec3, decal: wp.int32, index: IndexedDecals) -> wp.float32:
    """Return the field f of a decal before contact; 0 out of its influence, or where it does not act."""
    ball = index.records[RECORD * decal]
    w = q - xyz(ball)
    squared = wp.dot(w, w)
    size = ball[3] * ball[3]
    if squared >= size or not acts(w, n_q, decal, index):
        return 0.0
    return 1.0 - field_complement(squared / size)


@wp.func
def push_at(
    q: wp.vec3, n_q: wp.vec3, owner: wp.int32, decal: wp.int32, contact: wp.int32, index: IndexedDecals
) -> wp.float32:
    """Return the push of one neighbour alone on the owner of q: 0 without, 1 on their contact line."""
    rank = rank_of(owner, index.records)
    if decal == owner or not is_contact_rank(rank) or rank_of(decal, index.records) != rank:
        return 0.0
    if not has_cells(contact):
        e = complement_of(q, n_q, decal, index)
        return contact_push(e, complement_of(q, n_q, owner, index))
    radius = visible_radius(owner, index.records)
    other = visible_radius(decal, index.records)
    between = apart(owner, decal, index.records)
    w = (q - xyz(index.records[RECORD * owner])) / radius
    distance = wp.length(w)
    remaining = wp.max(1.0 - distance, MIN_REMAINDER)
    offset = q - xyz(index.records[RECORD * decal])
    if distance == 0.0 or not acts(offset, n_q, decal, index):
        return 0.0
    ray = w / distance
    if contact == Contact.ELASTIC:
        push = plane_push(ray, distance, between, radius, other, index.stiffness)
        return wp.min(push / remaining, 1.0)
    if wp.dot(ray, between) <= MIN_ADVANCE or are_nested(owner, decal, index.records):
        return 0.0
    end = plane_distance(ray, between, radius, other) / radius
    return wp.clamp((distance / end - distance) / remaining, 0.0, 1.0) if end < 1.0 else 0.0


@wp.func
def shows_at(q: wp.vec3, n_q: wp.vec3, decal: wp.int32, contact: wp.int32, index: IndexedDecals) -> wp.int32:
    """Return the sum of SHOWS_ALONE if the undeformed image reaches q, and SHOWS_IN_LAYER after contact."""
    e = complement_of(q, n_q, decal, index)
    if e > 0.5:
        return 0
    shows = wp.int32(0)
    if in_image(uv_at(q, n_q, decal, wp.vec3(e, 0.0, 0.0), index)):
        shows = wp.static(SHOWS_ALONE)
    rank = rank_of(decal, index.records)
    if not is_contact_rank(rank):
        return shows * wp.static(SHOWS_ALONE + SHOWS_IN_LAYER)
    if owner_below(q, n_q, rank + 1, 0, contact, index) == decal:
        pushed = contact_at(q, n_q, decal, contact, index)
        if in_image(uv_at(q, n_q, decal, pushed, index)):
            shows += wp.static(SHOWS_IN_LAYER)
    return shows


@wp.func
def write_neighbors(
    q: wp.vec3,
    n_q: wp.vec3,
    contact: wp.int32,
    index: IndexedDecals,
    owner: wp.int32,
    offset: wp.int32,
    decals: wp.array(dtype=wp.int32),
    fields: wp.array(dtype=wp.float32),
    pushes: wp.array(dtype=wp.float32),
    shows: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Return the number of decals with a field at q; from an offset on, also write them, if it is not −1."""
    count = wp.int32(0)
    for level in range(index.level_count):
        span = cell_range(q, level, index)
        for j in range(span[0], span[1]):
            decal = index.ids[j]
            field = field_at(q, n_q, decal, index)
            if field > 0.0:
                if offset >= 0:
                    decals[offset + count] = decal
                    fields[offset + count] = field
                    shows[offset + count] = shows_at(q, n_q, decal, contact, index)
                    if owner != NO_OWNER:
                        pushes[offset + count] = push_at(q, n_q, owner, decal, contact, index)
                count += 1
    return count


@wp.kernel
def list_neighbors(
    first: wp.int32,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    index: IndexedDecals,
    owners: wp.array(dtype=wp.int32),
    offsets: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    decals: wp.array(dtype=wp.int32),
    fields: wp.array(dtype=wp.float32),
    pushes: wp.array(dtype=wp.float32),
    shows: wp.array(dtype=wp.int32),
):
    """Count the decals with a field at each point; with offsets, also write them and all about them."""
    i = first + wp.tid()
    offset = wp.int32(-1)
    if offsets.shape[0] > 0:
        offset = offsets[i]
    n_q = wp.normalize(normals[i])
    counts[i] = write_neighbors(
        points[i], n_q, contact, index, owners[i], offset, decals, fields, pushes, shows
    )
