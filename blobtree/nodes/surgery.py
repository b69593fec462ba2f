"""Surgery on trees: add, remove, duplicate and join branches, each step a new tree.

A branch is a node that is an operand of a combination, with the maps above it; a `Path` leads to it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array
from blobtree.declare.claims import Support
from blobtree.errors import InvalidNode
from blobtree.nodes.node import Node
from blobtree.nodes.paths import (
    Path,
    common_transform,
    mapped,
    moved,
    node_at,
    nodes_along,
    primitive_at,
    primitives_around,
    resized,
    with_node,
    world_matrix,
    world_transform,
)
from blobtree.nodes.tree import (
    Difference,
    Intersection,
    Ricci,
    Sum,
    Transform,
    Union,
)
from blobtree.validation import describe, finite_vector, items

SOFTNESS = 3.0
"""Exponent of the Ricci blend that `Join.SOFT` makes: about half way from a sum to a union."""

GROWTH = 1e-3
"""Part of its radius by which a primitive grows in `dominant_primitive`."""


class Join(Enum):
    """How a branch joins the nodes beside it."""

    BLEND = "blend"
    SOFT = "soft union"
    UNION = "union"
    INTERSECTION = "intersection"
    DIFFERENCE = "difference"


JOIN_OF_KIND: dict[type[Node], Join] = {
    Sum: Join.BLEND,
    Ricci: Join.SOFT,
    Union: Join.UNION,
    Intersection: Join.INTERSECTION,
    Difference: Join.DIFFERENCE,
}


def combine(join: Join, first: Node, second: Node) -> Node:
    """Return two nodes as one; a difference takes the second away from the first."""
    match join:
        case Join.BLEND:
            return Sum((first, second))
        case Join.SOFT:
            return Ricci((first, second), exponent=SOFTNESS)
        case Join.UNION:
            return Union((first, second))
        case Join.INTERSECTION:
            return Intersection((first, second))
        case Join.DIFFERENCE:
            return Difference(first, second)


def add_node(tree: Node, path: Path, node: Node, join: Join) -> tuple[Node, Path]:
    """Join a new node to the branch at a path; the node is given in the space of that branch.

    Returns
    -------
    tuple[Node, Path]
        The new tree, and the path of the new node in it. A combination of the kind of `join` at the path, or
        just above it, takes the node as its last operand.
    """
    *above, _ = nodes_along(tree, path)
    if above and _takes_operand(above[-1], join):
        return add_operand(tree, path[:-1], node)
    return _join_at(tree, path, node, join)


def add_operand(tree: Node, path: Path, node: Node) -> tuple[Node, Path]:
    """Give the combination at a path one more operand, the last; return the tree and the operand's path."""
    parent: Any = node_at(tree, path)
    extended = replace(parent, operands=(*parent.operands, node))
    return with_node(tree, path, extended), (*path, len(parent.operands))


def remove_branch(tree: Node, path: Path) -> Node:
    """Return a tree without the branch at a path.

    A combination that keeps one operand becomes that operand. A difference without its solid and a map
    without its child are removed too.

    Raises
    ------
    InvalidNode
        Nothing would be left.
    """
    *above, _ = nodes_along(tree, path)
    while above:
        parent, step, path = above.pop(), path[-1], path[:-1]
        if parent.combines and not (_cuts(parent) and step == 0):
            others = _without_child(parent, step)
            if others is not None:
                return with_node(tree, path, others)
    raise InvalidNode("path: expected a part of a tree, got its last visible part; remove the object instead")


def without_branches(tree: Node, paths: Iterable[Path]) -> Node:
    """Return a tree without the branches at several paths; errors are those of `remove_branch`."""
    kept: dict[Path, Node | None] = dict.fromkeys(paths)
    above = {path[:depth] for path in kept for depth in range(len(path))}
    for path in sorted(above - kept.keys(), key=len, reverse=True):
        node: Node | None = node_at(tree, path)
        assert node is not None
        children = [kept.get((*path, step), child) for step, child in enumerate(node.children)]
        gone = [step for step, child in enumerate(children) if child is None]
        if not node.combines or len(gone) == len(children) or (_cuts(node) and 0 in gone):
            kept[path] = None if gone else with_node(node, (0,), _present(children[0]))
            continue
        for step, child in enumerate(children):
            if child is not None:
                node = with_node(node, (step,), child)
        for step in reversed(gone):
            node = None if node is None else _without_child(node, step)
        kept[path] = node
    result = kept.get((), tree)
    if result is None:
        raise InvalidNode("paths: expected a part of a tree, got all of it; leave out one of them")
    return result


