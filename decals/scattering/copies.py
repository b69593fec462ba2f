"""`on_copies`: the decals of one copy of a repeat on all of its copies."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import ISO, Node, PolarRepeat, Repeat
from blobtree._typing import Float32Array, Float64Array
from blobtree.nodes.tree import Transform
from blobtree.validation import describe
from decals.errors import InvalidDecals, InvalidScattering
from decals.model import Decals
from decals.scattering.domain import MAX_PARTICLES
from decals.surfaces.implicit import ImplicitSurface
from decals.validation import instance

ON_SURFACE = 1e-3
"""Distance from the surface, in radii of a decal, up to which the decal keeps its place and its normal."""

FLOAT_STEPS = 4.0
"""The same in steps of float32 at the decal, which are larger far from the origin."""

OUTWARD = 4.0
"""Length of a step along a decal's normal, in these distances. It ends outside or in another copy."""

MAX_DISTANCE = 0.5
"""Distance from the surface, in radii, beyond which a decal is left out: a blend or a copy covers it."""

RIGID = 1e-6
"""Largest difference from 1 of the squared scales of a map that only moves, turns or mirrors."""


def on_copies(decals: Decals, repeat: Node) -> Decals:
    """Return the decals of a repeat's child on all copies of the child, copy by copy.

    The decals of each copy are those of the child, moved as the copy is. On a mirrored copy, places and the
    tops of images are mirrored; images are not. Where copies blend, decals are projected onto the blend.
    Decals inside the blend, in the crease between united copies, or between solids that touch are left out.
    For a grid, a repeat of repeats, call it for the inner one first.

    Parameters
    ----------
    decals
        Decals on `repeat.child`, such as those of `scatter`. If the repeat is below transforms, the child is
        below them too.
    repeat
        A `Repeat` or a `PolarRepeat`, which may be below transforms. Endless repeats have no number of
        copies.

    Returns
    -------
    Decals
        ``n`` decals of each copy, without those that lie inside another copy.

    Raises
    ------
    InvalidDecals
        `decals` are not `Decals`.
    InvalidScattering
        `repeat` is another node, a transform gives its copies different shapes, or there would be more than
        100,000,000 decals.
    InvalidMesh
        The repeat has no surface.

    See Also
    --------
    decals.scatter : of a repeat itself, covers each copy with decals of its own.

    Examples
    --------
    >>> import blobtree, decals
    >>> ball = blobtree.Point((0, 0, 0), radius=1.0)
    >>> marks = decals.scatter(ball, count=40)
    >>> row = blobtree.Repeat(ball, (5, 0, 0), 4)
    >>> everywhere = decals.scattering.on_copies(marks, row)
    >>> len(everywhere), (everywhere.positions[40] - marks.positions[0]).round(3).tolist()
    (160, [5.0, 0.0, 0.0])
    """
    instance("decals", decals, Decals, InvalidDecals, "scatter returns some")
    count = _copy_count(repeat)
    if count is None:
        raise InvalidScattering(f"repeat: expected a Repeat or a PolarRepeat, got {describe(repeat)}")
    if len(decals) * count > MAX_PARTICLES:
        raise InvalidScattering(
            f"decals: expected at most {MAX_PARTICLES:,} on all copies, got {len(decals):,} on each of "
            f"{count:,}; take fewer"
        )
    copies = Decals.concatenate(_moved(decals, matrix) for matrix in _placements(repeat))
    if len(copies) == 0:
        return copies
    slack = ON_SURFACE * copies.radii + FLOAT_STEPS * np.spacing(np.abs(copies.positions).max(axis=1))
    stays = _on_surface(repeat, copies.positions, slack)
    visible = repeat(copies.positions + OUTWARD * slack[:, None] * copies.normals) < ISO
    unmoved = np.flatnonzero(stays & visible)
    off = np.flatnonzero(~stays)
    if len(off) == 0:
        return copies[unmoved]
    moved = copies[off]
    positions, normals = ImplicitSurface(repeat).project(moved.positions)
    near = np.linalg.norm(positions - moved.positions, axis=1) <= MAX_DISTANCE * moved.radii
    kept = np.flatnonzero(near & _on_surface(repeat, positions, slack[off]))
    moved = moved[kept].replace(positions=positions[kept], normals=normals[kept])
    order = np.argsort(np.concatenate([unmoved, off[kept]]))
    return Decals.concatenate([copies[unmoved], moved])[order]


