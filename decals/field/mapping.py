"""Mapping: from a surface point to an offset in a decal's tangent plane, whose direction its image follows.

The field, so the rim and the contact lines, depends on the chord |q − p| alone; a mapping only turns the
direction in which the image is read (the paper's equation 4 does it by projection). The corrected map is
exact on planes, spheres and cylinders.

What is drawn therefore has the map's direction and the chord's length, which on an arc of angle ψ falls
short of the arc's by ψ²/24: an RMS error of 0.016 (ρ/R)² of a decal of radius ρ where the surface curves with
radius R, and within half a per cent up to ρ = R/2. The map's length is no field: it depends on the normal at
q, so rims and lines of contact would break where the normal jumps, at creases and from object to object, the
cells of radial contact would not be convex, and a decal that spills would change size with what it meets.
"""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

from enum import IntEnum

import warp as wp

wp.set_module_options({"enable_backward": False})


class Mapping(IntEnum):
    """How the direction from a decal's centre to a surface point is found."""

    CHORD = 0
    """Projection onto the tangent plane: the paper's equation 4."""
    CORRECTED = 1
    """Bent back along the arc that the two normals span."""


SMALLEST_BEND = 1.0e-4
SMALLEST_SQUARE = 1.0e-37
MOST_TIGHTENING = 0.5


@wp.func
def chord_offset(w: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec3:
    """Projection of w = q − p onto the tangent plane at p (paper, equation 4)."""
    return w - wp.dot(w, n_p) * n_p


@wp.func
def arc_over_chord(sine: wp.float32, cosine: wp.float32) -> wp.float32:
    """Quotient (ψ/2) / sin(ψ/2) of the half angle with this sine and cosine, from 1 at ψ = 0 to π/2 at π.

    With t = tan(ψ/4) it is 2 atan(t) / (t (1 + cosine)); atan(t)/t is Abramowitz and Stegun's 4.4.49, good to
    2e-8 on [0, 1]. Graphics drivers' own arc tangents are worse, and differ.
    """
    t = sine / (1.0 + cosine)
    x = t * t
    far = 0.1065626393 + x * (-0.07528964 + x * (0.0429096138 + x * (-0.0161657367 + x * 0.0028662257)))
    near = 1.0 + x * (-0.3333314528 + x * (0.1999355085 + x * (-0.1420889944 + x * far)))
    return 2.0 * near / (1.0 + cosine)


@wp.func
def corrected_offset(w: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec3:
    """Offset of q along the surface, as if it bent from n_p to n_q on a circular arc that may tighten.

    With T the geodesic's direction at p, κ and τ its normal curvature and torsion, s its length, and ′
    along it, the chord's projection misses the log map s T by κ s²/6 (s n′) + O(s⁴), and n_q − n_p shows
    s n′. The heights h_p = w·n_p and h_q = w·n_q give κ s² = h_p − h_q and κ′ s³ = −6 (h_p + h_q): the
    arc's part, unrolled to all orders, needs only their difference; their sum is the change of curvature,
    whose part along T is added. What remains is κ τ′ s⁴/24 across T, which two normals cannot tell. Exact
    on planes, spheres and cylinders. Where n_q = n_p, or −n_p, so that no arc is told from any other, it
    is the projection.
    """
    height = wp.dot(w, n_p)
    flat = w - height * n_p
    turn = n_q - n_p
    bend = turn - wp.dot(turn, n_p) * n_p
    size = wp.length(bend)
    if size < SMALLEST_BEND:
        return flat
    along = bend / size
    sine = 0.5 * wp.length(turn)
    cosine = 0.5 * wp.length(n_q + n_p)
    stretch = arc_over_chord(sine, cosine)
    arc = 0.5 * wp.dot(w, turn) * (stretch - cosine) / sine
    # Projected onto flat; limited, because points of no common surface may have any heights.
    ahead = wp.dot(flat, along) / wp.max(wp.length_sq(flat), SMALLEST_SQUARE)
    tightening = -0.5 * (height + wp.dot(w, n_q)) * sine * stretch * stretch * ahead
    return flat * (1.0 + wp.clamp(tightening, -MOST_TIGHTENING, MOST_TIGHTENING)) + arc * along


@wp.func
def surface_offset(w: wp.vec3, n_p: wp.vec3, n_q: wp.vec3, mapping: wp.int32) -> wp.vec3:
    """Tangent offset of w = q − p by the mapping of this number."""
    if mapping == Mapping.CHORD:
        return chord_offset(w, n_p, n_q)
    return corrected_offset(w, n_p, n_q)


@wp.func
def tangent_coordinates(m: wp.vec3, n: wp.vec3, u: wp.vec3) -> wp.vec2:
    """Coordinates of m along the image's axes u and v = n × u."""
    return wp.vec2(wp.dot(m, u), wp.dot(m, wp.cross(n, u)))
