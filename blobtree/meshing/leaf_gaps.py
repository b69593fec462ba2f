"""Gaps between the leaves of a tree, and growth that leaves them open."""

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from blobtree.cells.surface_box import surface_box
from blobtree.formulas.falloff import ISO, RIM
from blobtree.tape.bounds import leaf_boxes
from blobtree.tape.grown import leaf_tape
from blobtree.tape.model import ImplicitModel, gradients_at, values_at
from blobtree.tape.part_sizes import has_warps
from blobtree.tape.program import (
    PlacedPrimitive,
    ProgramField,
    ProgramPrimitive,
    Run,
    Slab,
    influence_radii,
)
from blobtree.tape.tape import Tape

GAP_SHARE = 1 / 3
"""Largest growth of a leaf over the gap between it and another one."""

MAX_PAIRS = 200
"""Most pairs of leaves that grow, and leaves near them."""

GAP_STEPS = 12
"""Steps to and fro between two skeletons, at whose end the gap is known."""

SURFACE_STEPS = 4
"""Steps of Newton's method to the surface of a leaf alone; the first one is exact in similarity maps."""

FACE_POINTS = 24
"""Points along each side of a box around a face."""

FACE_STEPS = np.geomspace(1e-3, 1.0, 24)
"""Distances from a face at which another leaf is looked for, over the reach. The gap is at least as wide as
the last one before the leaf."""

TOUCHING = 1e-4
"""Gap over the reach of a search below which a leaf touches a face."""

GAP_STARTS = (0.0, 0.5, 1.0)
"""Places between a skeleton's middle and the corners of its hull at which these steps start."""


def hull_corners(placed: PlacedPrimitive) -> Float64Array:
    """Return the corners (n, 3) of the hull of a leaf or its skeleton, in the space around its map.

    A leaf that knows no hull has the corners of its box.
    """
    leaf, matrix = placed.primitive, placed.placement.matrix
    kind: Any = type(leaf)
    if hasattr(kind, "hulls"):
        hull = kind.hulls([leaf])[0]
    else:
        (lower,), (upper,) = kind.boxes([leaf])
        hull = np.array(list(product(*zip(lower, upper, strict=True))))
    corners: Float64Array = hull @ matrix[:3, :3].T + matrix[:3, 3]
    return corners


def thinnest_slab(placed: PlacedPrimitive) -> tuple[int, Slab] | None:
    """Return the number of a leaf's pair of flat faces that are nearest each other, and the pair itself.

    It is in the space around the leaf's map. The result is None for leaves that cannot be made thicker there.
    """
    leaf = placed.primitive
    if not isinstance(leaf, ProgramField) or leaf.profile[2] != 1.0:
        return None
    slabs = [slab.placed(placed.placement) for slab in leaf.slabs]
    number, thinnest = min(enumerate(slabs), key=lambda one: one[1].core, default=(0, None))
    return None if thinnest is None or thinnest.core <= 0.0 else (number, thinnest)


def limit_by_gaps(
    tree: ImplicitModel,
    leaves: list[tuple[Run, PlacedPrimitive]],
    lengths: Float64Array,
    slabs: Mapping[int, Slab],
) -> None:
    """Lower growths at gaps between leaves, so that these stay open; below warps, gaps are not known.

    Nothing grows where too many leaves are near each other. `slabs` has the leaves that grow across a slab,
    by number; all others grow on all sides.
    """
    if not lengths.any():
        return
    lower, upper = leaf_boxes(tree._program)
    beside = {}
    for number in np.flatnonzero(lengths).tolist():
        apart = np.maximum(lower - upper[number], lower[number] - upper).max(axis=1)
        beside[number] = np.flatnonzero(apart < lengths[number] / GAP_SHARE)
    if sum(map(len, beside.values())) > MAX_PAIRS:
        lengths[:] = 0.0
    if has_warps(tree):
        return
    for number, near in beside.items():
        placed, reach = leaves[number][1], lengths[number] / GAP_SHARE
        if reach == 0.0:
            continue
        if number in slabs:
            faces = face_points(tree, placed, number, slabs[number])
            others = [(leaves[other][1], other) for other in near[near != number].tolist()]
            gaps = [_gap_over(tree, slabs[number], faces, *other, reach) for other in others]
            lengths[number] = min([lengths[number], *(GAP_SHARE * gap for gap in gaps)])
            continue
        if not isinstance(placed.primitive, ProgramPrimitive):
            continue
        one = _Skeleton(tree, placed, number, reach)
        starts = one.closest(_starts(placed))
        for other in near[near != number].tolist():
            gap = _gap(one, _Skeleton(tree, leaves[other][1], other, reach), starts)
            if gap > 0.0:
                lengths[number] = min(lengths[number], GAP_SHARE * gap)


class _Skeleton:
    """The closest points of a leaf's skeleton, by the field of the leaf once it has grown enough."""

    def __init__(self, tree: ImplicitModel, placed: PlacedPrimitive, number: int, reach: float) -> None:
        scale = float(np.linalg.svd(placed.placement.matrix[:3, :3], compute_uv=False)[-1])
        lower, upper = surface_box(tree)
        box = float(np.linalg.norm(upper - lower))
        self.radius = 0.0
        if isinstance(placed.primitive, ProgramPrimitive):
            self.radius = RIM * float(influence_radii([placed]).min()) * scale
        program = tree._program
        self._tapes = [leaf_tape(program, number, length / scale) for length in (box, 4.0 * reach)]

    def closest(self, points: Float64Array) -> Float64Array:
        """Return the closest points; from afar they are less exact, until another step from there."""
        far, near = (_at_distance(tape, points, 0.0) for tape in self._tapes)
        return np.where(np.isfinite(near), near, far)


