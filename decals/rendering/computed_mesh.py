"""Triangle meshes in the G-buffer through compute shaders, for cards that have few units to rasterise.

A shader finds the nearest face at each pixel. Another one computes the surface where the pixel's ray meets
that face (a visibility buffer: Burns and Hunt, The Visibility Buffer: A Cache-Friendly Approach to Deferred
Shading, JCGT 2013).
"""

from collections.abc import Callable
from functools import partial

import moderngl
import numpy as np

from decals.rendering.context import Context
from decals.rendering.drawable import Drawable
from decals.rendering.gbuffer import NO_FACE, GBuffer
from decals.rendering.mesh import (
    ColoredMesh,
    MeshDrawable,
    MeshFaces,
    mesh_variant,
    split_mesh,
    use_base_texture,
)
from decals.rendering.pixel_pass import GROUP, PassBackend, attach_camera, set_uniform
from decals.rendering.viewpoint import WHOLE, Part, Tile, covered_rectangle
from decals.rendering.warmup import SHADERS, WarmupPlan, WarmupTask
from decals.shaders import compose
from decals.surfaces.normals import SplitMesh

FACE_GROUP = 128
"""Faces that invocations of one group look at together."""

MAX_GROUPS = 65_535
"""Groups that every driver starts at once."""

SPARE_SHARES = 1 << 16
"""Shares of large faces beside one for each face. Once they are taken, a further face is one share."""

SHARES_HEAD = np.array([0, 1, 1, 0, 0, 0, 0, 0], np.uint32).tobytes()
"""Numbers before an empty list: groups that draw it (three axes), length, spare shares taken, padding."""

MIN_BLOCK_BYTES = 1 << 27
"""Size of storage buffers that shaders can read, on drivers that do not state it."""

ROWS_BINDING, FACES_BINDING, SHARES_BINDING = 1, 2, 3
"""Binding points of the storage buffers in ``shaders/face_rows.glsl`` and ``shaders/faces.comp``."""

SURFACE_UNIT = 2
"""First image unit of the G-buffer in ``shaders/mesh.comp``; the faces' textures lie before it."""

ROW_LENGTHS = {"plain": 9, "base": 9, "textured": 11}
"""Numbers of a vertex, by the variant of its mesh."""


class ComputedMeshDrawable(MeshFaces):
    """A mesh that compute shaders draw."""

    def __init__(self, context: Context, mesh: ColoredMesh, split: SplitMesh) -> None:
        super().__init__(context, mesh, split)
        self._gl = context.gl
        self._finder, self._shares, self._surface = (
            make() for make in face_programs(context, mesh_variant(mesh))
        )
        self._list = context.gl.buffer(reserve=list_bytes(self._faces))

    @property
    def rasterised(self) -> bool:
        """False: positions are compared, and no depth is written."""
        return False

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Draw both sides of the faces at all pixels, or in a part of their rows."""
        rectangle = covered_rectangle(self._bounds, tile).rows(part)
        if not rectangle.area:
            return
        for binding, buffer in (
            (ROWS_BINDING, self._vertices),
            (FACES_BINDING, self._indices),
            (SHARES_BINDING, self._list),
        ):
            buffer.bind_to_storage_buffer(binding)
        gbuffer.bind_faces()
        gbuffer.bind_surface(SURFACE_UNIT)
        set_uniform(self._surface, "object_id", object_id)
        set_uniform(self._surface, "rectangle", (rectangle.x, rectangle.y, rectangle.width, rectangle.height))
        for program in (self._finder, self._shares):
            set_uniform(program, "tile_size", (tile.width, tile.height))
            set_uniform(program, "row_range", (rectangle.y, rectangle.y + rectangle.height))
        try:
            for first, last, image in self._ranges(WHOLE):
                self._find_faces(first, last)
                use_base_texture(self._surface, image)
                self._surface.run(-(-rectangle.width // GROUP), -(-rectangle.height // GROUP))
                self._gl.memory_barrier()
        except BaseException:
            gbuffer.forget_faces()
            raise

    def _find_faces(self, first: int, last: int) -> None:
        """Write the numbers of the nearest of these faces, after their depths."""
        set_uniform(self._finder, "first_face", first)
        set_uniform(self._finder, "end_face", last)
        for naming in (False, True):
            self._list.write(SHARES_HEAD)
            set_uniform(self._finder, "naming", naming)
            set_uniform(self._shares, "naming", naming)
            self._gl.memory_barrier()
            self._finder.run(min(-(-(last - first) // FACE_GROUP), MAX_GROUPS))
            self._gl.memory_barrier()
            self._shares.run_indirect(self._list)
        self._gl.memory_barrier()

    def release(self) -> None:
        """Release the memory."""
        self._list.release()
        super().release()


def face_program(
    context: Context, variant: str, name: str, *, shares: bool = False
) -> moderngl.ComputeShader:
    """Return a program for meshes of a variant, of the shader ``faces.comp`` or ``mesh.comp``."""
    defines: dict[str, str | int | bool] = {
        "GROUP": GROUP,
        "FACE_GROUP": FACE_GROUP,
        "NO_FACE": f"{NO_FACE}u",
        "ROW_LENGTH": ROW_LENGTHS[variant],
        "SHARES": shares,
        "SPARE_SHARES": SPARE_SHARES,
        "BASE": variant != "plain",
        "TEXTURED": variant == "textured",
    }
    return attach_camera(context.compute_program(compose(name, defines=defines, version="430 core")))


def face_programs(context: Context, variant: str) -> list[Callable[[], moderngl.ComputeShader]]:
    """Return functions that make the programs: for nearest faces, shares of large faces, and surfaces."""
    make = partial(face_program, context, variant)
    return [partial(make, "faces.comp"), partial(make, "faces.comp", shares=True), partial(make, "mesh.comp")]


def is_computed(context: Context) -> bool:
    """Return True if meshes are drawn by compute shaders, as all passes."""
    return context.backend is PassBackend.COMPUTE


def list_bytes(faces: int) -> int:
    """Return the size of the list of shares for a number of faces."""
    return len(SHARES_HEAD) + 16 * (faces + SPARE_SHARES)


def mesh_drawable(context: Context, mesh: ColoredMesh) -> Drawable:
    """Return the drawable of a mesh for the backend; one too large for storage buffers is rasterised."""
    split = split_mesh(mesh)
    limit = context.gl.info.get("GL_MAX_SHADER_STORAGE_BLOCK_SIZE", MIN_BLOCK_BYTES)
    bytes_of_rows = 4 * ROW_LENGTHS[mesh_variant(mesh)] * len(split.rows)
    if is_computed(context) and max(bytes_of_rows, list_bytes(len(split.faces))) <= limit:
        return ComputedMeshDrawable(context, mesh, split)
    return MeshDrawable(context, mesh, split)


def mesh_warmup(context: Context, mesh: ColoredMesh) -> WarmupPlan:
    """Return the slow first-time work of a mesh's drawable."""
    if not is_computed(context):
        return MeshDrawable.warmup(context, mesh)
    variant = mesh_variant(mesh)
    tasks = tuple(WarmupTask(SHADERS, make) for make in face_programs(context, variant))
    return WarmupPlan(f"computed mesh {variant}", tasks)
