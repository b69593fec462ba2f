"""VTK's cameras and actor matrices as arrays and projections."""

from functools import lru_cache
from typing import Any

import numpy as np
import pyvista as pv

from blobtree._typing import Float64Array
from decals.rendering.viewpoint import Projection


def matrix_of(actor: Any) -> Float64Array:
    """Return the matrix from an actor's coordinates to the world, float64, shape (4, 4)."""
    return np.asarray(pv.array_from_vtkmatrix(actor.GetMatrix()), np.float64)


def vtk_projection(renderer: Any, model: Float64Array | None = None) -> Projection:
    """Return the projection of a vtkRenderer's camera, perspective or parallel, with its clipping planes.

    Parameters
    ----------
    renderer
        A vtkRenderer.
    model
        Matrix from model to world, shape (4, 4). Default: identity.
    """
    camera = renderer.GetActiveCamera()
    matrix = camera.GetCompositeProjectionTransformMatrix(renderer.GetTiledAspectRatio(), -1.0, 1.0)
    world = np.asarray(pv.array_from_vtkmatrix(matrix), np.float64)
    return _projection((world if model is None else world @ model).tobytes())


@lru_cache(maxsize=8)
def _projection(matrix: bytes) -> Projection:
    """Return the projection of a float64 matrix; one step of a drag needs it several times."""
    return Projection(np.frombuffer(matrix).reshape(4, 4))
