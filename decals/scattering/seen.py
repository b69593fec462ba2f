"""`seen_from_outside`: a mask of the points that can be seen from outside the models."""

from collections.abc import Callable, Sequence

import numpy as np

from blobtree._typing import BoolArray, Float32Array
from blobtree.validation import point_array
from decals.errors import InvalidScattering
from decals.surfaces.convert import HasSurface, Model, as_surfaces
from decals.surfaces.surface import Surface
from decals.validation import count_number

CLEARANCE = 1e-5
"""Distance from a point at which its rays start, over the size of the models: they miss its own face."""

MAX_DIRECTIONS = 100_000
"""Largest number of directions."""


def seen_from_outside(
    surfaces: Surface | HasSurface | Model | Sequence[Surface | HasSurface | Model],
    *,
    directions: int = 256,
) -> Callable[[Float32Array], BoolArray]:
    """Return a mask of points from which a straight way leads out of the models.

    Give it to `scatter` or `cover`, and parts that are hidden get no decals: a seat in a car body with
    small gaps, the inside of a vessel under its lid. Other closed surfaces hide their inside without it.

    Parameters
    ----------
    surfaces : Surface, Model or object of a scene, or a sequence of these
        The models that hide points, see `decals.scatter`.
    directions
        Number of directions, spread evenly, in which ways are looked for; up to 100,000. Openings that appear
        smaller than 4π over this number, in steradians, may be missed.

    Returns
    -------
    callable
        Function of surface points, ``float[n, 3]``, to ``bool[n]``. A hidden point takes a ray for each
        direction, others a few.

    Raises
    ------
    InvalidScattering
        There is no such model, or the number is out of range.

    See Also
    --------
    region_mask : a mask of flags at faces or vertices.

    Examples
    --------
    >>> import blobtree, decals, pyvista as pv
    >>> room = pv.Box().triangulate().extract_cells(range(11))  # one half of a wall is open
    >>> seen = decals.scattering.seen_from_outside(room)
    >>> seen([[0, 0, -1], [0, 0, 5]]).tolist()
    [True, True]
    >>> hidden = decals.scattering.seen_from_outside([room, pv.Sphere(radius=3.0)])
    >>> hidden([[0, 0, -1], [0, 0, 3]]).tolist()
    [False, True]
    """
    hiding = as_surfaces(surfaces)
    if not hiding:
        raise InvalidScattering("surfaces: expected one or more, got none")
    ways = spread_directions(count_number("directions", directions, 1, MAX_DIRECTIONS, InvalidScattering))
    corners = np.array([surface.bounds for surface in hiding])
    clearance = CLEARANCE * float(np.linalg.norm(corners[:, 1].max(axis=0) - corners[:, 0].min(axis=0)))

    def seen(points: Float32Array) -> BoolArray:
        positions = point_array(points)
        found = np.zeros(len(positions), np.bool_)
        for way in ways:
            rows = np.flatnonzero(~found)
            if len(rows) == 0:
                break
            starts, headings = positions[rows] + clearance * way, np.broadcast_to(way, (len(rows), 3))
            free = np.ones(len(rows), np.bool_)
            for surface in hiding:
                free &= np.isinf(surface.raycast(starts, headings))
            found[rows[free]] = True
        return found

    return seen


def spread_directions(count: int) -> Float32Array:
    """Return unit vectors (count, 3) that lie evenly on the sphere, in an order that soon reaches all sides.

    They are a spherical Fibonacci lattice (Swinbank and Purser 2006, section 2), shuffled.
    """
    numbers = np.arange(count)
    heights = 1.0 - (2.0 * numbers + 1.0) / count
    angles = np.pi * (1.0 + np.sqrt(5.0)) * numbers
    across = np.sqrt(1.0 - heights * heights)
    lattice = np.stack([across * np.cos(angles), across * np.sin(angles), heights], axis=1)
    return np.random.default_rng(0).permutation(lattice).astype(np.float32)
