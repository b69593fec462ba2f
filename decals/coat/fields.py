"""Directions over scattered points: along principal curvature, along a gradient, smooth crosses."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.checks import shown
from decals.errors import InvalidSeeding
from decals.seeds.neighbours import FacingTree
from decals.surfaces.surface import Floats, unit_rows
from decals.wishes import answers

RING = 8
"""Neighbours of a point from which its curvature is estimated, and with which its cross is smoothed."""

ROUNDS = 30
"""Rounds of smoothing a cross field."""

DIFFERENCE = 1e-3
"""Step of the differences of a gradient, in diagonals of the points' box."""


def curvature_directions(positions: Floats, normals: Floats) -> NDArray[np.float64]:
    """Tangents along the principal curvature of larger magnitude, ``float64[n, 3]``; the sign is arbitrary.

    Zero where there are too few neighbours, or no direction is more curved than another.
    """
    first, second = frames(normals.astype(np.float64))
    values, vectors = np.linalg.eigh(_shape_operators(positions, normals))
    strongest = np.abs(values).argmax(axis=1)
    chosen = np.take_along_axis(vectors, strongest[:, None, None], axis=2)[..., 0]
    directions: NDArray[np.float64] = chosen[:, :1] * first + chosen[:, 1:] * second
    directions[values[:, 1] - values[:, 0] <= 1e-6 * np.abs(values).max(axis=1)] = 0.0
    return directions


def bends(positions: Floats, normals: Floats) -> NDArray[np.float64]:
    """Larger of the two principal curvatures, without its sign, ``float64[n]``; 0 without neighbours."""
    found: NDArray[np.float64] = np.abs(np.linalg.eigvalsh(_shape_operators(positions, normals))).max(axis=1)
    return found


def _shape_operators(positions: Floats, normals: Floats) -> NDArray[np.float64]:
    """How normals change along the surface, in each point's `frames`, ``float64[n, 2, 2]``.

    Fitted to how normals change toward the neighbours (least squares).
    """
    wide = normals.astype(np.float64)
    first, second = frames(wide)
    offsets, changes, known = _rings(positions, normals)
    frame = np.stack([first, second], axis=1)
    x = np.einsum("nkj,naj->nka", offsets, frame) * known[..., None]
    y = np.einsum("nkj,naj->nka", changes, frame) * known[..., None]
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
    operators: NDArray[np.float64] = np.stack([entries[:, [0, 1]], entries[:, [1, 2]]], axis=1)
    return operators


def smooth_crosses(
    positions: Floats, normals: Floats, directions: NDArray[np.float64], *, rounds: int = ROUNDS
) -> NDArray[np.float64]:
    """Turn tangents by quarter turns and as little more as makes neighbours agree, ``float64[n, 3]``.

    A cross looks the same after a quarter turn, so its fourth power is averaged among neighbours, as in
    Knöppel et al. (2013); frames are carried over by projection.
    """
    wide = normals.astype(np.float64)
    first, second = frames(wide)
    _, indices = FacingTree(positions, normals).nearest(positions, normals, count=RING, skip_self=True)
    known = indices >= 0
    carried = first[indices] - np.einsum("nkj,nj->nk", first[indices], wide)[..., None] * wide[:, None]
    turn = np.einsum("nkj,nj->nk", carried, first) + 1j * np.einsum("nkj,nj->nk", carried, second)
    turn = np.where(known, turn / np.maximum(np.abs(turn), 1e-12), 0.0) ** 4
    angle = np.einsum("nj,nj->n", directions, first) + 1j * np.einsum("nj,nj->n", directions, second)
    cross = _phase(angle) ** 4
    for _ in range(rounds):
        cross = _phase(cross + (turn * cross[indices]).sum(axis=1))
    root = np.exp(0.25j * np.angle(cross))
    found: NDArray[np.float64] = root.real[:, None] * first + root.imag[:, None] * second
    return found


def gradient_of(function: Callable[[Floats], ArrayLike]) -> Callable[[Floats], NDArray[np.float64]]:
    """Make a field of directions from a function of ``points[n, 3]`` to ``[n]``: its gradient."""
    if not callable(function):
        raise InvalidSeeding(f"function: expected one of points to numbers, got {shown(function)}")

    def value(points: NDArray[np.float64]) -> NDArray[np.float64]:
        found = answers("gradient_of", function, points)
        if found.shape != (len(points),):
            raise InvalidSeeding(
                f"gradient_of: expected shape [{len(points)}] from the function, got {list(found.shape)}"
            )
        return found

    def gradient(points: Floats) -> NDArray[np.float64]:
        wide = points.astype(np.float64)
        if len(wide) == 0:
            return wide
        step = DIFFERENCE * max(float(np.linalg.norm(np.ptp(wide, axis=0))), float(np.abs(wide).max()), 1e-9)
        shifts = step * np.eye(3)
        sides = [[value(wide + sign * shift) for sign in (1, -1)] for shift in shifts]
        return np.stack([(plus - minus) / (2.0 * step) for plus, minus in sides], axis=1)

    return gradient


def frames(normals: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two tangents at right angles for each unit normal, the same for the same normal."""
    axes = np.where(np.abs(normals[:, :1]) > 0.8, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = axes - np.einsum("ni,ni->n", axes, normals)[:, None] * normals
    first = unit_rows(first).astype(np.float64)
    return first, np.cross(normals, first)


def _rings(
    positions: Floats, normals: Floats
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Offsets to each point's neighbours, the change of the normal there, and which of them there are."""
    _, indices = FacingTree(positions, normals).nearest(positions, normals, count=RING, skip_self=True)
    offsets = positions[indices].astype(np.float64) - positions[:, None]
    changes = normals[indices].astype(np.float64) - normals[:, None]
    return offsets, changes, indices >= 0


def _phase(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    sizes = np.abs(values)
    phases: NDArray[np.complex128] = np.where(sizes > 1e-12, values / np.maximum(sizes, 1e-12), 1.0)
    return phases
