"""Images averaged over pixels: shares of a pixel on both sides of a rim or contact line, and footprints.

A pixel is a parallelogram on the surface's tangent plane, with the steps to the next pixels as its sides. A
rim or contact line is the zero of a field that is positive on the owner's side. Inside a pixel it is nearly a
straight line, which the field's value at the centre and its change along both sides give. The part of the
pixel on the positive side of up to three such lines is a polygon; its area and centre are exact.

The footprint is the change of image coordinates along both sides, for a fixed owner. Differences between
pixels would cross the edges between owners.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.contact import rim_distance
from decals.field.elastic import MIN_SPARE, ROUNDING, push_width, pushed_distance
from decals.field.mapping import ImageMapping, image_distance, tangent_coordinates, unroll, unroll_step
from decals.record import balls_nested

wp.set_module_options({"enable_backward": False})

MIN_SHARE = 1.0e-4
"""Smallest share of a pixel whose centre is computed."""

MIN_CHANGE = 1.0e-30
MIN_LENGTH = 1.0e-6

MIN_REST = 1.0e-8
"""Smallest divisor 1 − t − δ; squares of z, and their slopes, stay finite."""


@wp.func
def pixel_line(value: wp.float32, along: wp.vec2) -> wp.vec3:
    """Return the border of a linear field for `inner_part`, given its value at the centre and its changes.

    The first number is at least 0.5 where the field is positive in the whole pixel, and at most −0.5 where it
    is nowhere.
    """
    change = wp.max(wp.abs(along[0]) + wp.abs(along[1]), MIN_CHANGE)
    return wp.vec3(value / change, along[0] / change, along[1] / change)


@wp.func
def clip_span(span: wp.vec2, value: wp.float32, change: wp.float32) -> wp.vec2:
    """Return the part of an interval of t where value + change·t > 0; it may end before it begins."""
    if wp.abs(change) < MIN_CHANGE:
        if value > 0.0:
            return span
        return wp.vec2(0.0, 0.0)
    t = -value / change
    if change > 0.0:
        return wp.vec2(wp.max(span[0], t), span[1])
    return wp.vec2(span[0], wp.min(span[1], t))


@wp.func
def edge_part(
    start: wp.vec2, step: wp.vec2, distance: wp.float32, span: wp.vec2, a: wp.vec3, b: wp.vec3
) -> wp.vec3:
    """Return the integrals of 1, x and y over the triangle from the pixel's centre to a part of an edge.

    The edge is start + t·step for t in `span`, as far as it lies inside two lines; `distance` is that of the
    centre from it, positive inside.
    """
    first = clip_span(span, a[0] + a[1] * start[0] + a[2] * start[1], a[1] * step[0] + a[2] * step[1])
    both = clip_span(first, b[0] + b[1] * start[0] + b[2] * start[1], b[1] * step[0] + b[2] * step[1])
    area = 0.5 * distance * wp.max(both[1] - both[0], 0.0)
    centre = (2.0 / 3.0) * (start + 0.5 * (both[0] + both[1]) * step)
    return wp.vec3(area, area * centre[0], area * centre[1])


@wp.func
def side_part(start: wp.vec2, step: wp.vec2, a: wp.vec3, b: wp.vec3, c: wp.vec3) -> wp.vec3:
    """Return `edge_part` of one side of the pixel, inside three lines."""
    span = clip_span(
        wp.vec2(-0.5, 0.5), c[0] + c[1] * start[0] + c[2] * start[1], c[1] * step[0] + c[2] * step[1]
    )
    return edge_part(start, step, 0.5, span, a, b)


@wp.func
def line_part(line: wp.vec3, a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return `edge_part` of a line inside the pixel and two other lines."""
    square = line[1] * line[1] + line[2] * line[2]
    if wp.abs(line[0]) >= 0.5 or square < 0.25:
        return wp.vec3(0.0, 0.0, 0.0)
    length = wp.sqrt(square)
    start = wp.vec2(-line[0] * line[1] / square, -line[0] * line[2] / square)
    step = wp.vec2(-line[2] / length, line[1] / length)
    span = clip_span(wp.vec2(-2.0, 2.0), 0.5 + start[0], step[0])
    span = clip_span(span, 0.5 - start[0], -step[0])
    span = clip_span(span, 0.5 + start[1], step[1])
    span = clip_span(span, 0.5 - start[1], -step[1])
    return edge_part(start, step, line[0] / length, span, a, b)


