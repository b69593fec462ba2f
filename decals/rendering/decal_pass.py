"""The decal pass: colours all pixels at once, for any number of decals and objects."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import moderngl

from blobtree._typing import Float32Array
from decals.field.rules import PictureRules
from decals.rendering.context import Context
from decals.rendering.data_texture import DataTexture
from decals.rendering.decal_data import DecalData, stored
from decals.rendering.decal_library import Form, decal_library
from decals.rendering.effect import DecalTexture, ReliefEffect
from decals.rendering.gbuffer import GBuffer
from decals.rendering.image_array import ImageArray
from decals.rendering.pixel_pass import (
    IndirectPass,
    ListedPass,
    PassBackend,
    PixelPass,
    Program,
    attach_camera,
    read_floats,
    set_uniform,
    use_textures,
)
from decals.rendering.viewpoint import WHOLE, Part, Rectangle, Tile

BODY = "decal_pass.glsl"


@dataclass(frozen=True, eq=False)
class DecalSource:
    """The decals that a program evaluates, and how.

    Attributes
    ----------
    decals
        Records and index.
    rules
        How they share the surface. The mapping WALKED needs ``walks``.
    masks
        Masks of the objects, see `decals.receivers.object_mask`, for decals that are limited.
    materials, relief, walks
        Maps and heights of images, and walks of decals, see `Effect`; None without any.
    lights
        Of these the first casts shadows of ``relief``; None for the studio's key.
    """

    decals: DecalData
    rules: PictureRules
    masks: DataTexture | None = None
    materials: DecalTexture | None = None
    relief: ReliefEffect | None = None
    lights: Any = None
    walks: DecalTexture | None = None

    @property
    def form(self) -> Form:
        """The form of its GLSL; relief and walked images are not averaged over pixels."""
        relief, walked = self.relief is not None, self.walks is not None
        return Form(
            self.rules.contact,
            self.decals.layered,
            self.decals.limited,
            self.decals.nested,
            materials=self.materials is not None,
            relief=relief and self.materials is not None,
            walked=walked,
            filtered=self.rules.filtered and not relief and not walked,
        )

    def use(self, program: Program, unit: int) -> int:
        """Bind all textures to the units from ``unit`` on, and set the uniforms; return the next unit."""
        set_uniform(program, "decal_mapping", int(self.rules.mapping))
        set_uniform(program, "decal_stiffness", self.rules.stiffness)
        self.decals.use(program, unit)
        if self.relief is not None:
            self.relief.use(program, self.lights)
            if isinstance(program, moderngl.ComputeShader):
                self.decals.store()
        unit += self.decals.texture_count
        for name, data in (
            ("decal_materials", self.materials),
            ("decal_reliefs", self.relief),
            ("object_masks", self.masks),
            ("decal_walks", self.walks),
        ):
            if data is not None:
                data.texture.use(unit)
                set_uniform(program, name, unit)
                unit += 1
        return unit


class DecalPass:
    """Reads a G-buffer, writes its colour under decals and, on request, the decal at every pixel.

    Parameters
    ----------
    context
        Where to draw.
    size
        Size of the largest tile, in samples.
    buffers
        True to write owner, field and uv too.

    Attributes
    ----------
    material_targets : dict
        Normals and roughness, and emission and occlusion, by their names in the light pass; empty before the
        first scene with materials.
    """

    def __init__(self, context: Context, size: tuple[int, int], *, buffers: bool = False) -> None:
        self.paint = context.texture(size, "f2")
        self.decal = context.texture(size, "f4") if buffers else None
        self._targets = [texture for texture in (self.paint, self.decal) if texture is not None]
        self._framebuffer = context.gl.framebuffer(self._targets)
        self._context = context
        self._size = size
        self.material_targets: dict[str, moderngl.Texture] = {}
        self._last: tuple[tuple[object, ...], PixelPass] | None = None

    def draw(
        self,
        rectangle: Rectangle,
        gbuffer: GBuffer,
        source: "DecalSource | None",
        images: ImageArray | None,
        rest: Mapping[str, moderngl.Texture] | None = None,
        part: Part = WHOLE,
    ) -> None:
        """Paint some rows of a rectangle; without decals, or images for them, in the objects' own colours.

        Materials of the decals fill `material_targets` too. ``rest`` are the textures of a rest buffer.
        """
        painting = self._pass(None if source is None else source.form, posed=rest is not None)
        textures = {"g_position": gbuffer.position, "g_normal": gbuffer.normal, "g_color": gbuffer.color}
        textures |= rest or {}
        for program in painting.programs:
            use_textures(program, textures)
            if source is not None and images is not None:
                images.use(len(textures))
                set_uniform(program, "decal_images", len(textures))
                source.use(program, len(textures) + 1)
        painting.run(rectangle.rows(part))

    def read_decal(self, tile: Tile) -> Float32Array:
        """Read owner, field and uv, ``float32[h, w, 4]``, the lowest row first."""
        return read_floats(self._framebuffer, 1, tile)

    def _pass(self, form: Form | None, *, posed: bool) -> PixelPass:
        """Return the pass for a form of decals; None is for scenes without decals.

        Only the last pass is kept, as it holds its programs; the context keeps those of others for a while.
        """
        if self._last is None or self._last[0] != (form, posed):
            materials = form is not None and form.materials
            if materials and not self.material_targets:
                self.material_targets["g_material"] = self._context.texture(self._size, "f4")
                self.material_targets["g_glow"] = self._context.texture(self._size, "f2")
            targets = [*self._targets, *(self.material_targets.values() if materials else ())]
            programs = decal_programs(self._context, form, len(self._targets), posed=posed)
            if self._last is not None:
                self._last[1].release()
            make: Any = partial(PixelPass, self._context.gl, programs[0])
            if len(programs) > 1:
                kind = IndirectPass if self._context.backend is PassBackend.COMPUTE else ListedPass
                make = partial(kind, self._context.gl, programs)
            self._last = (form, posed), make(targets)
        return self._last[1]

    def release(self) -> None:
        """Release the memory."""
        if self._last is not None:
            self._last[1].release()
        self._framebuffer.release()
        for target in (*self._targets, *self.material_targets.values()):
            target.release()


def decal_programs(
    context: Context, form: Form | None, targets: int = 1, *, posed: bool = False
) -> tuple[Program, ...]:
    """Return the program for a form of decals; None is for scenes without decals.

    Filtered pictures take two, by `IndirectPass` or `ListedPass`, except in fragment shaders on a card.
    """
    slots: dict[str, str] = {}
    defines: dict[str, bool | int] = {}
    stages: list[dict[str, bool | int]] = [{}]
    compute = context.backend is PassBackend.COMPUTE
    if form is not None:
        library = decal_library(form)
        file = "filtered_decals.glsl" if form.filtered else "decals.glsl"
        slots = {"decals": f"//@ include {file}", "functions": library}
        defines = {"DECALS": True, "POSED": posed, "LIMITED": form.limited, "FILTERED": form.filtered}
        defines |= {"MATERIALS": form.materials, "RELIEF": form.relief}
        if form.relief:
            slots["relief"] = "//@ include relief.glsl"
        if form.relief and compute:
            slots["functions"], defines["STORED"] = stored(library), True
        if form.filtered and (compute or context.software):
            stages = [{"MARKED": targets + 2 * form.materials}, {"LISTED": True, "SHARED": compute}]
    shared = {"shared": "//@ include shared_parts.glsl"}
    return tuple(
        attach_camera(
            context.pixel_program(
                BODY,
                targets,
                slots=slots | (shared if stage.get("SHARED") else {}),
                defines={**defines, **stage},
            )
        )
        for stage in stages
    )