def _present(node: Node | None) -> Node:
    assert node is not None
    return node


def paths_after(before: Node, after: Node, paths: Iterable[Path]) -> tuple[Path, ...]:
    """Return the paths that lead, after an edit of a tree, to the nodes that paths led to before.

    Paths of removed nodes are left out.
    """
    return tuple(found for path in paths if (found := _path_after(before, after, path)) is not None)


def _path_after(before: Node, after: Node, path: Path) -> Path | None:
    node = node_at(before, path)
    try:
        at_path: Node | None = node_at(after, path)
    except InvalidNode:
        at_path = None
    if at_path is node:
        return path
    try:
        return path_of(after, node)
    except InvalidNode:
        same = at_path is not None and (type(at_path) is type(node) or _same_operands(at_path, node))
        return path if same else None


def _same_operands(one: Node, other: Node) -> bool:
    """Return True for two combinations of the very same operands."""
    pairs = zip(one.children, other.children, strict=False)
    return len(one.children) == len(other.children) > 1 and all(a is b for a, b in pairs)


def move_branch(tree: Node, path: Path, target: Path) -> tuple[Node, Path]:
    """Move the branch at a path to another place; it stays where it is in the world, but for warps.

    A combination at the target takes it as its last operand. Another node there gets it as its next sibling,
    if its parent is a combination, else the two are blended.

    Returns
    -------
    tuple[Node, Path]
        The new tree, and the path of the branch in it.

    Raises
    ------
    InvalidNode
        The target lies in the branch, or nothing but the branch would be left.
    """
    branch, place = node_at(tree, path), _operand_place(tree, target)
    path, target = tuple(path), tuple(target)
    if target[: len(path)] == path:
        raise InvalidNode(f"target: expected a place outside the branch {path}, got {target}")
    placed = _placed(branch, _nodes_above(tree, path), _nodes_above(tree, place))
    depth = len(place) - 1
    if place == target and path[: len(target)] == target:
        old = (*target, 0, *path[len(target) :])
    elif place != target and path[:depth] == place[:depth] and len(path) > depth and path[depth] >= place[-1]:
        old = (*path[:depth], path[depth] + 1, *path[depth + 1 :])
    else:
        old = path
    rest = remove_branch(_inserted(tree, target, place, placed), old)
    return rest, path_of(rest, placed)


def move_branch_into(source: Node, path: Path, tree: Node, target: Path) -> tuple[Node | None, Node, Path]:
    """Move the branch at a path of one tree to a place in another one; see `move_branch`.

    Returns
    -------
    tuple[Node | None, Node, Path]
        What is left of the first tree, None for nothing; the second tree with the branch; and the path in it
        that leads to the same node as before.
    """
    branch, place = node_at(source, path), _operand_place(tree, target)
    path, target = tuple(path), tuple(target)
    placed = _placed(branch, _nodes_above(source, path), _nodes_above(tree, place))
    found = (*target, 1) if place == target else place
    try:
        rest: Node | None = remove_branch(source, path)
    except InvalidNode:
        rest = None
    return rest, _inserted(tree, target, place, placed), found if placed is branch else (*found, 0)


def _operand_place(tree: Node, target: Path) -> Path:
    """Return the path of a new operand at a target; the target itself if the two are blended there."""
    *above, node = nodes_along(tree, target)
    if node.combines and not _cuts(node):
        return (*target, len(node.children))
    if above and above[-1].combines and not _cuts(above[-1]):
        return (*target[:-1], target[-1] + 1)
    return tuple(target)


def _inserted(tree: Node, target: Path, place: Path, placed: Node) -> Node:
    """Return a tree with another node at an operand's place, or blended with the node at the target."""
    if place == target:
        return with_node(tree, target, combine(Join.BLEND, node_at(tree, target), placed))
    parent: Any = node_at(tree, place[:-1])
    operands = (*parent.children[: place[-1]], placed, *parent.children[place[-1] :])
    return with_node(tree, place[:-1], replace(parent, operands=operands))


