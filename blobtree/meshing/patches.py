"""Tables of the patches of surface in a cell (dual marching cubes, Nielson 2004).

Corner c of a cell lies at (c & 1, c >> 1 & 1, c >> 2). Bit c of a cell's code is set if that corner is
inside. The surface in a cell consists of patches, each bounded by a loop of crossed edges; the dual mesh has
one vertex per patch. On a face where inside and outside corners alternate, the inside corners are kept apart.
Both cells at the face see the same corners, so both decide alike.

There is one exception. If both strands on such a face belong to one patch in both cells, the mesh would have
an edge with four triangles. The inside corners are joined there instead, which splits the patch in both cells
(Wenger 2013). Only cells with a single alternating face are concerned, so a code has two rows in the tables:
code, and code + FLIPPED.
"""

import numpy as np
from numpy.typing import NDArray

EDGES: tuple[tuple[int, int], ...] = tuple(
    (corner, corner | 1 << axis) for axis in range(3) for corner in range(8) if not corner >> axis & 1
)
"""The 12 edges as pairs of corners: four along x, four along y, four along z."""

FACES: tuple[tuple[int, ...], ...] = tuple(
    tuple(corner for corner in range(8) if corner >> axis & 1 == side)
    for axis in range(3)
    for side in range(2)
)
"""The 6 faces as their corners: two across x, two across y, two across z."""

FLIPPED = 256
"""Offset of the rows in which the alternating face joins the inside corners."""

MAX_PATCHES = 4
"""Most patches in one cell."""


def _crossed_edges(code: int, face: tuple[int, ...]) -> list[int]:
    """Return the edges of a face whose ends differ."""
    return [
        edge
        for edge, (a, b) in enumerate(EDGES)
        if {a, b} <= set(face) and (code >> a & 1) != (code >> b & 1)
    ]


def _alternating_faces(code: int) -> list[int]:
    """Return the faces whose corners are inside and outside by turns."""
    return [f for f, face in enumerate(FACES) if len(_crossed_edges(code, face)) == 4]


def _loops(code: int, *, join_inside: bool) -> list[int]:
    """Return for each edge the smallest edge of its loop, −1 if the edge is not crossed."""
    loop = [edge if (code >> a & 1) != (code >> b & 1) else -1 for edge, (a, b) in enumerate(EDGES)]

    def join(first: int, second: int) -> None:
        low, high = sorted((loop[first], loop[second]))
        loop[:] = [low if label == high else label for label in loop]

    for face in FACES:
        crossed = _crossed_edges(code, face)
        if len(crossed) == 2:
            join(*crossed)
        elif len(crossed) == 4:
            for corner in face:
                if bool(code >> corner & 1) != join_inside:
                    join(*(edge for edge in crossed if corner in EDGES[edge]))
    return loop


def _knotted_face(code: int) -> int:
    """Return the alternating face whose strands belong to one patch, or −1."""
    loop = _loops(code, join_inside=False)
    knotted = [
        face
        for face in _alternating_faces(code)
        if len({loop[edge] for edge in _crossed_edges(code, FACES[face])}) == 1
    ]
    assert not knotted or len(_alternating_faces(code)) == 1
    return knotted[0] if knotted else -1


def _tables() -> tuple[NDArray[np.int8], NDArray[np.int8], NDArray[np.int8]]:
    """Return PATCH_OF_EDGE, PATCH_COUNT and KNOTTED_FACE."""
    patch_of_edge = np.full((2 * FLIPPED, 12), -1, dtype=np.int8)
    patch_count = np.zeros(2 * FLIPPED, dtype=np.int8)
    for row in range(2 * FLIPPED):
        loop = _loops(row % FLIPPED, join_inside=row >= FLIPPED)
        labels = sorted(set(loop) - {-1})
        patch_count[row] = len(labels)
        patch_of_edge[row] = [labels.index(label) if label >= 0 else -1 for label in loop]
    knotted_face = np.array([_knotted_face(code) for code in range(FLIPPED)], dtype=np.int8)
    return patch_of_edge, patch_count, knotted_face


PATCH_OF_EDGE, PATCH_COUNT, KNOTTED_FACE = _tables()
"""By row: the patch of each edge (512, 12), −1 if it is not crossed, and the number of patches (512,).
By code: the face (256,) that the exception may concern, or −1."""
