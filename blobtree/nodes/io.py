"""BlobTree ↔ JSON: a flat, versioned list of nodes, each naming its operands by their place in the list.

    {"format": "blobtree", "version": 1, "nodes": [
        {"type": "point", "center": [0, 0, 0], "radius": 1, "color": [0.8, 0.8, 0.8]},
        {"type": "own skeleton", "kind": "ring", "parameters": {"size": 1}, "radius": 1, "color": [0, 0, 1]},
        {"type": "sum", "operands": [0, 1]}]}

The last node is the root. Operands stand before the node that uses them, so a file can hold no cycle, a
shared subtree is written once, and depth costs no recursion. A node of an own kind names its kind; whoever
reads the file must have defined it (`registry`).
"""

import os
import shutil
import uuid
from pathlib import Path
from typing import Any, ClassVar, Literal

import msgspec

from blobtree.errors import BlobTreeError, InvalidFile
from blobtree.nodes.primitives import Cone, Point, Segment
from blobtree.nodes.traversal import postorder
from blobtree.nodes.tree import (
    Difference,
    Intersection,
    Node,
    Offset,
    Ricci,
    Sum,
    Transform,
    Twist,
    Union,
    checked_tree,
)
from blobtree.own.operator import OwnCombination
from blobtree.own.registry import find_kind
from blobtree.own.skeleton import OwnPrimitive
from blobtree.validation import Matrix, Vector

VERSION: Literal[1] = 1

OwnValue = float | tuple[float, ...]


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="type"):
    """One node in a file; fields that hold other nodes hold their places instead."""

    node_type: ClassVar[type[Node]]
    references: ClassVar[tuple[str, ...]] = ()

    def make(self, values: dict[str, Any]) -> Node:
        """The node of these fields, other nodes in place of their places."""
        return self.node_type(**values)


class PointRecord(Record, frozen=True, tag="point"):
    """A ball."""

    node_type = Point
    center: Vector
    radius: float
    color: Vector


class SegmentRecord(Record, frozen=True, tag="segment"):
    """A capsule."""

    node_type = Segment
    start: Vector
    end: Vector
    radius: float
    color: Vector


class ConeRecord(Record, frozen=True, tag="cone"):
    """A round cone."""

    node_type = Cone
    start: Vector
    end: Vector
    radius: float
    end_radius: float
    color: Vector


class SumRecord(Record, frozen=True, tag="sum"):
    """A smooth blend."""

    node_type = Sum
    references = ("operands",)
    operands: tuple[int, ...]


class RicciRecord(Record, frozen=True, tag="ricci"):
    """A Ricci blend."""

    node_type = Ricci
    references = ("operands",)
    operands: tuple[int, ...]
    exponent: float


class UnionRecord(Record, frozen=True, tag="union"):
    """A union."""

    node_type = Union
    references = ("operands",)
    operands: tuple[int, ...]


class IntersectionRecord(Record, frozen=True, tag="intersection"):
    """An intersection."""

    node_type = Intersection
    references = ("operands",)
    operands: tuple[int, ...]


class DifferenceRecord(Record, frozen=True, tag="difference"):
    """A solid without a tool."""

    node_type = Difference
    references = ("solid", "tool")
    solid: int
    tool: int


class TransformRecord(Record, frozen=True, tag="transform"):
    """A node under an affine map."""

    node_type = Transform
    references = ("child",)
    child: int
    matrix: Matrix


class OffsetRecord(Record, frozen=True, tag="offset"):
    """A node with larger radii."""

    node_type = Offset
    references = ("child",)
    child: int
    distance: float


class TwistRecord(Record, frozen=True, tag="twist"):
    """A node turned about its z axis."""

    node_type = Twist
    references = ("child",)
    child: int
    degrees: float


class OwnSkeletonRecord(Record, frozen=True, tag="own skeleton"):
    """A primitive around a user's skeleton."""

    node_type = OwnPrimitive
    kind: str
    values: dict[str, OwnValue] = msgspec.field(name="parameters")
    radius: float
    color: Vector

    def make(self, values: dict[str, Any]) -> Node:
        """The node, if its kind is defined."""
        return _own_node(OwnPrimitive, values)


class OwnOperatorRecord(Record, frozen=True, tag="own operator"):
    """A combination by a user's operator."""

    node_type = OwnCombination
    references = ("operands",)
    kind: str
    values: dict[str, OwnValue] = msgspec.field(name="parameters")
    operands: tuple[int, ...]

    def make(self, values: dict[str, Any]) -> Node:
        """The node, if its kind is defined."""
        return _own_node(OwnCombination, values)


