"""A triangle mesh in the memory of a Warp device."""

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.launch import launch
from blobtree.lazy import Lazy
from decals.surfaces.ground import Scalars, Vectors
from decals.surfaces.mesh_queries import closest_faces, closest_points, first_hits, mark_inside
from decals.surfaces.surface import Floats


class MeshGround:
    """Sound faces of a mesh below a bounding volume hierarchy on one device.

    Parameters
    ----------
    vertices, corners, normals
        ``float32[n, 3]``, ``int32[m, 3]`` and the faces' unit normals ``float32[m, 3]``.
    bounds
        Corners of the box around the faces.
    winding
        Tells, when it is first asked what lies inside, whether the closed mesh winds counter-clockwise seen
        from outside (1) or clockwise (-1); 0 for an open one.
    device
        Warp device.
    """

    def __init__(
        self,
        vertices: Floats,
        corners: NDArray[np.int32],
        normals: Floats,
        *,
        bounds: tuple[Floats, Floats],
        winding: Callable[[], int],
        device: str,
    ) -> None:
        self.device = device
        self._winding, self._corners = winding, corners
        self._points: Any = wp.array(vertices, dtype=wp.vec3, device=device)
        self._normals: Any = wp.array(normals, dtype=wp.vec3, device=device)
        indices: Any = wp.array(corners.reshape(-1), dtype=wp.int32, device=device)
        self._mesh = wp.Mesh(points=self._points, indices=indices)
        low, high = (corner.astype(np.float64) for corner in bounds)
        self._low, self._high = wp.vec3(*bounds[0]), wp.vec3(*bounds[1])
        self._ball = wp.vec3(*(0.5 * (low + high))), float(0.51 * np.linalg.norm(high - low))

    @property
    def backing(self) -> list[Any]:
        """What a kernel needs to look for the closest point: mesh, normals, centre and radius of a ball."""
        return [self._mesh.id, self._normals, *self._ball]

    def project(self, points: Vectors, reaches: Scalars, positions: Vectors, normals: Vectors) -> None:
        """Write the closest points and the normals of their faces."""
        inputs = [*self.backing, points, reaches]
        launch(closest_points, len(points), inputs, [positions, normals], device=self.device)

    def locate(self, points: Vectors, faces: Scalars, weights: Any) -> None:
        """Write the closest of the sound faces, and the weights of its first two corners there."""
        inputs = [self._mesh.id, *self._ball, points]
        launch(closest_faces, len(points), inputs, [faces, weights], device=self.device)

    def hit(self, origins: Vectors, directions: Vectors, distances: Scalars) -> None:
        """Write the distance to the first face that each ray meets, infinity for a miss."""
        launch(first_hits, len(origins), [self._mesh.id, origins, directions], [distances], self.device)

    def mark_inside(self, points: Vectors, flags: Scalars) -> None:
        """Write 1 where the closed mesh winds around the point."""
        if self._winding():
            inputs = [self._winding_mesh.id, self._low, self._high, points]
            launch(mark_inside, len(points), inputs, [flags], device=self.device)

    @Lazy
    def _winding_mesh(self) -> wp.Mesh:
        """Winding numbers ask for faces that wind counter-clockwise."""
        turned = np.ascontiguousarray(self._corners[:, :: self._winding()])
        indices: Any = wp.array(turned.reshape(-1), dtype=wp.int32, device=self.device)
        return wp.Mesh(points=self._points, indices=indices, support_winding_number=True)
