"""Convolution surfaces along segments, arcs, strokes and triangles: integrals of a compact kernel.

Abutting pieces in a sum join without a bulge. A piece ends where its skeleton ends: its surface runs through
the end, without the round cap of a `Segment`. Pieces much shorter than their radius show nothing alone.

Source: Zanni, Bernhardt, Quiblier and Cani 2013, "SCALe-invariant Integral Surfaces" (SCALIS), with the
kernel (1 − p²)³ of compact support. Their surface lies at a threshold of the integral; here the integral is
scaled, so that a long straight line and a plane have the field ½ at their radius.

    f(q) = N ∫ (1 − |p|²)₊³ ds / τ,    p = (q − S(s)) / τ(s)

S runs over the skeleton and τ, the radius of the kernel there, is linear along a segment. ds / τ has no unit,
so that f does not change when the model is scaled. The integral over abutting pieces is that over the whole:
joints of a line do not bulge.

On a segment, with the parameter λ in which 1/τ is linear, p runs along a straight line at constant speed:

    p(λ) = (1 − λ) p₀ + λ p₁,    ds / τ = L z₀ z₁ dλ / z(λ),    z = 1/τ = (1 − λ) z₀ + λ z₁

where L is the segment's length. In the kernel's support the integrand is a polynomial of degree 6 over z;
that of the gradient, −6 (1 − |p|²)² p L z₀ z₁, is a polynomial of degree 5. The Gauss-Legendre rule of 6
nodes integrates polynomials of degree 11 exactly, and its terms for the value are positive: nothing cancels
in float32. What it misses of the logarithm in the value is below 1e-5 as long as z changes by less than a
factor of 3; beyond, it is added.
"""

import math
from dataclasses import KW_ONLY, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Box, Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.curves import Arc, checked_radii
from blobtree.nodes.fields import FieldPrimitive
from blobtree.nodes.flats import check_corners, triangle_texels
from blobtree.nodes.node import Node
from blobtree.nodes.primitives import Columns, Leaf, beside
from blobtree.nodes.tree import Macro, Sum
from blobtree.texels import Texels
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

LINE_FACTOR = 35.0 / 32.0
"""N of a curve: the field on an infinite line is 1."""

SHEET_FACTOR = 4.0 / math.pi
"""N of a surface: the field on an infinite plane is 1."""

LINE_RIM = math.sqrt(1.0 - 2.0 ** (-2.0 / 7.0))
"""Visible radius / kernel radius of a straight line, whose field is (1 − p²)^(7/2)."""

SHEET_RIM = math.sqrt(1.0 - 2.0 ** (-1.0 / 4.0))
"""Half the thickness / kernel radius of a plane, whose field is (1 − p²)⁴."""

STEEPEST_KERNEL = 0.2863
"""max p (1 − p²)²: a sixth of the kernel's steepest slope, rounded up."""

LINE_SLOPE = 0.3774
"""max over straight lines of ∫ p (1 − p²)² ds, rounded up."""

LINE_CURVATURE = 1.437
"""max over straight lines of ∫ |second derivative of the kernel| / 6 ds, rounded up."""

SHEET_SLOPE = 2.234
"""Bound on |∇f| τ of a part of a plane: 1.905 across it, 1.165 along it."""

SHEET_CURVATURE = 1.979
"""∫ |second derivative of the kernel| / 6 dA over a plane through the point, rounded up."""

BOUND_MARGIN = 2e-5
"""Margin of the bounds for the rounding of values, over the largest value 1."""

WIDEST_PANEL = 2.0
"""Largest angle over which the rule integrates a polynomial of degree 3 in cos θ to 1e-6."""

LARGEST_CHANGE = 0.5
"""Half the change of z over the interval, over its mean, from which the logarithm is added."""

TOUCH = 1e-6
"""Squared length of half a chord of the kernel below which an edge does not meet it."""

SHORTEST_AXIS = 1e-20
"""Smallest squared speed of p along a segment; where it is less, p is a constant."""


