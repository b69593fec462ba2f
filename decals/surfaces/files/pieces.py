"""Pieces of a mesh: triangles that files place one or several times, joined to one mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blobtree._typing import BoolArray, Float64Array, Int64Array
from decals.surfaces.files.faults import Unreadable

MAX_ELEMENTS = 1 << 25
"""Most vertices, and most triangles, of a file's mesh with all copies that the file places."""

MAX_WORK = 1 << 29
"""Most elements that are read or computed for it; a small file may ask for the same ones many times."""


@dataclass(frozen=True, slots=True)
class Piece:
    """Triangles with vertices of their own."""

    points: Float64Array
    """Positions, ``[n, 3]``."""

    faces: Int64Array
    """Corners, ``[m, 3]``, as indices into the points."""


class Budget:
    """Counts the elements of a mesh before memory and time are taken for them."""

    def __init__(self) -> None:
        self._vertices = self._triangles = self._work = 0

    def spend(self, vertices: int, triangles: int, place: str) -> None:
        """Count elements of the mesh; `Unreadable` if there are too many in all."""
        self._vertices += vertices
        self._triangles += triangles
        if max(self._vertices, self._triangles) > MAX_ELEMENTS:
            raise self._too_large(f"{MAX_ELEMENTS:,} vertices or triangles", place)

    def work(self, elements: int, place: str) -> None:
        """Count elements that are read; `Unreadable` if there are too many in all."""
        self._work += elements
        if self._work > MAX_WORK:
            raise self._too_large(f"{MAX_WORK:,} elements to read", place)

    def _too_large(self, limit: str, place: str) -> Unreadable:
        return Unreadable(
            f"it has more than {limit}, counted up to {place}", "reduce it, or divide it into several files"
        )


def mirrors(matrices: Float64Array) -> BoolArray:
    """Return which maps, ``[..., 3 or more, 3 or more]``, turn a right hand into a left one."""
    flags: BoolArray = np.linalg.det(matrices[..., :3, :3]) < 0.0
    return flags


def turned(faces: Int64Array, flags: BoolArray) -> Int64Array:
    """Return faces whose winding is reversed where the flags say so."""
    return np.where(flags[..., None], faces[..., ::-1], faces)


def placed(piece: Piece, matrices: Float64Array) -> Piece:
    """Return one piece that holds a copy of a piece for each matrix, ``[k, 4, 4]``.

    The faces of mirrored copies are turned, so they show the same side as those of the others.
    """
    copies, count = len(matrices), len(piece.points)
    points = piece.points @ matrices[:, :3, :3].swapaxes(1, 2) + matrices[:, None, :3, 3]
    faces = turned(np.broadcast_to(piece.faces, (copies, *piece.faces.shape)), mirrors(matrices)[:, None])
    starts = np.arange(copies)[:, None, None] * count
    return Piece(points.reshape(-1, 3), (faces + starts).reshape(-1, 3))


def joined(pieces: Sequence[Piece]) -> Piece:
    """Return all pieces as one."""
    if not pieces:
        return Piece(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    starts = np.cumsum([0] + [len(piece.points) for piece in pieces[:-1]])
    faces = [piece.faces + start for piece, start in zip(pieces, starts, strict=True)]
    return Piece(np.concatenate([piece.points for piece in pieces]), np.concatenate(faces))
