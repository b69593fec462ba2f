"""Meshes of trees with more triangles: edges are halved, and their middles are moved onto the surface."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from blobtree.progress import Progress
from decals.baking.meshes import BakeMesh
from decals.scenes.objects import TreeObject
from decals.surfaces.subdivide import means, subdivided
from decals.surfaces.surface import Surface, unit_rows

MAX_MOVE = 0.25
"""Largest distance of the middle of an edge from the surface, in its lengths; then every half is shorter."""

SMOOTH = 0.08
"""The same where the surface bends smoothly along the edge; a middle farther away lies beyond a crease."""

MAX_GAP = 0.0625
"""Largest distance of the middle of an edge from the surface, in texels, below a texture."""

EXPECTED_USE = 0.6
"""Part of a texture that charts are expected to cover."""

MAX_EDGES = 500_000
"""New edges of a mesh from which on none is halved any more."""

ALIKE = 0.9
"""Cosine from which on the normal of the surface is that of the edge's side; else a crease lies between."""


def middles_on(
    surface: Surface, starts: Float64Array, ends: Float64Array, most: float = MAX_MOVE
) -> tuple[Float64Array, Float32Array, Float64Array]:
    """Return the middles of edges on a surface, the normals there, and how far the middles were moved.

    A middle that would be moved by more than ``most`` lengths of its edge stays.
    """
    middles = 0.5 * (starts + ends)
    places, normals = surface.project(middles)
    moves = np.linalg.norm(places - middles, axis=1)
    near = moves <= most * np.linalg.norm(ends - starts, axis=1)
    return np.where(near[:, None], places, middles), normals, np.where(near, moves, 0.0)


def below_texture(
    meshes: Sequence[BakeMesh], objects: Sequence[object], texels: int, report: Progress
) -> list[BakeMesh]:
    """Return meshes with those of trees so fine that a texture of so many texels shows no difference.

    The colours of a texture are those at its triangles. Where these lie below the surface, a picture shows
    the colours at another place than a picture of the tree.
    """
    area = sum(_area(mesh) for mesh in meshes)
    texel = float(np.sqrt(area / (EXPECTED_USE * texels)))
    return [
        _finer(mesh, item.surface, texel, report) if isinstance(item, TreeObject) else mesh
        for mesh, item in zip(meshes, objects, strict=True)
    ]


def _area(mesh: BakeMesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def _halvings(mesh: BakeMesh, texel: float) -> int:
    """Return how often the longest edge is halved until its parts are shorter than a texel.

    Beside creases new edges may be as long as others for ever.
    """
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    longest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(initial=0.0))
    return max(int(np.ceil(np.log(max(longest / texel, 1.0)) / -np.log(0.5 + SMOOTH))), 0)


def _finer(mesh: BakeMesh, surface: Surface, texel: float, report: Progress) -> BakeMesh:
    """Return a mesh whose edges have their middles near the surface, unless they are shorter than a texel."""
    rounds = iter(range(_halvings(mesh, texel)))
    middles: list[Any] = []  # of the edges that were found to be long, and the normals there

    def are_long(starts: Float64Array, ends: Float64Array) -> BoolArray:
        report("dividing triangles", 0.0)
        long: BoolArray = np.linalg.norm(ends - starts, axis=1) > texel
        if len(long) > MAX_EDGES or next(rounds, None) is None:
            return np.zeros(len(long), np.bool_)
        places, normals, moves = middles_on(surface, starts[long], ends[long], SMOOTH)
        far = moves > MAX_GAP * texel
        long[long] = far
        middles[:] = places[far], normals[far]
        return long

    def midpoints(rows: Float64Array, ends: Int64Array) -> Float64Array:
        places, normals = middles
        own = unit_rows(means(rows[:, 3:], ends))
        alike = np.einsum("na,na->n", own, normals) > ALIKE
        return np.hstack([places, np.where(alike[:, None], normals, own)])

    rows, faces = subdivided(
        np.hstack([mesh.vertices, mesh.normals]).astype(np.float64),
        mesh.faces.astype(np.int64),
        are_long,
        midpoints,
    )
    vertices, normals = np.hsplit(rows.astype(np.float32), 2)
    corners = faces.astype(np.int32)
    return replace(mesh, vertices=vertices, faces=corners, normals=normals, places=vertices, facings=normals)
