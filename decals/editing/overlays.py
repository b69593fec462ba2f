"""What the decals do to a surface, sampled on its mesh: owners, stretch, folds and contact lines."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array
from decals.editing.document import Document
from decals.field.evaluate import evaluate
from decals.field.jacobian import folds_of, normal_derivatives_of_triangles, stretch_of
from decals.field.walks import walks_for

INSIDE = 0.5
"""Distance of a rim from the middle of its image, in image coordinates."""

MODES = "contact", "mapping", "stiffness"
"""Options of a drawing on which the samples depend."""


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
    modes: dict[str, Any] = {name: getattr(document.drawing, name) for name in MODES}
    modes["walks"] = walks_for(document.drawing.mapping, document.decals, document.objects)
    samples = evaluate(document.decals, vertices, normals, **modes)
    inside = np.linalg.norm(samples.uv - INSIDE, axis=1) <= INSIDE
    owners = np.where(inside, samples.owner, -1).astype(np.int32)
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


def contact_lines(vertices: Float32Array, faces: Int32Array, owners: Int32Array) -> Float32Array:
    """Return the lines between the decals of a mesh as segments, float32, shape (k, 2, 3).

    A triangle with vertices of two decals gets the segment between the middles of the edges that join them;
    one with three decals gets three segments from its middle. Rims beside bare surface are no contact lines.

    Parameters
    ----------
    vertices, faces
        A triangle mesh, shapes (n, 3) and (m, 3).
    owners
        Decal of each vertex; −1 for none.
    """
    numbers = owners[faces]
    faces, numbers = faces[(numbers >= 0).all(axis=1)], numbers[(numbers >= 0).all(axis=1)]
    points = vertices[faces].astype(np.float64)
    middles = (points + np.roll(points, -1, axis=1)) / 2
    crossed = numbers != np.roll(numbers, -1, axis=1)
    two, three = crossed.sum(axis=1) == 2, crossed.all(axis=1)
    ends = middles[two][crossed[two]].reshape(-1, 2, 3)
    centers = np.broadcast_to(points[three].mean(axis=1)[:, None], (int(three.sum()), 3, 3))
    spokes = np.stack([middles[three], centers], axis=2).reshape(-1, 2, 3)
    return np.concatenate([ends, spokes]).astype(np.float32)
