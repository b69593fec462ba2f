"""How large decals must be to leave no gap between them."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from blobtree.formulas.kernels import RIM as FIELD_RIM
from decals.seeds.neighbours import FacingTree
from decals.seeds.population import Sites

MARGIN = 0.03
"""Added to every radius, as a part of it: what the search for the farthest point may have missed."""

RIM = 0.75
"""Corners beyond this part of the radius found so far are where the search goes on."""

HOPE = 2.5
"""How much farther a round of trials may get, in its own distances; corners beyond hope drop out."""

SPECK = 0.05
"""Largest part of a decal's mean area that may stay bare, and only to spare it an outsized radius."""

OUTSIZED = 1.5
"""A radius is outsized where this much of the one without specks, and the median, would not do."""

TIE = 1.02
"""A point this little farther from a decal than from its owner is a corner of both."""

TRIALS = 6
"""Places tried around each corner in each round."""

SHRINK = (1.0, 0.6, 0.3, 0.15)
"""Distance of the trials in each round, in mean distances of the samples."""


class Sizing(Enum):
    """Rules for the radii of decals."""

    COVERING = "covering"
    """Least radii that leave no gap."""
    TOUCHING = "touching"
    """Half the distance to the nearest neighbour: none reaches into another."""
    DELAUNAY = "delaunay"
    """The paper's: the field ends at the farthest Delaunay neighbour; leaves small gaps."""


Project = Callable[[Sites], Sites]
"""Puts points back onto their own surfaces, dropping those that are hidden there."""


def covering_radii(decals: Sites, samples: Sites, project: Project, seed: int) -> NDArray[np.float64]:
    """Least radii, up to a small margin, at which decals cover the surfaces they lie on.

    A decal reaches to the farthest point of the surface that is nearer to it than to any other decal that
    faces the point: a corner of its Voronoi cell. Dense samples find the neighbourhood of each corner,
    the centre of the circle through its three decals and random trials climb to it. The paper's rule,
    radius of influence = distance D of the farthest Delaunay neighbour, leaves gaps: already a perfect
    hexagonal tiling needs s = D / (sqrt(3) 0.4542) = 1.271 D.

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
    found = _measure(tree, samples)
    limits = _limits(found, len(decals))
    radii = np.zeros(len(decals))
    _grow(radii, found, limits)
    rng = np.random.default_rng(seed)
    pitch = float(np.median(radii)) * np.sqrt(np.pi * len(decals) / max(len(samples), 1))
    found = found.peaks(RIM * radii)
    found = found.joined(_measure(tree, project(_corners(found, decals))))
    _grow(radii, found, limits)
    for shrink in SHRINK:
        found = found.peaks(np.maximum(RIM * radii, radii - HOPE * shrink * pitch))
        found = found.joined(_measure(tree, project(_around(found.sites, shrink * pitch, rng))))
        _grow(radii, found, limits)
    return (1.0 + MARGIN) * _without_zeros(radii, tree, decals)


def touching_radii(decals: Sites) -> NDArray[np.float64]:
    """Half the distance to the nearest decal that faces the same way; the median where there is none."""
    tree = FacingTree(decals.positions, decals.normals)
    nearest = tree.nearest(decals.positions, decals.normals, skip_self=True)[0][:, 0]
    return _filled(0.5 * nearest)


def delaunay_radii(decals: Sites, samples: Sites) -> NDArray[np.float64]:
    """Radii of the paper's rule (its section 3.4): influence as far as the farthest Delaunay neighbour.

    Two decals are neighbours in the surface's own Delaunay triangulation where their Voronoi cells meet:
    where samples are nearest to the one and next nearest to the other.
    """
    found = _measure(FacingTree(decals.positions, decals.normals), samples)
    pairs = found.decals[(found.decals[:, :2] >= 0).all(axis=1), :2]
    one, other = decals.positions[pairs[:, 0]], decals.positions[pairs[:, 1]]
    lengths = np.linalg.norm(one.astype(np.float64) - other, axis=1)
    farthest = np.full(len(decals), -np.inf)
    for side in (0, 1):
        np.maximum.at(farthest, pairs[:, side], lengths)
    return float(FIELD_RIM) * _filled(farthest)


def _filled(radii: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give rows that are not finite and above zero the median of the others, or 1."""
    known = np.isfinite(radii) & (radii > 0)
    return np.where(known, radii, float(np.median(radii[known])) if known.any() else 1.0)


