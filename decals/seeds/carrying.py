"""Particles carried along while their surfaces deform."""

import numpy as np

from decals.seeds.population import Sites, World
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import Flags, Floats, Surface

_STREAM = 2000


def carried(before: World, after: World, sites: Sites) -> Sites:
    """Take sites, sorted by surface, from the surfaces of one world to those of another."""
    positions, normals = sites.positions.copy(), sites.normals.copy()
    for number, (old, new) in enumerate(zip(before.surfaces, after.surfaces, strict=True)):
        own = sites.surface_ids == number
        if own.any():
            positions[own], normals[own] = new.project(_moved(old, new, sites.positions[own]))
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


def _moved(old: Surface, new: Surface, points: Floats) -> Floats:
    """Points of a mesh where its vertices have gone; all others as they are."""
    if not (isinstance(old, MeshSurface) and isinstance(new, MeshSurface)):
        return points
    if len(old.vertices) != len(new.vertices) or not np.array_equal(old.faces, new.faces):
        return points
    faces, weights = old.locate(points)
    corners = new.vertices[new.faces[faces]].astype(np.float64)
    places: Floats = np.einsum("nk,nki->ni", weights, corners).astype(np.float32)
    return places
