"""What the decals do to a surface, sampled on its mesh: owners, stretch, folds and contact lines."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array
from decals.editing.document import Document
from decals.field.evaluate import evaluate
from decals.field.jacobian import folds_of, normal_derivatives_of_triangles, stretch_of
from decals.field.walks import evaluation_options
from decals.surfaces.surface import unit_rows

INSIDE = 0.5
"""Distance of a rim from the middle of its image, in image coordinates."""

CROSSING_STEPS = 5
"""Halvings of an edge until the point at which the decal changes is known."""


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Decals at the vertices of a mesh, and how its triangles are mapped into their images.

    Attributes
    ----------
    owners
        Number of the decal that shows at each vertex, −1 for none, int32, shape (n,).
    stretch
        Of the middle of each triangle inside one decal: ratio of the largest to the smallest stretch of the
        image, as `decals.measure` has it; 1 keeps shapes, NaN elsewhere. Shape (m,).
    folds
        True for triangles whose image is turned over, shape (m,).
    """

    owners: Int32Array
    stretch: Float64Array
    folds: BoolArray


def sample_surface(
    document: Document, vertices: Float32Array, normals: Float32Array, faces: Int32Array
) -> SurfaceSamples:
    """Evaluate the decals of a document on a triangle mesh of its surface, in the modes of its drawing.

    Parameters
    ----------
    document
        The document.
    vertices, normals
        Vertices and unit normals, shape (n, 3) each.
    faces
        Triangles, counter-clockwise from outside, shape (m, 3).
    """
    modes = _modes(document)
    owners = _owners(document, vertices, normals, modes)
    stretch, folds = np.full(len(faces), np.nan), np.zeros(len(faces), np.bool_)
    rows = np.flatnonzero((owners[faces] >= 0).all(axis=1) & (np.ptp(owners[faces], axis=1) == 0))
    if len(rows):
        corners, facings = vertices[faces[rows]], normals[faces[rows]]
        turns = normal_derivatives_of_triangles(corners, facings)
        middles, facing = corners.mean(axis=1), facings.mean(axis=1)
        maps = evaluate(
            document.decals, middles, facing, jacobian=True, normal_derivatives=turns, **modes
        ).jacobian
        assert maps is not None
        stretch[rows] = stretch_of(maps)
        a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
        folds[rows] = folds_of(maps, np.cross(b - a, c - a))
    return SurfaceSamples(owners, stretch, folds)


def _modes(document: Document) -> dict[str, Any]:
    """Return the modes of a document's drawing, as `decals.evaluate` takes them."""
    return evaluation_options(document.drawing, document.decals, document.objects)


def _owners(
    document: Document, points: Float32Array, normals: Float32Array, modes: dict[str, Any]
) -> Int32Array:
    """Return the number of the decal that shows at each point; −1 where its image ends."""
    samples = evaluate(document.decals, points, normals, **modes)
    inside = np.linalg.norm(samples.uv - INSIDE, axis=1) <= INSIDE
    return np.where(inside, samples.owner, -1).astype(np.int32)


def contact_lines(
    document: Document,
    vertices: Float32Array,
    normals: Float32Array,
    faces: Int32Array,
    *,
    lift: float = 0.0,
) -> Float32Array:
    """Return the lines between the decals on a triangle mesh as segments, float32, shape (k, 2, 3).

    A triangle with vertices of two decals gets the segment between the points of its edges at which the decal
    changes; one with three decals gets three segments from the middle of these points. Rims beside bare
    surface are no contact lines.

    Parameters
    ----------
    document, vertices, normals, faces
        As for `sample_surface`.
    lift
        Distance of the lines above the mesh.
    """
    modes = _modes(document)
    owners = _owners(document, vertices, normals, modes)
    faces = faces[(owners[faces] >= 0).all(axis=1)]
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)
    crossed = owners[edges[..., 0]] != owners[edges[..., 1]]
    if not crossed.any():
        return np.zeros((0, 2, 3), np.float32)
    pairs, numbers = np.unique(edges[crossed], axis=0, return_inverse=True)
    first, second = pairs.T

    def between(rows: Float32Array, parts: Float64Array) -> Float32Array:
        places: Float32Array = np.asarray(
            rows[first] + parts[:, None] * (rows[second] - rows[first]), np.float32
        )
        return places

    low, high = np.zeros(len(pairs)), np.ones(len(pairs))
    for _ in range(CROSSING_STEPS):
        middle = (low + high) / 2
        facing = unit_rows(between(normals, middle))
        same = _owners(document, between(vertices, middle), facing, modes) == owners[first]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    points = np.zeros((*crossed.shape, 3))
    points[crossed] = between(vertices + lift * normals, (low + high) / 2)[numbers.ravel()]
    two, three = crossed.sum(axis=1) == 2, crossed.all(axis=1)
    ends = points[two][crossed[two]].reshape(-1, 2, 3)
    centers = np.broadcast_to(points[three].mean(axis=1, keepdims=True), points[three].shape)
    spokes = np.stack([points[three], centers], axis=2).reshape(-1, 2, 3)
    return np.concatenate([ends, spokes]).astype(np.float32)