def _nodes_above(tree: Node, path: Path) -> list[Node]:
    """Return the nodes above a place, the root first."""
    return list(nodes_along(tree, path[:-1])) if path else []


def _placed(branch: Node, old: Sequence[Node], new: Sequence[Node]) -> Node:
    """Return a branch as a node below other nodes, so that it stays where it is in the world."""
    differ = (i for i, pair in enumerate(zip(old, new, strict=False)) if pair[0] is not pair[1])
    shared = next(differ, min(len(old), len(new)))
    change = np.linalg.solve(*(common_transform(nodes[shared:], "place") for nodes in (new, old)))
    return branch if np.allclose(change, np.eye(4)) else branch.transform(change)


def path_of(tree: Node, wanted: Node) -> Path:
    """Return a path of a node in a tree; `InvalidNode` if it is not in it."""
    pending: list[tuple[Path, Node]] = [((), tree)]
    while pending:
        found, node = pending.pop()
        if node is wanted:
            return found
        pending.extend(((*found, step), child) for step, child in enumerate(node.children))
    raise InvalidNode("expected a node of the tree; it was removed with another one")


def group_operands(tree: Node, path: Path, steps: Sequence[int]) -> tuple[Node, Path]:
    """Put operands of the combination at a path under one of the same kind, where the first one was.

    The shape stays, so only sums, Ricci blends, unions and intersections can be grouped.

    Returns
    -------
    tuple[Node, Path]
        The new tree, and the path of the group in it.

    Raises
    ------
    InvalidNode
        The node at the path is no such combination, or has no two such operands and another one.
    """
    parent: Any = node_at(tree, path)
    given = items(steps) or ()
    if not all(isinstance(step, int) for step in given):
        raise InvalidNode(f"steps: expected indices of operands, got {describe(steps)}")
    chosen = sorted(set(given))
    if JOIN_OF_KIND.get(type(parent), Join.DIFFERENCE) is Join.DIFFERENCE:
        raise InvalidNode(
            f"path: expected a sum, Ricci blend, union or intersection, got a {type(parent).__name__}"
        )
    count = len(parent.operands)
    if not 2 <= len(chosen) < count or chosen[0] < 0 or chosen[-1] >= count:
        raise InvalidNode(f"steps: expected 2 to {count - 1} of {count} operands, got {chosen}")
    group = replace(parent, operands=tuple(parent.operands[step] for step in chosen))
    operands = [node for step, node in enumerate(parent.operands) if step not in chosen]
    operands.insert(chosen[0], group)
    return with_node(tree, path, replace(parent, operands=tuple(operands))), (*path, chosen[0])


def duplicate_branch(tree: Node, path: Path, offset: ArrayLike) -> tuple[Node, Path]:
    """Add a copy of the branch at a path, moved by `offset` (3,) in the world.

    The copy joins as the original does. A copy of a difference's solid or tool, or of an intersection's
    operand, is blended with the original, so that it is cut, or cuts, too.

    Returns
    -------
    tuple[Node, Path]
        The new tree, and the path of the copy in it.
    """
    local_offset = np.linalg.solve(world_matrix(tree, path), finite_vector("offset", offset))
    return _join_copy(tree, path, moved(node_at(tree, path), local_offset))


def mirror_branch(tree: Node, path: Path, axis: int = 0) -> tuple[Node, Path]:
    """Add a mirror image of the branch at a path, beyond the world's plane through 0 across an axis.

    It joins as the copy of `duplicate_branch` does. Returns the new tree, and the path of the image in it.
    """
    mirror, world = np.eye(4), world_transform(tree, path)
    mirror[axis, axis] = -1.0
    return _join_copy(tree, path, mapped(node_at(tree, path), np.linalg.solve(world, mirror @ world)))


def _join_copy(tree: Node, path: Path, copy: Node) -> tuple[Node, Path]:
    *above, _ = nodes_along(tree, path)
    if above and isinstance(above[-1], Sum | Ricci | Union):
        return add_operand(tree, path[:-1], copy)
    return _join_at(tree, path, copy, Join.BLEND)


