"""Mapping: from a surface point to an offset in a decal's tangent plane, whose direction its image follows.

The field, so the rim and the contact lines, depends on the chord |q − p| alone; a mapping only turns the
direction in which the image is read (the paper's equation 4 does it by projection). The corrected map is
exact on planes, spheres and cylinders.
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


SERIES_BELOW = 0.1
SMALLEST_BEND = 1.0e-4


@wp.func
def chord_offset(w: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec3:
    """Projection of w = q − p onto the tangent plane at p (paper, equation 4)."""
    return w - wp.dot(w, n_p) * n_p


@wp.func
def arc_over_chord(sine: wp.float32, cosine: wp.float32) -> wp.float32:
    """Quotient (ψ/2) / sin(ψ/2) of the half angle with this sine and cosine; 1 at ψ = 0."""
    if sine < SERIES_BELOW:
        s = sine * sine
        return 1.0 + s * (0.16666667 + s * (0.075 + s * 0.044642857))
    return wp.atan2(sine, cosine) / sine


@wp.func
def corrected_offset(w: wp.vec3, n_p: wp.vec3, n_q: wp.vec3) -> wp.vec3:
    """Offset of q along the surface, as if it bent from n_p to n_q on a circular arc.

    Across the arc's axis the chord w runs along n_q − n_p and is stretched to the length of the arc; along
    the axis it stays. Smooth at n_q = n_p, where it is the projection. Where n_q = −n_p no arc is told from
    any other: it is the projection again.
    """
    flat = w - wp.dot(w, n_p) * n_p
    turn = n_q - n_p
    bend = turn - wp.dot(turn, n_p) * n_p
    size = wp.length(bend)
    if size < SMALLEST_BEND:
        return flat
    along = bend / size
    sine = 0.5 * wp.length(turn)
    cosine = 0.5 * wp.length(n_q + n_p)
    arc = wp.dot(w, turn) / (2.0 * sine) * arc_over_chord(sine, cosine)
    return flat + (arc - wp.dot(w, along)) * along


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
