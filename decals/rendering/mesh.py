"""Triangle meshes in the G-buffer: rasterised, with normals that are smooth up to the crease angle."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Int32Array
from decals.rendering.base_textures import WHITE_TEXTURE, SharedTexture, shared_texture
from decals.rendering.context import Context
from decals.rendering.gbuffer import GBuffer
from decals.rendering.pixel_pass import Program, attach_camera, set_uniform
from decals.rendering.viewpoint import WHOLE, Bounds, Part, Tile
from decals.rendering.warmup import SHADERS, WarmupPlan, WarmupTask
from decals.shaders import compose
from decals.surfaces.base_color import BaseColor
from decals.surfaces.normals import (
    CREASE_ANGLE,
    SplitMesh,
    split_at_colors,
    split_at_creases,
)


@runtime_checkable
class ColoredMesh(Protocol):
    """A mesh object: ``float[n, 3]`` vertices, ``int[m, 3]`` faces, one sRGB colour or one per vertex.

    Its colour may also be a `decals.surfaces.BaseColor`.
    It may have a ``crease_angle`` in degrees; the default is `CREASE_ANGLE`.
    """

    @property
    def vertices(self) -> ArrayLike: ...  # noqa: D102
    @property
    def faces(self) -> ArrayLike: ...  # noqa: D102
    @property
    def color(self) -> ArrayLike | BaseColor: ...  # noqa: D102


class MeshFaces:
    """A mesh's vertices, faces and textures on the GPU."""

    def __init__(self, context: Context, mesh: ColoredMesh, split: SplitMesh | None = None) -> None:
        split = split or split_mesh(mesh)
        rows, faces = mesh_rows(mesh, split), np.ascontiguousarray(split.faces, np.int32)
        base = _base_color(mesh, split)
        self._textures: list[_TexturedFaces] = []
        if base is not None and base.textures:
            faces, self._textures = _by_texture(context, faces, base)
        self._faces = len(faces)
        self._bounds = rows[:, :3].min(axis=0), rows[:, :3].max(axis=0)
        self._vertices = context.gl.buffer(rows.tobytes())
        self._row_length = rows.shape[1]
        self._indices = context.gl.buffer(faces.tobytes())

    @property
    def bounds(self) -> Bounds:
        """Box around the vertices."""
        return self._bounds

    def _ranges(self, part: Part) -> Iterator[tuple[int, int, SharedTexture | None]]:
        """Yield the faces of a part: number of the first, number after the last, and their texture."""
        first, last = part.of(self._faces)
        for faces in self._textures or [_TexturedFaces(0, self._faces, None)]:
            start, end = max(first, faces.first), min(last, faces.last)
            if end > start:
                yield start, end, faces.image

    def release(self) -> None:
        """Release the memory."""
        self._vertices.release()
        self._indices.release()
        for faces in self._textures:
            if faces.image is not None:
                faces.image.release()


class MeshDrawable(MeshFaces):
    """A mesh that is rasterised."""

    def __init__(self, context: Context, mesh: ColoredMesh, split: SplitMesh | None = None) -> None:
        super().__init__(context, mesh, split)
        self._program = mesh_program(context, mesh)
        variant = mesh_variant(mesh)
        names = ["vertex_position", "vertex_normal", "vertex_color" if variant == "plain" else "vertex_light"]
        names += ["vertex_coordinates"] * (variant == "textured")
        layout = [(self._vertices, "3f 3f 3f 2f" if variant == "textured" else "3f 3f 3f", *names)]
        self._array = context.gl.vertex_array(self._program, layout, self._indices)

    @staticmethod
    def warmup(context: Context, mesh: ColoredMesh) -> WarmupPlan:
        """Return the slow first-time work of a drawable."""
        return WarmupPlan(
            f"mesh {mesh_variant(mesh)}", (WarmupTask(SHADERS, lambda: mesh_program(context, mesh)),)
        )

    @property
    def rasterised(self) -> bool:
        """True: the depth test is used."""
        return True

    def draw(self, object_id: int, tile: Tile, gbuffer: GBuffer, part: Part = WHOLE) -> None:
        """Rasterise the faces, or a part of them, both sides."""
        gbuffer.use(tile.width, tile.height)
        set_uniform(self._program, "object_id", object_id)
        for first, last, image in self._ranges(part):
            use_base_texture(self._program, image)
            self._array.render(first=3 * first, vertices=3 * (last - first))

    def release(self) -> None:
        """Release the memory."""
        self._array.release()
        super().release()


