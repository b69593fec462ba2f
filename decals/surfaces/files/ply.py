"""Reader of PLY files (Turk 1994).

VTK's own reader crashes on truncated files and wrong indices, and does not read triangle strips.
"""

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float64Array, Int64Array
from decals.surfaces.files.content import decimal_numbers, encoding_of, file_bytes, refusal, without_mark
from decals.surfaces.files.paint import Paint
from decals.surfaces.files.ply_colors import PlyColors, PlyFaces
from decals.surfaces.triangulate import Polygons

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_CORNERS = ("vertex_indices", "vertex_index")
_SINGLE = frozenset({"x", "y", "z", *_CORNERS})
"""Properties that an element must not have twice."""

_UNPAINTED = frozenset({"x", "y", "z", "nx", "ny", "nz"})
"""Properties that say nothing of colours."""

_PLACES = ("texcoord", "texcoords")
"""Lists of faces with the texture coordinates of their corners."""

_TEXTURE_FILE = re.compile(r"^comment\s+TextureFile\s+(.+?)\s*$", re.IGNORECASE | re.MULTILINE)

MAX_LIST_LENGTH = 1 << 27
"""Longest list that is read; a longer one is a sign of a damaged file."""

STRIP_END = -1
"""Index that ends a triangle strip within a list of strips."""


@dataclass(frozen=True)
class _Lists:
    """The lists of one property: their lengths, and the entries of all of them."""

    lengths: Int64Array
    entries: NDArray[np.generic]


@dataclass(frozen=True)
class _Table:
    """The rows of an element: its properties of one number each, and those that are lists."""

    name: str
    scalars: dict[str, NDArray[np.generic]]
    lists: dict[str, _Lists]


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    count_kind: str | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


def read_ply(path: Path) -> tuple[Float64Array, Polygons, Paint | None]:
    """Read the vertices and faces of a PLY file, ASCII or binary, of any polygon size, and their colours.

    Triangle strips (elements ``tristrips``) are divided into triangles.

    Raises
    ------
    InvalidMesh
        If the file is not PLY, has no faces, or ends too early.
    """
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # the checks of values come later
            return _read(file_bytes(path), path)
    except (ValueError, LookupError, OverflowError, TypeError, MemoryError) as error:
        raise refusal(path, "PLY", error) from error


def _read(content: bytes, path: Path) -> tuple[Float64Array, Polygons, Paint | None]:
    order, elements, body = _header(content)
    tables = list(zip(_tables(order, elements, body), elements, strict=True))
    vertices = [(table, element) for table, element in tables if table.name == "vertex"]
    if len(vertices) != 1 or not {"x", "y", "z"} <= vertices[0][0].scalars.keys():
        raise ValueError("it has no element of vertices with x, y and z")
    points = np.stack([np.asarray(vertices[0][0].scalars[axis], np.float64) for axis in "xyz"], axis=-1)
    parts = [
        _faces(table, element)
        for name in ("face", "tristrips")
        for table, element in tables
        if table.name == name
    ]
    if not parts:
        raise ValueError("it has no faces")
    textures = _TEXTURE_FILE.findall(content[: len(content) - len(body)].decode("utf-8", "replace"))
    columns = _typed(*vertices[0])
    named = columns.keys() | {name for part in parts for name in part.columns}
    painted = textures or named - _UNPAINTED or any(part.places is not None for part in parts)
    paint = PlyColors(path, textures, columns, parts) if painted else None
    return points, Polygons.joined([part.polygons for part in parts]), paint


def _faces(table: _Table, element: _Element) -> PlyFaces:
    """Return the polygons of an element with what it says of each; strips are divided into triangles."""
    polygons, columns = _corners(table), _typed(table, element)
    if table.name == "face":
        return PlyFaces(polygons, columns, _places(table, polygons.sizes))
    strips = [strip_triangles(strip) for strip in np.split(polygons.corners, np.cumsum(polygons.sizes)[:-1])]
    of_strip = np.repeat(np.arange(len(polygons)), [len(strip) for strip in strips[: len(polygons)]])
    triangles = Polygons.joined([Polygons.of(strip) for strip in strips])
    return PlyFaces(triangles, {name: values[of_strip] for name, values in columns.items()}, None)


def _places(face: _Table, sizes: Int64Array) -> NDArray[np.generic] | None:
    """Return the texture coordinates of all corners; None if faces have no such list of their length."""
    lists = next((face.lists[name] for name in _PLACES if name in face.lists), None)
    if lists is None or not (lists.lengths == 2 * sizes).all():
        return None
    return lists.entries.reshape(-1, 2)


def _typed(table: _Table, element: _Element) -> dict[str, NDArray[np.generic]]:
    """Return the numbers of a table in the types that the header names, unless a number does not fit."""
    kinds = {one.name: np.dtype(one.kind) for one in element.properties}
    return {
        name: values.astype(kinds[name]) if _fits(values, kinds[name]) else values
        for name, values in table.scalars.items()
    }


