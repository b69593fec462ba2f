"""Particles carried along while their surfaces deform."""

from typing import TypeAlias

import numpy as np

from blobtree._typing import BoolArray, Float32Array
from decals.errors import InvalidScattering
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.neighbors import FacingTree
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Surface

MIN_COLLAPSE_MOVE = 1.0
"""Median move of a surface's particles, in spacings, below which they cannot have collapsed."""

COLLAPSE_RATIO = 0.25
"""Ratio of the median nearest distances after and before, below which particles have collapsed."""

_STREAM = 2000

_Points: TypeAlias = tuple[Float32Array, Float32Array]
"""Positions and normals."""


def carried(
    before: Domain, after: Domain, points: OrientedPoints, spacing: float, fixed: BoolArray, *, stream: int
) -> OrientedPoints:
    """Return points as `carry` does; those that became forbidden, the fixed ones aside, at random places."""
    return resample_forbidden(after, carry(before, after, points, spacing), fixed, stream=stream)


def carry(before: Domain, after: Domain, points: OrientedPoints, spacing: float) -> OrientedPoints:
    """Carry points, sorted by surface, from the surfaces of one domain to those of another.

    `spacing` is their distance before. Raise `InvalidScattering` where they would collapse to a heap.
    """
    positions, normals = points.positions.copy(), points.normals.copy()
    for index, (old, new) in enumerate(zip(before.surfaces, after.surfaces, strict=True)):
        own = points.surface_ids == index
        if own.any():
            start = points.positions[own], points.normals[own]
            positions[own], normals[own] = _carry_one(index, old, new, start, spacing)
    return OrientedPoints(positions, normals, points.surface_ids)


def resample_forbidden(
    domain: Domain, points: OrientedPoints, fixed: BoolArray, *, stream: int
) -> OrientedPoints:
    """Replace points that lie where particles are forbidden by random ones, the fixed points aside."""
    projected, allowed = domain.project(points)
    lost = np.flatnonzero(~allowed & ~fixed)
    positions, normals = projected.positions.copy(), projected.normals.copy()
    if len(lost):
        counts = np.bincount(points.surface_ids[lost], minlength=len(domain.surfaces))
        samples = domain.sample(counts, stream=_STREAM + stream)
        positions[lost], normals[lost] = samples.positions, samples.normals
    return OrientedPoints(positions, normals, points.surface_ids)


def _carry_one(index: int, old: Surface, new: Surface, start: _Points, spacing: float) -> _Points:
    """Carry points within their faces; else to the closest points of the new surface.

    If these collapse, move the points with the box around their surface first.
    """
    points = start[0]
    if _has_same_faces(old, new):
        return new.project(_in_same_faces(old, new, points))
    for moved in (points, _in_same_box(old, new, points)):
        projected = new.project(moved)
        if not _collapsed(start, projected, spacing, _growth(old, new)):
            return projected
    raise InvalidScattering(
        f"surface {index}: expected one that its {len(points)} particles can follow, got one on which they "
        "would end up in a heap; deform it in smaller steps, or make another Relaxation"
    )


def _has_same_faces(old: Surface, new: Surface) -> bool:
    if not (isinstance(old, MeshSurface) and isinstance(new, MeshSurface)):
        return False
    return len(old.vertices) == len(new.vertices) and np.array_equal(old.faces, new.faces)


def _in_same_faces(old: Surface, new: Surface, points: Float32Array) -> Float32Array:
    """Return the points of a mesh after its vertices moved."""
    assert isinstance(old, MeshSurface)
    assert isinstance(new, MeshSurface)
    faces, weights = old.locate(points)
    corners = new.vertices[new.faces[faces]].astype(np.float64)
    positions: Float32Array = np.einsum("nk,nki->ni", weights, corners).astype(np.float32)
    return positions


def _in_same_box(old: Surface, new: Surface, points: Float32Array) -> Float32Array:
    """Move and stretch points with the box around their surface."""
    (lower, upper), (new_lower, new_upper) = (
        np.array(surface.bounds, dtype=np.float64) for surface in (old, new)
    )
    stretch = (new_upper - new_lower) / np.where(upper > lower, upper - lower, 1.0)
    positions: Float32Array = (new_lower + (points - lower) * stretch).astype(np.float32)
    return positions


def _growth(old: Surface, new: Surface) -> float:
    """Return the factor by which an even spacing grows from the old surface to the new one."""
    return float(np.sqrt(new.area / old.area))


def _collapsed(start: _Points, end: _Points, spacing: float, growth: float) -> bool:
    """Return True if particles moved far and came much nearer to each other than the surface shrank."""
    moves = np.linalg.norm(end[0] - start[0], axis=1)
    if len(moves) < 2 or np.median(moves) < MIN_COLLAPSE_MOVE * spacing:
        return False
    before = _median_nearest(start)
    return np.isfinite(before) and _median_nearest(end) < COLLAPSE_RATIO * growth * before


def _median_nearest(points: _Points) -> float:
    """Return the median distance to the nearest facing particle; infinity without any."""
    nearest = FacingTree(*points).nearest(*points, skip_self=True)[0][:, 0]
    finite = nearest[np.isfinite(nearest)]
    return float(np.median(finite)) if len(finite) else np.inf
