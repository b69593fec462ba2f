"""Arrays of Warp structs whose arrays are parts of larger ones: one launch then works on many values."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

Part = tuple[Any, NDArray[np.integer]]
"""An array, and where the part of each row begins in it, with the end."""


def struct_rows(
    kind: Any,
    example: Any,
    count: int,
    device: str,
    *,
    parts: Mapping[str, Part],
    values: Mapping[str, ArrayLike],
) -> Any:
    """Return an array of `count` structs of a kind on a device; it keeps the arrays of all of them alive.

    Parameters
    ----------
    kind, example
        Type of the structs, and one with the values that all rows share.
    parts, values
        The fields that differ, by name: parts of one array, or the value of each row.
    """
    table = np.full(count, np.array(example.numpy_value(), kind.numpy_dtype()))
    for name, (array, starts) in parts.items():
        field = table[name]
        field[:] = np.array(array.__ctype__().numpy_value(), field.dtype)
        field["data"] += np.asarray(starts[:-1], np.uint64) * np.uint64(array.strides[0])
        field["shape"][:, 0] = np.diff(starts)
    for name, column in values.items():
        table[name] = column
    rows: Any = wp.array(table, dtype=kind, device=device)
    rows.kept = example, parts
    return rows
