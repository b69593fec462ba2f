"""Walking a tree without recursion, so that its depth is limited by memory alone."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from blobtree.nodes.tree import Node

Result = TypeVar("Result")


def postorder(root: "Node", *, into: Callable[["Node"], bool] = lambda _node: True) -> list["Node"]:
    """Every distinct node object below and including `root`, children before parents.

    What lies below a node for which `into` is False is left out, unless it is reached by another way.
    """
    order: list[Node] = []
    seen: set[int] = set()
    pending: list[tuple[Node, bool]] = [(root, False)]
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


def branches(root: "Node") -> list["Node"]:
    """Every distinct node object that has children, below and including `root`, children before parents."""
    order: list[Node] = []
    seen: set[int] = set()
    pending: list[tuple[Node, bool]] = [(root, False)]
    while pending:
        node, children_done = pending.pop()
        if children_done:
            order.append(node)
        elif node.children and id(node) not in seen:
            seen.add(id(node))
            pending.append((node, True))
            pending.extend([(child, False) for child in reversed(node.children) if child.children])
    return order


def fold(root: "Node", combine: Callable[["Node", list[Result]], Result]) -> Result:
    """Value of `root`, a node's being `combine(node, values of its children)`; shared nodes count once."""
    values: dict[int, Result] = {}
    for node in postorder(root):
        values[id(node)] = combine(node, [values[id(child)] for child in node.children])
    return values[id(root)]
