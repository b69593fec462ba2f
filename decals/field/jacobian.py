"""Derivatives of image coordinates along a surface, and how they stretch and fold images."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array
from decals.field.query import Query
from decals.record import RECORD, RIM_RADIUS
from decals.surfaces.surface import tangent_axes

STEP = 1e-3
"""Step of the differences, in visible radii of the owner."""

MIN_SLOPE = 1e-12
"""Smallest divisor of a stretch."""

OwnersAndImages = tuple[Int32Array, Float32Array]

Points = NDArray[np.floating]


def image_jacobians(
    evaluate: Callable[[Float32Array, Float32Array], OwnersAndImages],
    points: Float32Array,
    normals: Float32Array,
    radii: Float64Array,
    center: OwnersAndImages,
    normal_derivatives: Float64Array | None,
) -> Float64Array:
    """Return derivatives of image coordinates by the point, along the surface.

    They are central differences, or one-sided ones beside a change of the owner.

    Parameters
    ----------
    evaluate : callable
        Owners and image coordinates at points with normals.
    points, normals : float32[m, 3]
        Points on the surface, and normals of any length.
    radii : float64[m]
        Visible radii of the owners.
    center : (int32[m], float32[m, 2])
        Owners and image coordinates at the points.
    normal_derivatives : float64[m, 3, 3], optional
        Derivatives of the normals by the point. By default the surface is flat.

    Returns
    -------
    float64[m, 2, 3]
        Row k is the gradient of coordinate k in the tangent plane. NaN without an owner, and where the owner
        is another one on both sides.
    """
    wide = normals.astype(np.float64)
    units = wide / np.maximum(np.linalg.norm(wide, axis=1, keepdims=True), 1e-300)
    owners, places = center
    ways = np.empty((2, len(points), 3))
    changes = np.empty((2, len(points), 2))
    known = owners >= 0
    for k, axis in enumerate(tangent_axes(units)):
        steps = (STEP * radii)[:, None] * axis
        turn = 0.0 if normal_derivatives is None else np.einsum("mij,mj->mi", normal_derivatives, steps)
        ends, images, same = [], [], []
        for sign in (1.0, -1.0):
            shifted = (points + sign * steps).astype(np.float32)
            owner, uv = evaluate(shifted, (wide + sign * turn).astype(np.float32))
            alike = owner == owners
            same.append(alike)
            ends.append(np.where(alike[:, None], shifted, points).astype(np.float64))
            images.append(np.where(alike[:, None], uv, places).astype(np.float64))
        known &= same[0] | same[1]
        with np.errstate(invalid="ignore"):  # points that are not finite have no owner
            ways[k] = ends[0] - ends[1]
        changes[k] = images[0] - images[1]
    return np.where(known[:, None, None], _solved(ways, changes), np.nan)


def _solved(ways: Float64Array, changes: Float64Array) -> Float64Array:
    """Return the matrices of least norm that map two steps to two changes of image coordinates."""
    a, b = ways
    aa, bb, ab = (np.einsum("mi,mi->m", x, y)[:, None] for x, y in ((a, a), (b, b), (a, b)))
    determinant = np.where(aa * bb - ab * ab > 0.0, aa * bb - ab * ab, 1.0)
    dual = (bb * a - ab * b) / determinant, (aa * b - ab * a) / determinant
    matrices: Float64Array = np.einsum("kmi,kmj->mij", changes, np.stack(dual))
    return matrices


def stretch_of(jacobians: Float64Array) -> Float64Array:
    """Return the ratio of the singular values of each derivative, 1 where shapes are kept: float64[m].

    Examples
    --------
    >>> from decals.field.jacobian import stretch_of
    >>> import numpy
    >>> stretch_of(numpy.array([[[0.5, 0, 0], [0, 1.5, 0]]]))
    array([3.])
    """
    a, b = jacobians[:, 0], jacobians[:, 1]
    squares = np.einsum("mi,mi->m", a, a) + np.einsum("mi,mi->m", b, b)
    area = np.linalg.norm(np.cross(a, b), axis=1)
    larger = 0.5 * (squares + np.sqrt(np.maximum(squares**2 - 4.0 * area**2, 0.0)))
    ratios: Float64Array = larger / np.maximum(area, MIN_SLOPE * np.maximum(larger, 1e-300))
    return ratios


def folds_of(jacobians: Float64Array, normals: Points) -> BoolArray:
    """Return True where an image is folded, which means mirrored; False where it is unknown."""
    folded: BoolArray = np.einsum("mi,mi->m", np.cross(jacobians[:, 0], jacobians[:, 1]), normals) < 0.0
    return folded


def normal_derivatives_of_triangles(corners: Points, normals: Points) -> Float64Array:
    """Return derivatives of interpolated normals by the point in each triangle, float64[m, 3, 3].

    Corners and their normals have the shape [m, 3, 3].
    """
    wide = corners.astype(np.float64)
    ways = np.stack([wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0]])
    turns = np.stack([normals[:, 1] - normals[:, 0], normals[:, 2] - normals[:, 0]]).astype(np.float64)
    return _solved(ways, turns)


def jacobians(query: Query, normal_derivatives: Float64Array | None) -> Float64Array:
    """Return derivatives of the image coordinates of a query."""
    spheres: Float32Array = query.target.records.numpy()[::RECORD, 3]
    radii = np.ones(query.count)
    places = query.target.places(query.host_owners)
    owned = places >= 0
    radii[owned] = RIM_RADIUS * spheres[places[owned]]

    def sampled(points: Float32Array, normals: Float32Array) -> tuple[Int32Array, Float32Array]:
        owner, uv, *_ = query.sampled(query.on_device(points), query.on_device(normals))
        return owner.numpy(), uv.numpy()

    center = query.host_owners, query.uv.numpy()
    return image_jacobians(sampled, *query.host_rows, radii, center, normal_derivatives)
