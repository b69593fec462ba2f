"""Reader of PLY files (Turk 1994).

VTK's own reader crashes on truncated files and wrong indices, and does not read triangle strips.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.errors import InvalidMesh

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_CORNERS = ("vertex_indices", "vertex_index")

Polygons = NDArray[Any] | Sequence[NDArray[Any]]
"""Corner indices ``int[m, k]``, or one ``int[k_i]`` for each polygon if they differ in size."""

MAX_LIST_LENGTH = 1 << 27
"""Longest list that is read; a longer one is a sign of a damaged file."""

STRIP_END = -1
"""Index that ends a triangle strip within a list of strips."""

Columns = dict[str, list[NDArray[np.generic]] | NDArray[np.generic]]


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


def read_ply(path: Path) -> tuple[NDArray[np.float64], Polygons]:
    """Read the vertices and faces of a PLY file, ASCII or binary, of any polygon size.

    Triangle strips (elements ``tristrips``) are divided into triangles.

    Returns
    -------
    points : float64[n, 3]
    polygons : int64[m, k], or a list of int64[k_i] if they differ in size

    Raises
    ------
    InvalidMesh
        If the file is not PLY, has no faces, or ends too early.
    """
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # the checks of values come later
            order, elements, body = _header(path.read_bytes())
            columns = dict(_elements(order, elements, body))
            vertex = columns.get("vertex", {})
            polygons = _polygons(columns)
            scalar = any(np.ndim(vertex[axis]) != 1 for axis in "xyz" if axis in vertex)
    except OSError as error:
        raise InvalidMesh(
            f"could not read {str(path)!r} ({error.strerror}); check its permissions"
        ) from error
    except (ValueError, LookupError, OverflowError, TypeError, MemoryError) as error:
        raise InvalidMesh(f"could not read {str(path)!r} as PLY ({error}); export it again") from error
    if scalar:
        raise InvalidMesh(f"{str(path)!r} has lists in place of coordinates; export it again")
    if polygons is None or not {"x", "y", "z"} <= vertex.keys():
        raise InvalidMesh(
            f"{str(path)!r} has no vertices with x, y, z or no faces; export it as a triangle mesh"
        )
    points = np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], axis=-1)
    return points, polygons


def _polygons(columns: dict[str, Columns]) -> Polygons | None:
    """Return the faces, and the triangles of strips, of a file; None if it has neither."""
    faces, strips = (_corner_lists(columns.get(element, {})) for element in ("face", "tristrips"))
    if strips is None or len(strips) == 0:
        return faces
    triangles = np.concatenate([strip_triangles(strip) for strip in strips])
    return triangles if faces is None or len(faces) == 0 else [*faces, *triangles]


def _corner_lists(element: Columns) -> Polygons | None:
    corners = next((element[name] for name in _CORNERS if name in element), None)
    if corners is None:
        return None
    if isinstance(corners, list):
        return [_row(row) for row in corners]
    if corners.ndim != 2:
        raise ValueError("its faces are no lists of corners")
    return np.asarray(corners, np.int64)


def _row(corners: NDArray[np.generic]) -> NDArray[np.int64]:
    if corners.ndim != 1:
        raise ValueError("its faces are no lists of corners")
    return np.asarray(corners, np.int64)


def strip_triangles(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles, ``int64[m, 3]``, of strips; every second one is reversed."""
    parts = np.split(corners, np.flatnonzero(corners == STRIP_END))
    strips = [part[part != STRIP_END] for part in parts]
    windows = [
        np.lib.stride_tricks.sliding_window_view(strip, 3).copy() for strip in strips if len(strip) > 2
    ]
    for triangles in windows:
        triangles[1::2, :2] = triangles[1::2, 1::-1]
    return np.concatenate(windows) if windows else np.zeros((0, 3), np.int64)


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    if not data.startswith(b"ply"):
        raise ValueError("it does not start with 'ply'")
    end = data.find(b"end_header")
    if end < 0:
        raise ValueError("its header does not end")
    body = data[data.index(b"\n", end) + 1 :]
    order, elements = None, []
    for line in data[:end].decode("ascii", "replace").splitlines()[1:]:
        match line.split():
            case ["format", name, _]:
                order = _ORDERS[name]
            case ["element", name, count]:
                elements.append(_Element(name, _row_count(count), ()))
            case ["property", "list", count_kind, kind, name]:
                elements.append(_extended(elements.pop(), _Property(name, _TYPES[kind], _TYPES[count_kind])))
            case ["property", kind, name]:
                elements.append(_extended(elements.pop(), _Property(name, _TYPES[kind])))
    if order is None:
        raise ValueError("its header names no format")
    return order, elements, body


