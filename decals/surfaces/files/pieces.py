"""Pieces of a mesh: triangles that files place one or several times, joined to one mesh."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from blobtree._typing import BoolArray, Float64Array, Int32Array, Int64Array
from decals.surfaces.base_color import BaseColor
from decals.surfaces.files.faults import Unreadable
from decals.surfaces.mesh_data import MeshData, joined

MAX_ELEMENTS = 1 << 24
"""Most vertices, and most triangles, of a mesh with all its copies, beside one for each byte of the file."""

MAX_WORK = 1 << 26
"""Most elements, beside `WORK_PER_BYTE`, that are read: a small file may ask for the same ones many times."""

WORK_PER_BYTE = 16


@dataclass(frozen=True, slots=True)
class Piece:
    """Triangles with vertices of their own."""

    points: Float64Array
    """Positions, ``[n, 3]``."""

    faces: Int64Array
    """Corners, ``[m, 3]``, as indices into the points."""

    color: BaseColor | None = None


IntArray = TypeVar("IntArray", Int32Array, Int64Array)


class Budget:
    """Counts the elements of a file before memory and time are taken for them."""

    def __init__(self) -> None:
        self._bytes = 0
        self._spent: Counter[str] = Counter()

    def grow(self, size: int) -> None:
        """Add what some bytes of the file may hold."""
        self._bytes += size

    def work(self, count: int, place: str) -> None:
        """Count elements that are read; `Unreadable` if there are too many in all."""
        self._spend("elements to read", count, MAX_WORK + WORK_PER_BYTE * self._bytes, place)

    def read(self, vertices: int, triangles: int, place: str) -> None:
        """Count elements of a piece; `Unreadable` if there are too many in all."""
        self._spend("vertices", vertices, MAX_ELEMENTS + self._bytes, place)
        self._spend("triangles", triangles, MAX_ELEMENTS + self._bytes, place)

    def place(self, copies: int, piece: Piece, place: str) -> None:
        """Count the copies of a piece; `Unreadable` if they have too many elements in all."""
        limit = MAX_ELEMENTS + self._bytes
        self._spend("vertices with all copies", copies * len(piece.points), limit, place)
        self._spend("triangles with all copies", copies * len(piece.faces), limit, place)

    def _spend(self, kind: str, count: int, limit: int, place: str) -> None:
        self._spent[kind] += count
        if self._spent[kind] > limit:
            raise Unreadable(
                f"it has more than {limit:,} {kind}, counted up to {place}",
                "reduce it, or divide it into several files",
            )


def mirrors(matrices: Float64Array) -> BoolArray:
    """Return which maps, ``[..., 3 or more, 3 or more]``, turn a right hand into a left one."""
    flags: BoolArray = np.linalg.det(matrices[..., :3, :3]) < 0.0
    return flags


def turned(faces: IntArray, flags: BoolArray) -> IntArray:
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
    color = None if piece.color is None else _copied(piece.color, mirrors(matrices))
    return Piece(points.reshape(-1, 3), (faces + starts).reshape(-1, 3), color)


def _copied(color: BaseColor, mirrored: BoolArray) -> BaseColor:
    """Return the base colour of as many copies of a piece as there are flags; true ones are mirrored."""
    copies, corners = len(mirrored), color.corners
    if corners is not None:
        starts = np.arange(copies)[:, None, None] * len(color)
        shape = copies, *corners.shape
        corners = (turned(np.broadcast_to(corners, shape), mirrored[:, None]) + starts).reshape(-1, 3)
    return replace(
        color,
        colors=None if color.colors is None else np.tile(color.colors, (copies, 1)),
        coordinates=None if color.coordinates is None else np.tile(color.coordinates, (copies, 1)),
        texture_of_face=None if color.texture_of_face is None else np.tile(color.texture_of_face, copies),
        corners=corners,
    )


def mesh_of(pieces: Sequence[Piece]) -> MeshData:
    """Return all pieces as one mesh, whose vertices are float64."""
    if not pieces:
        return MeshData(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
    parts: list[Any] = [(piece.points, piece.faces, piece.color) for piece in pieces]
    return joined([MeshData(*part) for part in parts])
