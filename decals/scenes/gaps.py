"""Widths of gaps: the distance of bare surface from the nearest image.

Statistics of this distance describe the negative space of a packing. RepulsionPak (Saputra, Kaplan and
Asente, Graphics Interface 2018; TVCG 2019) aims at gaps of even width. Its public code keeps the distance of
each pixel between elements from the nearest one. The distribution of that distance is the *spherical contact
distribution* of spatial statistics (Chiu, Stoyan, Kendall and Mecke, Stochastic Geometry, 2013).
"""

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int64Array
from decals.model import Decals
from decals.scattering.neighbors import FacingTree
from decals.scattering.owned_points import arc_lengths

COUNTS = (6, 24, 96, 384)
"""Nearest decals that are compared, in turn, until no farther one can be nearer by its radius."""


def gap_widths(decals: Decals, points: Float32Array, normals: Float32Array) -> Float64Array:
    """Return the distance of each bare point from the nearest image that faces it, ``float64[m]``.

    It is the distance from the centre, along the surface as the corrected mapping has it, less the radius.
    Points that no decal faces have their straight distance from the nearest decal.

    Parameters
    ----------
    decals
        The decals whose images count, one or more.
    points, normals
        Points that no image covers, ``float32[m, 3]`` each.
    """
    widths = np.full(len(points), np.inf)
    octaves = np.floor(np.log2(decals.radii))
    for octave in np.unique(octaves):
        part = decals[octaves == octave]
        tree, largest = FacingTree(part.positions, part.normals), float(part.radii.max())
        rows = np.arange(len(points))
        for count in COUNTS:
            distances, indices = tree.nearest(points[rows], normals[rows], count=min(count, len(part)))
            widths[rows] = np.minimum(widths[rows], _nearest(part, points[rows], normals[rows], indices))
            rows = rows[distances[:, -1] - largest < widths[rows]]
            if count >= len(part) or not len(rows):
                break
    alone = np.flatnonzero(~np.isfinite(widths))
    if len(alone):
        distances, indices = FacingTree(decals.positions, np.zeros_like(decals.normals)).nearest(
            points[alone], normals[alone]
        )
        widths[alone] = distances[:, 0] - decals.radii[indices[:, 0]]
    widths.clip(min=0.0, out=widths)
    return widths


def _nearest(
    decals: Decals, points: Float32Array, normals: Float32Array, indices: Int64Array
) -> Float64Array:
    """Return the least distance of each point from the rims of some decals, ``float64[m]``.

    The indices are -1 where there is no further decal; without any, the distance is infinite.
    """
    rows, columns = np.nonzero(indices >= 0)
    found = indices[rows, columns]
    offsets = points[rows].astype(np.float64) - decals.positions[found]
    facings = decals.normals[found].astype(np.float64), normals[rows].astype(np.float64)
    widths = np.full(len(points), np.inf)
    np.minimum.at(widths, rows, arc_lengths(offsets, *facings) - decals.radii[found])
    return widths
