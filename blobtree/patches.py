"""Which edges of a cell belong to one sheet of surface (dual marching cubes, Nielson 2004).

Corner c of a cell lies at (c & 1, c >> 1 & 1, c >> 2); bit c of a cell's code says whether it is inside.
The surface inside a cell falls apart into patches, each around a loop of crossed edges; the dual mesh has one
vertex per patch. On a face where inside and outside corners alternate, the inside ones are kept apart: both
cells that share the face see the same corners, so both decide alike.
"""

import numpy as np
from numpy.typing import NDArray

EDGES: tuple[tuple[int, int], ...] = tuple(
    (corner, corner | 1 << axis) for axis in range(3) for corner in range(8) if not corner >> axis & 1
)
"""The 12 edges as pairs of corners: four along x, four along y, four along z."""

_FACES: tuple[tuple[int, ...], ...] = tuple(
    tuple(corner for corner in range(8) if corner >> axis & 1 == side)
    for axis in range(3)
    for side in range(2)
)


def _loops(code: int) -> list[int]:
    """For each edge the smallest edge of its loop, −1 where the edge is not crossed."""
    inside = [bool(code >> corner & 1) for corner in range(8)]
    loop = [edge if inside[a] != inside[b] else -1 for edge, (a, b) in enumerate(EDGES)]

    def join(first: int, second: int) -> None:
        low, high = sorted((loop[first], loop[second]))
        loop[:] = [low if label == high else label for label in loop]

    for face in _FACES:
        crossed = [edge for edge, ends in enumerate(EDGES) if loop[edge] >= 0 and set(ends) <= set(face)]
        if len(crossed) == 2:
            join(*crossed)
        for corner in face if len(crossed) == 4 else ():
            if inside[corner]:
                join(*(edge for edge in crossed if corner in EDGES[edge]))
    return loop


def _tables() -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    patch_of_edge = np.full((256, 12), -1, dtype=np.int8)
    patch_count = np.zeros(256, dtype=np.int8)
    for code in range(256):
        loop = _loops(code)
        labels = sorted(set(loop) - {-1})
        patch_count[code] = len(labels)
        patch_of_edge[code] = [labels.index(label) if label >= 0 else -1 for label in loop]
    return patch_of_edge, patch_count


PATCH_OF_EDGE, PATCH_COUNT = _tables()
"""By code: patch (256, 12) of every edge, −1 where it is not crossed; number of patches (256,)."""
