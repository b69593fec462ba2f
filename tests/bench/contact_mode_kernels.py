"""Kernel of `tests.bench.contact_modes`: typed functions of all contact modes on sets without an index."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.contact import add_push, contact_complement, contact_push, rim_distance
from decals.field.elastic import plane_push, pushed_along_ray, square_of_push
from decals.field.radial import RIM_SQUARED, balls_nested, plane_distance, power
from decals.record import Contact, field_complement

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
def cell_rim(
    q: wp.vec3,
    row: wp.int32,
    contact: wp.int32,
    stiffness: wp.float32,
    centres: wp.array2d(dtype=wp.vec3),
    radii: wp.array2d(dtype=wp.float32),
) -> wp.float32:
    radius = radii[row, 0]
    w = q - centres[row, 0]
    distance = wp.length(w)
    if distance > radius or distance == 0.0:
        return -1.0
    ray = w / distance
    end = wp.float32(radius)
    squares = wp.float32(0.0)
    for j in range(1, centres.shape[1]):
        other = radii[row, j]
        if other > 0.0:
            apart = centres[row, j] - centres[row, 0]
            if balls_nested(apart, radius, other):
                if other < radius and power(q - centres[row, j], other) <= 0.0:
                    return -1.0
            else:
                if power(q - centres[row, j], other) < power(w, radius):
                    return -1.0
                if wp.dot(ray, apart) > 0.0:
                    end = wp.min(end, plane_distance(ray, apart, radius, other))
                push = plane_push(ray, distance / radius, apart, radius, other, stiffness)
                squares += square_of_push(distance / radius, push)
    if contact == Contact.RADIAL:
        return wp.min(distance / end, 1.0)
    return rim_distance(pushed_along_ray(distance / radius, squares))


@wp.kernel
def rims_in_sets(
    points: wp.array(dtype=wp.vec3),
    contact: wp.int32,
    stiffness: wp.float32,
    centres: wp.array2d(dtype=wp.vec3),
    radii: wp.array2d(dtype=wp.float32),
    rims: wp.array(dtype=wp.float32),
) -> None:
    """Write r/r_h at point i in the first decal of set i; −1 where another decal, or none, shows."""
    row = wp.tid()
    if contact < Contact.RADIAL:
        rims[row] = pushed_rim(points[row], row, contact, centres, radii)
    else:
        rims[row] = cell_rim(points[row], row, contact, stiffness, centres, radii)