_AnyRecord = (
    PointRecord
    | SegmentRecord
    | ConeRecord
    | SumRecord
    | RicciRecord
    | UnionRecord
    | IntersectionRecord
    | DifferenceRecord
    | TransformRecord
    | OffsetRecord
    | TwistRecord
    | OwnSkeletonRecord
    | OwnOperatorRecord
)
_RECORD_OF: dict[type[Node], type[_AnyRecord]] = {record.node_type: record for record in _AnyRecord.__args__}


class Document(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole file, or the part of another file that holds a tree."""

    format: Literal["blobtree"]
    version: Literal[1]
    nodes: tuple[_AnyRecord, ...]


def to_document(root: Node) -> Document:
    """The tree as records; InvalidNode for what is no tree."""
    checked_tree(root)
    order = postorder(root)
    place = {id(node): index for index, node in enumerate(order)}
    return Document("blobtree", VERSION, tuple(_record(node, place) for node in order))


def from_document(document: Document) -> Node:
    """The tree that `document` holds.

    Raises
    ------
    InvalidFile
        A node is wrong or refers to one that does not stand before it (a cycle); the message says which.
    """
    if not document.nodes:
        raise InvalidFile("nodes: expected at least one node, got none")
    nodes: list[Node] = []
    for index, record in enumerate(document.nodes):
        try:
            nodes.append(_node(record, nodes))
        except BlobTreeError as error:
            raise InvalidFile(f"nodes[{index}] ({record.__struct_config__.tag}): {error}") from None
    return nodes[-1]


def to_json(root: Node) -> bytes:
    """The tree as UTF-8 JSON."""
    return msgspec.json.format(msgspec.json.encode(to_document(root)), indent=1)


def from_json(text: bytes | str) -> Node:
    """The tree that a JSON text holds; InvalidFile where it holds none."""
    try:
        document = msgspec.json.decode(text, type=Document)
    except TypeError:
        raise InvalidFile(f"expected JSON as text or bytes, got {type(text).__name__}") from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InvalidFile(f"not a BlobTree of version {VERSION}: {error}") from None
    except RecursionError:
        raise InvalidFile("not a BlobTree: nested too deeply") from None
    return from_document(document)


def save(root: Node, path: str | os.PathLike[str]) -> None:
    """Write the tree to `path`, whole or not at all."""
    write_atomically(Path(path), to_json(root))


def load(path: str | os.PathLike[str]) -> Node:
    """Read the tree in the file `path`; InvalidFile where it holds none, OSError where it cannot be read."""
    if not isinstance(path, str | os.PathLike):
        raise InvalidFile(f"path: expected the path of a file, got {path!r}")
    try:
        return from_json(Path(path).read_bytes())
    except InvalidFile as error:
        raise InvalidFile(f"{path}: {error}") from None


def write_atomically(path: Path, content: bytes) -> None:
    """Put `content` into `path` so that a crash leaves either the old file or the new one."""
    temporary = path.with_name(f"{path.name}.{uuid.uuid4().hex}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if path.exists():
            shutil.copymode(path, temporary)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _record(node: Node, place: dict[int, int]) -> _AnyRecord:
    """`node` with its operands replaced by their places."""
    record_type = _record_type(node)
    values = {name: getattr(node, name) for name in record_type.__struct_fields__}
    for name in record_type.references:
        operand = values[name]
        values[name] = (
            place[id(operand)] if isinstance(operand, Node) else tuple(place[id(node)] for node in operand)
        )
    return record_type(**values)


def _node(record: Record, earlier: list[Node]) -> Node:
    """The node of `record`, its places replaced by the nodes that stand there."""
    values = {name: getattr(record, name) for name in record.__struct_fields__}
    for name in record.references:
        places = values[name]
        values[name] = (
            _at(places, earlier)
            if isinstance(places, int)
            else tuple(_at(place, earlier) for place in places)
        )
    return record.make(values)


def _record_type(node: Node) -> type[_AnyRecord]:
    if isinstance(node, OwnPrimitive):
        return OwnSkeletonRecord
    return OwnOperatorRecord if isinstance(node, OwnCombination) else _RECORD_OF[type(node)]


def _own_node(base: type[Node], fields: dict[str, Any]) -> Node:
    """A node of a user's kind."""
    name, parameters = fields.pop("kind"), fields.pop("values")
    kind: Any = find_kind(name)
    if not issubclass(kind, base):
        raise InvalidFile(f"kind {name!r} is defined as {kind.__mro__[1].__name__}, not {base.__name__}")
    wanted = {parameter.name for parameter in kind.parameters}
    if wanted != set(parameters):
        raise InvalidFile(
            f"kind {name!r} has the parameters {sorted(wanted)}, got {sorted(parameters)}; "
            "its definition here is not that of whoever wrote this"
        )
    node: Node = kind(**parameters, **fields)
    return node


def _at(place: int, earlier: list[Node]) -> Node:
    if not 0 <= place < len(earlier):
        raise InvalidFile(f"operand {place} does not stand before this node, which is node {len(earlier)}")
    return earlier[place]
