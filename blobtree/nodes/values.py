"""Nodes as values: equality, hashes, `repr` and pickling without recursion, for trees of any depth.

The methods that dataclasses generate recurse once per level, so they fail some hundred levels down. These
functions walk the tree with a list. A shared subtree is compared, hashed and pickled once.
"""

from collections.abc import Callable
from dataclasses import Field
from itertools import chain
from operator import attrgetter
from typing import Annotated, Any, TypeVar, get_origin, get_type_hints

from blobtree.declare.parameters import OPTIONAL, fields_of
from blobtree.errors import UnknownKind
from blobtree.identity import content_hash
from blobtree.tape.program import ProgramNode, postorder

HASH = "_hash"
CONTENT_HASH = "_content_hash"
"""Attributes that cache a node's hashes; they are not part of the value."""

Cached = TypeVar("Cached", int, str)

References = dict[str, int | tuple[int, ...]]
Record = tuple[type[ProgramNode], dict[str, Any], References]
"""A node's type, its parameters, and the indices of the records of its operands."""


def left_out(field: "Field[Any]", value: Any) -> bool:
    """Return True if texts and files leave out a field with this value."""
    return OPTIONAL in field.metadata and bool(value == field.default)


_OPERANDS: dict[type, tuple[str, ...]] = {}


def operand_names(kind: type) -> tuple[str, ...]:
    """Return the names of a class's fields that hold operands: those that declare no parameter."""
    if kind not in _OPERANDS:
        hints = get_type_hints(kind, include_extras=True)
        names = (field.name for field in fields_of(kind))
        _OPERANDS[kind] = tuple(name for name in names if get_origin(hints[name]) is not Annotated)
    return _OPERANDS[kind]


def operands_of(node: ProgramNode) -> dict[str, tuple[Any, ...]]:
    """Return the operands of `node` by the names of their fields."""
    values = {name: getattr(node, name) for name in operand_names(type(node))}
    return {name: value if isinstance(value, tuple) else (value,) for name, value in values.items()}


_CHILDREN: dict[type, Callable[[Any], tuple[Any, ...]]] = {}


def children_of(node: ProgramNode) -> tuple[Any, ...]:
    """Return the operands of `node`, from left to right."""
    kind = type(node)
    if kind not in _CHILDREN:
        _CHILDREN[kind] = _children_reader(kind)
    return _CHILDREN[kind](node)


def _children_reader(kind: type) -> Callable[[Any], tuple[Any, ...]]:
    names, hints = operand_names(kind), get_type_hints(kind)
    several = [get_origin(hints[name]) is tuple for name in names]
    if several == [True] or (len(names) > 1 and not any(several)):
        return attrgetter(*names)
    if several == [False]:
        (name,) = names
        return lambda node: (getattr(node, name),)
    return lambda node: tuple(chain.from_iterable(operands_of(node).values()))


def parameter_values(node: ProgramNode) -> dict[str, Any]:
    """Return the fields of `node` that hold no other nodes, in order."""
    operands = operand_names(type(node))
    return {name: value for name, value in _fields(node).items() if name not in operands}


def equal(first: ProgramNode, second: ProgramNode) -> bool:
    """Return True if two trees have the same types, parameters and structure."""
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
        if parameter_values(a) != parameter_values(b):
            return False
        pending.extend(zip(a.children, b.children, strict=True))
    return True


def hash_of(root: ProgramNode) -> int:
    """Return the hash of a tree; every node caches its own, so a larger tree costs little."""

    def own(node: ProgramNode) -> int:
        below = tuple(vars(child)[HASH] for child in node.children)
        return hash((type(node).__qualname__, tuple(parameter_values(node).values()), below))

    return _folded(root, HASH, own)


def content_hash_of(root: ProgramNode) -> str:
    """Return the content hash of a tree, see `blobtree.content_hash`; every node caches its own.

    Parameters at their defaults that texts leave out do not count, so later releases may add some.
    """

    def own(node: ProgramNode) -> str:
        kind: Any = type(node)
        given = {name: value for name, value in _shown_fields(node).items() if name in parameter_values(node)}
        below = {
            name: [vars(operand)[CONTENT_HASH] for operand in operands]
            for name, operands in operands_of(node).items()
        }
        return content_hash((kind.content_key(), given, below))

    return _folded(root, CONTENT_HASH, own)


