"""Maps from the leaves of a posed tree to the world of the same tree at rest."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np

from blobtree._typing import Float32Array, Float64Array
from blobtree.errors import InvalidNode
from blobtree.tape.program import (
    WORLD,
    Instruction,
    Placement,
    ProgramField,
    ProgramLeaf,
    ProgramNode,
    ProgramPrimitive,
    Run,
)

STEP = 1e-3
"""Step of the differences in `invert_map`, in lengths of the model."""

NEWTON_STEPS = 8
"""Steps of Newton's method in `invert_map`."""


@dataclass(frozen=True)
class _PlacedLeaf:
    """A leaf of a tree, its placement behind the innermost warp above it, and the one without any warp."""

    leaf: ProgramLeaf
    placement: Placement
    unwarped: Placement


def maps_to_rest(posed: ProgramNode, program: list[Instruction], rest: ProgramNode) -> Float64Array:
    """Return matrices (n, 4, 4) from each leaf of a program, in its own space, to the rest tree's world.

    Leaves correspond from left to right. A leaf whose skeleton differs is moved, turned and scaled onto the
    one at rest. The matrices lead to the world of the rest tree without its warps; see `invert_map`.

    Parameters
    ----------
    posed, program
        The posed tree and its program.
    rest
        The tree at rest, with the same leaves.

    Raises
    ------
    InvalidNode
        The trees have other leaves.
    """
    places, own = _placed_leaves(posed), _placed_leaves(rest)
    names = [[type(place.leaf).__name__.lstrip("_") for place in leaves] for leaves in (places, own)]
    if names[0] != names[1]:
        raise InvalidNode(
            f"rest: expected the leaves of the posed tree ({_summary(names[0])}), got {_summary(names[1])}"
        )
    numbers: defaultdict[tuple[int, bytes], list[int]] = defaultdict(list)
    for number, place in enumerate(places):
        numbers[_key(place.leaf, place.placement)].append(number)
    maps = []
    for step in program:
        for placed in step.primitives if isinstance(step, Run) else ():
            found = numbers[_key(placed.primitive, placed.placement)]
            if not found:
                raise InvalidNode(
                    "posed tree: expected leaves of positive weight under other operators than sums"
                )
            number = found.pop(0)
            maps.append(own[number].unwarped.matrix @ _between(places[number].leaf, own[number].leaf))
    return np.array(maps)


def _summary(names: list[str]) -> str:
    shown = ", ".join(names[:6])
    return f"{len(names)}: {shown}{', …' if len(names) > 6 else ''}"


def _key(leaf: ProgramLeaf, placement: Placement) -> tuple[int, bytes]:
    return id(leaf), placement.matrix.tobytes()


def _placed_leaves(root: ProgramNode) -> list[_PlacedLeaf]:
    """Return the leaves of a tree from left to right."""
    leaves: list[_PlacedLeaf] = []
    pending = [(root, WORLD, WORLD)]
    while pending:
        node, placement, unwarped = pending.pop()
        if isinstance(node, ProgramLeaf) and not node.program_children:
            leaves.append(_PlacedLeaf(node, placement, unwarped))
            continue
        children = node.program_children
        if node.warp is not None:
            placement = Placement(np.eye(4), placement.growth)
        elif len(children) == 1:
            placement, unwarped = node.child_placement(placement), node.child_placement(unwarped)
        pending.extend((child, placement, unwarped) for child in reversed(children))
    return leaves


def has_warps(root: ProgramNode) -> bool:
    """Return True if a tree bends space anywhere."""
    pending = [root]
    while pending:
        node = pending.pop()
        if not isinstance(node, ProgramLeaf):
            if node.warp is not None:
                return True
            pending.extend(node.program_children)
    return False