def _fits(values: NDArray[Any], kind: np.dtype[Any]) -> bool:
    """Return True if a type has all numbers; ASCII has them as float64."""
    if values.dtype == kind or kind.kind == "f":
        return True
    limits = np.iinfo(kind)
    return bool(((values >= limits.min) & (values <= limits.max)).all())


def _corners(table: _Table) -> Polygons:
    """Return the polygons or strips of an element."""
    found = next((table.lists[name] for name in _CORNERS if name in table.lists), None)
    if found is None:
        raise ValueError(f"its element {table.name!r} has no list of vertices")
    corners = found.entries.astype(np.int64)
    if (corners != found.entries).any():
        raise ValueError("a face asks for a vertex by a number that is not whole")
    return Polygons(corners, found.lengths)


def strip_triangles(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles, ``int64[m, 3]``, of strips; every second triangle is reversed."""
    parts = np.split(corners, np.flatnonzero(corners == STRIP_END))
    strips = [part[part != STRIP_END] for part in parts]
    windows = [
        np.lib.stride_tricks.sliding_window_view(strip, 3).copy() for strip in strips if len(strip) > 2
    ]
    for triangles in windows:
        triangles[1::2, :2] = triangles[1::2, 1::-1]
    return np.concatenate(windows) if windows else np.zeros((0, 3), np.int64)


def _header(content: bytes) -> tuple[str, list[_Element], bytes]:
    """Return the byte order (nothing for ASCII), the elements, and what follows the header."""
    data = without_mark(content)
    if not data.startswith(b"ply"):
        raise ValueError("it does not start with 'ply'")
    line_end = rb"\r" if data.startswith(b"ply\r") and not data.startswith(b"ply\r\n") else rb"\r?\n"
    end = re.search(rb"[\r\n]end_header[ \t]*" + line_end, data)
    if end is None:
        raise ValueError("its header does not end")
    order, elements = None, []
    for line in data[: end.start()].decode("ascii", "replace").splitlines()[1:]:
        match line.split():
            case ["format", name, _]:
                order = _known(_ORDERS, name, "format")
            case ["element", name, count]:
                elements.append(_Element(name, _row_count(count), ()))
            case ["property", "list", count_kind, kind, name]:
                kinds = _known(_TYPES, kind, "type"), _known(_TYPES, count_kind, "type")
                _extend(elements, _Property(name, *kinds))
            case ["property", kind, name]:
                _extend(elements, _Property(name, _known(_TYPES, kind, "type")))
    if order is None:
        raise ValueError("its header names no format")
    if order and encoding_of(content) not in (None, "utf-8"):
        raise ValueError(f"it is binary, but starts with the mark of {encoding_of(content)}")
    return order, elements, data[end.end() :]


def _row_count(text: str) -> int:
    count = int(text) if text.isdecimal() else -1
    if not 0 <= count <= np.iinfo(np.int64).max:
        raise ValueError(f"an element claims {text[:40]!r} rows")
    return count


def _known(names: Mapping[str, str], name: str, what: str) -> str:
    """Return what a name of the header stands for."""
    if name not in names:
        raise ValueError(f"its header has the unknown {what} {name[:40]!r}")
    return names[name]


def _extend(elements: list[_Element], prop: _Property) -> None:
    """Add a property to the last element of the header; of properties of one name, the first counts."""
    if not elements:
        raise ValueError(f"its property {prop.name[:40]!r} belongs to no element")
    element = elements.pop()
    if any(other.name == prop.name for other in element.properties):
        if prop.name in _SINGLE:
            raise ValueError(f"its element {element.name!r} has two properties {prop.name!r}")
        prop = replace(prop, name=f"{prop.name} {len(element.properties)}")  # names in files have no spaces
    elements.append(_Element(element.name, element.count, (*element.properties, prop)))


def _tables(order: str, elements: list[_Element], body: bytes) -> list[_Table]:
    """Decode the elements in turn; ASCII becomes rows of float64, which hold every index exactly."""
    if order:
        return _decoded(order, elements, body)[0]
    doubles = [_as_doubles(element) for element in elements]
    try:
        tables, rest = _decoded("=", doubles, decimal_numbers(body.split()).tobytes())
    except ValueError:
        words = _rows_of_lines(elements, body)
        if words is None:
            raise
    else:
        words = _rows_of_lines(elements, body) if rest else None
        if words is None:
            return tables
    return _decoded("=", doubles, decimal_numbers(words).tobytes())[0]


def _decoded(order: str, elements: list[_Element], body: bytes) -> tuple[list[_Table], int]:
    """Return the tables of elements, and the number of bytes behind them."""
    tables, position = [], 0
    for element in elements:
        table, position = _decode(order, element, body, position)
        tables.append(table)
    return tables, len(body) - position


def _rows_of_lines(elements: list[_Element], body: bytes) -> list[bytes] | None:
    """Return the words that rows of one line each need; None if the rows are not the lines.

    Some programs write more at the end of each line than the header declares.
    """
    lines = [words for line in body.replace(b"\r", b"\n").split(b"\n") if (words := line.split())]
    if len(lines) != sum(element.count for element in elements):
        return None
    kept: list[bytes] = []
    numbered = iter(lines)
    for element in elements:
        for words in islice(numbered, element.count):
            end = 0
            for p in element.properties:
                if end >= len(words):
                    return None
                end += 1 + (int(words[end]) if p.count_kind else 0)
            kept += words[:end]
    return kept


def _as_doubles(element: _Element) -> _Element:
    doubles = tuple(_Property(p.name, "f8", p.count_kind and "f8") for p in element.properties)
    return _Element(element.name, element.count, doubles)


def _decode(order: str, element: _Element, body: bytes, position: int) -> tuple[_Table, int]:
    """Decode all rows at once if their lists are as long as the first row's, else with a look at each row."""
    row, lengths = _first_row(order, element, body, position)
    if len(body) - position >= row.itemsize * element.count:
        rows = np.frombuffer(body, row, element.count, position)
        if all((rows["#" + name] == length).all() for name, length in lengths.items()):
            lists = {
                name: _Lists(np.full(element.count, length, np.int64), rows[name].reshape(-1))
                for name, length in lengths.items()
            }
            scalars = {p.name: rows[p.name] for p in element.properties if p.name not in lists}
            return _Table(element.name, scalars, lists), position + rows.nbytes
    if not lengths:
        raise _ends_within(element)
    return _decode_uneven(order, element, body, position)


def _first_row(
    order: str, element: _Element, body: bytes, position: int
) -> tuple[np.dtype[np.void], dict[str, int]]:
    """Return the layout of the row at a position, and the lengths of its lists; none if there is no row."""
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    lengths: dict[str, int] = {}
    for p in element.properties:
        shape: tuple[int, ...] = ()
        if p.count_kind:
            lengths[p.name] = 0
            if element.count:
                place = position + np.dtype(fields).itemsize
                lengths[p.name] = _list_length(_reader(order, p.count_kind), element, body, place)
            fields.append(("#" + p.name, order + p.count_kind, ()))
            shape = (lengths[p.name],)
        fields.append((p.name, order + p.kind, shape))
    return np.dtype(fields), lengths


def _decode_uneven(order: str, element: _Element, body: bytes, position: int) -> tuple[_Table, int]:
    """Walk over the rows to find where each list starts, then gather each property of all rows."""
    kinds = {p.name: np.dtype(order + p.kind) for p in element.properties}
    counts = {p.name: _reader(order, p.count_kind) for p in element.properties if p.count_kind}
    places: dict[str, list[int]] = {name: [] for name in kinds}
    lengths: dict[str, list[int]] = {name: [] for name in counts}
    steps = [(name, kind.itemsize, counts.get(name)) for name, kind in kinds.items()]
    for _ in range(element.count):
        for name, size, count in steps:
            entries = 1
            if count is not None:
                entries = _list_length(count, element, body, position)
                lengths[name].append(entries)
                position += count.size
            places[name].append(position)
            position += entries * size
    if position > len(body):
        raise _ends_within(element)
    numbers = {name: np.array(of, np.int64) for name, of in lengths.items()}
    lists = {
        name: _Lists(count, _gathered(body, kinds[name], np.array(places[name]), count))
        for name, count in numbers.items()
    }
    ones = np.ones(element.count, np.int64)
    scalars = {
        name: _gathered(body, kind, np.array(places[name]), ones)
        for name, kind in kinds.items()
        if name not in lists
    }
    return _Table(element.name, scalars, lists), position


def _gathered(
    body: bytes, kind: np.dtype[Any], places: Int64Array, lengths: Int64Array
) -> NDArray[np.generic]:
    """Return runs of numbers that start at places of the body, one after the other."""
    within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    starts = np.repeat(places, lengths) + within * kind.itemsize
    values = np.frombuffer(body, np.uint8)[starts[:, None] + np.arange(kind.itemsize)]
    gathered: NDArray[np.generic] = values.reshape(-1).view(kind)
    return gathered


def _reader(order: str, kind: str) -> struct.Struct:
    """Return the reader of one number of a NumPy type."""
    return struct.Struct(order + np.dtype(kind).char)


def _list_length(count: struct.Struct, element: _Element, body: bytes, position: int) -> int:
    """Return the length of the list at a position; ValueError if it is absurd."""
    if position + count.size > len(body):
        raise _ends_within(element)
    (value,) = count.unpack_from(body, position)
    if not 0 <= value <= MAX_LIST_LENGTH or value != int(value):
        raise ValueError(f"one of its lists claims {value} entries")
    return int(value)


def _ends_within(element: _Element) -> ValueError:
    return ValueError(f"it ends within its {element.count} rows of {element.name!r}")
