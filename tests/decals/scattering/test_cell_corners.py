"""Cells that are surely covered have no bare point, by comparison with all points of a fine grid."""

import numpy as np
import pytest

from decals.scattering.domain import OrientedPoints
from decals.scattering.owned_points import Centers, OwnedPoints, power_corners, surely_covered

UP = np.array([0, 0, 1], np.float32)
PEAK = 0.4


def flat(points: np.ndarray, normals: np.ndarray | None = None) -> OrientedPoints:
    """Return points of a plane or with normals of their own."""
    lifted = np.column_stack([points, np.zeros(len(points))]) if points.shape[1] == 2 else points
    directions = np.tile(UP, (len(points), 1)) if normals is None else normals
    return OrientedPoints(
        lifted.astype(np.float32), directions.astype(np.float32), np.zeros(len(points), np.int32)
    )


def sheet(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return uneven centres on a square of side 10, their radii, and a grid of points."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[0:10, 0:10].astype(float)
    centers = np.stack([columns + 0.25 + 0.5 * (rows % 2), rows + 0.5], axis=-1).reshape(-1, 2)
    centers += rng.uniform(-0.15, 0.15, centers.shape)
    axis = np.linspace(0.0, 10.0, 161)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    apart = np.linalg.norm(grid[:, None] - centers, axis=-1)
    radii = np.zeros(len(centers))
    np.maximum.at(radii, apart.argmin(axis=1), apart.min(axis=1))
    return centers, radii * rng.uniform(0.9, 1.1, len(radii)), grid


def owned_and_peaks(
    decals: OrientedPoints, points: OrientedPoints, radii: np.ndarray
) -> tuple[OwnedPoints, OwnedPoints]:
    owned = Centers.of(decals).find(points)
    return owned, owned.peaks(PEAK * radii)


def bare_cells(centers: np.ndarray, points: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return True for decals that own a bare point: by contact, the decal of least power is the owner."""
    apart = np.linalg.norm(points[:, None] - centers, axis=-1)
    owners = (apart**2 - radii**2).argmin(axis=1)
    result = np.zeros(len(centers), np.bool_)
    result[owners[apart[np.arange(len(points)), owners] > radii[owners]]] = True
    return result


@pytest.mark.parametrize("seed", range(6))
def test_sure_cells_of_a_sheet_have_no_bare_point(seed: int) -> None:
    centers, radii, grid = sheet(seed)
    points = np.random.default_rng(seed + 50).uniform(0.0, 10.0, (6400, 2))
    owned, peaks = owned_and_peaks(flat(centers), flat(points), radii)
    sure, bare = surely_covered(owned, peaks, radii), bare_cells(centers, grid, radii)
    assert bare.any()
    assert not (sure & bare).any()
    # beside a border, the corners beyond it are missing
    inside = ((centers > 1.6) & (centers < 8.4)).all(axis=1)
    assert not sure[(centers < 0.8).any(axis=1) | (centers > 9.2).any(axis=1)].any()
    large = surely_covered(owned, peaks, 1.35 * radii)
    assert large[inside].mean() > 0.75


def test_cells_across_an_edge_are_not_sure() -> None:
    centers, radii, _ = sheet(1)
    points = np.random.default_rng(7).uniform(0.0, 10.0, (6400, 2))
    # the plane turns down where x > 5
    down = np.array([np.sin(np.radians(60.0)), 0.0, np.cos(np.radians(60.0))])
    normals = [np.where(places[:, :1] > 5.0, down, UP) for places in (centers, points)]
    radii *= 1.3
    owned, peaks = owned_and_peaks(flat(centers, normals[0]), flat(points, normals[1]), radii)
    sure = surely_covered(owned, peaks, radii)
    assert sure.any()
    assert not sure[np.abs(centers[:, 0] - 5.0) < 0.4].any()


def test_cells_of_a_ball_are_sure_and_covered() -> None:
    rng = np.random.default_rng(2)
    centers, points = (rng.normal(size=(count, 3)) for count in (1500, 30_000))
    for places in (centers, points):
        places /= np.linalg.norm(places, axis=1, keepdims=True)
    kept = [0]  # apart from each other, as relaxed ones
    for row in range(1, len(centers)):
        if np.linalg.norm(centers[kept] - centers[row], axis=1).min() > 0.16:
            kept.append(row)
    centers = centers[kept]
    apart = np.linalg.norm(points[:10_000, None] - centers, axis=-1)
    radii = np.zeros(len(centers))
    np.maximum.at(radii, apart.argmin(axis=1), apart.min(axis=1))
    radii *= 1.12
    owned, peaks = owned_and_peaks(flat(centers, centers), flat(points, points), radii)
    sure = surely_covered(owned, peaks, radii)
    assert sure.mean() > 0.25
    assert not (sure & bare_cells(centers, points[10_000:20_000], radii)).any()


def test_corners_have_equal_powers() -> None:
    centers, radii, _ = sheet(4)
    points = np.random.default_rng(8).uniform(2.0, 8.0, (3000, 2))
    owned, peaks = owned_and_peaks(flat(centers), flat(points), radii)
    corners = power_corners(peaks, radii).positions[:, :2].astype(float)
    powers = np.sort(np.linalg.norm(corners[:, None] - centers, axis=-1) ** 2 - radii**2, axis=1)
    lowest = powers[:, 2] < powers[:, 0] + 1e-4
    assert lowest.sum() > 60
    assert lowest.mean() > 0.8
    assert len(owned.points) == 3000
