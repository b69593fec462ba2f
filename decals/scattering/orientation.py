"""Tangents of decals: the directions of their images' u axes."""

from collections.abc import Callable
from enum import Enum
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array
from blobtree.validation import describe
from decals.errors import InvalidScattering
from decals.scattering.neighbors import FacingTree
from decals.surfaces.surface import unit_rows
from decals.validation import function_values, member, real_array

MIN_TANGENTIAL_SHARE = 1e-3
"""Least tangential share of a direction; below it the direction counts as normal to the surface."""

FIT_NEIGHBORS = 8
"""Neighbours of a point in the estimate of its curvature, and in the smoothing of its cross."""

SMOOTHING_ROUNDS = 30
"""Rounds of smoothing of a cross field."""

GRADIENT_STEP = 1e-3
"""Step of the central differences of a gradient, in diagonals of the points' box."""


class Orientation(Enum):
    """Directions that follow the surface itself.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Segment
    >>> limb = decals.surfaces.ImplicitSurface(Segment((-2, 0, 0), (2, 0, 0), radius=0.5))
    >>> rings = decals.scatter(limb, count=80, direction=decals.scattering.Orientation.CURVATURE)
    >>> side = abs(rings.positions[:, 0]) < 1.5
    >>> bool(abs(rings.tangents[side, 0]).mean() < 0.2)
    True
    """

    CURVATURE = "curvature"
    """Along the principal curvature of larger magnitude: around a limb."""
    CROSS = "cross"
    """As `CURVATURE`, smoothed: neighbouring tangents agree up to quarter turns."""


Direction: TypeAlias = ArrayLike | Callable[[Float32Array], ArrayLike] | Orientation | str | None
"""Directions of tangents.

None (random), one vector for all decals, a function of ``points[n, 3]`` to ``vectors[n, 3]`` (such as
`gradient_of` returns), or an `Orientation` or its name.
"""


def as_direction(direction: Direction) -> Direction:
    """Return a direction with the `Orientation` of a name; the values of a function are checked later.

    Raise `InvalidScattering` for an invalid direction.
    """
    if isinstance(direction, str):
        return member("direction", direction, Orientation, InvalidScattering)
    if direction is None or isinstance(direction, Orientation) or callable(direction):
        return direction
    if not _check_vectors(real_array("direction", direction, InvalidScattering), (3,)).any():
        raise InvalidScattering("direction: expected a direction, got the zero vector; give it a length")
    return direction


def tangents(positions: Float32Array, normals: Float32Array, direction: Direction, seed: int) -> Float32Array:
    """Return unit tangents, ``float32[n, 3]``, random or along a direction.

    Where the direction vanishes or is normal to the surface, the tangent is a fixed function of the normal.
    Raise `InvalidScattering` for directions that are not finite or have a wrong shape.
    """
    wide = unit_rows(normals).astype(np.float64)
    fallback = _tangents_near_axis(wide)
    if direction is None:
        angles = np.random.default_rng(seed).random((len(normals), 1)) * (2.0 * np.pi)
        return unit_rows(np.cos(angles) * fallback + np.sin(angles) * np.cross(wide, fallback))
    if isinstance(direction, Orientation):
        vectors = _surface_directions(direction, positions, normals)
    else:
        vectors = _direction_vectors(direction, positions)
    tangential = vectors - np.einsum("ni,ni->n", vectors, wide)[:, None] * wide
    lengths = np.linalg.norm(vectors, axis=1)
    undefined = np.linalg.norm(tangential, axis=1) <= MIN_TANGENTIAL_SHARE * lengths
    return unit_rows(np.where(undefined[:, None], fallback, tangential))