@wp.func
def gauss_node(number: wp.int32) -> wp.vec2:
    """Return node and weight `number` of the Gauss-Legendre rule of 6 nodes on [−1, 1]."""
    node = wp.vec2(0.238619186083196909, 0.467913934572691047)
    if number >= 2:
        node = wp.vec2(0.661209386466264514, 0.360761573048138608)
    if number >= 4:
        node = wp.vec2(0.932469514203152028, 0.171324492379170345)
    if number % 2 == 1:
        node = wp.vec2(-node[0], node[1])
    return node


@wp.func
def taylor_bounds(
    f: wp.vec4, radius: wp.float32, slope: wp.float32, curvature: wp.float32, largest: wp.float32
) -> wp.vec3:
    """Return (smallest f, largest f, largest |∇f|) over a ball, from value and gradient at its centre.

    `slope`, `curvature` and `largest` bound |∇f|, the norm of the Hessian and f over the ball.
    """
    gradient = wp.length(wp.vec3(f[1], f[2], f[3]))
    change = radius * wp.min(slope, gradient + 0.5 * radius * curvature) + BOUND_MARGIN
    steepest = wp.min(slope, gradient + radius * curvature) * (1.0 + BOUND_MARGIN)
    return wp.vec3(
        wp.max(f[0] - change, 0.0), wp.min(f[0] + change, largest * (1.0 + BOUND_MARGIN)), steepest
    )


# -- segment --------------------------------------------------------------------------------------------


@wp.func
def chord_in_kernel(start: wp.vec3, axis: wp.vec3) -> wp.vec3:
    """Return (first, last, nearest): where start + λ axis lies in the unit ball, and its nearest point.

    0 ≤ first ≤ last ≤ 1, with first = last outside the ball; the nearest λ is that of the whole line.
    """
    squared_length = wp.max(wp.dot(axis, axis), SHORTEST_AXIS)
    nearest = -wp.dot(start, axis) / squared_length
    p = start + axis * nearest
    squared_distance = wp.dot(p, p)  # type: ignore[call-overload]  # mypy takes the vector for a number
    half = wp.sqrt(wp.max(1.0 - squared_distance, 0.0) / squared_length)
    first = wp.clamp(nearest - half, 0.0, 1.0)
    return wp.vec3(first, wp.clamp(nearest + half, first, 1.0), nearest)


