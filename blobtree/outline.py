"""A tree as indented text, one node a line."""

from dataclasses import fields
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .tree import Node


def outline(root: "Node") -> str:
    """`root` and what is below it, operands indented below their operator."""
    lines: list[str] = []
    pending: list[tuple[Node, int]] = [(root, 0)]
    while pending:
        node, depth = pending.pop()
        lines.append("  " * depth + _line(node))
        pending.extend((child, depth + 1) for child in reversed(node.children))
    return "\n".join(lines)


def _line(node: "Node") -> str:
    """The node's name and its own parameters, other nodes left out."""
    own = {field.name: getattr(node, field.name) for field in fields(node)}  # type: ignore[arg-type]
    held = set(map(id, node.children))
    shown = [f"{name}={value!r}" for name, value in own.items() if not _holds_nodes(value, held)]
    return f"{type(node).__name__}({', '.join(shown)})"


def _holds_nodes(value: Any, held: set[int]) -> bool:
    return id(value) in held or (isinstance(value, tuple) and any(id(item) in held for item in value))
