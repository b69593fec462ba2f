"""Images averaged over pixels: shares of a pixel on both sides of a rim or contact line, and footprints.

A pixel is a parallelogram on the surface's tangent plane, with the steps to the next pixels as its sides. A
rim or contact line is the zero of a field that is positive on the owner's side. Inside a pixel it is nearly a
straight line: the field's value at the centre and its change along both sides decide the share of the pixel
on the positive side, and where that part lies.

The footprint is the change of image coordinates along both sides, for a fixed owner. Differences between
pixels would cross the edges between owners.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.transpile.derivative import directional_derivative
from decals.field.contact import rim_distance
from decals.field.elastic import MIN_DISTANCE, plane_push, pushed_distance, square_of_push
from decals.field.mapping import ImageMapping, image_distance, tangent_coordinates, unroll, unroll_step

wp.set_module_options({"enable_backward": False})

MIN_SIDE = 0.02
"""Smallest change along the shorter side, relative to the longer one; it bounds cancellation."""

MIN_CHANGE = 1.0e-30
MIN_LENGTH = 1.0e-6
MIN_SHARE = 1.0e-4
"""Smallest share of a pixel whose centre is computed."""


@wp.func
def cube_above(x: wp.float32) -> wp.float32:
    """Return max(x, 0)³."""
    y = wp.max(x, 0.0)
    return y * y * y


@wp.func
def square_above(x: wp.float32) -> wp.float32:
    """Return max(x, 0)²."""
    y = wp.max(x, 0.0)
    return y * y


@wp.func
def positive_part(value: wp.float32, along: wp.vec2) -> wp.vec3:
    """Return the part of a pixel in which a linear field is positive: its share, and its centre.

    The field is `value` at the pixel's centre and changes by `along` from side to side. Over the pixel it is
    distributed as the sum of two uniform variables. The share is the integral of that density above 0, the
    mean the integral of the share over the share. The centre, in sides of the pixel, lies on the gradient.
    """
    longer = wp.max(wp.abs(along[0]), wp.abs(along[1]))
    if longer < MIN_CHANGE:
        if value > 0.0:
            return wp.vec3(1.0, 0.0, 0.0)
        return wp.vec3(0.0, 0.0, 0.0)
    side = wp.max(wp.min(wp.abs(along[0]), wp.abs(along[1])) / longer, MIN_SIDE)
    outer = 0.5 * (1.0 + side)
    inner = 0.5 * (1.0 - side)
    d = value / longer
    if d >= outer:
        return wp.vec3(1.0, 0.0, 0.0)
    if d <= -outer:
        return wp.vec3(0.0, 0.0, 0.0)
    share = (
        square_above(d + outer) - square_above(d + inner) - square_above(d - inner) + square_above(d - outer)
    ) / (2.0 * side)
    if share < MIN_SHARE:
        return wp.vec3(0.0, 0.0, 0.0)
    moment = (
        cube_above(d + outer) - cube_above(d + inner) - cube_above(d - inner) + cube_above(d - outer)
    ) / (6.0 * side)
    shift = (moment / share - d) * longer / wp.dot(along, along)
    return wp.vec3(share, shift * along[0], shift * along[1])


@wp.func
def push_square(
    w: wp.vec3, apart: wp.vec3, radius: wp.float32, other: wp.float32, stiffness: wp.float32
) -> wp.float32:
    """Return z² of one neighbour in elastic contact at an offset from the centre, in visible radii."""
    distance = wp.length(w)
    ray = w / wp.max(distance, MIN_DISTANCE)
    return square_of_push(distance, plane_push(ray, distance, apart, radius, other, stiffness))


@wp.func
def contact_distance(complement: wp.float32) -> wp.float32:
    """Return the distance of `decals.field.contact.rim_distance`; contact laws have another one."""
    return rim_distance(complement)


push_square_step = directional_derivative(push_square, ("w",))
"""The same and its change along a step."""

pushed_distance_step = directional_derivative(pushed_distance)
"""Distance in the image, and its change."""


@wp.func
def image_steps(
    w: wp.vec3,
    right: wp.vec3,
    up: wp.vec3,
    n_p: wp.vec3,
    n_q: wp.vec3,
    tangent: wp.vec3,
    rim: wp.vec3,
    mapping: wp.int32,
) -> tuple[wp.vec2, wp.vec2, wp.vec2, wp.vec3]:
    """Return uv and length along the surface at w, and the changes of both along two steps.

    `rim` is the distance after contact and its changes. All are in visible radii. Steps are unrolled, which
    keeps their lengths; contact then stretches them along the ray.
    """
    chord = wp.length(w)
    ray = w / wp.max(chord, MIN_LENGTH)
    offset = tangent_coordinates(w, n_p, tangent)
    x = tangent_coordinates(right, n_p, tangent)
    y = tangent_coordinates(up, n_p, tangent)
    length = float(chord)
    drawn = float(rim[0])
    if mapping != ImageMapping.CHORD:
        arc = unroll(w, n_p, n_q)
        length = arc[3]
        drawn = image_distance(rim[0], chord, length)
        offset = tangent_coordinates(wp.vec3(arc[0], arc[1], arc[2]), n_p, tangent)
        x = tangent_coordinates(unroll_step(right, n_p, n_q), n_p, tangent)
        y = tangent_coordinates(unroll_step(up, n_p, n_q), n_p, tangent)
    toward = offset / wp.max(wp.length(offset), MIN_LENGTH)
    across = wp.vec2(-toward[1], toward[0])
    lengths = wp.vec2(wp.dot(toward, x), wp.dot(toward, y))
    chords = wp.vec2(wp.dot(ray, right), wp.dot(ray, up))
    # the derivative of `image_distance`
    share = wp.clamp((length - chord) / wp.max(1.0 - chord, MIN_LENGTH), 0.0, 1.0)
    rest = wp.clamp((1.0 - rim[0]) / wp.max(1.0 - chord, MIN_LENGTH), 0.0, 1.0)
    steps = (1.0 - share) * wp.vec2(rim[1], rim[2]) + rest * (lengths - (1.0 - share) * chords)
    turn = drawn / wp.max(length, MIN_LENGTH)
    uv = wp.vec2(0.5, 0.5) + 0.5 * drawn * toward
    uv_right = 0.5 * (steps[0] * toward + turn * wp.dot(across, x) * across)
    uv_up = 0.5 * (steps[1] * toward + turn * wp.dot(across, y) * across)
    if length < MIN_LENGTH:
        uv_right = 0.5 * x
        uv_up = 0.5 * y
    return uv, uv_right, uv_up, wp.vec3(length, lengths[0], lengths[1])
