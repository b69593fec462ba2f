"""Particles carried along while their surfaces deform."""

import numpy as np

from decals.errors import InvalidSeeding
from decals.seeds.neighbours import FacingTree
from decals.seeds.population import Sites, World
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Flags, Floats, Surface

FAR = 1.0
"""Ways shorter than so many spacings, in the median, collapse nobody."""

COLLAPSED = 0.25
"""Particles have collapsed where they are so many times nearer to each other than before, in the median."""

_STREAM = 2000

_Placed = tuple[Floats, Floats]


def carried(before: World, after: World, sites: Sites, spacing: float) -> Sites:
    """Take sites, sorted by surface, from the surfaces of one world to those of another.

    `InvalidSeeding` where they would end up in a heap; `spacing` is their distance before.
    """
    positions, normals = sites.positions.copy(), sites.normals.copy()
    for number, (old, new) in enumerate(zip(before.surfaces, after.surfaces, strict=True)):
        own = sites.surface_ids == number
        if own.any():
            start = sites.positions[own], sites.normals[own]
            positions[own], normals[own] = _taken(number, old, new, start, spacing)
    return Sites(positions, normals, sites.surface_ids)


def freed(world: World, sites: Sites, fixed: Flags, *, stream: int) -> Sites:
    """Put sites where nobody may lie to random places of their own surfaces, the fixed ones aside."""
    settled, allowed = world.settle(sites)
    lost = np.flatnonzero(~allowed & ~fixed)
    positions, normals = settled.positions.copy(), settled.normals.copy()
    if len(lost):
        counts = np.bincount(sites.surface_ids[lost], minlength=len(world.surfaces))
        found = world.sample(counts, stream=_STREAM + stream)
        positions[lost], normals[lost] = found.positions, found.normals
    return Sites(positions, normals, sites.surface_ids)


def _taken(number: int, old: Surface, new: Surface, start: _Placed, spacing: float) -> _Placed:
    """Points in their faces; else where the new surface is closest, to them or to where its box has gone."""
    points = start[0]
    if _has_same_faces(old, new):
        return new.project(_in_their_faces(old, new, points))
    for moved in (points, _in_its_box(old, new, points)):
        found = new.project(moved)
        if not _collapsed(start, found, spacing, _growth(old, new)):
            return found
    raise InvalidSeeding(
        f"surface {number}: expected one that its {len(points)} seeds can follow, got one on which they "
        "would end up in a heap; deform it in smaller steps, or make another Relaxation"
    )


def _has_same_faces(old: Surface, new: Surface) -> bool:
    if not (isinstance(old, MeshSurface) and isinstance(new, MeshSurface)):
        return False
    return len(old.vertices) == len(new.vertices) and np.array_equal(old.faces, new.faces)


def _in_their_faces(old: Surface, new: Surface, points: Floats) -> Floats:
    """Points of a mesh where its vertices have gone."""
    assert isinstance(old, MeshSurface)
    assert isinstance(new, MeshSurface)
    faces, weights = old.locate(points)
    corners = new.vertices[new.faces[faces]].astype(np.float64)
    places: Floats = np.einsum("nk,nki->ni", weights, corners).astype(np.float32)
    return places


def _in_its_box(old: Surface, new: Surface, points: Floats) -> Floats:
    """Points moved and stretched as the box around their surface."""
    (low, high), (new_low, new_high) = (np.array(one.bounds, dtype=np.float64) for one in (old, new))
    stretch = (new_high - new_low) / np.where(high > low, high - low, 1.0)
    places: Floats = (new_low + (points - low) * stretch).astype(np.float32)
    return places


def _growth(old: Surface, new: Surface) -> float:
    """How many times farther apart particles are when they lie evenly on the new surface."""
    return float(np.sqrt(new.area / old.area))


def _collapsed(start: _Placed, found: _Placed, spacing: float, growth: float) -> bool:
    """Whether particles came much nearer to each other than the surface shrank, on a long way."""
    if len(start[0]) < 2 or np.median(np.linalg.norm(found[0] - start[0], axis=1)) < FAR * spacing:
        return False
    before = _apart(start)
    return np.isfinite(before) and _apart(found) < COLLAPSED * growth * before


def _apart(placed: _Placed) -> float:
    """Median distance to the nearest particle that faces the same way; infinity where nobody has one."""
    nearest = FacingTree(*placed).nearest(*placed, skip_self=True)[0][:, 0]
    known = nearest[np.isfinite(nearest)]
    return float(np.median(known)) if len(known) else np.inf
