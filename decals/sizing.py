"""How large decals must be to leave no gap between them."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from decals.neighbours import FacingTree
from decals.population import Sites
from decals.surface import Floats

MARGIN = 0.02
"""Added to every radius, as a part of it: what the search for the farthest point may have missed."""

RIM = 0.75
"""Samples beyond this part of the radius found so far are where the search goes on."""

TRIALS = 4
"""Places tried around each such sample."""

SHRINK = (1.0, 0.5, 0.25)
"""Distance of the trials in each round, in mean distances of the samples."""

Project = Callable[[Sites], Sites]
"""Puts points back onto their own surfaces, dropping those that are hidden there."""


def covering_radii(decals: Sites, samples: Sites, project: Project, seed: int) -> NDArray[np.float64]:
    """Least radii, up to a small margin, at which decals cover the surfaces they lie on.

    A decal reaches to the farthest point of the surface that is nearer to it than to any other decal that
    faces the point: the corner of its Voronoi cell. Dense samples find the neighbourhood of that point,
    random trials around the outer samples climb to it. The paper's rule, radius of influence =
    distance D of the farthest Delaunay neighbour, leaves gaps: already a perfect hexagonal tiling
    needs s = D / (sqrt(3) 0.4542) = 1.271 D.

    Points that face none of the nearest decals (`neighbours.WIDENING`) stay bare. A decal that owns no
    sample takes half the distance to its nearest neighbour, else the median radius of the others.

    Parameters
    ----------
    decals
        Centres, with the normals of their surfaces.
    samples
        Points spread evenly over what must be covered, 32 or more for each decal.
    project
        Puts trial points back onto their surfaces.
    seed
        Of the trials.

    Returns
    -------
    float64[n], above zero.
    """
    tree = FacingTree(decals.positions, decals.normals)
    radii = np.zeros(len(decals))
    distances, owners = _measure(tree, samples)
    _grow(radii, distances, owners)
    rng = np.random.default_rng(seed)
    pitch = float(np.median(radii)) * np.sqrt(np.pi * len(decals) / max(len(samples), 1))
    for shrink in SHRINK:
        outer = np.flatnonzero((owners >= 0) & (distances > RIM * radii[owners]))
        samples = project(_around(samples, outer, shrink * pitch, rng))
        distances, owners = _measure(tree, samples)
        _grow(radii, distances, owners)
    return (1.0 + MARGIN) * _without_zeros(radii, tree, decals)


def _measure(tree: FacingTree, samples: Sites) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Distance of each sample to the nearest decal that faces it, and which that is."""
    distances, owners = tree.nearest(samples.positions, samples.normals)
    return distances[:, 0], owners[:, 0]


def _grow(radii: NDArray[np.float64], distances: NDArray[np.float64], owners: NDArray[np.int64]) -> None:
    """Let every decal reach to all points that it owns."""
    owned = owners >= 0
    np.maximum.at(radii, owners[owned], distances[owned])


def _around(samples: Sites, rows: NDArray[np.int64], distance: float, rng: np.random.Generator) -> Sites:
    """The samples themselves and random points around each."""
    positions = np.repeat(samples.positions[rows], TRIALS + 1, axis=0)
    jitter = rng.normal(0.0, distance, positions.shape).astype(np.float32)
    jitter[:: TRIALS + 1] = 0.0
    repeated: list[Floats] = [np.repeat(samples.normals[rows], TRIALS + 1, axis=0)]
    return Sites(positions + jitter, repeated[0], np.repeat(samples.surface_ids[rows], TRIALS + 1))


def _without_zeros(radii: NDArray[np.float64], tree: FacingTree, decals: Sites) -> NDArray[np.float64]:
    """Give decals that own nothing a size all the same."""
    nothing = ~(radii > 0)
    if not nothing.any():
        return radii
    nearest, _ = tree.nearest(decals.positions, decals.normals, skip_self=True)
    others = radii[~nothing]
    fallback = float(np.median(others)) if len(others) else 1.0
    usable = np.isfinite(nearest[:, 0]) & (nearest[:, 0] > 0)
    return np.where(nothing, np.where(usable, 0.5 * nearest[:, 0], fallback), radii)
