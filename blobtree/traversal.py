"""Walks over a tree without recursion, so that memory alone limits its depth."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar


class HasChildren(Protocol):
    """A node of any tree."""

    @property
    def children(self) -> Sequence[Any]:
        """Nodes of the same tree, from left to right."""


AnyNode = TypeVar("AnyNode", bound=HasChildren)
Result = TypeVar("Result")


def postorder(root: AnyNode, *, into: Callable[[AnyNode], bool] = lambda _node: True) -> list[AnyNode]:
    """Return every distinct node object from `root` down, children before parents.

    Nodes below a node for which `into` is False are left out, unless another path leads to them.
    """
    order: list[AnyNode] = []
    seen: set[int] = set()
    pending: list[tuple[AnyNode, bool]] = [(root, False)]
    while pending:
        node, children_done = pending.pop()
        if children_done:
            order.append(node)
        elif id(node) not in seen:
            seen.add(id(node))
            children = node.children
            if children and into(node):
                pending.append((node, True))
                pending.extend([(child, False) for child in reversed(children)])
            else:
                order.append(node)
    return order


def branches(root: AnyNode) -> list[AnyNode]:
    """Return every distinct node object with children from `root` down, children before parents."""
    order: list[AnyNode] = []
    seen: set[int] = set()
    pending: list[tuple[AnyNode, bool]] = [(root, False)]
    while pending:
        node, children_done = pending.pop()
        if children_done:
            order.append(node)
        elif node.children and id(node) not in seen:
            seen.add(id(node))
            pending.append((node, True))
            pending.extend([(child, False) for child in reversed(node.children) if child.children])
    return order


def fold(root: AnyNode, combine: Callable[[AnyNode, list[Result]], Result]) -> Result:
    """Return the value of `root`; a node's value is `combine(node, values of its children)`.

    A shared node is combined once.
    """
    values: dict[int, Result] = {}
    for node in postorder(root):
        values[id(node)] = combine(node, [values[id(child)] for child in node.children])
    return values[id(root)]
