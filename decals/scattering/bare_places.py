"""Bare places of surfaces: their number, and centres and radii of new decals that cover them."""

import numpy as np

from blobtree._typing import BoolArray, Float64Array, Int64Array
from blobtree.progress import check_cancelled
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.gap_filling import cell_middles
from decals.scattering.neighbors import FacingTree, NearestFacing
from decals.surfaces.surface import row_blocks

LINK = 2.5
"""Distance up to which bare samples belong to one place, in mean distances of the samples."""

FILLED = 0.92
"""Distance from the centre of a new decal at which a bare sample counts as covered, in the decal's radii.

The rest is a margin for points between the samples, and for surface that bends.
"""

LEAST_RADIUS = 0.6
"""Radius of a decal that fills a narrow place, in the usual radii there."""

FIRST_DISTANCE = 1.4
"""Least distance of the first centres, in reaches; in a hexagonal tiling without gaps it is 1.73."""

MAX_TURNS = 8
"""Largest number of times that centres are added to those that do not cover all samples."""

LARGEST = 1.15
"""Largest radius of a new decal, in usual radii."""

EVEN_ROUNDS = 5
"""Rounds that move each centre to the middle of the samples nearest to it (Lloyd 1982)."""

MAX_HEAP = 16
"""Most samples of one small cube that are linked to others."""

ENCLOSING_STEPS = 20
"""Steps toward the centres of the least balls around these samples (Bădoiu and Clarkson 2003)."""


def places_of(samples: OrientedPoints, distance: float) -> int:
    """Return the number of connected places of bare samples.

    Parameters
    ----------
    samples
        Bare samples.
    distance
        Mean distance of all samples, bare or not.
    """
    from scipy.sparse import coo_array  # imported where they are used: they take a quarter of a second
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    reach, count = LINK * distance, len(samples)
    if count == 0:
        return 0
    samples = samples[_without_heaps(samples, reach)]
    axis = int(np.ptp(samples.positions, axis=0).argmax())
    samples = samples[np.argsort(samples.positions[:, axis], kind="stable")]
    along = samples.positions[:, axis].astype(np.float64)
    places, labels = len(samples), np.arange(len(samples))
    for rows in row_blocks(len(samples), "counting bare places"):
        end = int(np.searchsorted(along, along[rows.stop - 1] + reach, side="right"))
        near = samples[rows.start : end]
        pairs = cKDTree(near.positions).query_pairs(reach, output_type="ndarray")
        facing = np.einsum("ni,ni->n", *(near.normals[pairs[:, side]] for side in (0, 1))) > 0.0
        linked = labels[pairs[facing] + rows.start].T
        links = coo_array((np.ones(linked.shape[1], np.bool_), tuple(linked)), shape=(places, places))
        places, joined = connected_components(links, directed=False)
        labels = joined[labels]
    return int(places)


def _without_heaps(samples: OrientedPoints, reach: float) -> Int64Array:
    """Return rows of samples: at most `MAX_HEAP` of each small cube whose normals have the same signs.

    These samples are all linked to each other, so more of them change nothing. A projection can move very
    many samples to one place, as at a tip, and their pairs would fill the memory.
    """
    cells = np.floor((samples.positions - samples.positions.min(axis=0)) * (2.0 / reach)).astype(np.int64)
    keys = np.zeros(len(samples), np.int64)
    for columns, size in ((cells, 1 << 19), (np.sign(samples.normals).astype(np.int64), 3)):
        for column in columns.T:
            keys = keys * size + column % size
    order = np.argsort(keys, kind="stable")
    begins = np.flatnonzero(np.diff(keys[order], prepend=-1))
    places = np.arange(len(order)) - np.repeat(begins, np.diff(begins, append=len(order)))
    return np.sort(order[places < MAX_HEAP])


