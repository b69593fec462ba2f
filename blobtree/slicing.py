"""The field of a tree on a plane, as pyvista objects; these functions import pyvista late."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from blobtree.errors import InvalidPoints, InvalidResolution
from blobtree.formulas.falloff import ISO
from blobtree.pyvista_views import polydata_of, require_pyvista
from blobtree.tape.model import ImplicitModel
from blobtree.validation import describe, finite_number, finite_vector, is_whole, items

if TYPE_CHECKING:
    import pyvista as pv

    from blobtree.field_slice import FieldSlice

SLICE_RESOLUTION = 256
"""Squares along the longer side of a slice."""

MAX_SQUARES = 1 << 14
"""Largest number of squares along the longer side of a slice."""

LEVELS = tuple(level / 10.0 for level in range(1, 11))
"""Field values that get lines by default."""

NEWTON_STEPS = 8
LEVEL_TOLERANCE = 1e-6
"""Largest field error of a point on the line of its level."""


def slice_tree(
    tree: ImplicitModel,
    origin: ArrayLike,
    normal: ArrayLike,
    *,
    resolution: int = SLICE_RESOLUTION,
    values: Iterable[float] = LEVELS,
) -> "FieldSlice":
    """Return the field on a plane, see `Node.slice`."""
    require_pyvista()
    from blobtree.field_slice import FieldSlice

    levels = _levels(values)
    if not is_whole(resolution) or not 1 <= resolution <= MAX_SQUARES:
        raise InvalidResolution(
            f"resolution: expected a whole number of squares from 1 to {MAX_SQUARES}, got {resolution!r}"
        )
    corner, sides, counts = _rectangle(tree, origin, normal, int(resolution))
    plane = _plane(tree, corner, sides, counts)
    across = np.cross(*sides)
    step = float(max(np.linalg.norm(side) / count for side, count in zip(sides, counts, strict=True)))
    blocks = FieldSlice()
    blocks["plane"] = plane
    blocks["lines"] = _lines(tree, plane, levels, across, step)
    blocks["surface"] = _lines(tree, plane, [ISO], across, step)
    return blocks


def _levels(values: Iterable[float]) -> list[float]:
    found = items(values)
    if found is None:
        raise InvalidPoints(
            f"values: expected several field values, got {describe(values)}; put it in a list"
        )
    levels = sorted({finite_number("values", value) for value in found})
    if levels and levels[0] <= 0.0:
        raise InvalidPoints(
            f"values: expected field values above 0, got {levels[0]!r}; 0 is everywhere outside"
        )
    return levels


def _rectangle(
    tree: ImplicitModel, origin: ArrayLike, normal: ArrayLike, resolution: int
) -> tuple[Float64Array, tuple[Float64Array, Float64Array], tuple[int, int]]:
    """Return lowest corner (3,), sides (3,) and counts of squares of the plane's part in the box."""
    start = np.array(finite_vector("origin", origin))
    axis = np.array(finite_vector("normal", normal))
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise InvalidPoints("normal: expected a direction, got the zero vector")
    axis /= length
    right = np.eye(3)[0 if abs(axis[0]) < 0.9 else 1]
    right = right - (right @ axis) * axis
    right /= np.linalg.norm(right)
    up = np.cross(axis, right)
    crossings = _crossings(tree, start, axis)
    if len(crossings) == 0:
        raise InvalidPoints(
            f"origin: the plane through {tuple(start.tolist())} misses the model, whose influence ends at "
            f"{tree.support[0].tolist()} and {tree.support[1].tolist()}; move it"
        )
    flat = np.column_stack([(crossings - start) @ right, (crossings - start) @ up])
    low, high = flat.min(axis=0), flat.max(axis=0)
    extent = np.maximum(high - low, 1e-6 * float((high - low).max()) or 1e-30)
    counts = np.maximum(np.rint(resolution * extent / extent.max()), 1).astype(int)
    sides = (extent[0] * right, extent[1] * up)
    return start + low[0] * right + low[1] * up, sides, (int(counts[0]), int(counts[1]))


def _crossings(tree: ImplicitModel, start: Float64Array, axis: Float64Array) -> Float64Array:
    """Return the points (n, 3) where edges of the tree's box cross the plane."""
    box = np.array(tree.support, np.float64)
    corners = np.array([[box[c >> i & 1, i] for i in range(3)] for c in range(8)])
    heights = (corners - start) @ axis
    points = []
    for a in range(8):
        for b in (a | 1, a | 2, a | 4):
            if a != b and (heights[a] <= 0.0) != (heights[b] <= 0.0):
                fraction = heights[a] / (heights[a] - heights[b])
                points.append(corners[a] + fraction * (corners[b] - corners[a]))
    return np.array(points).reshape(-1, 3)


def _plane(
    tree: ImplicitModel,
    corner: Float64Array,
    sides: tuple[Float64Array, Float64Array],
    counts: tuple[int, int],
) -> "pv.PolyData":
    """Return a grid of squares with the field at their corners."""
    nu, nv = counts
    u, v = np.linspace(0.0, 1.0, nu + 1), np.linspace(0.0, 1.0, nv + 1)
    points = (corner + v[:, None, None] * sides[1] + u[None, :, None] * sides[0]).reshape(-1, 3)
    lowest = (np.arange(nv)[:, None] * (nu + 1) + np.arange(nu)).reshape(-1, 1)
    squares = lowest + np.array([0, 1, nu + 2, nu + 1])
    plane = polydata_of(points.astype(np.float32), squares)
    plane.point_data["field"] = tree(plane.points)
    return plane


def _lines(
    tree: ImplicitModel, plane: "pv.PolyData", levels: list[float], across: Float64Array, step: float
) -> "pv.PolyData":
    """Return the lines of some field levels, with their points moved onto the levels within the plane."""
    import pyvista as pv

    if not levels:
        return pv.PolyData()
    lines: Any = plane.contour(isosurfaces=levels, scalars="field")
    if lines.n_points == 0:
        return pv.PolyData()
    points = lines.points.astype(np.float64)
    targets = np.asarray(lines["field"], np.float64)
    targets = np.array(levels)[np.abs(targets[:, None] - np.array(levels)).argmin(axis=1)]
    lines.points = _onto_levels(tree, points, targets, across / np.linalg.norm(across), step).astype(
        np.float32
    )
    lines.point_data["field"] = targets.astype(np.float32)
    return cast("pv.PolyData", lines)


def _onto_levels(
    tree: ImplicitModel, points: Float64Array, targets: Float64Array, axis: Float64Array, step: float
) -> Float64Array:
    """Return points moved onto their levels by Newton's method; a point that gets no closer stays."""
    best, moved = points.copy(), points.copy()
    gaps = targets - tree(points)
    smallest = np.abs(gaps)
    for _ in range(NEWTON_STEPS):
        active = np.flatnonzero(np.abs(gaps) > LEVEL_TOLERANCE)
        if len(active) == 0:
            break
        slopes = tree.gradient(moved[active]).astype(np.float64)
        slopes -= (slopes @ axis)[:, None] * axis
        steepness = np.linalg.norm(slopes, axis=1)
        lengths = np.clip(gaps[active] / np.maximum(steepness, 1e-30), -0.5 * step, 0.5 * step)
        moved[active] += slopes * (lengths / np.maximum(steepness, 1e-30))[:, None]
        gaps[active] = targets[active] - tree(moved[active])
        better = active[np.abs(gaps[active]) < smallest[active]]
        best[better], smallest[better] = moved[better], np.abs(gaps[better])
    return best
