"""Arrays and a header as one text, which the viewer of a page unpacks (``viewer/packing.mjs``)."""

import base64
import zlib
from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

KINDS = {"float32": "Float32", "float16": "Uint16", "int32": "Int32", "int16": "Int16", "uint8": "Uint8"}
"""Beginnings of JavaScript's names of arrays; half floats go to the graphics card by their bits."""

LEVEL = 9
"""Effort of the compression: pages are written once and read often."""


def packed(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return a header and arrays by their names as base64 of zlib.

    Inside are the length of the header, the header in JSON, and the arrays. Equal arrays are written once.
    Whole numbers are written as differences. The bytes of each row are then sorted by their place, so that
    like bytes follow each other.
    """
    parts: list[bytes] = []
    directory: dict[tuple[str, bytes], dict[str, Any]] = {}
    for name, array in arrays.items():
        content = array.dtype.name, array.tobytes()
        if content in directory:
            directory[content]["names"].append(name)
            continue
        rows = array.reshape(len(array), -1) if array.dtype == np.uint8 else array.reshape(-1, 1)
        given = np.ascontiguousarray(rows)
        if differences := array.dtype == np.int32:
            given = np.diff(given, axis=0, prepend=given.dtype.type(0))
        width = given.shape[1] * given.itemsize
        places = given.view(np.uint8).reshape(-1, width).T
        parts.append(places.tobytes())
        directory[content] = {
            "names": [name],
            "kind": KINDS[array.dtype.name],
            "count": array.size,
            "width": width,
            "differences": bool(differences),
        }
    text = msgspec.json.encode({**header, "arrays": list(directory.values())})
    whole = len(text).to_bytes(4, "little") + text + b"".join(parts)
    return base64.b64encode(zlib.compress(whole, LEVEL)).decode("ascii")