def gradient_of(function: Callable[[Float32Array], ArrayLike]) -> Callable[[Float32Array], Float64Array]:
    """Return the gradient of a function of points, as a direction for `scatter`.

    Parameters
    ----------
    function
        A function of ``points[n, 3]`` to ``[n]``. Its gradient is taken by central differences.

    Returns
    -------
    A function of ``points[n, 3]`` to ``float64[n, 3]``.

    Raises
    ------
    InvalidScattering
        If `function` cannot be called. The gradient raises it if the function returns invalid values.

    Examples
    --------
    >>> import decals
    >>> upward = decals.scattering.gradient_of(lambda points: 2.0 * points[:, 1])
    >>> import numpy as np
    >>> upward(np.zeros((1, 3))).round(3)
    array([[0., 2., 0.]])
    """
    if not callable(function):
        raise InvalidScattering(f"function: expected one of points to numbers, got {describe(function)}")

    def value(points: Float64Array) -> Float64Array:
        values = function_values("gradient_of", function, points, error=InvalidScattering)
        if values.shape != (len(points),):
            raise InvalidScattering(
                f"gradient_of: expected shape [{len(points)}] from the function, got {list(values.shape)}"
            )
        return values

    def gradient(points: Float32Array) -> Float64Array:
        wide = points.astype(np.float64)
        if len(wide) == 0:
            return wide
        extent = max(float(np.linalg.norm(np.ptp(wide, axis=0))), float(np.abs(wide).max()), 1e-9)
        step = GRADIENT_STEP * extent
        shifts = step * np.eye(3)
        sides = [[value(wide + sign * shift) for sign in (1, -1)] for shift in shifts]
        return np.stack([(plus - minus) / (2.0 * step) for plus, minus in sides], axis=1)

    return gradient


def curvature_directions(positions: Float32Array, normals: Float32Array) -> Float64Array:
    """Return tangents along the principal curvature of larger magnitude, ``float64[n, 3]``, of any sign.

    Zero where there are too few neighbours, or both curvatures are equal.
    """
    first, second = tangent_frames(normals.astype(np.float64))
    values, vectors = np.linalg.eigh(_shape_operators(positions, normals))
    strongest = np.abs(values).argmax(axis=1)
    components = np.take_along_axis(vectors, strongest[:, None, None], axis=2)[..., 0]
    directions: Float64Array = components[:, :1] * first + components[:, 1:] * second
    directions[values[:, 1] - values[:, 0] <= 1e-6 * np.abs(values).max(axis=1)] = 0.0
    return directions


def max_curvatures(positions: Float32Array, normals: Float32Array) -> Float64Array:
    """Return the larger magnitude of the principal curvatures, ``float64[n]``; 0 without neighbours."""
    curvatures: Float64Array = np.abs(np.linalg.eigvalsh(_shape_operators(positions, normals))).max(axis=1)
    return curvatures


def smooth_crosses(positions: Float32Array, normals: Float32Array, directions: Float64Array) -> Float64Array:
    """Turn tangents by quarter turns, and as little more as makes neighbours agree, ``float64[n, 3]``.

    A cross looks the same after a quarter turn, so its fourth power is averaged among neighbours, as in
    Knöppel et al. (2013); frames are transported by projection.
    """
    wide = normals.astype(np.float64)
    first, second = tangent_frames(wide)
    tree = FacingTree(positions, normals)
    _, indices = tree.nearest(positions, normals, count=FIT_NEIGHBORS, skip_self=True)
    valid = indices >= 0
    transported = first[indices] - np.einsum("nkj,nj->nk", first[indices], wide)[..., None] * wide[:, None]
    turns = np.einsum("nkj,nj->nk", transported, first) + 1j * np.einsum("nkj,nj->nk", transported, second)
    turns = np.where(valid, turns / np.maximum(np.abs(turns), 1e-12), 0.0) ** 4
    angles = np.einsum("nj,nj->n", directions, first) + 1j * np.einsum("nj,nj->n", directions, second)
    crosses = _phases(angles) ** 4
    for _ in range(SMOOTHING_ROUNDS):
        crosses = _phases(crosses + (turns * crosses[indices]).sum(axis=1))
    roots = np.exp(0.25j * np.angle(crosses))
    smooth: Float64Array = roots.real[:, None] * first + roots.imag[:, None] * second
    return smooth


