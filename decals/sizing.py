"""How large decals must be to leave no gap between them."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from decals.neighbours import FacingTree
from decals.population import Sites

MARGIN = 0.02
"""Added to every radius, as a part of it: what the search for the farthest point may have missed."""

RIM = 0.75
"""Samples beyond this part of the radius found so far are where the search goes on."""

SPECK = 0.02
"""Largest part of a decal's mean area that may stay bare, and only to spare it an outsized radius."""

OUTSIZED = 1.5
"""A radius is outsized where this much of the one without specks, and the median, would not do."""

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

    Two things stay bare: points that face none of the nearest decals (`neighbours.WIDENING`), and specks,
    such as a lone folded face or a crumb far off, that would make a decal outsized (`SPECK`, `OUTSIZED`).
    A decal that owns no sample takes half the distance to its nearest neighbour, else the median radius.

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
    limits = _limits(distances, owners, len(decals))
    _grow(radii, distances, owners, limits)
    rng = np.random.default_rng(seed)
    pitch = float(np.median(radii)) * np.sqrt(np.pi * len(decals) / max(len(samples), 1))
    for shrink in SHRINK:
        outer = np.flatnonzero((owners >= 0) & (distances > RIM * radii[owners]))
        samples = project(_around(samples, outer, shrink * pitch, rng))
        distances, owners = _measure(tree, samples)
        _grow(radii, distances, owners, limits)
    return (1.0 + MARGIN) * _without_zeros(radii, tree, decals)


def _measure(tree: FacingTree, samples: Sites) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Distance of each sample to the nearest decal that faces it, and which that is."""
    distances, owners = tree.nearest(samples.positions, samples.normals)
    return distances[:, 0], owners[:, 0]


def _limits(distances: NDArray[np.float64], owners: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """Radius beyond which a decal is outsized."""
    specks = max(1, round(SPECK * len(owners) / count))
    order = np.lexsort((-distances, owners))
    order = order[owners[order] >= 0]
    starts = np.searchsorted(owners[order], np.arange(count + 1))
    without = np.minimum(starts[:-1] + specks, len(order) - 1)
    enough = starts[:-1] + specks < starts[1:]
    trimmed = np.where(enough, distances[order[without]], 0.0) if len(order) else np.zeros(count)
    median = float(np.median(trimmed[enough])) if enough.any() else np.inf
    return OUTSIZED * np.maximum(trimmed, median)


def _grow(
    radii: NDArray[np.float64],
    distances: NDArray[np.float64],
    owners: NDArray[np.int64],
    limits: NDArray[np.float64],
) -> None:
    """Let every decal reach to all points that it owns, specks aside."""
    owned = np.flatnonzero(owners >= 0)
    owned = owned[distances[owned] <= limits[owners[owned]]]
    np.maximum.at(radii, owners[owned], distances[owned])


def _around(samples: Sites, rows: NDArray[np.int64], distance: float, rng: np.random.Generator) -> Sites:
    """Repeat the samples, with random points around each."""
    positions = np.repeat(samples.positions[rows], TRIALS + 1, axis=0)
    jitter = rng.normal(0.0, distance, positions.shape).astype(np.float32)
    jitter[:: TRIALS + 1] = 0.0
    normals = np.repeat(samples.normals[rows], TRIALS + 1, axis=0)
    return Sites(positions + jitter, normals, np.repeat(samples.surface_ids[rows], TRIALS + 1))


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
