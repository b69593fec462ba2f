"""The process in which xatlas works, because it lets no other thread of its own process go on.

It reads arrays from stdin and writes arrays to stdout, as NumPy's archives.
"""

import io
from collections.abc import Sequence
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np

from decals.child_process import answer_once

Arrays: TypeAlias = Sequence[Any]
"""Arrays of different types."""


def answer(request: bytes) -> bytes:
    """Return the answer to a request."""
    texels_per_unit, max_area, padding, *arrays = unpacked(request)
    return packed(atlas(arrays, float(texels_per_unit), float(max_area), int(padding)))


def atlas(arrays: Arrays, texels_per_unit: float, max_area: float, padding: int) -> Arrays:
    """Cut meshes into charts, and pack all charts on one page.

    Parameters
    ----------
    arrays
        Vertices ``float32[n, 3]``, faces ``uint32[m, 3]`` and normals ``float32[n, 3]`` of each mesh.
    texels_per_unit, max_area, padding
        Options of xatlas.

    Returns
    -------
    sequence of arrays
        Width and height of the page; then for each mesh the rows ``[k]``, faces ``[m, 3]`` and positions
        ``float32[k, 2]`` of its new vertices, from 0 to 1.
    """
    xatlas = import_module("xatlas")
    made = xatlas.Atlas()
    for first in range(0, len(arrays), 3):
        made.add_mesh(*arrays[first : first + 3])
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    charts.max_chart_area = max_area
    packing.padding = padding
    packing.texels_per_unit = texels_per_unit
    # Without a fixed resolution all charts lie on one page of about the right size, scaled afterwards.
    packing.resolution = 0
    made.generate(charts, packing)
    result: list[Any] = [np.array([made.width, made.height], np.float64)]
    for number in range(len(arrays) // 3):
        result.extend(made.get_mesh(number))
    return result


def packed(arrays: Arrays) -> bytes:
    """Return arrays as bytes."""
    file = io.BytesIO()
    np.savez(file, *arrays)
    return file.getvalue()


def unpacked(content: bytes) -> Arrays:
    """Return the arrays of `packed`."""
    with np.load(io.BytesIO(content)) as archive:
        return [archive[f"arr_{number}"] for number in range(len(archive.files))]


if __name__ == "__main__":
    answer_once(answer)
