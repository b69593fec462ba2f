"""Faces without area: taken out of a closed mesh so that it stays closed."""

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Int32Array, Int64Array
from decals.sorting import stable_order
from decals.surfaces.mesh import have_area
from decals.surfaces.topology import components, welded
from decals.surfaces.windings import Triangles

ROUNDS = 16
"""Most rounds; a flat face beside flat faces needs several."""

SHORT = 1e-5
"""Length of a side over that of the longest one, below which its two corners become one."""


def without_flat_faces(vertices: Float32Array, faces: Int32Array) -> Int32Array:
    """Return the faces of a mesh that have area, between which no gap opens.

    Equal vertices become one, and so do the ends of very short sides of flat faces. Another flat face lies on
    its longest side; it goes, and the face beyond that side is divided at its third corner (an edge flip).
    Faces on a line that enclose nothing go together, as do the two sides of a fold. Flat faces that stay
    after some rounds are left.

    Parameters
    ----------
    vertices : float32[n, 3]
        The vertices.
    faces : int32[m, 3]
        The faces.

    Examples
    --------
    >>> square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 0, 0]], np.float32)
    >>> without_flat_faces(square, np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1]], np.int32)).tolist()
    [[0, 4, 2], [0, 2, 3], [4, 1, 2]]
    """
    kept: Int64Array = welded(vertices)[faces]
    for _ in range(ROUNDS):
        kept = kept[(kept != np.roll(kept, 1, axis=1)).all(axis=1)]
        triangles = Triangles.of(vertices, kept.astype(np.int32))
        rows = np.flatnonzero(~have_area(triangles))
        if not len(rows):
            break
        corners = triangles.corners[rows]
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        short = sides.min(axis=1) < SHORT * sides.max(axis=1)
        if short.any():
            kept = _collapsed(kept, rows[short], sides[short].argmin(axis=1), len(vertices))
        elif len(closed := _closed_groups(kept[rows], len(vertices))):
            kept = np.delete(kept, rows[closed], axis=0)
        else:
            kept = kept[~_flip(kept, rows, sides.argmax(axis=1), len(vertices))]
    return kept.astype(np.int32)


def _collapsed(faces: Int64Array, rows: Int64Array, sides: Int64Array, count: int) -> Int64Array:
    """Return the faces after both ends of one side of some faces are one vertex, without new folds."""
    ends = np.stack([faces[rows, sides], faces[rows, (sides + 1) % 3]], axis=1)
    places = np.arange(count)
    places[ends.max(axis=1)] = ends.min(axis=1)
    while (places[places] != places).any():
        places = places[places]
    moved = places[faces]
    changed = (moved != faces).any(axis=1)
    pairs = _folds(moved)
    return np.delete(moved, pairs[:, changed[pairs].any(axis=0)], axis=0)


def _folds(faces: Int64Array) -> Int64Array:
    """Return pairs of faces that have the same corners and wind the other way round, ``int64[2, k]``."""
    first = faces.argmin(axis=1)[:, None]
    turned = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    ordered = np.sort(turned, axis=1)
    order = np.lexsort(ordered.T)
    alike = (ordered[order[1:]] == ordered[order[:-1]]).all(axis=1)
    against = turned[order[1:], 1] != turned[order[:-1], 1]
    pairs = np.flatnonzero(alike & against)
    pairs = pairs[np.diff(pairs, prepend=-2) > 1]  # a face goes with one other
    return np.stack([order[pairs], order[pairs + 1]])


def _closed_groups(faces: Int64Array, count: int) -> Int64Array:
    """Return the rows of faces in groups without a border: each side has another face of its group."""
    ends = np.roll(faces, -1, axis=1)
    keys, opposite = (faces * count + ends).reshape(-1), (ends * count + faces).reshape(-1)
    order = stable_order(keys)
    at = order[np.searchsorted(keys[order], opposite) % len(keys)]
    shared = keys[at] == opposite
    links = np.stack([np.flatnonzero(shared), at[shared]], axis=1) // 3
    group = components(links, len(faces))
    has_border = np.zeros(len(faces), np.bool_)
    has_border[group[np.flatnonzero(~shared) // 3]] = True
    return np.flatnonzero(~has_border[group])


def _flip(faces: Int64Array, rows: Int64Array, sides: Int64Array, count: int) -> BoolArray:
    """Flip one side of some faces in place, each face once; return the faces that are gone."""
    keys = (faces * count + np.roll(faces, -1, axis=1)).reshape(-1).tolist()
    places = {key: place for place, key in enumerate(keys)}
    gone, changed = np.zeros(len(faces), np.bool_), set[int]()
    for row, side in zip(rows.tolist(), sides.tolist(), strict=True):
        c, a, b = np.roll(faces[row], -side).tolist()
        beyond, at = divmod(places.get(a * count + c, -1), 3)
        if beyond < 0 or {row, beyond} & changed:
            continue
        d = int(faces[beyond, (at + 2) % 3])
        if d == b:  # both faces of a fold
            gone[[row, beyond]] = True
        elif b * count + d in places or d * count + b in places:
            continue  # that edge has its two faces already
        else:
            faces[beyond], faces[row] = (a, b, d), (b, c, d)
            places[b * count + d] = 3 * row + 2
        changed |= {row, beyond}
    return gone