def _folded(root: ProgramNode, name: str, own: Callable[[ProgramNode], Cached]) -> Cached:
    """Return a value of a tree that each node computes from those of its operands, and keeps under a name."""
    for node in postorder(root, into=lambda node: name not in vars(node)):
        if name not in vars(node):
            object.__setattr__(node, name, own(node))
    value: Cached = vars(root)[name]
    return value


def text_of(root: ProgramNode) -> str:
    """Return a tree as the Python expression that constructs it."""
    pieces: list[str] = []
    pending: list[ProgramNode | str] = [root]
    while pending:
        item = pending.pop()
        if isinstance(item, str):
            pieces.append(item)
        else:
            pending.extend(reversed(_tokens(item)))
    return "".join(pieces)


def to_records(root: ProgramNode) -> list[Record]:
    """Return a tree as flat records, each behind those of its operands; the last is the root."""
    order = postorder(root)
    indices = {id(node): place for place, node in enumerate(order)}
    records: list[Record] = []
    for node in order:
        references: References = {}
        for name, operands in operands_of(node).items():
            places = tuple(indices[id(operand)] for operand in operands)
            references[name] = places if isinstance(getattr(node, name), tuple) else places[0]
        records.append((type(node), parameter_values(node), references))
    return records


def from_records(records: list[Record]) -> ProgramNode:
    """Return the tree of records from `to_records`.

    Raises
    ------
    UnknownKind
        A kind has other parameters than when the records were made.
    """
    nodes: list[ProgramNode] = []
    for kind, values, references in records:
        operands = {
            name: nodes[indices] if isinstance(indices, int) else tuple(nodes[place] for place in indices)
            for name, indices in references.items()
        }
        try:
            nodes.append(kind(**values, **operands))
        except TypeError as error:
            raise UnknownKind(
                f"{kind.__name__}: expected the parameters {', '.join(f.name for f in fields_of(kind))}, got "
                f"{', '.join(values | operands)}; the pickle was written with another definition of it"
            ) from error
    return nodes[-1]


def _fields(node: ProgramNode) -> dict[str, Any]:
    return {field.name: getattr(node, field.name) for field in fields_of(type(node))}


def _shown_fields(node: ProgramNode) -> dict[str, Any]:
    """Return the fields of a node that texts show."""
    values = _fields(node)
    return {f.name: values[f.name] for f in fields_of(type(node)) if not left_out(f, values[f.name])}


def _tokens(node: ProgramNode) -> list[ProgramNode | str]:
    """Return the text of one node in order, with its operands in place of their texts."""
    values = parameter_values(node)
    tokens: list[ProgramNode | str] = [f"{type(node).__qualname__}("]
    for number, (name, value) in enumerate(_shown_fields(node).items()):
        tokens.append(f"{', ' if number else ''}{name}=")
        if name in values:
            tokens.append(repr(value))
        elif isinstance(value, tuple):
            tokens.append("(")
            for item in value:
                tokens += [item, ", "]
            tokens[-1] = ",)" if len(value) == 1 else ")"
        else:
            tokens.append(value)
    return [*tokens, ")"]


DEEPEST_INDENT = 32
"""Levels that indentation shows; deeper levels are numbered, to limit the text of deep trees."""


def outline(root: ProgramNode) -> str:
    """Return one line per node, operands indented below their operator."""
    lines: list[str] = []
    pending: list[tuple[ProgramNode, int]] = [(root, 0)]
    while pending:
        node, depth = pending.pop()
        lines.append(_indent(depth) + _line(node))
        pending.extend((child, depth + 1) for child in reversed(node.children))
    return "\n".join(lines)


def _indent(depth: int) -> str:
    """Return the indentation of a node `depth` levels below the root."""
    return "  " * min(depth, DEEPEST_INDENT) + (f"[{depth}] " if depth > DEEPEST_INDENT else "")


def _line(node: ProgramNode) -> str:
    """Return the node's name and its parameters, without its operands."""
    own = parameter_values(node)
    parts = [f"{name}={value!r}" for name, value in _shown_fields(node).items() if name in own]
    return f"{type(node).__name__}({', '.join(parts)})"
