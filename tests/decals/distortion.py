"""How decals lie on a mesh: stretched, folded and bare shares at points that the scattering did not use."""

from dataclasses import dataclass

import numpy as np

import decals
from decals import Decals
from decals.field.jacobian import folds_of, stretch_of
from decals.scenes.measure import STRETCHED
from tests.decals.fault_models import Arrays

CHUNK = 1 << 16
"""Points that are evaluated at a time."""


@dataclass(frozen=True)
class Distortion:
    """Shares of the area: stretched, folded, and without an image."""

    stretched: float
    folded: float
    bare: float


def random_points(mesh: Arrays, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points uniform by area, and the normals of their faces, ``float64[n, 3]`` each."""
    vertices, faces = np.asarray(mesh[0], np.float64), mesh[1]
    rng = np.random.default_rng(seed)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    crosses = np.cross(b - a, c - a)
    doubled = np.linalg.norm(crosses, axis=1)
    rows = rng.choice(len(faces), count, p=doubled / doubled.sum())
    root, along = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    points = (1 - root) * a[rows] + root * ((1 - along) * b[rows] + along * c[rows])
    return points, crosses[rows] / doubled[rows, None]


def distortion(layout: Decals, mesh: Arrays, count: int, seed: int = 7) -> Distortion:
    """Measure what `decals.evaluate` shows at random points, with the normals of their faces."""
    points, normals = random_points(mesh, count, seed)
    parts = [
        _measured(layout, points[first : first + CHUNK], normals[first : first + CHUNK])
        for first in range(0, count, CHUNK)
    ]
    stretched, folded, sure, bare = (sum(part[k] for part in parts) for k in range(4))
    return Distortion(stretched / sure, folded / sure, bare / count)


def bare_corners(layout: Decals, mesh: Arrays) -> int:
    """Number of corners of faces, just inside them, where `decals.evaluate` shows no image."""
    corners = np.asarray(mesh[0], np.float64)[mesh[1]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    corners, normals = corners[areas > 0], normals[areas > 0] / areas[areas > 0, None]
    points = corners + 1e-3 * (corners.mean(axis=1, keepdims=True) - corners)
    return _measured(layout, points.reshape(-1, 3), normals.repeat(3, axis=0))[3]


def _measured(layout: Decals, points: np.ndarray, normals: np.ndarray) -> tuple[int, int, int, int]:
    """Counts of stretched, folded, measured and bare points."""
    found = decals.evaluate(layout, points, normals, jacobian=True)
    assert found.jacobian is not None
    shown = (found.owner >= 0) & (((found.uv - 0.5) ** 2).sum(axis=1) <= 0.2501)
    sure = shown & np.isfinite(found.jacobian[:, 0, 0])
    stretched = stretch_of(found.jacobian[sure]) > STRETCHED
    folded = folds_of(found.jacobian[sure], normals[sure])
    return int(stretched.sum()), int(folded.sum()), int(sure.sum()), int((~shown).sum())
