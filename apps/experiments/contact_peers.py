"""Residual overlap and area kept: contact of decals beside ideas of PAVEL and RepulsionPak.

All methods start from the same overlapping discs in a square. Contact deforms them in place. The two others
are our re-implementations, in the plane, of what their authors describe; constants are ours:

* ``"kept area"``, after PAVEL (Fanni, Pellacini, Scateni and Giachetti, TOG 2022), which removes the overlap
  of elements by implicit deformable models that keep their volumes. Each shape is a distance on a grid. Where
  two overlap, the line of equal distances parts them, and each shape grows elsewhere by what it lost.
* ``"repulsion"``, after RepulsionPak (Saputra, Kaplan and Asente, GI 2018). Shapes are polygons of springs.
  They start small, grow, and repel each other and the sides of the square.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from blobtree._typing import BoolArray, Float64Array
from decals import Contact, Decals, evaluate
from decals.errors import InvalidInput
from decals.experiments import Grid, Seeds
from decals.validation import count_number

CELLS = 256
"""Cells along a side of the square, in which areas are counted."""

SPREAD = 0.25
"""Standard deviation of the logarithms of radii."""

CORNERS, STEPS = 24, 300
"""Corners of a polygon of springs, and steps of its motion."""

RESTING, START = 0.75, 0.4
"""Share of the steps in which polygons grow, and their size at the start."""

NEAREST = 6
"""Corners of others that repel a corner."""

SPRING, HUB, REPULSION, PRESSURE = 0.3, 0.1, 0.006, 0.5
"""Strengths of springs along an outline and to its centre, of repulsion, and of pushes out of an overlap."""

Shapes = BoolArray
"""Cells inside each shape, bool[n, CELLS, CELLS]."""


def contact_peers(method: str, crowding: float, count: int = 30, seed: int = 0) -> dict[str, float]:
    """Let overlapping discs in a square make room for each other.

    Parameters
    ----------
    method
        One of `METHODS`.
    crowding
        Sum of the areas of the discs over that of the square.
    count
        Number of discs.
    seed
        Seed of their places and sizes.

    Returns
    -------
    dict
        ``overlap``, the area inside of several shapes, and ``free_overlap``, that of the discs, over the
        square; ``kept`` and ``kept_least``, the mean and the least area of a shape over that of its disc;
        ``covered``, the share of the square that they cover; ``gap_cv``, the variation of the distances of
        bare cells from the nearest shape; ``moved``, the mean distance between the centre of a shape and that
        of its disc, over the radius.
    """
    centers, radii = discs(crowding, count_number("count", count, 1, None, InvalidInput), seed)
    free = _inside(centers, radii)
    shapes = METHODS[method](centers, radii)
    areas, full = shapes.sum(axis=(1, 2)), free.sum(axis=(1, 2))
    kept = areas / full
    gaps = distance_transform_edt(~shapes.any(axis=0))
    gaps = gaps[gaps > 0]
    moved = np.linalg.norm(_centroids(shapes) - _centroids(free), axis=1) / radii
    return {
        "overlap": float((shapes.sum(axis=0) > 1).mean()),
        "free_overlap": float((free.sum(axis=0) > 1).mean()),
        "kept": float(kept.mean()),
        "kept_least": float(kept.min()),
        "covered": float(shapes.any(axis=0).mean()),
        "gap_cv": float(gaps.std() / gaps.mean()),
        "moved": float(moved[areas > 0].mean()),
    }


def discs(crowding: float, count: int, seed: int) -> tuple[Float64Array, Float64Array]:
    """Return centres and radii of discs inside the unit square; each centre is the best of ten."""
    rng = np.random.default_rng(seed)
    radii = np.exp(SPREAD * rng.normal(size=count))
    radii *= np.sqrt(crowding / (np.pi * (radii**2).sum()))
    centers = np.zeros((0, 2))
    for radius in radii:
        candidates = radius + (1.0 - 2.0 * radius) * rng.random((10, 2))
        gaps = np.linalg.norm(candidates[:, None] - centers, axis=2) - radii[: len(centers)] - radius
        best = gaps.min(axis=1, initial=np.inf).argmax()
        centers = np.concatenate([centers, candidates[best : best + 1]])
    return centers, radii


def _cells() -> Float64Array:
    """Return the middles of all cells, float64[CELLS, CELLS, 2]."""
    axis = (np.arange(CELLS) + 0.5) / CELLS
    return np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)


def _centroids(shapes: Shapes) -> Float64Array:
    areas = np.maximum(shapes.sum(axis=(1, 2)), 1)
    sums: Float64Array = np.einsum("nij,ijk->nk", shapes.astype(np.float64), _cells())
    return np.asarray(sums / areas[:, None])


def _distances(centers: Float64Array, radii: Float64Array) -> Float64Array:
    """Return the signed distances of all cells from the discs, below 0 inside."""
    offsets = _cells()[None] - centers[:, None, None]
    return np.asarray(np.linalg.norm(offsets, axis=3) - radii[:, None, None])


def _inside(centers: Float64Array, radii: Float64Array) -> Shapes:
    return _distances(centers, radii) < 0.0


def _contact(contact: str) -> Callable[[Float64Array, Float64Array], Shapes]:
    """Return the method that shows decals in a contact mode."""

    def shapes(centers: Float64Array, radii: Float64Array) -> Shapes:
        flat = np.zeros((len(radii), 1))
        decals = Decals(
            positions=np.hstack([centers, flat]).astype(np.float32),
            normals=np.hstack([flat, flat, flat + 1]).astype(np.float32),
            tangents=np.hstack([flat + 1, flat, flat]).astype(np.float32),
            radii=radii.astype(np.float32),
        )
        cells = _cells().reshape(-1, 2)
        points = np.hstack([cells, 0.0 * cells[:, :1]])
        found = evaluate(decals, points, np.broadcast_to([0.0, 0.0, 1.0], points.shape), contact=contact)
        owners = np.where(found.field >= 0.5, found.owner, -1)
        return np.asarray(owners.reshape(CELLS, CELLS) == np.arange(len(radii))[:, None, None])

    return shapes


def _kept_area(centers: Float64Array, radii: Float64Array) -> Shapes:
    """Part shapes at equal distances, and let each grow into empty space until it has its area again."""
    distances = _distances(centers, radii)
    deepest = distances.argmin(axis=0)
    shapes = np.zeros(distances.shape, np.bool_)
    for number, distance in enumerate(distances):
        cells = np.flatnonzero(deepest == number)
        wanted = int((distance < 0.0).sum())
        nearest = cells[distance.reshape(-1)[cells].argsort(kind="stable")[:wanted]]
        shapes[number].reshape(-1)[nearest] = True
    return shapes


def _repulsion(centers: Float64Array, radii: Float64Array) -> Shapes:
    """Let polygons of springs grow and repel each other."""
    count = len(radii)
    angles = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    shapes = centers[:, None] + START * radii[:, None, None] * unit
    velocities = np.zeros_like(shapes)
    owners = np.repeat(np.arange(count), CORNERS)
    soft = 0.15 * float(radii.mean())
    for step in range(STEPS):
        size = min(1.0, START + (1.0 - START) * step / (RESTING * STEPS))
        forces = _springs(shapes, size * radii)
        corners = shapes.reshape(-1, 2)
        distance, near = cKDTree(corners).query(corners, k=CORNERS // 2 + NEAREST)
        apart = corners[:, None] - corners[near]
        weight = np.where(owners[near] == owners[:, None], 0.0, soft**2 / (soft**2 + distance**2))
        away = apart / np.maximum(distance, 1e-9)[..., None] * weight[..., None]
        forces += REPULSION * radii[:, None, None] * away.sum(axis=1).reshape(shapes.shape)
        forces += PRESSURE * _out_of_others(shapes)
        forces += np.clip(shapes, 0.0, 1.0) - shapes
        velocities = 0.6 * (velocities + forces)
        shapes = shapes + np.clip(velocities, -0.01, 0.01)
    return np.stack([_within(shape, _cells().reshape(-1, 2)).reshape(CELLS, CELLS) for shape in shapes])


def _springs(shapes: Float64Array, radii: Float64Array) -> Float64Array:
    """Return the forces of the springs along the outlines, and to the centres."""
    sides = np.roll(shapes, -1, axis=1) - shapes
    length = np.linalg.norm(sides, axis=2, keepdims=True)
    rest = 2.0 * np.sin(np.pi / CORNERS) * radii[:, None, None]
    pull = SPRING * (length - rest) * sides / np.maximum(length, 1e-9)
    spokes = shapes.mean(axis=1, keepdims=True) - shapes
    spoke = np.linalg.norm(spokes, axis=2, keepdims=True)
    hub = HUB * (spoke - radii[:, None, None]) * spokes / np.maximum(spoke, 1e-9)
    return np.asarray(pull - np.roll(pull, 1, axis=1) + hub)


def _out_of_others(shapes: Float64Array) -> Float64Array:
    """Return the pushes of corners inside other polygons towards their own centres."""
    corners = shapes.reshape(-1, 2)
    owners = np.repeat(np.arange(len(shapes)), CORNERS)
    caught = np.zeros(len(corners), np.bool_)
    for number, shape in enumerate(shapes):
        low, high = shape.min(axis=0), shape.max(axis=0)
        near = np.flatnonzero(((corners >= low) & (corners <= high)).all(axis=1) & (owners != number))
        caught[near[_within(shape, corners[near])]] = True
    pushes = 0.2 * (shapes.mean(axis=1, keepdims=True) - shapes)
    return np.asarray(pushes * caught.reshape(len(shapes), CORNERS, 1))


def _within(polygon: Float64Array, points: NDArray[np.float64]) -> BoolArray:
    """Return whether points lie inside of a polygon, by its crossings with a ray to the right."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    inside = np.zeros(len(points), np.bool_)
    near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    x, y = points[near, None].transpose(2, 0, 1)
    across = (start[:, 1] > y) != (end[:, 1] > y)
    rise = np.where(end[:, 1] == start[:, 1], 1.0, end[:, 1] - start[:, 1])
    right = x < start[:, 0] + (y - start[:, 1]) * (end[:, 0] - start[:, 0]) / rise
    inside[near] = (across & right).sum(axis=1) % 2 == 1
    return inside


METHODS: dict[str, Callable[[Float64Array, Float64Array], Shapes]] = {
    "none": _inside,
    **{mode.name.lower(): _contact(mode.name.lower()) for mode in Contact},
    "kept area": _kept_area,
    "repulsion": _repulsion,
}
"""Methods by name; ``"none"`` leaves the discs as they are."""

experiment = contact_peers
design = Grid(method=[*METHODS], crowding=[0.6, 0.9, 1.2]) * Seeds(2)
full = Grid(method=[*METHODS], crowding=[0.4, 0.6, 0.8, 1.0, 1.2, 1.6], count=[30, 100]) * Seeds(10)
