"""Owner and contact in one traversal of the index, if all decals are contact decals of one layer.

The traversal that finds the owner keeps the complements of all candidates, so that the pushes of neighbours
need no second one. Shaders keep them in two vectors, which are registers. An indexed array would be memory.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.contact import MIN_COMPLEMENT, MIN_SPAN, add_push, contact_complement, log_one_minus
from decals.field.ownership import NO_OWNER, pushed_complement
from decals.index.lookup import IndexedDecals, cell_range
from decals.record import NO_FIELD, complement_of

wp.set_module_options({"enable_backward": False})

ALMOST_ONE = 0.99999994
"""Largest float32 below 1."""

MAX_KEPT = 8
"""Number of complements that are kept. Where more decals act, the index is traversed a second time."""


@wp.func
def push_of(e: wp.float32, least: wp.float32, per_span: wp.float32, per_least: wp.float32) -> wp.float32:
    """Return the push φ of a neighbour (`contact_push` with given reciprocals); 0 for the owner."""
    if e <= least or e + least >= 1.0:
        return 0.0
    return wp.exp(log_one_minus(wp.min((e - least) * per_span, ALMOST_ONE)) * per_least)


@wp.func
def add_pushes(
    push: wp.float32,
    e: wp.vec4,
    least: wp.float32,
    per_span: wp.float32,
    per_least: wp.float32,
    contact: wp.int32,
) -> wp.float32:
    """Extend 1 − ∏(1 − φ), or the largest φ in `Contact.MIN`, by four neighbours."""
    first = add_push(push, push_of(e[0], least, per_span, per_least), contact)
    second = add_push(first, push_of(e[1], least, per_span, per_least), contact)
    third = add_push(second, push_of(e[2], least, per_span, per_least), contact)
    return add_push(third, push_of(e[3], least, per_span, per_least), contact)


@wp.func
def single_layer_at(
    q: wp.vec3,
    n_q: wp.vec3,
    contact: wp.int32,
    index: IndexedDecals,
) -> wp.vec2:
    """Return (owner, E) at q in the contact modes PRODUCT and MIN; (NO_OWNER, 0) outside all rims.

    They are those of `owner_at` and `complement_at`. The decals must not be layered.
    """
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
            e = complement_of(q, n_q, decal, index.records)
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
        return wp.vec2(float(NO_OWNER), 0.0)
    if count > MAX_KEPT:
        deformed = pushed_complement(q, n_q, owner, contact, index)
        return wp.vec2(float(owner), deformed)
    per_span = 1.0 / wp.max(1.0 - 2.0 * least, MIN_SPAN)
    per_least = 1.0 / wp.max(least, MIN_COMPLEMENT)
    push = wp.float32(0.0)
    push = add_pushes(push, a, least, per_span, per_least, contact)
    if count > 4:
        push = add_pushes(push, b, least, per_span, per_least, contact)
    if ties > 1:  # on a contact line
        push = 1.0
    return wp.vec2(float(owner), contact_complement(least, push))
