"""Triangle meshes in the G-buffer: rasterised, with smooth normals."""

from typing import Protocol, runtime_checkable

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Int32Array
from decals.rendering.context import Context
from decals.rendering.gbuffer import GBuffer
from decals.rendering.pixel_pass import attach_camera, set_uniform
from decals.rendering.viewpoint import WHOLE, Bounds, Part, Tile
from decals.rendering.warmup import SHADERS, WarmupPlan, WarmupTask
from decals.shaders import compose


@runtime_checkable
class ColoredMesh(Protocol):
    """A mesh object: ``float[n, 3]`` vertices, ``int[m, 3]`` faces, one sRGB colour or one per vertex."""

    @property
    def vertices(self) -> ArrayLike: ...  # noqa: D102
    @property
    def faces(self) -> ArrayLike: ...  # noqa: D102
    @property
    def color(self) -> ArrayLike: ...  # noqa: D102


class MeshDrawable:
    """A mesh's vertices and faces on the GPU."""

    def __init__(self, context: Context, mesh: ColoredMesh) -> None:
        rows = mesh_rows(mesh)
        faces = np.ascontiguousarray(mesh.faces, np.int32)
        self._faces = len(faces)
        self._bounds = rows[:, :3].min(axis=0), rows[:, :3].max(axis=0)
        self._program = _program(context)
        self._vertices = context.gl.buffer(rows.tobytes())
        self._indices = context.gl.buffer(faces.tobytes())
        layout = [(self._vertices, "3f 3f 3f", "vertex_position", "vertex_normal", "vertex_color")]
        self._array = context.gl.vertex_array(self._program, layout, self._indices)

    @staticmethod
    def warmup(context: Context, _mesh: ColoredMesh) -> WarmupPlan:
        """Return the slow first-time work of a drawable."""
        return WarmupPlan("mesh", (WarmupTask(SHADERS, lambda: _program(context)),))

    @property
    def bounds(self) -> Bounds:
        """Box around the vertices."""
        return self._bounds

    @property
    def rasterised(self) -> bool:
        """True: meshes use the depth test."""
        return True

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Rasterise the faces, or a part of them, both sides."""
        gbuffer.use(tile.width, tile.height)
        set_uniform(self._program, "object_id", object_id)
        first, last = part.of(self._faces)
        if last > first:
            self._array.render(first=3 * first, vertices=3 * (last - first))

    def release(self) -> None:
        """Release the memory."""
        for resource in (self._array, self._vertices, self._indices):
            resource.release()


def _program(context: Context) -> moderngl.Program:
    return attach_camera(context.program(compose("mesh.vert"), compose("mesh.frag")))


def mesh_rows(mesh: ColoredMesh) -> Float32Array:
    """Return position, normal and sRGB colour of every vertex, ``float32[n, 9]``, as in the vertex buffer."""
    vertices = np.asarray(mesh.vertices, np.float32)
    rows = np.empty((len(vertices), 9), np.float32)
    rows[:, :3] = vertices
    rows[:, 3:6] = vertex_normals(vertices, np.ascontiguousarray(mesh.faces, np.int32))
    rows[:, 6:] = np.asarray(mesh.color, np.float32)
    return rows


def vertex_normals(vertices: Float32Array, faces: Int32Array) -> Float32Array:
    """Return unit normals at the vertices, each the sum of its faces' normals weighted by area.

    A vertex without any face, or whose faces cancel, gets the z axis.
    """
    a, b, c = np.moveaxis(vertices.astype(np.float64)[faces], 1, 0)
    crosses = np.cross(b - a, c - a)
    corners = faces.reshape(-1)
    sums = np.stack(
        [np.bincount(corners, np.repeat(crosses[:, i], 3), len(vertices)) for i in range(3)], axis=1
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    units = np.where(lengths > 0, sums / np.where(lengths > 0, lengths, 1), [0.0, 0.0, 1.0])
    return units.astype(np.float32)
