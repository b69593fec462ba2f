"""Discrete exponential maps (Schmidt, Grimm and Wyvill 2006, "Interactive Decal Compositing with Discrete
Exponential Maps", section 3), for the comparison of methods.

From its centre a map grows along the shortest paths of edges. Each edge is unrolled into the tangent plane of
its start: projected along the normal, and stretched to its length. Frames are rotated onto each other by the
smallest rotation between their normals. The paths are those of SciPy's Dijkstra on the edges of the mesh; the
paper's upwind average over neighbours, an extension, is left out.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class ExponentialMaps:
    """A mesh with a frame at each vertex.

    Attributes
    ----------
    vertices, normals : float64[v, 3]
    tangents : float64[v, 2, 3]
        Two tangents of each vertex.
    edges : sparse float64[v, v]
        Lengths of edges.
    """

    vertices: Float64Array
    normals: Float64Array
    tangents: Float64Array
    edges: Any

    @classmethod
    def of(cls, vertices: Float64Array, faces: NDArray[Any], normals: Float64Array) -> "ExponentialMaps":
        """Prepare a mesh with unit normals at its vertices."""
        starts = faces.reshape(-1)
        ends = np.roll(faces, -1, axis=1).reshape(-1)
        pairs = np.unique(np.sort(np.column_stack([starts, ends]), axis=1), axis=0)
        lengths = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)
        count = len(vertices)
        edges = coo_matrix((lengths, (pairs[:, 0], pairs[:, 1])), shape=(count, count)).tocsr()
        least = np.eye(3)[np.abs(normals).argmin(axis=1)]
        first = np.cross(normals, least)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        tangents = np.stack([first, np.cross(normals, first)], axis=1)
        return cls(vertices, normals, tangents, edges)

    def map(self, center: int, radius: float) -> tuple[NDArray[np.int64], Float64Array]:
        """Return the vertices that paths of a length reach, and their offsets from the centre, [k, 3]."""
        distance, before = dijkstra(
            self.edges, directed=False, indices=center, return_predecessors=True, limit=radius
        )
        reached = np.flatnonzero(np.isfinite(distance))
        reached = reached[np.argsort(distance[reached], kind="stable")]
        ends, starts = reached[1:], before[reached[1:]]
        steps = self._steps(starts, ends)
        turns = self._turns(starts, ends)
        place, angle = {center: 0j}, {center: 1.0 + 0j}
        for start, end, step, turn in zip(
            starts.tolist(), ends.tolist(), steps.tolist(), turns.tolist(), strict=True
        ):
            place[end] = place[start] + angle[start] * step
            angle[end] = angle[start] * turn
        flat = np.array([place[vertex] for vertex in reached.tolist()])
        offsets = np.column_stack([flat.real, flat.imag]) @ self.tangents[center]
        return reached.astype(np.int64), offsets

    def _steps(self, starts: NDArray[Any], ends: NDArray[Any]) -> NDArray[np.complex128]:
        """Return edges in the tangent planes of their starts, at their own lengths, as complex numbers."""
        w = self.vertices[ends] - self.vertices[starts]
        flat = np.einsum("nij,nj->ni", self.tangents[starts], w)
        size = np.linalg.norm(flat, axis=1)
        flat *= (np.linalg.norm(w, axis=1) / np.where(size > 0, size, 1.0))[:, None]
        result: NDArray[np.complex128] = flat[:, 0] + 1j * flat[:, 1]
        return result

    def _turns(self, starts: NDArray[Any], ends: NDArray[Any]) -> NDArray[np.complex128]:
        """Return the rotations from the frames of ends to those of starts, as complex numbers of length 1."""
        a, b = self.normals[ends], self.normals[starts]
        v = self.tangents[ends, 0]
        axis, cosine = np.cross(a, b), (a * b).sum(axis=1, keepdims=True)
        along = (axis * v).sum(axis=1, keepdims=True)
        turned = cosine * v + np.cross(axis, v) + axis * along / (1.0 + cosine)
        flat = np.einsum("nij,nj->ni", self.tangents[starts], turned)
        result: NDArray[np.complex128] = flat[:, 0] + 1j * flat[:, 1]
        return result / np.abs(result)
