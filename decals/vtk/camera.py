"""VTK's camera as the renderer sees it."""

from functools import lru_cache
from typing import Any

import numpy as np
import pyvista as pv

from decals.scenes.viewpoint import Floats, Projection


def matrix_of(actor: Any) -> Floats:
    """Give an actor's own coordinates to the world's, ``float64[4, 4]``."""
    return np.asarray(pv.array_from_vtkmatrix(actor.GetMatrix()), np.float64)


def vtk_projection(renderer: Any, model: Floats | None = None) -> Projection:
    """Give what a vtkRenderer's camera shows: perspective or parallel, clipping planes as they are.

    Parameters
    ----------
    renderer
        A vtkRenderer.
    model
        Model to world, ``float64[4, 4]``; identity if not given.
    """
    camera = renderer.GetActiveCamera()
    matrix = camera.GetCompositeProjectionTransformMatrix(renderer.GetTiledAspectRatio(), -1.0, 1.0)
    world = np.asarray(pv.array_from_vtkmatrix(matrix), np.float64)
    return _projection((world if model is None else world @ model).tobytes())


@lru_cache(maxsize=8)
def _projection(matrix: bytes) -> Projection:
    """Give the projection of a matrix of float64; one step of a hand asks several times."""
    return Projection(np.frombuffer(matrix).reshape(4, 4))
