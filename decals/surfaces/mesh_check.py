"""`MeshCheck`: whether a mesh is closed and manifold, and which of its faces are flipped or degenerate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Int64Array
from decals.sorting import distinct_numbers, runs
from decals.surfaces.topology import components, edge_keys, first_copies, parts_of, welded
from decals.surfaces.windings import Triangles

MIN_HEIGHT = 1e-7
"""Least height of a face over its longest side; float32 does not tell smaller ones from none."""


@dataclass(frozen=True)
class MeshCheck:
    """The soundness of a mesh; vertices at one position count as one.

    Attributes
    ----------
    name : str
        Name of the mesh.
    vertices, faces, parts : int
        Numbers of positions, of faces, and of parts that share no vertex.
    borders : int
        Edges of one face; 0 for a closed mesh.
    flipped : int
        Edges of two faces that wind differently.
    inward : int
        Closed parts, outside of others or not, with a negative volume: they wind inward, or are cavities.
    degenerate : int
        Faces without area.
    copies : int
        Faces that other faces repeat.
    branching : int
        Edges of more than two faces.
    pinched : int
        Vertices at which several fans of faces meet.
    area, volume : float
        The volume is NaN for a mesh that is not closed.

    Examples
    --------
    >>> import pyvista
    >>> from decals.surfaces import check_mesh
    >>> cube = pyvista.Cube().triangulate()
    >>> check = check_mesh(cube.points, cube.regular_faces)
    >>> check.closed, check.sound, check.parts
    (True, True, 1)
    """

    name: str
    vertices: int
    faces: int
    parts: int
    borders: int
    flipped: int
    inward: int
    degenerate: int
    copies: int
    branching: int
    pinched: int
    area: float
    volume: float

    @property
    def closed(self) -> bool:
        """True if every edge has faces on both sides."""
        return self.borders == 0 and self.faces > 0

    @property
    def faults(self) -> dict[str, int]:
        """What a sound mesh has none of, by its name, where there is some."""
        counts = {
            "flipped edges": self.flipped,
            "degenerate faces": self.degenerate,
            "copied faces": self.copies,
            "edges of more than two faces": self.branching,
            "pinched vertices": self.pinched,
        }
        return {name: count for name, count in counts.items() if count}

    @property
    def sound(self) -> bool:
        """True for a manifold without flipped or degenerate faces; it may be open."""
        return not self.faults


def check_mesh(vertices: NDArray[np.floating], faces: NDArray[np.integer], name: str = "mesh") -> MeshCheck:
    """Check a triangle mesh as it is.

    Parameters
    ----------
    vertices : float[n, 3]
        Positions.
    faces : int[m, 3]
        Corner indices, in range.
    name : str
        Name of the mesh.

    Examples
    --------
    >>> from decals.surfaces import check_mesh
    >>> import numpy
    >>> square = numpy.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> check = check_mesh(square, numpy.array([[0, 1, 2], [0, 3, 2]]))
    >>> check.closed, check.faults
    (False, {'flipped edges': 1})
    """
    far = len(vertices) and vertices.dtype == np.float64  # float32 would merge points far from zero
    points: Float32Array = np.ascontiguousarray(vertices - vertices[0] if far else vertices, np.float32)
    corners = welded(points)[faces.astype(np.int64)]
    triangles = Triangles.of(points, faces.astype(np.int32))
    sides = np.linalg.norm(triangles.corners - np.roll(triangles.corners, 1, axis=1), axis=2).max(axis=1)
    flat = triangles.doubled_areas <= MIN_HEIGHT * sides**2
    distinct = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    kept = corners[distinct]
    edges = _Edges(kept)
    groups = parts_of(kept) if len(kept) else np.zeros(0, np.int64)
    middle = points.mean(axis=0, dtype=np.float64) if len(points) else np.zeros(3)
    moved = triangles.corners[distinct] - middle
    volumes = np.einsum("ij,ij->i", moved[:, 0], np.cross(moved[:, 1], moved[:, 2])) / 6.0
    by_part = np.bincount(groups, volumes)
    open_parts = np.zeros(len(by_part), np.bool_)
    open_parts[groups[edges.border_faces]] = True
    return MeshCheck(
        name=name,
        vertices=len(distinct_numbers(corners, len(points))),
        faces=len(faces),
        parts=len(by_part),
        borders=len(edges.border_faces),
        flipped=edges.flipped,
        inward=int(((by_part < 0.0) & ~open_parts).sum()),
        degenerate=int((flat | ~distinct).sum()),
        copies=_copies(kept),
        branching=edges.branching,
        pinched=edges.pinched(kept),
        area=float(0.5 * triangles.doubled_areas.sum()),
        volume=float(volumes.sum()) if len(kept) and not len(edges.border_faces) else float("nan"),
    )


def _copies(corners: Int64Array) -> int:
    """Return how many faces have the corners of another one, in either winding."""
    same = first_copies(np.sort(corners, axis=1))
    return int((same != np.arange(len(same))).sum())


class _Edges:
    """Edges of faces with distinct corners, ``int64[m, 3]``."""

    def __init__(self, corners: Int64Array) -> None:
        starts, ends = corners.reshape(-1), np.roll(corners, -1, axis=1).reshape(-1)
        forward = starts < ends
        order, first, counts = runs(edge_keys(corners).reshape(-1))
        self.border_faces: Int64Array = order[first[counts == 1]] // 3
        self.branching = int((counts > 2).sum())
        pairs = first[counts == 2]
        self._one, self._other = order[pairs], order[pairs + 1]
        self._differ = forward[self._one] == forward[self._other]
        self.flipped = int(self._differ.sum())
        sides = first[counts > 2], counts[counts > 2]
        self._fans = [order[start : start + count] for start, count in zip(*sides, strict=True)]

    def pinched(self, corners: Int64Array) -> int:
        """Return the number of vertices whose faces are several fans; edges join the fans on both sides."""
        links = [_joined_corners(corners, self._one, self._other)]
        links += [_joined_corners(corners, fan[:-1], fan[1:]) for fan in self._fans]
        fans = components(np.concatenate(links), corners.size)
        vertices = np.empty(int(fans.max(initial=-1)) + 1, np.int64)
        vertices[fans] = corners.reshape(-1)  # all corners of a fan are one vertex
        return int((np.bincount(vertices) > 1).sum())


def _joined_corners(corners: Int64Array, sides: Int64Array, others: Int64Array) -> Int64Array:
    """Return pairs of corners ``3 f + k`` at the two ends of edges that two sides share."""

    def ends(side: Int64Array) -> Int64Array:
        face, start = side // 3, side % 3
        return np.stack([3 * face + start, 3 * face + (start + 1) % 3], axis=1)

    flat, mine, theirs = corners.reshape(-1), ends(sides), ends(others)
    alike = (flat[mine[:, 0]] == flat[theirs[:, 0]])[:, None]
    matched = np.where(alike, theirs, theirs[:, ::-1])
    return np.concatenate([np.stack([mine[:, k], matched[:, k]], axis=1) for k in (0, 1)])
