"""Density of seeds painted on the vertices of a mesh."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from decals.errors import InvalidSeeding
from decals.population import Density
from decals.surface import Floats, as_points

NEAREST = 3
"""Vertices from which a value is interpolated."""


def vertex_density(vertices: ArrayLike, values: ArrayLike) -> Density:
    """Make a density of values at vertices, for `seed` and `Relaxation`.

    Between vertices the nearest three are blended by inverse distance; at a vertex its value holds.

    Parameters
    ----------
    vertices
        ``float[n, 3]``.
    values
        ``float[n]``, above zero.

    Raises
    ------
    InvalidSeeding
        If values and vertices differ in number, or a value is not finite and above zero.
    """
    places = as_points(vertices, "vertices")
    given = np.asarray(values, dtype=np.float64)
    if given.shape != (len(places),) or len(places) == 0:
        raise InvalidSeeding(f"values: expected shape [{len(places)}], got {list(given.shape)}; one a vertex")
    if not (np.isfinite(given).all() and (given > 0).all()):
        raise InvalidSeeding("values: expected finite numbers above zero; bar places by a mask")
    tree = cKDTree(places)
    columns = np.arange(1, min(NEAREST, len(places)) + 1)

    def density(points: Floats) -> Floats:
        distances, indices = tree.query(points, k=columns)
        weights = 1.0 / np.maximum(distances, 1e-9 * (distances[:, -1:] + 1e-30))
        blended: Floats = (weights * given[indices]).sum(axis=1) / weights.sum(axis=1)
        return blended

    return density