def filling_points(
    domain: Domain, samples: OrientedPoints, depths: Float64Array, usual: Float64Array, beside: OrientedPoints
) -> tuple[OrientedPoints, Float64Array]:
    """Return the centres of decals that cover bare samples, evenly and with few, and their radii.

    Parameters
    ----------
    domain
        The surfaces.
    samples
        Bare samples.
    depths
        Distance of each from the decals, ``float64[n]``; the deepest ones get decals first.
    usual
        Radius of decals at each sample, ``float64[n]``.
    beside
        Further bare samples near these, which the decals of the next centres reach.
    """
    reaches = FILLED * usual
    nearest = NearestFacing(samples.positions, samples.normals)
    centers = samples[spread_apart(samples, depths, FIRST_DISTANCE * reaches)]
    for turn in range(MAX_TURNS):
        check_cancelled("filling bare places")
        for _ in range(EVEN_ROUNDS if turn < MAX_TURNS - 1 else 0):
            _, owners = nearest.of(centers.positions, centers.normals)
            centers = _centered(domain, centers, samples, owners)
        distances, owners = nearest.of(centers.positions, centers.normals)
        rows = np.flatnonzero(distances > reaches)
        if len(rows) == 0:
            break
        more = rows[spread_apart(samples[rows], distances[rows], reaches[rows])]
        centers = OrientedPoints.joined([centers, samples[more]])
    distances, owners = nearest.of(centers.positions, centers.normals)
    farthest, sizes = np.zeros(len(centers)), np.zeros(len(centers))
    owned = owners >= 0
    np.maximum.at(farthest, owners[owned], distances[owned])
    np.maximum.at(sizes, owners[owned], usual[owned])
    distances, owners = NearestFacing(beside.positions, beside.normals).of(centers.positions, centers.normals)
    reached = np.flatnonzero((owners >= 0) & (distances <= LARGEST * sizes[owners]))
    np.maximum.at(farthest, owners[reached], distances[reached])
    kept = np.flatnonzero(sizes > 0.0)
    return centers[kept], np.clip(farthest / FILLED, LEAST_RADIUS * sizes, LARGEST * sizes)[kept]


def spread_apart(
    points: OrientedPoints, depths: Float64Array, distances: Float64Array, least_cosine: float = 0.0
) -> Int64Array:
    """Return some of the points, the deepest first, none within its distance of another that faces it.

    Two points face each other if the cosine of their normals is above the least one.
    """
    from scipy.spatial import cKDTree

    tree, chosen = cKDTree(points.positions), list[int]()
    free = np.ones(len(points), np.bool_)
    for row in np.argsort(-depths, kind="stable").tolist():
        if free[row]:
            chosen.append(row)
            near = np.array(tree.query_ball_point(points.positions[row], distances[row]), np.int64)
            free[near[points.normals[near] @ points.normals[row] > least_cosine]] = False
            free[row] = False
    return np.array(chosen, np.int64)


def _centered(
    domain: Domain, centers: OrientedPoints, samples: OrientedPoints, owners: Int64Array
) -> OrientedPoints:
    """Return centres moved to those of the least balls around their samples, on the surface."""
    found = np.unique(owners[owners >= 0])
    middles = cell_middles(centers, found, samples.positions, owners, ENCLOSING_STEPS)
    before = centers[found]
    after, allowed = domain.project(
        OrientedPoints(middles.astype(np.float32), before.normals, before.surface_ids)
    )
    kept = allowed & (np.einsum("ni,ni->n", after.normals, before.normals) > 0.0)
    positions, normals = centers.positions.copy(), centers.normals.copy()
    positions[found[kept]], normals[found[kept]] = after.positions[kept], after.normals[kept]
    return OrientedPoints(positions, normals, centers.surface_ids)


def grown_radii(
    samples: OrientedPoints, centers: OrientedPoints, radii: Float64Array, usual: Float64Array
) -> tuple[Float64Array, BoolArray]:
    """Return radii of new decals that grow to bare samples beside them, and True for samples they reach.

    Parameters
    ----------
    samples
        Bare samples.
    centers, radii
        The decals that may grow.
    usual
        Usual radius at each of them, ``float64[k]``.
    """
    if len(centers) == 0:
        return radii, np.zeros(len(samples), np.bool_)
    tree, largest = FacingTree(centers.positions, centers.normals), LARGEST * usual
    found, which = tree.nearest(samples.positions, samples.normals)
    distances, owners = found[:, 0], which[:, 0]
    reached = (owners >= 0) & (distances <= FILLED * largest[owners])
    grown = radii.copy()
    np.maximum.at(grown, owners[reached], distances[reached] / FILLED)
    # an image that ends before its radius, where the surface bends, grows as well
    again = np.unique(owners[reached & (distances <= FILLED * radii[owners])])
    grown[again] = np.minimum(np.maximum(grown[again], 1.04 * radii[again]), largest[again])
    return grown, reached & (grown[owners] > radii[owners])
