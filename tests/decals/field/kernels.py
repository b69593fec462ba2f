"""Warp kernels of the tests of this folder."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.field.contact import add_push, contact_complement, contact_push, contact_uv, rim_distance
from decals.field.mapping import image_distance, in_image, tangent_coordinates, unroll, unroll_step
from decals.field.ownership import NO_OWNER, contact_at, owner_at, single_layer_at
from decals.index.lookup import IndexedDecals
from decals.record import NO_FIELD, RECORD, RIM_RADIUS, field_complement, xyz

wp.set_module_options(KERNEL_OPTIONS)

STEPS = 6


@wp.kernel
def rims_of_points(
    points: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    index: IndexedDecals,
    owners: wp.array(dtype=wp.int32),
    rims: wp.array(dtype=wp.float32),
) -> None:
    """Owner and r/r_h of points, all normals upward."""
    i = wp.tid()
    up = wp.vec3(0.0, 0.0, 1.0)
    owner = owner_at(points[i], up, contact, index)
    owners[i] = owner
    if owner != NO_OWNER:
        e = contact_at(points[i], up, owner, contact, index)[0]
        rims[i] = rim_distance(e)


@wp.kernel
def slopes_of_rays(
    owners: wp.array(dtype=wp.int32),
    rays: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    index: IndexedDecals,
    least: wp.array(dtype=wp.float32),
    most: wp.array(dtype=wp.float32),
) -> None:
    """Least and most change of r/r_h over x/ρ on the part of each ray from its owner's centre with r < 1."""
    i = wp.tid()
    up = wp.vec3(0.0, 0.0, 1.0)
    ball = index.records[RECORD * owners[i]]
    last = wp.float32(0.0)
    low = wp.float32(1.0e9)
    high = wp.float32(-1.0e9)
    for step in range(1, STEPS + 1):
        x = float(step) / float(STEPS)
        q = xyz(ball) + (x * RIM_RADIUS * ball[3]) * rays[i]
        e = contact_at(q, up, owners[i], contact, index)[0]
        r = rim_distance(e)
        slope = (r - last) * float(STEPS)
        if r < 1.0:
            low = wp.min(low, slope)
            high = wp.max(high, slope)
        else:
            low = wp.min(low, wp.where(r < last, -1.0, low))
            high = wp.max(high, wp.where(last == 0.0, 1.0 / x, high))
        last = r
    least[i] = low
    most[i] = high


@wp.kernel
def contact_of_rows(
    e: wp.array2d(dtype=wp.float32),
    owner: wp.array(dtype=wp.int32),
    contact: wp.int32,
    result: wp.array(dtype=wp.float32),
) -> None:
    row = wp.tid()
    k = owner[row]
    push = wp.float32(0.0)
    for i in range(e.shape[1]):
        if i != k:
            push = add_push(push, contact_push(e[row, i], e[row, k]), contact)
    result[row] = contact_complement(e[row, k], push)


@wp.kernel
def rims_of_sets(
    points: wp.array(dtype=wp.vec3),
    centres: wp.array2d(dtype=wp.vec3),
    influence: wp.array2d(dtype=wp.float32),
    contact: wp.int32,
    owners: wp.array(dtype=wp.int32),
    rims: wp.array(dtype=wp.float32),
) -> None:
    row = wp.tid()
    least = wp.float32(NO_FIELD)
    owner = wp.int32(-1)
    for i in range(centres.shape[1]):
        w = points[row] - centres[row, i]
        e = field_complement(wp.dot(w, w) / (influence[row, i] * influence[row, i]))
        if e < least:
            least = e
            owner = i
    push = wp.float32(0.0)
    for i in range(centres.shape[1]):
        w = points[row] - centres[row, i]
        e = field_complement(wp.dot(w, w) / (influence[row, i] * influence[row, i]))
        if i != owner:
            push = add_push(push, contact_push(e, least), contact)
    owners[row] = owner if least <= 0.5 else -1
    rims[row] = rim_distance(contact_complement(least, push))


@wp.kernel
def uv_of_offsets(
    offsets: wp.array(dtype=wp.vec2), rims: wp.array(dtype=wp.float32), uv: wp.array(dtype=wp.vec2)
) -> None:
    row = wp.tid()
    uv[row] = contact_uv(offsets[row], rims[row])


@wp.kernel
def arcs_of(
    w: wp.array(dtype=wp.vec3),
    n_p: wp.array(dtype=wp.vec3),
    n_q: wp.array(dtype=wp.vec3),
    arcs: wp.array(dtype=wp.vec4),
) -> None:
    i = wp.tid()
    arcs[i] = unroll(w[i], n_p[i], n_q[i])


@wp.kernel
def turns_of(
    steps: wp.array(dtype=wp.vec3),
    n_p: wp.array(dtype=wp.vec3),
    n_q: wp.array(dtype=wp.vec3),
    turned: wp.array(dtype=wp.vec3),
) -> None:
    i = wp.tid()
    turned[i] = unroll_step(steps[i], n_p[i], n_q[i])


@wp.kernel
def distances_of(
    rims: wp.array(dtype=wp.float32),
    chords: wp.array(dtype=wp.float32),
    lengths: wp.array(dtype=wp.float32),
    drawn: wp.array(dtype=wp.float32),
) -> None:
    i = wp.tid()
    drawn[i] = image_distance(rims[i], chords[i], lengths[i])


@wp.kernel
def coordinates_of(
    m: wp.array(dtype=wp.vec3),
    n: wp.array(dtype=wp.vec3),
    u: wp.array(dtype=wp.vec3),
    xy: wp.array(dtype=wp.vec2),
    seen: wp.array(dtype=wp.bool),
) -> None:
    i = wp.tid()
    xy[i] = tangent_coordinates(m[i], n[i], u[i])
    seen[i] = in_image(xy[i])


@wp.kernel
def both_ways(
    points: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    index: IndexedDecals,
    once: wp.array(dtype=wp.vec4),
    twice: wp.array(dtype=wp.vec4),
) -> None:
    i = wp.tid()
    q = points[i]
    up = wp.vec3(0.0, 0.0, 1.0)
    once[i] = single_layer_at(q, up, contact, index)
    owner = owner_at(q, up, contact, index)
    pushed = wp.vec3(0.0, 0.0, 0.0)
    if owner >= 0:
        pushed = contact_at(q, up, owner, contact, index)
    twice[i] = wp.vec4(float(owner), pushed[0], pushed[1], pushed[2])