@wp.func
def inner_part(a: wp.vec3, b: wp.vec3, c: wp.vec3) -> wp.vec3:
    """Return the part of a pixel inside three lines of `pixel_line`: its share, and its centre, in sides.

    By the divergence theorem, the integrals over the polygon are sums over its edges, without their order.
    """
    sides = side_part(wp.vec2(0.5, 0.0), wp.vec2(0.0, 1.0), a, b, c)
    sides += side_part(wp.vec2(-0.5, 0.0), wp.vec2(0.0, 1.0), a, b, c)
    sides += side_part(wp.vec2(0.0, 0.5), wp.vec2(1.0, 0.0), a, b, c)
    sides += side_part(wp.vec2(0.0, -0.5), wp.vec2(1.0, 0.0), a, b, c)
    whole = sides + line_part(a, b, c) + line_part(b, a, c) + line_part(c, a, b)
    if whole[0] < MIN_SHARE:
        return wp.vec3(0.0, 0.0, 0.0)
    return wp.vec3(wp.min(whole[0], 1.0), whole[1] / whole[0], whole[2] / whole[0])


@wp.func
def push_gradient(
    w: wp.vec3, apart: wp.vec3, radius: wp.float32, other: wp.float32, stiffness: wp.float32
) -> wp.vec4:
    """Return the gradient of z² of one neighbour in elastic contact, and z², at w in visible radii.

    They are those of `decals.field.elastic.square_of_push`. The share t of the way to the plane is linear in
    w, and z depends on t and |w| alone.
    """
    squared = wp.dot(apart, apart)
    between = squared + (radius - other) * (radius + other)
    distance = wp.length(w)
    t = 2.0 * radius * wp.dot(w, apart) / between
    nothing = wp.vec4(0.0, 0.0, 0.0, 0.0)
    if between <= 0.0 or t <= distance:  # the ray meets the rim before the plane
        return nothing
    width = push_width(squared, radius, other)
    x = 1.0 - (1.0 - t) / width
    if x <= 0.0:
        return nothing
    if balls_nested(apart, radius, other):
        return nothing
    end = distance / t
    spare = wp.max(1.0 - end, MIN_SPARE)
    x = wp.min(x, 1.0)
    power = stiffness + ROUNDING / spare
    push = spare * wp.pow(x, power)
    rest = wp.max(1.0 - distance - push, MIN_REST)
    by_spare = push * (1.0 - ROUNDING * wp.log(x) / spare) / spare
    by_t = by_spare * end / t + push * power / (x * width)
    z = push / rest
    scale = 2.0 * z / (rest * rest)
    along = scale * (rest + push) * by_t * 2.0 * radius / between
    outward = scale * (push - (rest + push) * by_spare / t) / wp.max(distance, MIN_LENGTH)
    gradient = along * apart + outward * w
    return wp.vec4(gradient[0], gradient[1], gradient[2], z * z)


@wp.func
def pushed_steps(distance: wp.float32, steps: wp.vec2, squares: wp.vec3) -> wp.vec3:
    """Return `decals.field.elastic.pushed_distance` and its changes, given those of its arguments."""
    z = wp.sqrt(squares[0])
    kept = 1.0 / (1.0 + z)
    by_squares = 0.5 * (1.0 - distance) * kept * kept / wp.max(z, MIN_LENGTH)
    return wp.vec3(
        pushed_distance(distance, squares[0]),
        kept * steps[0] + by_squares * squares[1],
        kept * steps[1] + by_squares * squares[2],
    )


@wp.func
def contact_distance(complement: wp.float32) -> wp.float32:
    """Return the distance of `decals.field.contact.rim_distance`; contact laws have another one."""
    return rim_distance(complement)


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
