"""Image mapping: direction and distance of a surface point from the centre, in the image of its owner.

The field depends only on the chord |q − p|, and with it the owner, the rim and the contact lines. The length
along the surface is no such field, because it depends on the normal at q. Rims and contact lines would break
where the normal jumps, the cells of radial contact would not be convex, and the size of a decal that spills
would depend on the surface it meets.

The length enters only where the image is read (`image_distance`). The image then shows the unrolled surface
between contact lines that stay in place. The rim of the image lies at its radius along the surface. On a
curved surface that is a little inside the rim of the field, and the gap between them stays uncoloured.

The corrected mapping assumes a circular arc between two points with their normals. It is exact on planes,
spheres and cylinders. Seen from a flat face, the arc to the next face has length zero at their edge, so
images continue across edges.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

from enum import IntEnum

import warp as wp

wp.set_module_options({"enable_backward": False})


class ImageMapping(IntEnum):
    """Image mapping: how surface points become image coordinates.

    Examples
    --------
    >>> import decals
    >>> list(decals.ImageMapping)
    [<ImageMapping.CHORD: 0>, <ImageMapping.CORRECTED: 1>, <ImageMapping.WALKED: 2>]
    """

    CHORD = 0
    """Projection onto the tangent plane, at the distance of the chord (paper, equation 4)."""
    CORRECTED = 1
    """Unrolled along the circular arc that the two normals define."""
    WALKED = 2
    """Unrolled along the shortest path over the surface (log map), for edges, corners and large decals."""


MIN_BEND = 1.0e-37
MIN_TURN = 1.0e-20
MIN_COSINE = 1.0e-4
"""Smallest cosine of half the angle between two normals; opposed normals define no arc."""
MIN_REMAINDER = 1.0e-7
IMAGE_RADIUS_SQUARED = 0.25001
"""Squared radius of an image in its own coordinates, with a margin for rounding."""


@wp.func
def arc_over_chord(sine_squared: wp.float32, cosine: wp.float32) -> wp.float32:
    """Return (ψ/2) / sin(ψ/2) for the half angle with this squared sine and cosine: 1 at ψ = 0, π/2 at π.

    With t = tan(ψ/4) it is 2 atan(t) / (t (1 + cosine)). The series of atan(t)/t is Abramowitz and Stegun's
    4.4.49, with an error below 2e-8 on [0, 1]. The arc tangents of graphics drivers are less accurate, and
    differ.
    """
    per = 1.0 / (1.0 + cosine)
    x = sine_squared * per * per
    far = 0.1065626393 + x * (-0.07528964 + x * (0.0429096138 + x * (-0.0161657367 + x * 0.0028662257)))
    near = 1.0 + x * (-0.3333314528 + x * (0.1999355085 + x * (-0.1420889944 + x * far)))
    return 2.0 * near * per


@wp.func
def unroll(w: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec4:
    """Return the unrolled offset of q = p + w, up to a part along n_p, and the length along the surface.

    On an arc of radius R and angle ψ, each end lies R (1 − cos ψ) below the tangent plane of the other: the
    heights are a = −w·n_p and b = w·n_q. The projected chord is too short by R (ψ − sin ψ) towards n_q, the
    squared chord by R² (ψ² − 4 sin²(ψ/2)).

    The first correction takes R from the harmonic mean of a and b. The second takes R² from a b (1 + 2 y²)
    with y = (b − a)/(b + a). Both vanish with a or b, as at an edge seen from a flat face. With that factor
    the length grows beyond the edge as on the unrolled next face, to second order in ψ. (The length of a
    cubic would have 1.6 in place of 2.)

    The error is κ τ′ s⁴/24 across the path, for curvature κ, change of torsion τ′ and length s: two normals
    do not determine it. For equal or opposed normals, and for paths that bend up and down, the result is the
    chord. w is in visible radii, so that no square leaves the range of float32.
    """
    a = -wp.dot(w, n_p)
    b = wp.dot(w, n_q)
    bend = a * b
    squared = wp.dot(w, w)
    if bend <= MIN_BEND:
        return wp.vec4(w[0], w[1], w[2], wp.sqrt(squared))
    turn = n_q - n_p
    x = wp.max(0.25 * wp.dot(turn, turn), MIN_TURN)
    cosine = wp.max(0.5 * wp.length(n_q + n_p), MIN_COSINE)
    stretch = arc_over_chord(x, cosine)
    per = 1.0 / (a + b)
    y = (b - a) * per
    toward = (
        turn + 2.0 * x * n_p
    )  # perpendicular to n_p: near opposed normals, the part along n_p would dominate
    m = w + bend * per * (stretch - cosine) / (x * cosine) * toward
    arc = squared + bend * (1.0 + 2.0 * y * y) * (stretch * stretch - 1.0) / x
    return wp.vec4(m[0], m[1], m[2], wp.sqrt(arc))


@wp.func
def unroll_step(step: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec3:
    """Return a step on the surface at q as a step in the unrolled image, up to a part along n_p.

    The step is rotated as the normal is on the path to the centre, which is exact along an arc. Its
    projection onto the tangent plane at the centre would be too short by the cosine between the normals.
    """
    share = wp.dot(step, n_p) / wp.max(1.0 + wp.dot(n_p, n_q), MIN_COSINE * MIN_COSINE)
    return step - share * n_q


@wp.func
def roll_step(step: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec3:
    """Return a direction in the image as one on the surface at q; the inverse of `unroll_step`."""
    share = wp.dot(step, n_q) / wp.max(1.0 + wp.dot(n_p, n_q), MIN_COSINE)
    return step - share * (n_p + n_q)


@wp.func
def image_distance(rim: wp.float32, chord: wp.float32, length: wp.float32) -> wp.float32:
    """Return the distance ℓ in the image of a point that the field puts at distance `rim`, in visible radii.

    1 − ℓ = (1 − rim) (1 − length)/(1 − chord): the remaining distance to the rim after contact, times its
    ratio of arc to chord. Both factors decrease along a ray, so no image folds. Without pushes (rim = chord)
    ℓ is the length; on contact lines (rim = 1) it is 1; where the length is the chord it is `rim`. Beyond 1,
    ℓ is the length.
    """
    share = wp.clamp((length - chord) / wp.max(1.0 - chord, MIN_REMAINDER), 0.0, 1.0)
    return wp.max(rim + (1.0 - rim) * share, length)


@wp.func
def in_image(uv: wp.vec2) -> wp.bool:
    """Return True inside the image, a disc that ends at its radius along the surface."""
    x = uv[0] - 0.5
    y = uv[1] - 0.5
    return x * x + y * y <= IMAGE_RADIUS_SQUARED


@wp.func
def tangent_coordinates(m: wp.vec3, n: wp.vec3, u: wp.vec3) -> wp.vec2:
    """Return the coordinates of m along the axes u and v = n × u of the image."""
    return wp.vec2(wp.dot(m, u), wp.dot(m, wp.cross(n, u)))