@wp.func
def convolution_segment(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (f, ∇f); tape[at] = (start, 1/τ there), tape[at + 1] = (end, 1/τ there)."""
    start = tape[at]
    end = tape[at + 1]
    a = wp.vec3(start[0], start[1], start[2])
    b = wp.vec3(end[0], end[1], end[2])
    p0 = (q - a) * start[3]
    axis = (q - b) * end[3] - p0
    chord = chord_in_kernel(p0, axis)
    half = 0.5 * (chord[1] - chord[0])
    middle = 0.5 * (chord[1] + chord[0])
    p_nearest = p0 + axis * chord[2]
    growth = end[3] - start[3]
    z = start[3] + growth * middle
    change = growth * half / z
    value = float(0.0)
    of_one = float(0.0)
    gradient = wp.vec3()
    for number in range(6):
        node = gauss_node(number)
        p = p_nearest + axis * (middle - chord[2] + half * node[0])
        k = wp.max(1.0 - wp.dot(p, p), 0.0)
        weight = node[1] / (1.0 + change * node[0])
        of_one += weight
        value += weight * k * k * k
        gradient += p * (node[1] * k * k)
    change = wp.abs(change)
    if change > LARGEST_CHANGE:
        p = p_nearest - axis * (start[3] / growth + chord[2])  # where z = 0
        k = 1.0 - wp.dot(p, p)
        value += k * k * k * (wp.log((1.0 + change) / (1.0 - change)) / change - of_one)
    scale = LINE_FACTOR * wp.length(b - a) * start[3] * end[3] * half
    gradient = gradient * (-6.0 * scale)
    return wp.vec4(scale / z * value, gradient[0], gradient[1], gradient[2])


@wp.func
def convolution_segment_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return (smallest f, largest f, largest |∇f|) over a ball.

    A part of the segment that the kernel of any point of the ball reaches is reached from the centre by a
    kernel with a radius larger by that of the ball. There s / τ has the length `measure` at most.
    """
    start = tape[at]
    end = tape[at + 1]
    a = wp.vec3(start[0], start[1], start[2])
    b = wp.vec3(end[0], end[1], end[2])
    t0 = 1.0 / start[3]
    t1 = 1.0 / end[3]
    p0 = (center - a) / (t0 + radius)
    axis = (center - b) / (t1 + radius) - p0
    chord = chord_in_kernel(p0, axis)
    if chord[1] <= chord[0]:
        return wp.vec3()
    nearest = wp.length(p0 + axis * wp.clamp(chord[2], chord[0], chord[1]))
    first = chord[0] * (t0 + radius) / (t1 + radius + chord[0] * (t0 - t1))
    last = chord[1] * (t0 + radius) / (t1 + radius + chord[1] * (t0 - t1))
    z = 1.0 / wp.min(t0 + first * (t1 - t0), t0 + last * (t1 - t0))
    length = wp.length(b - a)
    measure = length * (last - first) * z
    nearest = wp.max(nearest - wp.max(1.0 - nearest, 0.0) * radius * z, 0.0)
    k = 1.0 - nearest * nearest
    slope = measure * wp.min(STEEPEST_KERNEL, k * k)
    curvature = measure * wp.min(1.0, 4.0 * k)
    straightness = 1.0 - wp.abs(t1 - t0) / length
    if straightness > 0.0:
        slope = wp.min(slope, LINE_SLOPE / straightness)
        curvature = wp.min(curvature, LINE_CURVATURE / straightness)
    return taylor_bounds(
        convolution_segment(center, tape, at),
        radius,
        6.0 * LINE_FACTOR * z * slope,
        6.0 * LINE_FACTOR * z * z * curvature,
        LINE_FACTOR * measure * k * k * k,
    )


# -- arc ------------------------------------------------------------------------------------------------


@wp.func
def arc_in_kernel(
    local: wp.vec3, arc_radius: wp.float32, half: wp.vec2, margin: wp.float32, part: wp.int32
) -> wp.vec2:
    """Return the angles (first, last) of part 0 or 1 of an arc in the kernel, from the azimuth of the point.

    `local` is the point in the arc's frame, x toward its middle and z across its plane, in kernel radii, and
    `half` the cosine and sine of half the arc. There 1 − |p|² is `margin` − 4 r R sin²(φ/2). The part behind
    the point, at ±π, may cut the arc in two. Angles near 0 are those that matter, and they are exact.
    """
    x = local[0]
    y = local[1]
    swing = 4.0 * wp.sqrt(x * x + y * y) * arc_radius
    widest = wp.PI
    if margin < swing:
        inside = wp.max(margin, 0.0)
        widest = 2.0 * wp.atan2(wp.sqrt(inside), wp.sqrt(swing - inside))  # asin is coarse in some drivers
    start = wp.atan2(-x * half[1] - y * half[0], x * half[0] - y * half[1])
    end = wp.atan2(x * half[1] - y * half[0], x * half[0] + y * half[1])
    if x == 0.0 and y == 0.0:
        start = -wp.PI
        end = -wp.PI + 2.0 * wp.atan2(half[1], half[0])
    if end < start:
        if part == 0:
            end = wp.PI
        else:
            start = -wp.PI
    elif part == 1:
        end = start
    first = wp.clamp(start, -widest, widest)
    return wp.vec2(first, wp.clamp(end, first, widest))


@wp.func
def arc_margin(local: wp.vec3, arc_radius: wp.float32) -> wp.float32:
    """Return 1 − |p|² at the point of the whole circle that is nearest to a point in the arc's frame."""
    gap = wp.sqrt(local[0] * local[0] + local[1] * local[1]) - arc_radius
    return 1.0 - local[2] * local[2] - gap * gap


@wp.func
def convolution_arc(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (f, ∇f) of a circular arc.

    tape[at] = (centre, 1/τ), tape[at + 1] = (from the centre to the middle of the arc, cosine of half its
    angle), tape[at + 2] = (the same vector turned by 90° along the arc, sine of half its angle). With φ
    measured from the azimuth of the point, 1 − |p|² is a linear function of cos φ, so the integrals are
    elementary. The rule of 6 nodes per panel has an error below 1e-6.
    """
    center = tape[at]
    half = wp.vec2(tape[at + 1][3], tape[at + 2][3])
    middle = wp.vec3(tape[at + 1][0], tape[at + 1][1], tape[at + 1][2])
    across = wp.vec3(tape[at + 2][0], tape[at + 2][1], tape[at + 2][2])
    z = center[3]
    arc_radius = wp.length(middle) * z
    w = (q - wp.vec3(center[0], center[1], center[2])) * z
    toward = wp.normalize(middle)
    beside = wp.normalize(across)
    local = wp.vec3(wp.dot(w, toward), wp.dot(w, beside), wp.dot(w, wp.cross(toward, beside)))
    margin = arc_margin(local, arc_radius)
    if margin <= 0.0:
        return wp.vec4()
    radial = wp.sqrt(local[0] * local[0] + local[1] * local[1])
    outward = toward
    sideways = beside
    if radial > 0.0:
        outward = (toward * local[0] + beside * local[1]) / radial
        sideways = (beside * local[0] - toward * local[1]) / radial
    nearest = w - outward * arc_radius
    value = float(0.0)
    gradient = wp.vec3()
    for part in range(2):
        span = arc_in_kernel(local, arc_radius, half, margin, part)
        panels = 1 + int((span[1] - span[0]) / WIDEST_PANEL)
        width = 0.5 * (span[1] - span[0]) / float(panels)
        for panel in range(panels):
            for number in range(6):
                node = gauss_node(number)
                phi = span[0] + width * (float(2 * panel + 1) + node[0])
                bend = wp.sin(0.5 * phi)
                k = wp.max(margin - 4.0 * radial * arc_radius * bend * bend, 0.0)
                chord = outward * bend - sideways * wp.cos(0.5 * phi)
                weight = width * node[1] * k * k
                value += weight * k
                gradient += (nearest + chord * (2.0 * arc_radius * bend)) * weight
    gradient = gradient * (-6.0 * LINE_FACTOR * arc_radius * z)
    return wp.vec4(LINE_FACTOR * arc_radius * value, gradient[0], gradient[1], gradient[2])


@wp.func
def convolution_arc_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return (smallest f, largest f, largest |∇f|) over a ball, as of a segment."""
    texel = tape[at]
    half = wp.vec2(tape[at + 1][3], tape[at + 2][3])
    middle = wp.vec3(tape[at + 1][0], tape[at + 1][1], tape[at + 1][2])
    across = wp.vec3(tape[at + 2][0], tape[at + 2][1], tape[at + 2][2])
    z = 1.0 / (1.0 / texel[3] + radius)
    w = (center - wp.vec3(texel[0], texel[1], texel[2])) * z
    toward = wp.normalize(middle)
    beside = wp.normalize(across)
    local = wp.vec3(wp.dot(w, toward), wp.dot(w, beside), wp.dot(w, wp.cross(toward, beside)))
    arc_radius = wp.length(middle) * z
    margin = arc_margin(local, arc_radius)
    first = arc_in_kernel(local, arc_radius, half, margin, 0)
    second = arc_in_kernel(local, arc_radius, half, margin, 1)
    measure = wp.length(middle) * texel[3] * (first[1] - first[0] + second[1] - second[0])
    if measure <= 0.0:
        return wp.vec3()
    nearest = wp.sqrt(wp.max(1.0 - margin, 0.0))
    nearest = wp.max(nearest - wp.max(1.0 - nearest, 0.0) * radius * texel[3], 0.0)
    k = 1.0 - nearest * nearest
    return taylor_bounds(
        convolution_arc(center, tape, at),
        radius,
        6.0 * LINE_FACTOR * texel[3] * measure * wp.min(STEEPEST_KERNEL, k * k),
        6.0 * LINE_FACTOR * texel[3] * texel[3] * measure * wp.min(1.0, 4.0 * k),
        LINE_FACTOR * measure * k * k * k,
    )


# -- triangle -------------------------------------------------------------------------------------------


@wp.func
def swept_angle(distance: wp.float32, first: wp.float32, last: wp.float32) -> wp.float32:
    """Return the angle at which the origin sees a part of a line at a signed distance."""
    return wp.atan2(distance * (last - first), distance * distance + first * last)


@wp.func
def triangle_edge(a: wp.vec3, edge: wp.vec3, normal: wp.vec3, margin: wp.float32) -> wp.vec4:
    """Return what an edge adds to (∫∫ k³, ∫∫ k², ∫ k³ along the edge, 0), with k = margin − |x|².

    a, where the edge starts, is relative to the foot of the point in the triangle's plane. By Green's theorem
    the integral of a function of |x| alone is a sum over the edges: of distance ∫ F(|x|²) / |x|² dt, F being
    the function's integral along the ray to the edge; outside the kernel's disc F is constant, and its factor
    is the angle.
    """
    direction = wp.normalize(edge)
    first = wp.dot(a, direction)
    last = first + wp.length(edge)
    distance = wp.dot(wp.cross(a, direction), normal)
    reach = wp.sqrt(wp.max(margin - distance * distance - TOUCH, 0.0))
    enter = wp.clamp(first, -reach, reach)
    leave = wp.clamp(last, -reach, reach)
    cubes = float(0.0)
    squares = float(0.0)
    along = float(0.0)
    half = 0.5 * (leave - enter)
    for number in range(6):
        node = gauss_node(number)
        t = 0.5 * (enter + leave) + half * node[0]
        v = distance * distance + t * t
        k = wp.max(margin - v, 0.0)
        cubes += node[1] * (margin + k) * (margin * margin + k * k)
        squares += node[1] * (margin * margin + margin * k + k * k)
        along += node[1] * k * k * k
    outside = swept_angle(distance, first, enter) + swept_angle(distance, leave, last)
    cube = margin * margin * margin
    return wp.vec4(
        (distance * half * cubes + margin * cube * outside) / 8.0,
        (distance * half * squares + cube * outside) / 6.0,
        half * along,
        0.0,
    )


@wp.func
def convolution_triangle(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (f, ∇f); tape[at] = (corner a, 1/τ); tape[at + 1] = (b − a, 0); tape[at + 2] = (c − a, 0).

    tape[at + 3] = (unit normal, 0), which float32 could not compute for slivers.
    """
    corner = tape[at]
    z = corner[3]
    a = (wp.vec3(corner[0], corner[1], corner[2]) - q) * z
    to_b = wp.vec3(tape[at + 1][0], tape[at + 1][1], tape[at + 1][2]) * z
    to_c = wp.vec3(tape[at + 2][0], tape[at + 2][1], tape[at + 2][2]) * z
    normal = wp.vec3(tape[at + 3][0], tape[at + 3][1], tape[at + 3][2])
    height = -wp.dot(a, normal)
    margin = 1.0 - height * height
    if margin <= 0.0:
        return wp.vec4()
    a = a + normal * height
    ab = triangle_edge(a, to_b, normal, margin)
    bc = triangle_edge(a + to_b, to_c - to_b, normal, margin)
    ca = triangle_edge(a + to_c, -to_c, normal, margin)
    inside = ab + bc + ca
    if inside[0] <= 0.0:
        return wp.vec4()
    if inside[2] <= 0.0 and 8.0 * inside[0] < wp.PI * margin * margin * margin * margin:
        return wp.vec4()  # no edge lies in the kernel's disc, and the triangle does not hold it
    outward = wp.normalize(to_b) * ab[2] + wp.normalize(to_c - to_b) * bc[2] - wp.normalize(to_c) * ca[2]
    gradient = normal * (-6.0 * height * inside[1]) - wp.cross(outward, normal)
    gradient = gradient * (SHEET_FACTOR * z)
    return wp.vec4(SHEET_FACTOR * inside[0], gradient[0], gradient[1], gradient[2])


@wp.func
def squared_distance_to_edge(a: wp.vec3, edge: wp.vec3) -> wp.float32:
    """Return the squared distance of the origin from the line segment from a to a + `edge`."""
    t = wp.clamp(-wp.dot(a, edge) / wp.max(wp.dot(edge, edge), SHORTEST_AXIS), 0.0, 1.0)
    return wp.length_sq(a + edge * t)  # type: ignore[call-overload]  # mypy takes the vector for a number


@wp.func
def distance_to_triangle(a: wp.vec3, to_b: wp.vec3, to_c: wp.vec3, normal: wp.vec3) -> wp.float32:
    """Return the distance of the origin from the triangle of a, a + `to_b` and a + `to_c`."""
    to_c_from_b = to_c - to_b
    b = a + to_b
    if (
        wp.dot(wp.cross(a, to_b), normal) >= 0.0
        and wp.dot(wp.cross(b, to_c_from_b), normal) >= 0.0
        and wp.dot(wp.cross(a, to_c), normal) <= 0.0
    ):
        return wp.abs(wp.dot(a, normal))
    nearest = wp.min(squared_distance_to_edge(a, to_b), squared_distance_to_edge(b, to_c_from_b))
    return wp.sqrt(wp.min(nearest, squared_distance_to_edge(a, to_c)))


@wp.func
def convolution_triangle_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return (smallest f, largest f, largest |∇f|) over a ball."""
    corner = tape[at]
    z = corner[3]
    a = (wp.vec3(corner[0], corner[1], corner[2]) - center) * z
    to_b = wp.vec3(tape[at + 1][0], tape[at + 1][1], tape[at + 1][2]) * z
    to_c = wp.vec3(tape[at + 2][0], tape[at + 2][1], tape[at + 2][2]) * z
    normal = wp.vec3(tape[at + 3][0], tape[at + 3][1], tape[at + 3][2])
    nearest = wp.max(distance_to_triangle(a, to_b, to_c, normal) - radius * z, 0.0)
    if nearest >= 1.0:
        return wp.vec3()
    k = 1.0 - nearest * nearest
    area = wp.min(0.5 * wp.length(wp.cross(to_b, to_c)), wp.PI)
    slope = 6.0 * SHEET_FACTOR * area * wp.min(STEEPEST_KERNEL, k * k)
    curvature = 6.0 * SHEET_FACTOR * wp.min(area * wp.min(1.0, 4.0 * k), SHEET_CURVATURE)
    return taylor_bounds(
        convolution_triangle(center, tape, at),
        radius,
        z * wp.min(slope, SHEET_SLOPE),
        z * z * curvature,
        wp.min(SHEET_FACTOR * area * k * k * k, k * k * k * k),
    )


STEEPEST_TAPER = 0.5
"""Change of radius per length up to which a tapered segment shows its radii; steeper ones are thicker."""

FLATTEST_TRIANGLE = 1e-4
"""Height of a triangle over its longest side below which float32 takes it for a line."""


class ConvolutionPrimitive(FieldPrimitive):
    """A leaf whose field is an integral over a skeleton; `hull` and `kernel_radii` give its box."""

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return points (n, k, 3) whose convex hulls hold n skeletons; by default their points."""
        declared = parameters_of(cls).values()
        return np.stack([columns[p.name] for p in declared if p.quantity is Quantity.POINT], axis=1)

    @classmethod
    def kernel_radii(cls, columns: Columns) -> Float64Array:
        """Return the radii (n, 1 or k) of the kernels at the points of `hull`."""
        raise NotImplementedError

    @classmethod
    def box(cls, columns: Columns) -> Box:
        """Return the boxes around the balls of the kernels' radii."""
        points, radii = cls.hull(columns), cls.kernel_radii(columns)[:, :, None]
        return (points - radii).min(axis=1), (points + radii).max(axis=1)

    def grown(self, distance: float) -> Self:
        """Return this leaf with radii larger by a distance."""
        radii = {
            name: getattr(self, name) + distance
            for name, parameter in parameters_of(type(self)).items()
            if parameter.quantity is Quantity.RADIUS
        }
        if min(radii.values()) <= 0.0:
            raise InvalidNode(f"offset: {distance:g} leaves nothing of {self!r}")
        return replace(self, **radii)


class ConvolutionSegment(ConvolutionPrimitive):
    """A straight limb whose radius changes linearly, and which joins others in a sum without a bulge.

    A long one shows its radii, as the hull of two balls does, up to a change of radius of half its length.
    The field is SCALIS of a compact polynomial kernel (Zanni et al. 2013), in closed form.

    Raises
    ------
    InvalidNode
        Start and end are equal: a point has no length to integrate over; use a `Point`.

    Examples
    --------
    >>> from blobtree import ConvolutionSegment
    >>> limb = ConvolutionSegment((0, 0, 0), (4, 0, 0), radius=0.5, end_radius=0.5)
    >>> halves = [ConvolutionSegment(a, b, radius=0.5, end_radius=0.5)
    ...           for a, b in [((0, 0, 0), (2, 0, 0)), ((2, 0, 0), (4, 0, 0))]]
    >>> points = [[2, 0.5, 0], [2, 0, 0], [4, 0, 0]]
    >>> limb(points).round(3).tolist(), sum(halves)(points).round(3).tolist()
    ([0.5, 1.0, 0.5], [0.5, 1.0, 0.5])
    """

    tag = "convolution_segment"
    texels_read = 2
    value_gradient = formula(convolution_segment)
    bounds = formula(convolution_segment_bounds)

    start: Vector = par.point("start of the segment")
    end: Vector = par.point("end of the segment")
    _: KW_ONLY
    radius: float = par.radius("visible radius at the start")
    end_radius: float = par.radius("visible radius at the end")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start == self.end:
            raise InvalidNode(
                f"end: expected a point other than the start, got {self.end} for both; use a Point for a ball"
            )

    @classmethod
    def kernel_radii(cls, columns: Columns) -> Float64Array:
        """Return the radii (n, 2) at both ends, smaller where the segment is tapered.

        The field of a tapered line at its radius is larger than ½, because the thicker part adds more than
        the thinner lacks. A factor that depends on the taper alone restores the radius of the hull of two
        balls. It was fitted to the field of endless cones, with an error below 2e-4.
        """
        radii = np.concatenate([columns["radius"], columns["end_radius"]], axis=1)
        lengths = np.linalg.norm(columns["end"] - columns["start"], axis=1, keepdims=True)
        tapers = np.minimum(np.abs(radii[:, 1:] - radii[:, :1]) / lengths, STEEPEST_TAPER) ** 2
        factors = 1.0 - tapers * (0.65794805 - tapers * (0.46114516 - tapers * 0.76805927))
        kernels: Float64Array = radii * factors / LINE_RIM
        return kernels

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return start and end, each beside the reciprocal of the kernel's radius."""
        inverses = 1.0 / cls.kernel_radii(columns)
        ends = [beside(columns["start"], inverses[:, 0]), beside(columns["end"], inverses[:, 1])]
        return np.stack(ends, axis=1)


class ConvolutionArc(ConvolutionPrimitive):
    """A limb of one radius along a part of a circle, which joins segments and arcs without a bulge.

    The field is SCALIS of a compact polynomial kernel (Zanni et al. 2013), to an error of 1e-6.

    Raises
    ------
    InvalidNode
        Two points are equal, or the three lie on a line: then use a `ConvolutionSegment`.

    Examples
    --------
    >>> from blobtree import ConvolutionArc
    >>> half = ConvolutionArc((3, 0, 0), (0, 3, 0), (-3, 0, 0), radius=0.5)
    >>> half([[0, 3, 0.5], [3, 0, 0], [0, -3, 0]]).round(2).tolist()
    [0.5, 0.5, 0.0]
    """

    tag = "convolution_arc"
    texels_read = 3
    value_gradient = formula(convolution_arc)
    bounds = formula(convolution_arc_bounds)

    start: Vector = par.point("start of the arc")
    through: Vector = par.point("a point of the arc between its ends")
    end: Vector = par.point("end of the arc")
    _: KW_ONLY
    radius: float = par.radius("visible radius around the skeleton")

    def __post_init__(self) -> None:
        super().__post_init__()
        Arc(self.start, self.through, self.end, radius=self.radius)  # refuses points that are on no circle

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the corners of the hull of the `Arc` through the same points."""
        return Arc.hull(columns)

    @classmethod
    def kernel_radii(cls, columns: Columns) -> Float64Array:
        """Return the radii (n, 1)."""
        return columns["radius"] / LINE_RIM

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return the texels of an `Arc`, with 1 / kernel radius in place of the influence radius."""
        return Arc.texels(columns, 1.0 / cls.kernel_radii(columns))


class ConvolutionTriangle(ConvolutionPrimitive):
    """A flat sheet of one thickness over a triangle, which joins others at an edge without a bulge.

    The field is SCALIS of a compact polynomial kernel (Zanni et al. 2013), in closed form.

    Raises
    ------
    InvalidNode
        The corners lie on a line: then use a `ConvolutionSegment`.

    Examples
    --------
    >>> from blobtree import ConvolutionTriangle
    >>> sail = ConvolutionTriangle((0, 0, 0), (9, 0, 0), (0, 9, 0), radius=0.3)
    >>> sail([[2, 2, 0.3], [2, 2, 0], [2, 0, 0]]).round(3).tolist()
    [0.5, 1.0, 0.5]
    """

    tag = "convolution_triangle"
    texels_read = 4
    value_gradient = formula(convolution_triangle)
    bounds = formula(convolution_triangle_bounds)

    a: Vector = par.point("first corner")
    b: Vector = par.point("second corner")
    c: Vector = par.point("third corner")
    _: KW_ONLY
    radius: float = par.radius("half the visible thickness")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_corners(self.a, self.b, self.c, FLATTEST_TRIANGLE, "a ConvolutionSegment")

    @classmethod
    def kernel_radii(cls, columns: Columns) -> Float64Array:
        """Return the radii (n, 1)."""
        return columns["radius"] / SHEET_RIM

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return the first corner beside 1 / kernel radius, the edges from it, and the unit normal."""
        return triangle_texels(columns, 1.0 / cls.kernel_radii(columns)[:, 0])


class ConvolutionStroke(Macro, Leaf):
    """A limb along a polyline without bulges at its corners: the sum of convolution segments.

    Repeat the first point at the end for a closed one.

    Raises
    ------
    InvalidNode
        There are less than two points, neighbours are equal, or the number of radii is another.

    Examples
    --------
    >>> from blobtree import ConvolutionStroke
    >>> tail = ConvolutionStroke([(0, 0, 0), (3, 0, 0), (6, 0, 0)], [0.5, 0.5, 0.1])
    >>> tail([[1.5, 0.5, 0], [1.5, 0, 0]]).round(2).tolist()
    [0.5, 1.0]
    """

    file_tag = "convolution_stroke"

    points: tuple[Vector, ...] = par.points("two or more points in order")
    radii: tuple[float, ...] = par.radii("visible radius at each point, or one for all points")

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "radii", checked_radii(self.points, self.radii))

    @Lazy
    def expanded(self) -> Node:
        """Return the sum of segments between neighbours."""
        ends = zip(pairwise(self.points), pairwise(self.radii), strict=True)
        same: dict[str, Any] = {"color": self.color, "attributes": self.attributes, "weight": self.weight}
        return Sum(
            tuple(
                ConvolutionSegment(*points, radius=radii[0], end_radius=radii[1], **same)
                for points, radii in ends
            )
        )