def on_all_copies(decals: Decals, tree: Node) -> Decals:
    """Return the decals of `one_copy` of a tree on all its copies."""
    for repeat in reversed(_repeats(tree)[0]):
        decals = on_copies(decals, repeat)
    return decals


def has_copies(tree: Node) -> bool:
    """Return True for a repeat, also one below transforms."""
    return _copy_count(tree) is not None


def one_copy(tree: Node) -> tuple[Node, int]:
    """Return one of the copies that a tree consists of, and their number; for another tree, itself and 1.

    Repeats count whose parents are repeats and transforms alone. The copy is below these transforms.
    """
    repeats, one = _repeats(tree)
    return one, math.prod(_copy_count(repeat) or 1 for repeat in repeats)


def _repeats(tree: Node) -> tuple[list[Node], Node]:
    """Return the repeats of a tree, the outermost first, and one copy.

    The first repeat is the tree. Each next one is the one before with its outermost repeat replaced by one
    copy of that. The copy is what remains.
    """
    repeats = list[Node]()
    while True:
        transforms, node = _below_transforms(tree)
        if not isinstance(node, Repeat | PolarRepeat):
            return repeats, tree
        repeats.append(tree)
        tree = node.child
        for transform in reversed(transforms):
            tree = replace(transform, child=tree)


def _copy_count(tree: Node) -> int | None:
    """Return the number of copies of the repeat that a tree is below its transforms; None without one."""
    node = _below_transforms(tree)[1]
    return node.count if isinstance(node, Repeat | PolarRepeat) else None


def _below_transforms(tree: Node) -> tuple[list[Transform], Node]:
    """Return the transforms at the root of a tree, and the node below them."""
    transforms = list[Transform]()
    while isinstance(tree, Transform):
        transforms.append(tree)
        tree = tree.child
    return transforms, tree


def _on_surface(repeat: Node, positions: Float32Array, slack: Float32Array) -> NDArray[np.bool_]:
    """Return True for points within a distance of the surface; not for those in creases between copies."""
    gaps = np.abs(repeat(positions) - ISO)
    slopes = np.linalg.norm(repeat.gradient(positions), axis=1)
    reached: NDArray[np.bool_] = gaps <= slack * slopes
    return reached


def _placements(tree: Node) -> list[Float64Array]:
    """Return the affine maps (3, 4) of one copy of a repeat to all, that of the copy itself first."""
    transforms, repeat = _below_transforms(tree)
    assert isinstance(repeat, Repeat | PolarRepeat)
    outer = np.eye(4)
    for transform in transforms:
        outer = outer @ _whole(transform.matrix)
    inverse = np.linalg.inv(outer)
    matrices = [
        np.eye(3, 4)
        if copy is repeat.child or not isinstance(copy, Transform)
        else (outer @ _whole(copy.matrix) @ inverse)[:3]
        for copy in repeat.expanded.children
    ]
    squares = np.array([matrix[:, :3] @ matrix[:, :3].T for matrix in matrices])
    if np.abs(squares - np.eye(3)).max() > RIGID:
        raise InvalidScattering(
            "repeat: expected copies of one shape, got some that a transform scales in other directions than "
            "the first; scale by one factor"
        )
    return matrices


def _whole(matrix: ArrayLike) -> Float64Array:
    """Return an affine map (3, 4) with the last row of its matrix."""
    return np.vstack([np.asarray(matrix, np.float64), (0.0, 0.0, 0.0, 1.0)])


def _moved(decals: Decals, matrix: Float64Array) -> Decals:
    """Return decals under a rigid map (3, 4), which may be a reflection."""
    linear, offset = matrix[:, :3], matrix[:, 3]
    normals, tops = decals.normals @ linear.T, decals.bitangents @ linear.T
    return decals.replace(
        positions=decals.positions @ linear.T + offset, normals=normals, tangents=np.cross(tops, normals)
    )
