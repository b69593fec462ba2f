"""Base colours of pyvista's datasets: arrays that hold colours, and texture coordinates."""

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Int64Array
from decals.surfaces.base_color import BaseColor, linear_colors

if TYPE_CHECKING:
    import pyvista as pv

_COLOR_NAME = re.compile(r"rgb|colou?r", re.IGNORECASE)
"""Part of the names of arrays that hold colours: RGBA, VertexColors, COLOR_0, my_rgb."""


def has_colors(dataset: Any) -> bool:
    """Return True if a dataset or any block of it has colours."""
    import pyvista as pv

    if isinstance(dataset, pv.MultiBlock):
        return any(has_colors(block) for block in dataset)
    return isinstance(dataset, pv.DataSet) and next(_color_arrays(dataset), None) is not None


def dataset_color(surface: "pv.PolyData", origins: Int64Array, *, name: str) -> BaseColor | None:
    """Return the base colour of a pyvista surface, or its texture coordinates alone; None without either.

    Colours are the active scalars of points or faces if they are RGB or RGBA bytes; or the first array of
    such bytes, or of floats from 0 to 1, whose name has "rgb", "rgba" or "color" in it.

    Parameters
    ----------
    surface
        The surface.
    origins : int64[m]
        Polygon of the surface that each triangle is a part of.
    name : str
        Name of the dataset in messages.
    """
    coordinates = _coordinates(surface)
    array_name, values, of_points = next(_color_arrays(surface), ("", None, True))
    if values is None:
        return None if coordinates is None else BaseColor(coordinates=coordinates)
    colors = linear_colors(values, name=f"{name}, array {array_name!r}")
    if of_points:
        return BaseColor(colors, coordinates)
    polygons = colors[surface.n_verts + surface.n_lines :]  # cells of a surface: points, lines, polygons
    return BaseColor.of_faces(polygons[origins])


def _color_arrays(dataset: "pv.DataSet") -> Iterator[tuple[str, NDArray[Any], bool]]:
    """Give name and values of the arrays that hold colours, active ones first; True for those of points."""
    kinds = ((dataset.point_data, True), (dataset.cell_data, False))
    for active in (True, False):
        for data, of_points in kinds:
            scalars = data.GetScalars()  # not pyvista's own property, which may choose other arrays
            for name in data.keys():  # noqa: SIM118  # arrays without a name have none in a loop
                is_active = scalars is not None and scalars.GetName() == name
                if is_active is active and _holds_colors(name, values := data[name], active=active):
                    yield name, np.asarray(values), of_points


def _holds_colors(name: str, values: NDArray[Any], *, active: bool) -> bool:
    if values.ndim != 2 or values.shape[1] not in (3, 4):
        return False
    named = _COLOR_NAME.search(name) is not None
    return (active or named) if values.dtype == np.uint8 else named and values.dtype.kind == "f"


def _coordinates(surface: "pv.PolyData") -> NDArray[Any] | None:
    array = surface.active_texture_coordinates
    if array is None or array.ndim != 2 or array.shape[1] < 2:
        return None
    return np.asarray(array[:, :2])