def use_base_texture(program: Program, image: SharedTexture | None) -> None:
    """Bind a mesh's texture to the first unit (``shaders/base_texture.glsl``); without one, do nothing."""
    if image is not None:
        image.texture.use(0)
        set_uniform(program, "base_texture", 0)
        set_uniform(program, "mirrored", image.mirrored)


def mesh_variant(mesh: ColoredMesh) -> str:
    """Return the name of the program that draws a mesh: plain, or with base colours or textures."""
    if not isinstance(mesh.color, BaseColor):
        return "plain"
    return "textured" if mesh.color.textures else "base"


def mesh_program(context: Context, mesh: ColoredMesh) -> moderngl.Program:
    """Return the program that draws a mesh."""
    variant = mesh_variant(mesh)
    if variant == "plain":
        return attach_camera(context.program(compose("mesh.vert"), compose("mesh.frag")))
    defines = {"TEXTURED": 1} if variant == "textured" else {}
    texts = (compose(name, defines=defines) for name in ("base_mesh.vert", "base_mesh.frag"))
    return attach_camera(context.program(*texts))


@dataclass(frozen=True)
class _TexturedFaces:
    """Faces from the first to before the last one, and their texture if they have one."""

    first: int
    last: int
    image: SharedTexture | None


def _by_texture(
    context: Context, faces: Int32Array, color: BaseColor
) -> tuple[Int32Array, list[_TexturedFaces]]:
    """Return faces in the order of their textures, and those of each texture."""
    ordered, parts = color.by_texture(faces)
    shared = [
        _TexturedFaces(first, last, shared_texture(context, texture or WHITE_TEXTURE))
        for first, last, texture in parts
    ]
    return ordered, shared


def _base_color(mesh: ColoredMesh, split: SplitMesh) -> BaseColor | None:
    """Return the base colour of split vertices; None for a mesh of one colour, or with sRGB per vertex."""
    return split.color if isinstance(mesh.color, BaseColor) else None


def split_mesh(mesh: ColoredMesh) -> SplitMesh:
    """Return the mesh as it is drawn: split at its creases, and where its base colour jumps."""
    angle: float = getattr(mesh, "crease_angle", CREASE_ANGLE)
    faces = np.ascontiguousarray(mesh.faces, np.int32)
    split = split_at_creases(np.asarray(mesh.vertices, np.float32), faces, angle)
    return split_at_colors(split, mesh.color) if isinstance(mesh.color, BaseColor) else split


def mesh_rows(mesh: ColoredMesh, split: SplitMesh) -> Float32Array:
    """Return position, normal and sRGB colour of every split vertex, ``float32[n, 9]``.

    Base colours are linear, and places in textures follow: ``float32[n, 11]``.
    """
    base = _base_color(mesh, split)
    rows = np.empty((len(split.rows), 11 if base is not None and base.textures else 9), np.float32)
    rows[:, :3] = np.asarray(mesh.vertices, np.float32)[split.rows]
    rows[:, 3:6] = split.normals
    if base is not None:
        rows[:, 6:9] = 1.0 if base.colors is None else base.colors
        if base.textures:
            rows[:, 9:] = base.coordinates
        return rows
    colors = np.asarray(mesh.color, np.float32)
    rows[:, 6:] = colors if colors.ndim == 1 else colors[split.rows]
    return rows
