"""Posed meshes in the G-buffer, and their rest poses in the rest buffer."""

from dataclasses import replace
from typing import Protocol, runtime_checkable

import moderngl
import numpy as np

from blobtree.sized_cache import kept_with
from decals.rendering.context import Context
from decals.rendering.mesh import ColoredMesh, MeshDrawable, mesh_program, mesh_variant, split_mesh
from decals.rendering.pixel_pass import attach_camera, set_uniform
from decals.rendering.rest_buffer import RestBuffer
from decals.rendering.viewpoint import WHOLE, Part, Tile
from decals.rendering.warmup import SHADERS, WarmupPlan, WarmupTask
from decals.shaders import compose
from decals.surfaces.normals import SplitMesh, vertex_normals


@runtime_checkable
class PosedColoredMesh(ColoredMesh, Protocol):
    """A mesh object in a pose: its vertices have places in a rest pose, where its decals lie."""

    @property
    def rest(self) -> ColoredMesh: ...  # noqa: D102


class PosedMeshDrawable(MeshDrawable):
    """A posed mesh on the GPU, with the rest pose that its decals lie on.

    It is split where its rest pose has creases, so that triangles have the same corners in all poses.
    """

    def __init__(self, context: Context, mesh: PosedColoredMesh) -> None:
        rest_split = _rest_split(mesh.rest)
        positions = np.asarray(mesh.vertices, np.float32)[rest_split.rows]
        super().__init__(
            context, mesh, replace(rest_split, normals=vertex_normals(positions, rest_split.faces))
        )
        rest_rows = np.asarray(mesh.rest.vertices, np.float32)[rest_split.rows]
        self._rest_rows = context.gl.buffer(np.hstack([rest_rows, rest_split.normals]).tobytes())
        self._rest_program = _rest_program(context)
        layout = [
            (self._vertices, f"3f {self._row_length - 3}x4", "vertex_position"),
            (self._rest_rows, "3f 3f", "vertex_rest_position", "vertex_rest_normal"),
        ]
        self._rest_array = context.gl.vertex_array(self._rest_program, layout, self._indices)

    @staticmethod
    def warmup(context: Context, mesh: ColoredMesh) -> WarmupPlan:
        """Return the slow first-time work of a drawable."""
        tasks = (
            WarmupTask(SHADERS, lambda: mesh_program(context, mesh)),
            WarmupTask(SHADERS, lambda: _rest_program(context)),
        )
        return WarmupPlan(f"posed mesh {mesh_variant(mesh)}", tasks)

    def draw_rest(self, object_id: int, tile: Tile, rest: RestBuffer, part: Part = WHOLE) -> None:
        """Rasterise the rest pose of the faces, or a part of them, where they are visible."""
        rest.use(tile.width, tile.height)
        set_uniform(self._rest_program, "object_id", object_id)
        first, last = part.of(self._faces)
        if last > first:
            self._rest_array.render(first=3 * first, vertices=3 * (last - first))

    def release(self) -> None:
        """Release the memory."""
        for resource in (self._rest_array, self._rest_rows):
            resource.release()
        super().release()


@kept_with(lambda rest: rest)
def _rest_split(rest: ColoredMesh) -> SplitMesh:
    """Return the split of a rest pose, which all poses share."""
    return split_mesh(rest)


def _rest_program(context: Context) -> moderngl.Program:
    return attach_camera(context.program(compose("rest.vert"), compose("rest.frag")))
