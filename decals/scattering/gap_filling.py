"""Particles beside wide gaps move toward the middle of their cells."""

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int64Array
from decals.scattering.domain import Domain, OrientedPoints
from decals.scattering.neighbors import FacingTree, NeighborQuery
from decals.scattering.particle_state import ParticleState

WIDE_GAP = 0.8
"""Distance from the nearest particle, in spacings, from which a point lies in a wide gap. In a hexagonal
tiling no point is farther than 0.577, in a square one 0.658."""

WIDE_CELL = 0.72
"""Reach of a cell in the tangent plane, in spacings, from which its border is looked at on the surface."""

GAP_REACH = 1.5
"""Largest distance of a point from its nearest particle, in spacings; farther ones lie on scraps."""

OWN = 1.02
"""Ratio of a point's distances from a particle and from the nearest one up to which it is of the particle's
cell: points on the border of a cell are as far from others."""

EVEN = 1.1
"""Largest ratio of spacings at which the density counts as even."""

ROUNDS = 8
"""Largest number of rounds of moves."""

MOVE = 0.5
"""Length of a move, as a share of the way to the middle."""

ENCLOSING_STEPS = 24
"""Steps toward the centres of the least balls around points (Bădoiu and Clarkson 2003)."""


def fill_gaps(state: ParticleState, least: float) -> None:
    """Move particles beside wide gaps; gaps remain along lips and ragged boundaries.

    A particle beside a wide gap moves toward the centre of the least ball around its Voronoi cell.
    It stays if another particle would be nearer than before, and nearer than `least`. Where the density is
    not even, all stay: wide gaps belong beside its steps.

    Parameters
    ----------
    state
        The particles.
    least
        Least distance of particles, in spacings.
    """
    sizes = state.host_sizes
    if sizes.max() > EVEN * sizes.min():
        return
    query = NeighborQuery(state, 2.0 * GAP_REACH)
    near = np.arange(state.count)
    for _ in range(ROUNDS):
        rows = near[state.movable[near]]
        rows = rows[query.cells(rows, outlines=False)[0] > WIDE_CELL]
        points = state.points()
        outlines, owners = _outlines(state, query, points, rows)
        gaps = query.owners(outlines.positions, outlines.normals)[0]
        own = np.linalg.norm(outlines.positions - points.positions[owners], axis=1)
        owners = np.where(own <= OWN * state.spacing * gaps, owners, -1)
        rows = np.unique(owners[(owners >= 0) & (gaps > WIDE_GAP)])
        if len(rows) == 0:
            break
        moved = _moved(state.domain, points, rows, outlines.positions, owners)
        now, then = (
            query.apart(some, rows).astype(np.float64) * sizes[rows] for some in (points[rows], moved)
        )
        keep = np.flatnonzero(_far_enough(moved, now, then, least * sizes[rows]))
        if len(keep) == 0:
            break
        left, rows, moved = points.positions[rows[keep]], rows[keep], moved[keep]
        state.move_to(rows, moved.positions, moved.normals)
        query.refresh()
        near = query.near(np.concatenate([left, moved.positions]))


def _outlines(
    state: ParticleState, query: NeighborQuery, points: OrientedPoints, rows: Int64Array
) -> tuple[OrientedPoints, Int64Array]:
    """Return the points of the surfaces on the borders of some particles' cells, and the particle of each."""
    outlines = query.cells(rows)[1]
    around = np.repeat(rows, outlines.shape[1])
    flat = OrientedPoints(outlines.reshape(-1, 3), points.normals[around], points.surface_ids[around])
    projected, allowed = state.domain.project(flat)
    found = np.flatnonzero(allowed)
    return projected[found], around[found]


def _moved(
    domain: Domain, points: OrientedPoints, rows: Int64Array, samples: Float32Array, owners: Int64Array
) -> OrientedPoints:
    """Return some particles after their moves, the others' place where these would be hidden."""
    before = points[rows]
    starts = before.positions.astype(np.float64)
    targets = starts + MOVE * (cell_middles(points, rows, samples, owners) - starts)
    after, allowed = domain.project(
        OrientedPoints(targets.astype(np.float32), before.normals, before.surface_ids)
    )
    kept = np.flatnonzero(allowed)
    return before.replaced(kept, after[kept])


def cell_middles(
    points: OrientedPoints,
    rows: Int64Array,
    samples: Float32Array,
    owners: Int64Array,
    steps: int = ENCLOSING_STEPS,
) -> Float64Array:
    """Return the centres of the least balls around the cells of some points, ``float64[k, 3]``.

    A cell is the samples that a point owns; without any, its middle is the point.

    Parameters
    ----------
    points, rows
        The points, and the numbers of those that have the cells.
    samples, owners
        Points of the surfaces, ``float32[m, 3]``, and the row of the point that owns each, -1 for none.
    steps
        Steps toward the centres.
    """
    middles = points.positions.astype(np.float64)
    of_row = np.zeros(len(points), np.bool_)
    of_row[rows] = True
    owned = np.flatnonzero((owners >= 0) & of_row[owners])
    order = owned[np.argsort(owners[owned], kind="stable")]
    found, starts, counts = np.unique(owners[order], return_index=True, return_counts=True)
    own, groups = samples[order].astype(np.float64), np.repeat(np.arange(len(found)), counts)
    farthest = np.empty(len(found), np.int64)
    for step in range(1, steps if len(found) else 1):
        offsets = own - middles[found][groups]
        lengths = np.einsum("ni,ni->n", offsets, offsets)
        far = np.flatnonzero(lengths >= np.maximum.reduceat(lengths, starts)[groups])
        farthest[groups[far]] = far
        middles[found] += (own[farthest] - middles[found]) / (step + 1)
    return middles[rows]


def _far_enough(
    moved: OrientedPoints, now: Float64Array, then: Float64Array, least: Float32Array
) -> BoolArray:
    """Return True for moves after which no particle is too near, also none that moves at the same time.

    Parameters
    ----------
    moved
        The particles after their moves.
    now, then
        Distance of each to the nearest other particle, before and after its move alone.
    least
        Distance that is enough.
    """
    tree = FacingTree(moved.positions, moved.normals)
    apart = tree.nearest(moved.positions, moved.normals, skip_self=True)[0][:, 0]
    enough: BoolArray = np.minimum(then, apart) >= np.minimum(least, now)
    return enough
