"""Kernel of `tests.bench.contact_modes`: typed functions of all contact modes on sets without an index."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals import Contact
from decals.field.contact import add_push, contact_complement, contact_push, rim_distance
from decals.field.elastic import bump_of, join_bumps, plane_push, pushed_along_ray, square_of_push
from decals.field.radial import RIM_SQUARED, plane_distance, power
from decals.record import balls_nested, field_complement

wp.set_module_options({"enable_backward": False})


@wp.func
def complement_in(q: wp.vec3, centre: wp.vec3, radius: wp.float32) -> wp.float32:
    w = (q - centre) / radius
    return field_complement(wp.dot(w, w) * RIM_SQUARED)


@wp.func
def pushed_rim(
    q: wp.vec3,
    row: wp.int32,
    contact: wp.int32,
    centres: wp.array2d(dtype=wp.vec3),
    radii: wp.array2d(dtype=wp.float32),
) -> wp.float32:
    own = complement_in(q, centres[row, 0], radii[row, 0])
    if own > 0.5:
        return -1.0
    push = wp.float32(0.0)
    for j in range(1, centres.shape[1]):
        if radii[row, j] > 0.0:
            e = complement_in(q, centres[row, j], radii[row, j])
            if e < own:
                return -1.0
            push = add_push(push, contact_push(e, own), contact)
    return rim_distance(contact_complement(own, push))


@wp.func
def cell_place(
    q: wp.vec3,
    row: wp.int32,
    contact: wp.int32,
    stiffness: wp.float32,
    centres: wp.array2d(dtype=wp.vec3),
    radii: wp.array2d(dtype=wp.float32),
) -> wp.vec3:
    none = wp.vec3(0.0, 0.0, -1.0)
    radius = radii[row, 0]
    w = q - centres[row, 0]
    distance = wp.length(w)
    if distance > radius or distance == 0.0:
        return none
    ray = w / distance
    end = wp.float32(radius)
    squares = wp.float32(0.0)
    bump = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for j in range(1, centres.shape[1]):
        other = radii[row, j]
        if other > 0.0:
            apart = centres[row, j] - centres[row, 0]
            if balls_nested(apart, radius, other):
                if other < radius:
                    if power(q - centres[row, j], other) <= 0.0:
                        return none
                    bump = join_bumps(bump, bump_of(q - centres[row, j], radius, other))
            else:
                if power(q - centres[row, j], other) < power(w, radius):
                    return none
                if wp.dot(ray, apart) > 0.0:
                    end = wp.min(end, plane_distance(ray, apart, radius, other))
                push = plane_push(ray, distance / radius, apart, radius, other, stiffness)
                squares += square_of_push(distance / radius, push)
    if contact == Contact.RADIAL:
        return wp.min(distance / end, 1.0) * ray
    r = rim_distance(pushed_along_ray(distance / radius, squares))
    return r * ray + (1.0 - r * r) * wp.vec3(bump[0], bump[1], 0.0)


@wp.kernel
def places_in_sets(
    points: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    stiffness: wp.float32,
    centres: wp.array2d(dtype=wp.vec3),
    radii: wp.array2d(dtype=wp.float32),
    places: wp.array(dtype=wp.vec3),
) -> None:
    """Write the place of point i in the image of the first decal of set i, a disc of radius 1.

    All points lie in the planes z = 0. z is −1 where another decal, or none, shows.
    """
    row = wp.tid()
    if contact < Contact.RADIAL:
        rim = pushed_rim(points[row], row, contact, centres, radii)
        places[row] = rim * wp.normalize(points[row])
        if rim < 0.0:
            places[row] = wp.vec3(0.0, 0.0, -1.0)
    else:
        places[row] = cell_place(points[row], row, contact, stiffness, centres, radii)
