"""Place of a surface point in the undeformed image of a decal, and whether the image reaches the point.

Rims are balls: they end at the chord. Images end at the length along the surface, which is longer where the
surface bends.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.mapping import IMAGE_RADIUS_SQUARED, ImageMapping, tangent_coordinates, unroll
from decals.field.walk import walked_place
from decals.index.lookup import IndexedDecals
from decals.record import RECORD, visible_radius, xyz

wp.set_module_options({"enable_backward": False})

MIN_PLACE = 1.0e-12
"""Smallest distance in the image by which is divided."""

MAX_ARC = 0.4126
"""Bound on (length²/chord² − 1)/|n_q − n_p|² of the corrected mapping."""


@wp.func
def image_place(w: wp.vec3, n_q: wp.vec3, decal: wp.int32, index: IndexedDecals) -> wp.vec3:
    """Return the direction (x, y) of a point at w from a decal's centre, and its length along the surface.

    All are in visible radii. The mapping is CORRECTED or WALKED.
    """
    normal = xyz(index.records[RECORD * decal + 1])
    arc = unroll(w, normal, n_q)
    place = tangent_coordinates(xyz(arc), normal, xyz(index.records[RECORD * decal + 2]))
    length = arc[3]
    if index.walked:
        place = wp.max(length / wp.max(wp.length(place), MIN_PLACE), 1.0) * place
        walked = walked_place(decal, w, n_q, place, index)
        place += walked[2] * (wp.vec2(walked[0], walked[1]) - place)
        length += walked[2] * (wp.max(wp.length(place), wp.length(w)) - length)
    return wp.vec3(place[0], place[1], length)


@wp.func
def image_reaches(q: wp.vec3, n_q: wp.vec3, decal: wp.int32, index: IndexedDecals) -> wp.bool:
    """Return True if the image of a decal does not end before q, a point inside its rim."""
    if index.mapping == ImageMapping.CHORD:
        return True
    w = (q - xyz(index.records[RECORD * decal])) / visible_radius(decal, index.records)
    turn = n_q - xyz(index.records[RECORD * decal + 1])
    if not index.walked and wp.dot(w, w) * (1.0 + MAX_ARC * wp.dot(turn, turn)) < 1.0:
        return True  # as most points, without the length
    length = image_place(w, n_q, decal, index)[2]
    return 0.25 * length * length <= IMAGE_RADIUS_SQUARED
