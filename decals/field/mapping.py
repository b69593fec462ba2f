"""Mapping: where in a decal's image a surface point lies, in a direction and at a distance from its centre.

The field, so who owns a point, its rim and its lines of contact, depends on the chord |q − p| alone. A length
along the surface is no field: it depends on the normal at q, so rims and lines of contact would break where
the normal jumps, the cells of radial contact would not be convex, and a decal that spills would change size
with what it meets. It enters where the image is read (`drawn_distance`): what is drawn is the surface, rolled
out, between lines of contact that stay in place. The rim of the image lies at its radius along the surface,
which on a curved one is a little before the rim of the field; what is left between them stays bare.

The corrected map sees an arc between two points and their normals, and is exact on planes, spheres and
cylinders. From a flat face nothing is an arc yet where the next one begins, so images run on across edges.
"""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

from enum import IntEnum

import warp as wp

wp.set_module_options({"enable_backward": False})


class Mapping(IntEnum):
    """How the place of a surface point in an image is found."""

    CHORD = 0
    """Projection onto the tangent plane, at the chord's length: the paper's equation 4."""
    CORRECTED = 1
    """Rolled out along the arc that the two normals span."""


SMALLEST_BEND = 1.0e-37
SMALLEST_TURN = 1.0e-20
SMALLEST_COSINE = 1.0e-4
"""Of half the angle between normals: opposed ones tell no arc from any other."""
SMALLEST_REST = 1.0e-7
RIM_SQUARED = 0.25001
"""Square of the distance of an image's rim from its centre, and what rounding adds."""


@wp.func
def arc_over_chord(sine_squared: wp.float32, cosine: wp.float32) -> wp.float32:
    """Quotient (ψ/2) / sin(ψ/2) of the half angle with this sine and cosine, from 1 at ψ = 0 to π/2 at π.

    With t = tan(ψ/4) it is 2 atan(t) / (t (1 + cosine)); atan(t)/t is Abramowitz and Stegun's 4.4.49, good to
    2e-8 on [0, 1]. Graphics drivers' own arc tangents are worse, and differ.
    """
    per = 1.0 / (1.0 + cosine)
    x = sine_squared * per * per
    far = 0.1065626393 + x * (-0.07528964 + x * (0.0429096138 + x * (-0.0161657367 + x * 0.0028662257)))
    near = 1.0 + x * (-0.3333314528 + x * (0.1999355085 + x * (-0.1420889944 + x * far)))
    return 2.0 * near * per


@wp.func
def unrolled(w: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec4:
    """Offset of q = p + w, up to a part along n_p, and the length of the way there along the surface.

    On an arc of radius R and angle ψ each end lies R (1 − cos ψ) below the other's tangent plane: heights
    a = −w·n_p and b = w·n_q. The chord's projection falls short by R (ψ − sin ψ) towards n_q, the squared
    chord by R² (ψ² − 4 sin²(ψ/2)). The first takes R from the harmonic mean of a and b, the second R² from
    a b (1 + 2 y²) with y = (b − a)/(b + a): all of it ends where a or b does, as at an edge seen from a flat
    face. By that factor the length grows there as on the next face, rolled out, to second order of ψ; the
    length of a cubic has 1.6 in place of 2. Missing is κ τ′ s⁴/24 across the way (curvature κ, change of
    torsion τ′, length s), which two normals cannot tell. Where they are equal or opposed, or where the way
    bends up and down, it is the chord. w is in radii of the rim, so no square leaves the range of float32.
    """
    a = -wp.dot(w, n_p)
    b = wp.dot(w, n_q)
    bend = a * b
    squared = wp.dot(w, w)
    if bend <= SMALLEST_BEND:
        return wp.vec4(w[0], w[1], w[2], wp.sqrt(squared))
    turn = n_q - n_p
    x = wp.max(0.25 * wp.dot(turn, turn), SMALLEST_TURN)
    cosine = wp.max(0.5 * wp.length(n_q + n_p), SMALLEST_COSINE)
    stretch = arc_over_chord(x, cosine)
    per = 1.0 / (a + b)
    y = (b - a) * per
    toward = turn + 2.0 * x * n_p  # across n_p: near opposed normals, what is along it would drown the rest
    m = w + bend * per * (stretch - cosine) / (x * cosine) * toward
    arc = squared + bend * (1.0 + 2.0 * y * y) * (stretch * stretch - 1.0) / x
    return wp.vec4(m[0], m[1], m[2], wp.sqrt(arc))


@wp.func
def turned_back(step: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec3:
    """A step on the surface at q as the image rolled out has it, up to a part along n_p.

    It turns as the normal does on the way to the centre: exact along an arc, where the projection onto the
    tangent plane at the centre would be shorter by the cosine between the normals.
    """
    share = wp.dot(step, n_p) / wp.max(1.0 + wp.dot(n_p, n_q), SMALLEST_COSINE * SMALLEST_COSINE)
    return step - share * n_q


@wp.func
def drawn_distance(rim: wp.float32, chord: wp.float32, length: wp.float32) -> wp.float32:
    """Distance ℓ in the image, of a point that the field puts at `rim`; all in radii of the rim.

    1 − ℓ = (1 − rim) (1 − length)/(1 − chord): what neighbours leave of the way to the rim, times what the
    arc leaves of it. Both fall along a ray, so nothing folds. ℓ is the length where nobody pushes (rim =
    chord), 1 on lines of contact (rim = 1), `rim` where the length is the chord. Beyond 1, ℓ is the length.
    """
    share = wp.clamp((length - chord) / wp.max(1.0 - chord, SMALLEST_REST), 0.0, 1.0)
    return wp.max(rim + (1.0 - rim) * share, length)


@wp.func
def in_image(uv: wp.vec2) -> wp.bool:
    """Whether there is anything of the image here: it is a disc, and ends at its radius along the surface."""
    x = uv[0] - 0.5
    y = uv[1] - 0.5
    return x * x + y * y <= RIM_SQUARED


@wp.func
def tangent_coordinates(m: wp.vec3, n: wp.vec3, u: wp.vec3) -> wp.vec2:
    """Coordinates of m along the image's axes u and v = n × u."""
    return wp.vec2(wp.dot(m, u), wp.dot(m, wp.cross(n, u)))