def rejoin_branch(tree: Node, path: Path, join: Join) -> tuple[Node, Path]:
    """Join the branch at a path to the nodes beside it in another way.

    The other nodes stay joined as they are. A difference takes the branch away from them.

    Returns
    -------
    tuple[Node, Path]
        The new tree, and the path in it that leads to the same node as before.

    Raises
    ------
    InvalidNode
        The branch has no nodes beside it.
    """
    branch = branch_path(tree, path)
    node = node_at(tree, branch)
    others = _without_child(node_at(tree, branch[:-1]), branch[-1]) if branch else None
    if others is None:
        raise InvalidNode("path: expected a branch with others beside it, got one that is alone in its tree")
    joined, new_path = _join_at(with_node(tree, branch[:-1], others), branch[:-1], node, join)
    return joined, (*new_path, *path[len(branch) :])


def branch_path(tree: Node, path: Path) -> Path:
    """Shorten a path to the operand of a combination: the maps above a primitive belong to its branch."""
    *above, _ = nodes_along(tree, path)
    while above and not above.pop().combines:
        path = path[:-1]
    return path


def world_space_path(tree: Node, path: Path) -> Path:
    """Shorten a path to its first node that is no combination: that node lies in the world's space."""
    for depth, node in enumerate(nodes_along(tree, path)):
        if not node.combines:
            return path[:depth]
    return path


def join_of(tree: Node, path: Path) -> Join | None:
    """Return how the branch at a path joins the nodes beside it, None if no `Join` says it.

    In a difference the tool joins, the solid does not.
    """
    path = branch_path(tree, path)
    if not path or (join := JOIN_OF_KIND.get(type(node_at(tree, path[:-1])))) is None:
        return None
    return None if join is Join.DIFFERENCE and path[-1] == 0 else join


def dominant_primitive(tree: Node, point: ArrayLike) -> Path:
    """Return the path of the primitive whose growth would change the field most at a surface point (3,).

    In a hole that is the tool of a difference, although its field is not the highest there.
    """
    points: Float32Array = np.array([finite_vector("point", point)], np.float32)
    value = float(tree(points)[0])

    def sensitivity(path: Path) -> float:
        grown = with_node(tree, path, resized(primitive_at(tree, path), 1.0 + GROWTH))
        return abs(float(grown(points)[0]) - value)

    return max(primitives_around(tree, points), key=sensitivity)


def same_structure(first: Node, second: Node) -> bool:
    """Return True if paths lead to the same parts of two trees; `Transform` nodes do not count."""
    return _structure(first) == _structure(second)


def _structure(tree: Node) -> list[tuple[type[Node], int]]:
    """Kinds of nodes and their numbers of children, from the root down."""
    kinds: list[tuple[type[Node], int]] = []
    pending = [tree]
    while pending:
        node = pending.pop()
        if not isinstance(node, Transform):
            kinds.append((type(node), len(node.children)))
        pending.extend(reversed(node.children))
    return kinds


def _join_at(tree: Node, path: Path, node: Node, join: Join) -> tuple[Node, Path]:
    """Join a node to the one at a path; a combination of that kind takes it as its last operand."""
    first = node_at(tree, path)
    if _takes_operand(first, join):
        return add_operand(tree, path, node)
    return with_node(tree, path, combine(join, first, node)), (*path, 1)


def _takes_operand(node: Node, join: Join) -> bool:
    """Return True if one more operand of `node` is joined by `join`."""
    alike = not isinstance(node, Ricci) or node.exponent == SOFTNESS
    return join is not Join.DIFFERENCE and JOIN_OF_KIND.get(type(node)) is join and alike


def _cuts(node: Node) -> bool:
    """Return True if the result is the first operand, changed by the second."""
    return node.operator is not None and node.operator.support is Support.LEFT


def _without_child(parent: Node, step: int) -> Node | None:
    """Return a combination without one of its children, None if it had no other."""
    if len(parent.children) > 1 and hasattr(parent, "without"):  # it has parameters of each operand
        left: Node = parent.without(step)
        return left
    others = (*parent.children[:step], *parent.children[step + 1 :])
    if len(others) > 1:
        return replace(parent, operands=others)  # type: ignore[type-var]  # every node is a dataclass
    return others[0] if others else None
