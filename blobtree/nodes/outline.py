"""A tree as indented text, one node a line."""

from typing import TYPE_CHECKING

from blobtree.nodes.identity import own_parameters

if TYPE_CHECKING:
    from blobtree.nodes.tree import Node

DEEPEST_INDENT = 32
"""Levels that indentation shows; below them a number does, or a deep tree would be megabytes of blanks."""


def outline(root: "Node") -> str:
    """`root` and what is below it, operands indented below their operator."""
    lines: list[str] = []
    pending: list[tuple[Node, int]] = [(root, 0)]
    while pending:
        node, depth = pending.pop()
        lines.append(_indent(depth) + _line(node))
        pending.extend((child, depth + 1) for child in reversed(node.children))
    return "\n".join(lines)


def _indent(depth: int) -> str:
    """What stands before a node `depth` levels below the root."""
    return "  " * min(depth, DEEPEST_INDENT) + (f"[{depth}] " if depth > DEEPEST_INDENT else "")


def _line(node: "Node") -> str:
    """The node's name and its own parameters, other nodes left out."""
    shown = [f"{name}={value!r}" for name, value in own_parameters(node).items()]
    return f"{type(node).__name__}({', '.join(shown)})"