def tangent_frames(normals: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return two tangents at right angles for each unit normal, the same for the same normal."""
    first = unit_rows(_tangents_near_axis(normals)).astype(np.float64)
    return first, np.cross(normals, first)


def _tangents_near_axis(normals: Float64Array) -> Float64Array:
    """Return the tangents closest to the x axis, or to the y axis where the normal is near x."""
    axes = np.where(np.abs(normals[:, :1]) > 0.8, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    directions: Float64Array = axes - np.einsum("ni,ni->n", axes, normals)[:, None] * normals
    return directions


def _surface_directions(
    orientation: Orientation, positions: Float32Array, normals: Float32Array
) -> Float64Array:
    """Return the directions of an orientation; signs and quarter turns are arbitrary."""
    if len(positions) == 0:
        return np.zeros((0, 3))
    directions = curvature_directions(positions, normals)
    if orientation is Orientation.CURVATURE:
        return directions
    return smooth_crosses(positions, normals, directions)


def _direction_vectors(
    direction: ArrayLike | Callable[[Float32Array], ArrayLike], positions: Float32Array
) -> Float64Array:
    """Return a vector for each position, with 1 as its largest component, or zero."""
    if callable(direction):
        vectors = _check_vectors(
            function_values("direction", direction, positions, error=InvalidScattering), positions.shape
        )
    else:
        vectors = _check_vectors(real_array("direction", direction, InvalidScattering), (3,))
    rows = np.broadcast_to(vectors, positions.shape)
    largest = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    scaled: Float64Array = rows / np.where(largest > 0, largest, 1.0)
    return scaled


def _check_vectors(vectors: Float64Array, shape: tuple[int, ...]) -> Float64Array:
    if vectors.shape != shape:
        raise InvalidScattering(f"direction: expected shape {list(shape)}, got {list(vectors.shape)}")
    if not np.isfinite(vectors).all():
        raise InvalidScattering(
            "direction: expected finite numbers, got NaN or infinity; return zeros where it is undefined"
        )
    return vectors


def _shape_operators(positions: Float32Array, normals: Float32Array) -> Float64Array:
    """Return the change of the normal along the surface, in each point's frame, ``float64[n, 2, 2]``.

    A symmetric S that maps offsets to the changes of the normal is fitted to the neighbours (least squares).
    """
    first, second = tangent_frames(normals.astype(np.float64))
    offsets, changes, valid = _neighbor_offsets(positions, normals)
    frame = np.stack([first, second], axis=1)
    x = np.einsum("nkj,naj->nka", offsets, frame) * valid[..., None]
    y = np.einsum("nkj,naj->nka", changes, frame) * valid[..., None]
    # normal equations of the symmetric S = [[p, q], [q, r]] that takes offsets x to changes y
    xx, xy, yy = x[..., 0] ** 2, x[..., 0] * x[..., 1], x[..., 1] ** 2
    a, b, c = xx.sum(axis=1), xy.sum(axis=1), yy.sum(axis=1)
    left = np.zeros((len(a), 3, 3))
    left[:, 0, 0], left[:, 0, 1], left[:, 1, 0] = a, b, b
    left[:, 1, 1], left[:, 1, 2], left[:, 2, 1], left[:, 2, 2] = a + c, b, b, c
    right = np.stack(
        [
            (x[..., 0] * y[..., 0]).sum(axis=1),
            (x[..., 1] * y[..., 0] + x[..., 0] * y[..., 1]).sum(axis=1),
            (x[..., 1] * y[..., 1]).sum(axis=1),
        ],
        axis=1,
    )
    entries = np.einsum("nij,nj->ni", np.linalg.pinv(left, rcond=1e-8, hermitian=True), right)
    operators: Float64Array = np.stack([entries[:, [0, 1]], entries[:, [1, 2]]], axis=1)
    return operators


def _neighbor_offsets(
    positions: Float32Array, normals: Float32Array
) -> tuple[Float64Array, Float64Array, BoolArray]:
    """Return offsets to each point's neighbours, changes of the normal, and True for valid neighbours."""
    tree = FacingTree(positions, normals)
    _, indices = tree.nearest(positions, normals, count=FIT_NEIGHBORS, skip_self=True)
    offsets = positions[indices].astype(np.float64) - positions[:, None]
    changes = normals[indices].astype(np.float64) - normals[:, None]
    return offsets, changes, indices >= 0


def _phases(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    sizes = np.abs(values)
    phases: NDArray[np.complex128] = np.where(sizes > 1e-12, values / np.maximum(sizes, 1e-12), 1.0)
    return phases
