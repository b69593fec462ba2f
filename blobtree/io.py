"""BlobTree ↔ JSON: a flat, versioned list of nodes, each naming its operands by their index in the list.

    {"format": "blobtree", "version": 1, "nodes": [
        {"type": "point", "center": [0, 0, 0], "radius": 1, "color": [0.8, 0.8, 0.8]},
        {"type": "custom_skeleton", "kind": "ring", "parameters": {"size": 1}, "radius": 1,
         "color": [0, 0, 1]},
        {"type": "sum", "operands": [0, 1]}]}

The last node is the root. Operands stand before the node that uses them, so a file can hold no cycle, a
shared subtree is written once, and depth costs no recursion. The record of a node follows from its class: the
`file_tag` is its type, and its fields are those of the dataclass. A custom node names its kind, which the
reading process must have defined. Older files call custom nodes "own skeleton" and "own operator"; they load
to equal trees.
"""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Union, cast, get_type_hints

import msgspec

from blobtree.declare.falloff import Falloff
from blobtree.declare.parameters import OPTIONAL, fields_of
from blobtree.declare.registry import CUSTOM_KINDS, CUSTOM_TAGS
from blobtree.errors import ImplicitDecalsError, InvalidFile, UnusableFile
from blobtree.files import read_file, write_atomically
from blobtree.json_errors import json_reason
from blobtree.nodes.attributes import Attributes, AttributeValue
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.node import Node
from blobtree.nodes.values import left_out, operand_names
from blobtree.tape.model import checked_tree
from blobtree.tape.program import postorder
from blobtree.validation import describe

VERSION: Literal[1] = 1

CustomValue = float | tuple[float, ...]


class NodeRecord(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="type", omit_defaults=True
):
    """One node in a file; fields that hold other nodes hold their indices instead."""

    node_kind: ClassVar[type[Node]]
    references: ClassVar[tuple[str, ...]] = ()

    def make(self, values: dict[str, Any]) -> Node:
        """Return the node with these values, in which nodes replace their indices."""
        return self.node_kind(**values)


class CustomRecord(NodeRecord, frozen=True):
    """A node of a custom kind, which must be defined."""

    kind: str
    values: dict[str, CustomValue] = msgspec.field(name="parameters")

    def make(self, values: dict[str, Any]) -> Node:
        """Return the node of its kind."""
        return _custom_node(self.node_kind, values)


def _record_type(kind: type[Node], tag: str, base: type[NodeRecord] = NodeRecord) -> type[NodeRecord]:
    """Return the record of a class of nodes, or of the custom kinds that derive from one."""
    hints = get_type_hints(kind)
    references, declared = operand_names(kind), [field.name for field in fields_of(kind)]
    types: list[Any] = [
        (name, (int if hints[name] is Node else tuple[int, ...]) if name in references else hints[name])
        for name in declared
    ]
    for place, field in enumerate(fields_of(kind)):
        if isinstance(field.default, Attributes):
            types[place] = (field.name, dict[str, AttributeValue], {})
        elif isinstance(field.default, Falloff):
            types[place] = (field.name, str, field.default.name)
        elif OPTIONAL in field.metadata:
            types[place] = (*types[place], field.default)
    common = [(name, hints[name]) for name in getattr(kind, "common", ()) if name not in declared]
    record: Any = msgspec.defstruct(
        f"{kind.__name__}Record",
        common + types,
        bases=(base,),
        namespace={"node_kind": kind, "references": references},
        tag=tag,
        frozen=True,
        module=__name__,
    )
    return cast("type[NodeRecord]", record)


RECORD_OF_KIND = {kind: _record_type(kind, tag) for tag, kind in NODE_KINDS.items()}
"""Records of the built-in classes of nodes."""

CUSTOM_RECORDS = {tag: _record_type(base, tag, CustomRecord) for tag, base in CUSTOM_TAGS.items()}
"""Records of custom nodes, by their tags."""

if TYPE_CHECKING:
    AnyRecord = NodeRecord
else:
    AnyRecord = Union[(*RECORD_OF_KIND.values(), *CUSTOM_RECORDS.values())]


class TreeFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole file, or the part of another file that holds a tree."""

    format: Literal["blobtree"]
    version: Literal[1]
    nodes: tuple[AnyRecord, ...]


def to_tree_file(root: Node) -> TreeFile:
    """Return the tree as records; raise `InvalidNode` if `root` is no tree."""
    checked_tree(root)
    order = postorder(root)
    index = {id(node): i for i, node in enumerate(order)}
    return TreeFile("blobtree", VERSION, tuple(_record_of(node, index) for node in order))


def from_tree_file(file: TreeFile) -> Node:
    """Return the tree that a file holds.

    Raises
    ------
    InvalidFile
        A node is invalid, or refers to a node that does not stand before it (a cycle); the message names it.
    """
    if not file.nodes:
        raise InvalidFile("nodes: expected at least one node, got none")
    nodes: list[Node] = []
    for index, record in enumerate(file.nodes):
        try:
            nodes.append(_node_of(record, nodes))
        except ImplicitDecalsError as error:
            raise InvalidFile(f"nodes[{index}] ({record.__struct_config__.tag}): {error}") from None
    return nodes[-1]


def to_json(root: Node) -> bytes:
    """Return a tree as JSON.

    Parameters
    ----------
    root : Node
        Root of the tree.

    Returns
    -------
    bytes
        UTF-8 text, which `from_json` reads.

    Raises
    ------
    InvalidNode
        `root` is not a node.

    Examples
    --------
    >>> from blobtree import Point, from_json, to_json
    >>> ball = Point((0, 0, 0), radius=1.0)
    >>> from_json(to_json(ball)) == ball
    True
    """
    return msgspec.json.format(msgspec.json.encode(to_tree_file(root)), indent=1)


def from_json(text: bytes | str) -> Node:
    """Return the tree in a JSON text.

    Parameters
    ----------
    text : bytes or str
        A text that `to_json` returned.

    Returns
    -------
    Node
        Root of the tree.

    Raises
    ------
    InvalidFile
        The text holds no valid tree, or names a custom kind that is not defined.

    Examples
    --------
    >>> from blobtree import from_json
    >>> from_json('{"format": "blobtree", "version": 1, "nodes": []}')
    Traceback (most recent call last):
    blobtree.errors.InvalidFile: nodes: expected at least one node, got none
    """
    try:
        file = msgspec.json.decode(text, type=TreeFile)
    except TypeError:
        raise InvalidFile(f"expected JSON as text or bytes, got {type(text).__name__}") from None
    except (msgspec.DecodeError, UnicodeError) as error:
        raise InvalidFile(f"not a BlobTree of version {VERSION}: {json_reason(error, text)}") from None
    except RecursionError:
        raise InvalidFile("not a BlobTree: nested too deeply") from None
    return from_tree_file(file)


def save(root: Node, path: str | os.PathLike[str]) -> None:
    """Write a tree to a JSON file. A failure leaves an existing file as it is.

    Parameters
    ----------
    root : Node
        Root of the tree.
    path : str or path-like
        Path of the file.

    Raises
    ------
    InvalidNode
        `root` is not a node.
    InvalidFile
        `path` is not the path of a file.
    UnusableFile
        The file cannot be written.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from blobtree import Point, load, save
    >>> path = pathlib.Path(tempfile.mkdtemp(), "ball.json")
    >>> save(Point((0, 0, 0), radius=1.0), path)
    >>> load(path)
    Point(center=(0.0, 0.0, 0.0), radius=1.0, color=(0.8, 0.8, 0.8))
    """
    write_atomically(_checked_path(path), to_json(root))


def load(path: str | os.PathLike[str]) -> Node:
    """Return the tree in a JSON file.

    Parameters
    ----------
    path : str or path-like
        Path of a file that `save` wrote.

    Returns
    -------
    Node
        Root of the tree.

    Raises
    ------
    InvalidFile
        The file holds no valid tree, or names a custom kind that is not defined.
    UnusableFile
        The file cannot be read; a `MissingFile` if it does not exist.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from blobtree import Point, load, save
    >>> path = pathlib.Path(tempfile.mkdtemp(), "ball.json")
    >>> save(Point((0, 0, 0), radius=1.0), path)
    >>> load(path) == Point((0, 0, 0), radius=1.0)
    True
    """
    path = _checked_path(path)
    try:
        return from_json(read_file(Path(path)))
    except OSError as error:
        raise UnusableFile.of(error, path, "read") from error
    except InvalidFile as error:
        raise InvalidFile(f"{path}: {error}") from None
    except ValueError:  # of the path; a text that is no tree is an InvalidFile
        raise InvalidFile(f"path: expected the path of a file, got {path!r}") from None


def _checked_path(path: str | os.PathLike[str]) -> str | os.PathLike[str]:
    if not isinstance(path, str | os.PathLike):
        raise InvalidFile(f"path: expected the path of a file, got {describe(path)}")
    return path


def _record_of(node: Node, index: dict[int, int]) -> NodeRecord:
    """Return the record of `node`, whose operands are replaced by their indices."""
    kind: Any = type(node)
    record_type = RECORD_OF_KIND.get(kind) or CUSTOM_RECORDS[kind.custom_tags[0]]
    defaults = {field.name for field in fields_of(type(node)) if left_out(field, getattr(node, field.name))}
    values = {name: getattr(node, name) for name in record_type.__struct_fields__ if name not in defaults}
    values |= {name: dict(value) for name, value in values.items() if isinstance(value, Attributes)}
    values |= {name: value.name for name, value in values.items() if isinstance(value, Falloff)}
    for name in record_type.references:
        operand = values[name]
        values[name] = (
            index[id(operand)] if isinstance(operand, Node) else tuple(index[id(node)] for node in operand)
        )
    return record_type(**values)


def _node_of(record: NodeRecord, earlier: list[Node]) -> Node:
    """Return the node of `record`, whose indices are replaced by the nodes that stand before it."""
    values = {name: getattr(record, name) for name in record.__struct_fields__}
    for name in record.references:
        indices = values[name]
        values[name] = (
            _operand(indices, earlier)
            if isinstance(indices, int)
            else tuple(_operand(index, earlier) for index in indices)
        )
    return record.make(values)


def _custom_node(base: type[Node], values: dict[str, Any]) -> Node:
    """Return a node of a custom kind."""
    name, parameters = values.pop("kind"), values.pop("values")
    kind: Any = CUSTOM_KINDS.find(name)
    if not issubclass(kind, base):
        raise InvalidFile(f"kind {name!r} is defined as {kind.__mro__[1].__name__}, not {base.__name__}")
    expected = {parameter.name for parameter in kind.parameters}
    if expected != set(parameters):
        raise InvalidFile(
            f"kind {name!r} has the parameters {sorted(expected)}, got {sorted(parameters)}; "
            "the file was written with another definition of it"
        )
    node: Node = kind(**parameters, **values)
    return node


def _operand(index: int, earlier: list[Node]) -> Node:
    if not 0 <= index < len(earlier):
        raise InvalidFile(f"operand {index} does not stand before this node, which is node {len(earlier)}")
    return earlier[index]