@dataclass(frozen=True)
class _Measured:
    """Points, and the distances to the three nearest decals that face each, ``[n, 3]``; -1 for none."""

    sites: Sites
    distances: NDArray[np.float64]
    decals: NDArray[np.int64]

    def joined(self, other: "_Measured") -> "_Measured":
        """Put the points of both together."""
        return _Measured(
            Sites.joined([self.sites, other.sites]),
            np.concatenate([self.distances, other.distances]),
            np.concatenate([self.decals, other.decals]),
        )

    def peaks(self, least: NDArray[np.float64]) -> "_Measured":
        """Keep the point farthest from its owner, of those with the same owner and the same next two decals.

        Such points share one corner of the owner's Voronoi cell. Those nearer to their owner than its
        `least` drop out.
        """
        owners = self.decals[:, 0]
        outer = np.flatnonzero((owners >= 0) & (self.distances[:, 0] > least[owners]))
        corners = np.hstack([self.decals[outer, :1], np.sort(self.decals[outer, 1:], axis=1)])
        order = np.lexsort((-self.distances[outer, 0], *corners.T))
        sorted_corners = corners[order]
        first = np.ones(len(order), np.bool_)
        first[1:] = (sorted_corners[1:] != sorted_corners[:-1]).any(axis=1)
        rows = outer[order[first]]
        return _Measured(self.sites[rows], self.distances[rows], self.decals[rows])


def _measure(tree: FacingTree, samples: Sites) -> _Measured:
    return _Measured(samples, *tree.nearest(samples.positions, samples.normals, count=3))


def _corners(peaks: _Measured, decals: Sites) -> Sites:
    """Guess the corner near each peak: the centre of the circle through its three decals."""
    whole = np.flatnonzero((peaks.decals >= 0).all(axis=1))
    a, b, c = np.moveaxis(decals.positions[peaks.decals[whole]].astype(np.float64), 1, 0)
    ab, ac = b - a, c - a
    normal = np.cross(ab, ac)
    square = np.einsum("ni,ni->n", normal, normal)
    ab2, ac2 = np.einsum("ni,ni->n", ab, ab), np.einsum("ni,ni->n", ac, ac)
    offset = ac2[:, None] * np.cross(normal, ab) + ab2[:, None] * np.cross(ac, normal)
    offset /= np.where(square > 0, 2.0 * square, 1.0)[:, None]
    sound = (square > 0) & (np.linalg.norm(offset, axis=1) < 2.0 * peaks.distances[whole, 0])
    guesses = (a + offset)[sound].astype(np.float32)
    return Sites(guesses, peaks.sites.normals[whole][sound], peaks.sites.surface_ids[whole][sound])


def _limits(found: _Measured, count: int) -> NDArray[np.float64]:
    """Radius beyond which a decal is outsized."""
    distances, owners = found.distances[:, 0], found.decals[:, 0]
    specks = max(1, round(SPECK * len(owners) / count))
    order = np.lexsort((-distances, owners))
    order = order[owners[order] >= 0]
    if len(order) == 0:
        return np.zeros(count)
    starts = np.searchsorted(owners[order], np.arange(count + 1))
    next_largest = starts[:-1] + specks
    enough = next_largest < starts[1:]
    trimmed = np.where(enough, distances[order[np.minimum(next_largest, len(order) - 1)]], 0.0)
    median = float(np.median(trimmed[enough])) if enough.any() else np.inf
    return OUTSIZED * np.maximum(trimmed, median)


def _grow(radii: NDArray[np.float64], found: _Measured, limits: NDArray[np.float64]) -> None:
    """Let every decal reach to all points that it owns, or all but owns at a corner, specks aside."""
    close = (found.decals >= 0) & (found.distances <= TIE * found.distances[:, :1])
    distances, owners = found.distances[close], found.decals[close]
    fair = distances <= limits[owners]
    np.maximum.at(radii, owners[fair], distances[fair])


def _around(sites: Sites, distance: float, rng: np.random.Generator) -> Sites:
    """Random points around each site."""
    repeated = sites[np.repeat(np.arange(len(sites)), TRIALS)]
    jitter = rng.normal(0.0, distance, repeated.positions.shape).astype(np.float32)
    return Sites(repeated.positions + jitter, repeated.normals, repeated.surface_ids)


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
