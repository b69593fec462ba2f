"""Subdivision of triangle meshes: long edges are halved, and faces on both sides of an edge stay joined."""

from collections.abc import Callable

import numpy as np

from blobtree._typing import BoolArray, Float64Array, Int64Array
from decals.errors import InvalidMesh
from decals.sorting import groups

MAX_FACES = 10_000_000
"""Most triangles of a subdivided mesh."""

Midpoints = Callable[[Float64Array, Int64Array], Float64Array]
"""Rows ``float64[k, c]`` of new vertices, from the rows of all and the ends ``int64[k, 2]`` of edges."""

_CUTS = {
    1: ((0, 3, 2), (3, 1, 2)),
    2: ((0, 1, 4), (0, 4, 2)),
    4: ((0, 1, 5), (5, 1, 2)),
    3: ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    6: ((4, 2, 5), (1, 4, 5), (1, 5, 0)),
    5: ((5, 0, 3), (2, 5, 3), (2, 3, 1)),
    7: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}
"""Triangles by the edges that are halved, if any: corners 0 to 2, middles 3 to 5 of the edges behind them."""


def means(rows: Float64Array, ends: Int64Array) -> Float64Array:
    """Return the means of the rows at both ends of edges."""
    return 0.5 * (rows[ends[:, 0]] + rows[ends[:, 1]])


def too_many(count: str) -> InvalidMesh:
    """Return the error of a mesh that takes more than MAX_FACES triangles."""
    return InvalidMesh(
        f"expected at most {MAX_FACES:,} triangles, edges so short need {count}; give a longer edge_length"
    )


def subdivided(
    rows: Float64Array,
    faces: Int64Array,
    is_long: Callable[[Float64Array, Float64Array], BoolArray],
    midpoints: Midpoints = means,
) -> tuple[Float64Array, Int64Array]:
    """Halve edges until no edge is long.

    Whether an edge is halved depends on the positions of its ends alone. So copies of a vertex, such as those
    on two sides of a crease, get copies of all new vertices between them, and no crack opens.

    Parameters
    ----------
    rows : float64[n, c]
        Positions of the vertices, and whatever else is known of them.
    faces : int64[m, 3]
        Corner indices.
    is_long : callable
        From the positions of both ends of k edges, ``float64[k, 3]`` each, to ``bool[k]``. Each round asks
        for the new edges.
    midpoints : callable
        Rows of new vertices, by default the means of those of the ends.

    Returns
    -------
    rows : float64[n', c]
        The given vertices, and new ones.
    faces : int64[m', 3]

    Raises
    ------
    InvalidMesh
        More than MAX_FACES triangles would be needed.
    """
    before, done = 0, [faces[:0]]  # faces without a long edge stay as they are
    while True:
        next_corners = np.roll(faces, -1, axis=1)
        low, high = (of(faces, next_corners).reshape(-1) for of in (np.minimum, np.maximum))
        first, edge_of, _ = groups(low * len(rows) + high)
        edges = np.stack([low[first], high[first]], axis=1)
        halved = edges[:, 1] >= before  # the others were short before
        halved[halved] = is_long(*(rows[ends, :3] for ends in edges[halved].T))
        if not halved.any():
            return rows, np.concatenate([*done, faces])
        numbers = np.full(len(edges), -1)
        numbers[halved] = len(rows) + np.arange(int(halved.sum()))
        middles = numbers[edge_of.reshape(-1, 3)]
        kinds = (middles >= 0) @ [1, 2, 4]
        if sum(map(len, done)) + (1 + np.bitwise_count(kinds)).sum() > MAX_FACES:
            raise too_many("more")  # each middle adds a triangle
        done.append(faces[kinds == 0])
        before = len(rows)
        rows = np.concatenate([rows, midpoints(rows, edges[halved])])
        corners = np.concatenate([faces, middles], axis=1)
        faces = np.concatenate(
            [corners[kinds == kind][:, cut] for kind, cuts in _CUTS.items() for cut in cuts]
        )