def _at_distance(tape: Tape, points: Float64Array, aim: float) -> Float64Array:
    """Return where distances from a skeleton, over the influence, are `aim` by a step of Newton's method.

    The result is NaN outside the field.
    """
    rows = gradients_at(tape, points).astype(np.float64)
    rest = np.cbrt(rows[:, 0].clip(0.0, 1.0))
    distance = np.sqrt(1.0 - rest)
    slope = 6.0 * distance * rest**2
    squared = (rows[:, 1:] ** 2).sum(axis=1)
    step = rows[:, 1:] * ((distance - aim) * slope / np.maximum(squared, 1e-300))[:, None]
    result: Float64Array = np.where((rest > 0.0)[:, None], points + step, np.nan)
    return result


def _starts(placed: PlacedPrimitive) -> Float64Array:
    """Return points throughout the hull of a leaf's skeleton (n, 3)."""
    corners = hull_corners(placed)
    middle = corners.mean(axis=0)
    pairs = 0.5 * (corners[:, None] + corners[None]).reshape(-1, 3)
    starts: Float64Array = np.concatenate([middle + share * (pairs - middle) for share in GAP_STARTS])
    return starts


def surface_points(tree: ImplicitModel, placed: PlacedPrimitive, number: int) -> Float64Array:
    """Return points (n, 3) all over the surface of a leaf alone, or on both faces of its thinnest slab."""
    if has_warps(tree):
        return np.empty((0, 3))
    flat = thinnest_slab(placed)
    if flat is not None:
        return face_points(tree, placed, number, flat[1]).reshape(-1, 3)
    if not isinstance(placed.primitive, ProgramPrimitive):
        return np.empty((0, 3))
    skeleton = _Skeleton(tree, placed, number, 0.0)
    beside = 1.5 * skeleton.radius * np.concatenate([np.eye(3), -np.eye(3)])
    points = (_starts(placed) + beside[:, None]).reshape(-1, 3)
    tape = leaf_tape(tree._program, number)
    for _step in range(SURFACE_STEPS):
        points = _at_distance(tape, points, RIM)
        points = points[np.isfinite(points).all(axis=1)]
    return points


def face_points(tree: ImplicitModel, placed: PlacedPrimitive, number: int, slab: Slab) -> Float64Array:
    """Return points (2, n, 3) on the lower and the upper face of a leaf's slab."""
    corners = hull_corners(placed) - slab.middle
    flat = corners - np.outer(corners @ slab.normal, slab.normal)
    axes = np.linalg.svd(flat - flat.mean(axis=0))[2][:2]
    ends = flat @ axes.T
    lower, upper = ends.min(axis=0), ends.max(axis=0)
    shares = (np.arange(FACE_POINTS) + 0.5) / FACE_POINTS
    places = np.stack(np.meshgrid(shares, shares), axis=-1).reshape(-1, 2)
    inner = slab.middle + (lower + places * (upper - lower)) @ axes
    inside = values_at(leaf_tape(tree._program, number), inner) > ISO
    ways = slab.half * slab.normal
    return np.stack([inner[inside] - ways, inner[inside] + ways])


def _gap_over(
    tree: ImplicitModel,
    slab: Slab,
    faces: Float64Array,
    other: PlacedPrimitive,
    number: int,
    reach: float,
) -> float:
    """Return a lower bound on the distance of another leaf from a slab.

    It is infinity if they are far apart, or meet: then the leaf may also hang over a face.
    """
    heights = (hull_corners(other) - slab.middle) @ slab.normal
    beyond = slab.half
    if isinstance(other.primitive, ProgramPrimitive):
        stretch = float(np.linalg.svd(other.placement.matrix[:3, :3], compute_uv=False)[0])
        beyond += RIM * float(influence_radii([other]).max()) * stretch
    gap = float(max(heights.min(), -heights.max())) - beyond
    if gap > TOUCHING * reach:
        return gap
    distances = np.concatenate([[0.0], reach * FACE_STEPS])
    ways = np.stack([-slab.normal, slab.normal])[:, None] * distances[:, None, None, None]
    tape = leaf_tape(tree._program, number)
    inside = values_at(tape, (faces + ways).reshape(-1, 3)).reshape(len(distances), -1) >= ISO
    over = np.asarray(inside.any(axis=1))
    return float(distances[over.argmax() - 1]) if over.any() and not over[0] else float(np.inf)


def _gap(one: "_Skeleton", other: "_Skeleton", starts: Float64Array) -> float:
    """Return the distance between the surfaces of two leaves; it is below 0 where they meet.

    Steps to and fro between two convex sets end where these are nearest (von Neumann 1933).
    """
    points, gap = starts, np.inf
    for _step in range(GAP_STEPS):
        across = other.closest(points)
        points = one.closest(across[np.isfinite(across).all(axis=1)])
        distances = np.linalg.norm(points - other.closest(points), axis=1)
        gap = float(np.min(distances, initial=np.inf)) - one.radius - other.radius
        if gap <= 0.0 or not len(points):
            break
    return gap