def invert_map(
    function: Callable[[Float64Array], Float32Array], targets: Float32Array, starts: Float32Array
) -> Float32Array:
    """Return points that a smooth map takes to targets, float32[n, 3], by Newton's method.

    Parameters
    ----------
    function
        The map, of points float64[n, 3]; NaN where it is not defined.
    targets
        Where the points should go, float32[n, 3].
    starts
        Points near all the results, float32[m, 3]. Each search begins at that whose image is nearest.
    """
    from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

    images = function(starts.astype(np.float64))
    defined = np.isfinite(images).all(axis=1)
    known = np.isfinite(targets).all(axis=1)
    goals = targets[known].astype(np.float64)
    points = starts[defined].astype(np.float64)[cKDTree(images[defined]).query(goals)[1]]
    step = STEP * float(np.ptp(starts, axis=0).max())
    errors, length = goals - function(points), np.ones(len(goals))
    for _ in range(NEWTON_STEPS):
        sides = [function(points + step * axis) - function(points - step * axis) for axis in np.eye(3)]
        jacobians = np.nan_to_num(np.stack(sides, axis=2) / (2.0 * step))
        moves = np.einsum("nij,nj->ni", np.linalg.pinv(jacobians), errors)
        trials = points + length[:, None] * moves
        found = goals - function(trials)
        better = np.linalg.norm(found, axis=1) < np.linalg.norm(errors, axis=1)
        points[better], errors[better] = trials[better], found[better]
        length = np.where(better, 1.0, 0.5 * length)
    result = np.full(targets.shape, np.nan, np.float32)
    result[known] = points
    return result


def _between(posed: ProgramLeaf, rest: ProgramLeaf) -> Float64Array:
    """Return the matrix (4, 4) that takes a leaf's skeleton to that of the leaf at rest."""
    if not hasattr(posed, "hulls"):
        return _between_boxes(cast(ProgramField, posed), cast(ProgramField, rest))
    a, b = cast(ProgramPrimitive, posed), cast(ProgramPrimitive, rest)
    start, end = type(a).hulls([a])[0], type(b).hulls([b])[0]
    across = float(np.mean(type(b).radii([b]))) / float(np.mean(type(a).radii([a])))
    matrix = np.eye(4)
    if len(start) != len(end):
        raise InvalidNode(
            f"rest: expected a {type(a).__name__} with {len(start)} points as in the pose, got {len(end)}"
        )
    if np.array_equal(start, end) and across == 1.0:
        return matrix
    x, y = start - start.mean(axis=0), end - end.mean(axis=0)
    lengths = np.linalg.svd(x, compute_uv=False)
    size = float(np.abs(start).max(initial=1e-30))
    if lengths[0] <= 1e-9 * size or not y.any():
        linear = across * np.eye(3)
    elif len(lengths) < 2 or lengths[1] <= 1e-6 * lengths[0]:
        farthest = np.abs(x).sum(axis=1).argmax()
        before, after = x[farthest], y[farthest]
        d, e = before / np.linalg.norm(before), after / np.linalg.norm(after)
        along = float(np.linalg.norm(after) / np.linalg.norm(before))
        linear = _shortest_turn(d, e) @ (across * np.eye(3) + (along - across) * np.outer(d, d))
    else:
        u, _, v = np.linalg.svd(y.T @ x)
        turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
        linear = turn * float(np.linalg.norm(y) / np.linalg.norm(x))
    matrix[:3, :3] = linear
    matrix[:3, 3] = end.mean(axis=0) - linear @ start.mean(axis=0)
    return matrix


def _between_boxes(posed: ProgramField, rest: ProgramField) -> Float64Array:
    """Return the matrix that takes the box of a direct field to that of the field at rest."""
    (low, high), (low_rest, high_rest) = (
        (np.asarray(corner, np.float64)[0] for corner in type(field).boxes([field]))
        for field in (posed, rest)
    )
    matrix = np.eye(4)
    matrix[:3, :3] = np.diag((high_rest - low_rest) / (high - low))
    matrix[:3, 3] = low_rest - matrix[:3, :3] @ low
    return matrix


def _shortest_turn(start: Float64Array, end: Float64Array) -> Float64Array:
    """Return the rotation by the least angle that takes one unit vector to another."""
    axis, cosine = np.cross(start, end), float(start @ end)
    if cosine < -1.0 + 1e-12:
        side = np.cross(start, np.eye(3)[np.abs(start).argmin()])
        side /= np.linalg.norm(side)
        half_turn: Float64Array = 2.0 * np.outer(side, side) - np.eye(3)
        return half_turn
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Float64Array = np.eye(3) + cross + cross @ cross / (1.0 + cosine)
    return turn
