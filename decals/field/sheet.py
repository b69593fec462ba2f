"""Where all decals are contact decals of one layer: owner and deformation in one walk of the index.

The walk that finds the owner keeps the complements that it meets, so that no second one is needed to know the
neighbours' pushes. Shaders keep them in two vectors, which are registers; an indexed array would be memory.
"""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from decals.field.contact import (
    NOWHERE,
    SMALLEST_COMPLEMENT,
    SMALLEST_SPAN,
    add_push,
    contact_complement,
    log_of_rest,
)
from decals.field.ownership import NOBODY, pushed_complement
from decals.grid.lookup import cell_range
from decals.records import complement_of

wp.set_module_options({"enable_backward": False})

ALMOST_ONE = 0.99999994

KEPT = 8
"""Complements that are kept; where more decals act, the index is walked a second time."""


@wp.func
def push_of(e: wp.float32, least: wp.float32, per_span: wp.float32, per_least: wp.float32) -> wp.float32:
    """Push φ of a neighbour (`contact_push`, divisions done before); none of the owner, whose e is least."""
    if e <= least or e + least >= 1.0:
        return 0.0
    return wp.exp(log_of_rest(wp.min((e - least) * per_span, ALMOST_ONE)) * per_least)


@wp.func
def add_pushes(
    push: wp.float32,
    e: wp.vec4,
    least: wp.float32,
    per_span: wp.float32,
    per_least: wp.float32,
    contact: wp.int32,
) -> wp.float32:
    """Extend 1 − ∏(1 − φ), or the largest φ, by four neighbours."""
    first = add_push(push, push_of(e[0], least, per_span, per_least), contact)
    second = add_push(first, push_of(e[1], least, per_span, per_least), contact)
    third = add_push(second, push_of(e[2], least, per_span, per_least), contact)
    return add_push(third, push_of(e[3], least, per_span, per_least), contact)


@wp.func
def sheet_at(
    q: wp.vec3,
    n_q: wp.vec3,
    contact: wp.int32,
    decals: wp.array(dtype=wp.vec4),
    level_count: wp.int32,
    levels: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    mask: wp.int32,
    ids: wp.array(dtype=wp.int32),
) -> wp.vec2:
    """(owner, E) at q in the paper's contact and the smooth one; (NOBODY, 0) outside all rims.

    The same as `owner_at` and `complement_at` find, for decals that are not layered.
    """
    owner = wp.int32(NOBODY)
    least = wp.float32(0.5)
    ties = wp.int32(0)
    count = wp.int32(0)
    a = wp.vec4(NOWHERE, NOWHERE, NOWHERE, NOWHERE)
    b = wp.vec4(NOWHERE, NOWHERE, NOWHERE, NOWHERE)
    for level in range(level_count):
        span = cell_range(q, level, levels, table, mask, ids)
        for j in range(span[0], span[1]):
            decal = ids[j]
            e = complement_of(q, n_q, decal, decals)
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
        return wp.vec2(float(NOBODY), 0.0)
    if count > KEPT:
        deformed = pushed_complement(
            q, n_q, owner, contact, False, decals, level_count, levels, table, mask, ids
        )
        return wp.vec2(float(owner), deformed)
    per_span = 1.0 / wp.max(1.0 - 2.0 * least, SMALLEST_SPAN)
    per_least = 1.0 / wp.max(least, SMALLEST_COMPLEMENT)
    push = wp.float32(0.0)
    push = add_pushes(push, a, least, per_span, per_least, contact)
    if count > 4:
        push = add_pushes(push, b, least, per_span, per_least, contact)
    if ties > 1:  # on a line of contact
        push = 1.0
    return wp.vec2(float(owner), contact_complement(least, push))
