"""`Mesh`: triangles in NumPy arrays."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import Float32Array, Int32Array
from blobtree.device import prefaulted_array
from blobtree.meshing.device_mesh import DeviceMesh


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed triangle mesh, as `polygonize` returns it.

    Attributes
    ----------
    vertices
        float32[n, 3]: positions, in the model's units.
    faces
        int32[m, 3]: indices of vertices, counter-clockwise seen from outside.
    normals
        float32[n, 3]: outward unit normals; on a crease, the mean of the normals of its sides.
    colors
        float32[n, 3]: blended colours, from 0 to 1.
    sheet_counts
        uint8[n], or None without ``creases=True``: the number of smooth sheets that meet in each vertex. It
        is 1 on a smooth part, 2 on a crease, 3 or 4 in a corner, and 0 if the sheets of a cell do not meet
        nearby.

    Examples
    --------
    >>> from blobtree import Point, polygonize
    >>> mesh = polygonize(Point((0, 0, 0), radius=1.0), resolution=16)
    >>> mesh.vertices.shape[1], mesh.faces.dtype.name, mesh.sheet_counts
    (3, 'int32', None)
    """

    vertices: Float32Array
    faces: Int32Array
    normals: Float32Array
    colors: Float32Array
    sheet_counts: NDArray[np.uint8] | None = None


def download(mesh: DeviceMesh, sheet_counts: NDArray[np.uint8] | None = None) -> Mesh:
    """Return the triangles of a device as NumPy arrays."""
    arrays = [mesh.vertices, mesh.faces, mesh.normals, mesh.colors]
    vertices, faces, normals, colors = map(_on_host, arrays)
    return Mesh(vertices, faces, normals, colors, sheet_counts)


def _on_host(array: Any) -> Any:
    """Return the vectors of a device as a NumPy array, which shares the memory of the CPU's own arrays."""
    if array.device.is_cpu:
        return array.numpy()
    host = prefaulted_array((len(array), 3), np.int32 if array.dtype == wp.vec3i else np.float32)
    wp.copy(wp.array(host, dtype=array.dtype, device="cpu", copy=False), array)
    wp.synchronize_device(array.device)
    return host
