"""Nodes as values, however deep their tree: equality, hash, `repr` and pickling without recursion.

What dataclasses generate calls itself once per level, so it fails some hundred levels down. These walk the
tree with a list of their own. A subtree that is used in several places is compared, hashed and pickled once.
"""

from dataclasses import fields
from typing import TYPE_CHECKING, Any

from blobtree.nodes.traversal import postorder

if TYPE_CHECKING:
    from blobtree.nodes.tree import Node

HASH = "_hash"
"""Where a node keeps its hash once that has been asked for; it is not part of the value."""

References = dict[str, int | tuple[int, ...]]
Record = tuple[type["Node"], dict[str, Any], References]
"""A node's type, its own parameters, and the places among the records of what its other fields hold."""


def own_parameters(node: "Node") -> dict[str, Any]:
    """The fields of `node` that hold no other nodes, in order."""
    held = set(map(id, node.children))
    return {name: value for name, value in _fields(node).items() if not _holds_nodes(value, held)}


def equal(first: "Node", second: "Node") -> bool:
    """Whether two trees are of the same types, parameters and structure."""
    pending = [(first, second)]
    seen: set[tuple[int, int]] = set()
    while pending:
        a, b = pending.pop()
        if a is b or (id(a), id(b)) in seen:
            continue
        seen.add((id(a), id(b)))
        if type(a) is not type(b) or len(a.children) != len(b.children):
            return False
        if len({vars(node)[HASH] for node in (a, b) if HASH in vars(node)}) == 2:
            return False
        if own_parameters(a) != own_parameters(b):
            return False
        pending.extend(zip(a.children, b.children, strict=True))
    return True


def hash_of(root: "Node") -> int:
    """Hash of a tree, the same for equal ones; every node keeps its own, so a larger tree costs little."""
    for node in postorder(root, into=lambda node: HASH not in vars(node)):
        if HASH not in vars(node):
            below = tuple(vars(child)[HASH] for child in node.children)
            value = hash((type(node).__qualname__, tuple(own_parameters(node).values()), below))
            object.__setattr__(node, HASH, value)
    result: int = vars(root)[HASH]
    return result


def text_of(root: "Node") -> str:
    """A tree as the Python expression that makes it."""
    pieces: list[str] = []
    pending: list[Node | str] = [root]
    while pending:
        item = pending.pop()
        if isinstance(item, str):
            pieces.append(item)
        else:
            pending.extend(reversed(_tokens(item)))
    return "".join(pieces)


def to_records(root: "Node") -> list[Record]:
    """A tree as flat records, each node behind those that it uses; the last one is the root."""
    order = postorder(root)
    places = {id(node): place for place, node in enumerate(order)}
    records: list[Record] = []
    for node in order:
        own = own_parameters(node)
        references: References = {}
        for name, value in _fields(node).items():
            if name not in own:
                references[name] = (
                    tuple(places[id(item)] for item in value)
                    if isinstance(value, tuple)
                    else places[id(value)]
                )
        records.append((type(node), own, references))
    return records


def from_records(records: list[Record]) -> "Node":
    """The tree that `to_records` took apart."""
    nodes: list[Node] = []
    for kind, own, references in records:
        operands = {
            name: nodes[places] if isinstance(places, int) else tuple(nodes[place] for place in places)
            for name, places in references.items()
        }
        nodes.append(kind(**own, **operands))
    return nodes[-1]


def _fields(node: "Node") -> dict[str, Any]:
    return {field.name: getattr(node, field.name) for field in fields(node)}  # type: ignore[arg-type]  # every kind of node is a dataclass


def _holds_nodes(value: Any, held: set[int]) -> bool:
    return id(value) in held or (isinstance(value, tuple) and any(id(item) in held for item in value))


def _tokens(node: "Node") -> list["Node | str"]:
    """The text of one node, in order, with the nodes that stand in it."""
    own = own_parameters(node)
    tokens: list[Node | str] = [f"{type(node).__qualname__}("]
    for number, (name, value) in enumerate(_fields(node).items()):
        tokens.append(f"{', ' if number else ''}{name}=")
        if name in own:
            tokens.append(repr(value))
        elif isinstance(value, tuple):
            tokens.append("(")
            for item in value:
                tokens += [item, ", "]
            tokens[-1] = ",)" if len(value) == 1 else ")"
        else:
            tokens.append(value)
    return [*tokens, ")"]
