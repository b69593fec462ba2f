"""Triangle meshes in the G-buffer: rasterised, with normals that are smooth up to the crease angle."""

from dataclasses import replace
from typing import Protocol, runtime_checkable
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array
from decals.rendering.context import Context
from decals.rendering.gbuffer import GBuffer
from decals.rendering.pixel_pass import attach_camera, set_uniform
from decals.rendering.rest_buffer import RestBuffer
from decals.rendering.viewpoint import WHOLE, Bounds, Part, Tile
from decals.rendering.warmup import SHADERS, WarmupPlan, WarmupTask
from decals.shaders import compose
from decals.surfaces.normals import CREASE_ANGLE, SplitMesh, split_at_creases, vertex_normals


@runtime_checkable
class ColoredMesh(Protocol):
    """A mesh object: ``float[n, 3]`` vertices, ``int[m, 3]`` faces, one sRGB colour or one per vertex.

    It may have a ``crease_angle`` in degrees; the default is `CREASE_ANGLE`.
    """

    @property
    def vertices(self) -> ArrayLike: ...  # noqa: D102
    @property
    def faces(self) -> ArrayLike: ...  # noqa: D102
    @property
    def color(self) -> ArrayLike: ...  # noqa: D102


@runtime_checkable
class PosedColoredMesh(ColoredMesh, Protocol):
    """A mesh object in a pose: its vertices have places in a rest pose, where its decals lie."""

    @property
    def rest(self) -> ColoredMesh: ...  # noqa: D102


class MeshDrawable:
    """A mesh's vertices and faces on the GPU."""

    def __init__(self, context: Context, mesh: ColoredMesh, split: SplitMesh | None = None) -> None:
        split = split or split_mesh(mesh)
        rows, faces = mesh_rows(mesh, split), np.ascontiguousarray(split.faces, np.int32)
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
            (self._vertices, "3f 6x4", "vertex_position"),
            (self._rest_rows, "3f 3f", "vertex_rest_position", "vertex_rest_normal"),
        ]
        self._rest_array = context.gl.vertex_array(self._rest_program, layout, self._indices)

    @staticmethod
    def warmup(context: Context, _mesh: ColoredMesh) -> WarmupPlan:
        """Return the slow first-time work of a drawable."""
        tasks = (
            WarmupTask(SHADERS, lambda: _program(context)),
            WarmupTask(SHADERS, lambda: _rest_program(context)),
        )
        return WarmupPlan("posed mesh", tasks)

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


_rest_splits: WeakKeyDictionary[ColoredMesh, SplitMesh] = WeakKeyDictionary()


def _rest_split(rest: ColoredMesh) -> SplitMesh:
    """Return the split of a rest pose, which all poses share."""
    split = _rest_splits.get(rest)
    if split is None:
        split = _rest_splits[rest] = split_mesh(rest)
    return split


def _rest_program(context: Context) -> moderngl.Program:
    return attach_camera(context.program(compose("rest.vert"), compose("rest.frag")))


def _program(context: Context) -> moderngl.Program:
    return attach_camera(context.program(compose("mesh.vert"), compose("mesh.frag")))


def split_mesh(mesh: ColoredMesh) -> SplitMesh:
    """Return the mesh as it is drawn: split at its creases."""
    angle: float = getattr(mesh, "crease_angle", CREASE_ANGLE)
    faces = np.ascontiguousarray(mesh.faces, np.int32)
    return split_at_creases(np.asarray(mesh.vertices, np.float32), faces, angle)


def mesh_rows(mesh: ColoredMesh, split: SplitMesh) -> Float32Array:
    """Return position, normal and sRGB colour of every split vertex, ``float32[n, 9]``."""
    rows = np.empty((len(split.rows), 9), np.float32)
    rows[:, :3] = np.asarray(mesh.vertices, np.float32)[split.rows]
    rows[:, 3:6] = split.normals
    colors = np.asarray(mesh.color, np.float32)
    rows[:, 6:] = colors if colors.ndim == 1 else colors[split.rows]
    return rows
