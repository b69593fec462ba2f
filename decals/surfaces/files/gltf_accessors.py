"""Accessors of a glTF file as arrays, checked against the true size of their buffers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float64Array, Int64Array
from decals.surfaces.files.faults import Unreadable, item
from decals.surfaces.files.gltf_buffers import Buffers
from decals.surfaces.files.gltf_document import MESHOPT, Accessor, BufferView, Document
from decals.surfaces.files.pieces import MAX_ELEMENTS, Budget

_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

Rows = Int64Array | slice
"""Which elements of an accessor are wanted."""

ALL = slice(None)


class Accessors:
    """The accessors of a file; elements are views of the buffers until they are picked."""

    def __init__(self, document: Document, buffers: Buffers, budget: Budget) -> None:
        self._document = document
        self._buffers = buffers
        self.budget = budget

    def of(self, index: int, place: str) -> Accessor:
        """Return the record of an accessor that a place of the file names."""
        accessor = item(self._document.accessors, index, "accessor", place)
        if accessor.buffer_view is None and accessor.count > MAX_ELEMENTS:
            raise Unreadable(f"accessor {index} has {accessor.count} elements, but no buffer view")
        return accessor

    def floats(self, index: int, kinds: tuple[str, ...], place: str, rows: Rows = ALL) -> Float64Array:
        """Return elements of one of the kinds, such as "VEC3"; normalised integers become fractions."""
        stored = self.stored(index, kinds, place, rows)
        values = stored.astype(np.float64)
        if self.of(index, place).normalized and stored.dtype.kind in "iu":
            values /= np.iinfo(stored.dtype).max
            np.maximum(values, -1.0, out=values)
        return values

    def stored(self, index: int, kinds: tuple[str, ...], place: str, rows: Rows = ALL) -> NDArray[Any]:
        """Return elements, ``[n, width]``, as the file holds them, with sparse ones in their place."""
        accessor, name = self.of(index, place), f"accessor {index}"
        if accessor.type not in kinds:
            raise Unreadable(f"{place} expects {' or '.join(kinds)}, but {name} has {accessor.type[:20]!r}")
        width, kind = _WIDTHS[accessor.type], _component(accessor.component_type, name)
        if accessor.buffer_view is None:
            values = np.broadcast_to(np.zeros(1, kind), (accessor.count, width))
        else:
            view = accessor.buffer_view, accessor.byte_offset
            values = self._elements(*view, kind, (accessor.count, width), name)
        if isinstance(rows, np.ndarray) and len(rows) and rows.max() >= accessor.count:
            raise Unreadable(f"{place} asks for element {rows.max()} of {name}, which has {accessor.count}")
        return self._replaced(accessor, values, rows, name)

    def _replaced(self, accessor: Accessor, values: NDArray[Any], rows: Rows, name: str) -> NDArray[Any]:
        """Return the rows of the values, with those that the accessor's sparse part replaces."""
        sparse = accessor.sparse
        self.budget.work(len(values) if isinstance(rows, slice) else len(rows), name)
        picked = values[rows]
        if sparse is None or sparse.count == 0:
            return picked
        kind = _component(sparse.indices.component_type, name)
        place = sparse.indices.buffer_view, sparse.indices.byte_offset
        positions = self._elements(*place, kind, (sparse.count, 1), name)[:, 0].astype(np.int64)
        self.budget.work(sparse.count, name)
        if positions.min() < 0 or positions.max() >= accessor.count:
            raise Unreadable(f"{name} replaces elements beyond its {accessor.count}")
        shape = sparse.count, values.shape[1]
        others = self._elements(
            sparse.values.buffer_view, sparse.values.byte_offset, values.dtype, shape, name
        )
        order = np.argsort(positions, kind="stable")
        wanted = np.arange(len(values))[rows]
        found = np.searchsorted(positions[order], wanted, side="right") - 1
        chosen = order[np.maximum(found, 0)]
        hits = positions[chosen] == wanted
        picked = picked.copy()
        picked[hits] = others[chosen[hits]]
        return picked

    def _elements(
        self, index: int, offset: int, kind: "np.dtype[Any]", shape: tuple[int, int], name: str
    ) -> NDArray[Any]:
        """Return a view of elements in a buffer view, all of which lie inside it."""
        view = item(self._document.buffer_views, index, "buffer view", name)
        self._check_compression(view, name)
        size = kind.itemsize * shape[1]
        stride = view.byte_stride or size
        end = offset + stride * (shape[0] - 1) + size if shape[0] else 0
        if stride < size:
            raise Unreadable(f"buffer view {index} has a stride of {stride} bytes for elements of {size}")
        if end > view.byte_length:
            raise Unreadable(f"{name} needs {end} bytes of buffer view {index}, which has {view.byte_length}")
        content = self._buffers.content(view.buffer, f"buffer view {index}")
        if shape[0] and view.byte_offset + end > len(content):
            needed = f"{name} needs {view.byte_offset + end} bytes of buffer {view.buffer}"
            raise Unreadable(f"{needed}, which has {len(content)}")
        if not shape[0]:
            return np.zeros(shape, kind)
        strides = stride, kind.itemsize
        return np.ndarray(shape, kind, content, view.byte_offset + offset, strides)

    def _check_compression(self, view: BufferView, name: str) -> None:
        """Refuse a compressed buffer view, unless its buffer holds the same elements without compression."""
        extensions = view.extensions
        for extension, present in zip(MESHOPT, (extensions.meshopt, extensions.meshopt_khr), strict=True):
            if present and not self._buffers.has_bytes(view.buffer):
                raise compressed(extension, name)


def compressed(extension: str, place: str) -> Unreadable:
    """Return the fault of a place whose numbers an extension compresses."""
    return Unreadable(
        f"{place} is compressed by the extension {extension}, which is not read",
        "export it without compression",
    )


def _component(code: int, name: str) -> "np.dtype[Any]":
    if code not in _COMPONENTS:
        raise Unreadable(f"{name} has components of the unknown type {code}")
    return np.dtype(_COMPONENTS[code])
