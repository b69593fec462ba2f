"""Actors of VTK as objects of scenes, with the colours that their mappers give them."""

from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkRenderingCore import vtkPolyDataMapper

from blobtree._typing import Float64Array, Int64Array
from decals.scenes.objects import MeshObject
from decals.surfaces.base_color import BaseColor, BaseTexture, linear_colors
from decals.vtk.mapper import surface_of, triangles_of

ACTOR = "actor"
"""Name of the object."""


def actor_object(actor: Any, mapper: Any, matrix: Float64Array, **options: Any) -> MeshObject | None:
    """Return the polygons of an actor as an object; None without any.

    Parameters
    ----------
    actor
        The actor.
    mapper
        The vtkPolyDataMapper that draws it.
    matrix
        Map from its coordinates to those of the object, ``float64[4, 4]``.
    **options
        Options of `MeshObject`.
    """
    actor.GetMapper().Update()
    surface, _ = surface_of(pv.wrap(actor.GetMapper().GetInputDataObject(0, 0)))
    triangles, cells = triangles_of(surface)
    if not len(triangles):
        return None
    points = np.asarray(surface.points, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return MeshObject(ACTOR, points, triangles, _color(actor, mapper, surface, cells), **options)


def _color(actor: Any, mapper: Any, surface: pv.PolyData, cells: Int64Array) -> Any:
    """Return the colour of an actor: that of its scalars, of its texture, or one for all of it."""
    plain = actor.GetProperty().GetColor()
    mapped: Any = vtkPolyDataMapper()
    of_cells: Any = reference(0)
    mapped.ShallowCopy(mapper)
    mapped.SetInputData(surface)
    mapped.SetInterpolateScalarsBeforeMapping(False)  # else it returns no colours
    levels = mapped.MapScalars(surface, 1.0, of_cells) if mapper.GetScalarVisibility() else None
    if levels is not None:
        rows = linear_colors(pv.convert_array(levels)[:, :3])
        return BaseColor.of_faces(rows[cells]) if of_cells.get() else BaseColor(rows)
    coordinates = surface.active_texture_coordinates
    if actor.GetTexture() is None or coordinates is None:
        return plain
    rows = linear_colors(np.tile(plain, (surface.n_points, 1)))
    make_texture: Any = pv.Texture
    return BaseColor(rows, coordinates, (BaseTexture(make_texture(actor.GetTexture()).to_array()),))