def _row_count(text: str) -> int:
    count = int(text)
    if not 0 <= count <= np.iinfo(np.int64).max:
        raise ValueError(f"an element claims {text[:40]} rows")
    return count


def _extended(element: _Element, prop: _Property) -> _Element:
    return _Element(element.name, element.count, (*element.properties, prop))


def _elements(order: str, elements: list[_Element], body: bytes) -> Iterator[tuple[str, Columns]]:
    """Decode the elements in turn; ASCII becomes rows of float64, which hold every index exactly."""
    if not order:
        body, order = np.array(body.split(), np.float64).tobytes(), "="
        elements = [_as_doubles(element) for element in elements]
    position = 0
    for element in elements:
        columns, position = _decode(order, element, body, position)
        yield element.name, columns


def _as_doubles(element: _Element) -> _Element:
    doubles = tuple(_Property(p.name, "f8", p.count_kind and "f8") for p in element.properties)
    return _Element(element.name, element.count, doubles)


def _decode(order: str, element: _Element, body: bytes, position: int) -> tuple[Columns, int]:
    """Decode all rows at once if their lists are as long as the first row's, else row by row."""
    if element.count == 0:
        return {p.name: np.zeros((0, 3) if p.count_kind else 0) for p in element.properties}, position
    row = _row_type(order, element, body, position)
    if len(body) - position >= row.itemsize * element.count:
        rows = np.frombuffer(body, row, element.count, position)
        if all(
            (rows["#" + p.name] == rows["#" + p.name][0]).all() for p in element.properties if p.count_kind
        ):
            return {p.name: rows[p.name] for p in element.properties}, position + rows.nbytes
    if not any(p.count_kind for p in element.properties):
        raise ValueError(f"it ends within its {element.count} rows of {element.name!r}")
    return _decode_slowly(order, element, body, position)


def _decode_slowly(order: str, element: _Element, body: bytes, position: int) -> tuple[Columns, int]:
    columns: dict[str, list[NDArray[np.generic]]] = {p.name: [] for p in element.properties}
    for _ in range(element.count):
        row = _row_type(order, element, body, position)
        if position + row.itemsize > len(body):
            raise ValueError(f"it ends within its {element.count} rows of {element.name!r}")
        values = np.frombuffer(body, row, 1, position)[0]
        for p in element.properties:
            columns[p.name].append(values[p.name])
        position += row.itemsize
    return dict(columns), position


def _row_type(order: str, element: _Element, body: bytes, position: int) -> np.dtype[np.void]:
    """Layout of the row that starts at a position, its lists being as long as it says."""
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for p in element.properties:
        length: tuple[int, ...] = ()
        if p.count_kind:
            fields.append(("#" + p.name, order + p.count_kind, ()))
            place = position + np.dtype(fields).itemsize - np.dtype(p.count_kind).itemsize
            if place + np.dtype(p.count_kind).itemsize > len(body):
                raise ValueError(f"it ends within its {element.count} rows of {element.name!r}")
            length = (_list_length(np.frombuffer(body, order + p.count_kind, 1, place)[0]),)
        fields.append((p.name, order + p.kind, length))
    return np.dtype(fields)


def _list_length(value: Any) -> int:
    """Return the length of a list; ValueError if it is absurd."""
    count = int(value) if np.isfinite(value) else -1
    if not 0 <= count <= MAX_LIST_LENGTH:
        raise ValueError(f"one of its lists claims {value} entries")
    return count
