"""The decal pass: colours all pixels at once, for any number of decals and objects."""

from functools import cache
from typing import Any

import moderngl

from blobtree._typing import Float32Array
from blobtree.formulas.falloff import RIM
from blobtree.transpile.glsl import translate_library
from decals.field.elastic import bump_at, image_shift, join_bumps
from decals.field.law import AnyContact, ContactLaw
from decals.field.mapping import ImageMapping, in_image, tangent_coordinates, unroll_step
from decals.field.ownership import contact_at, owner_at, owner_below, single_layer_at, uv_at
from decals.field.pixel_filter import (
    contact_distance,
    image_steps,
    inner_part,
    pixel_line,
    push_square_step,
    pushed_distance_step,
)
from decals.field.radial import is_above, lies_on_top, power
from decals.field.receivers import acts, fade_at
from decals.index.lookup import next_number_below
from decals.record import Contact, balls_nested, has_cells
from decals.rendering.context import Context
from decals.rendering.gbuffer import GBuffer
from decals.rendering.lights import Lighting
from decals.rendering.materials import MaterialArray, Relief
from decals.rendering.pixel_pass import (
    PixelPass,
    Program,
    attach_camera,
    read_floats,
    set_uniform,
    use_textures,
)
from decals.rendering.rest_buffer import RestBuffer
from decals.rendering.uploads import DataTexture, DecalData, ImageArray
from decals.rendering.viewpoint import WHOLE, Part, Rectangle, Tile

BODY = "decal_pass.glsl"


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
        self._passes: dict[tuple[object, ...], PixelPass] = {}

    def draw(
        self,
        rectangle: Rectangle,
        gbuffer: GBuffer,
        decals: DecalData | None,
        images: ImageArray | None,
        mapping: ImageMapping,
        contact: AnyContact,
        stiffness: float,
        filtered: bool = False,
        rest: RestBuffer | None = None,
        masks: DataTexture | None = None,
        materials: MaterialArray | None = None,
        relief: Relief | None = None,
        lights: Lighting | None = None,
        walks: DataTexture | None = None,
        part: Part = WHOLE,
    ) -> None:
        """Paint some rows of a rectangle; without decals, or images for them, in the objects' own colours.

        ``masks`` are those of the objects, see `decals.receivers.object_mask`, for decals that are limited.
        ``materials`` fill `material_targets` too. The first of the ``lights`` casts shadows of ``relief``.
        The mapping WALKED needs ``walks``, see `Uploads.walks`.
        """
        limited, library = decals is not None and decals.limited, ""
        filtered = filtered and materials is None and walks is None  # these are not averaged over pixels
        if decals is not None:
            library = decal_library(
                contact,
                layered=decals.layered,
                limited=limited,
                nested=decals.nested,
                walked=walks is not None,
                filtered=filtered,
            )
        shining = materials is not None and decals is not None
        variant = {
            "limited": limited,
            "filtered": filtered,
            "materials": shining,
            "relief": shining and relief is not None,
        }
        painting = self._pass(library, posed=rest is not None, **variant)
        program = painting.program
        textures = {"g_position": gbuffer.position, "g_normal": gbuffer.normal, "g_color": gbuffer.color}
        textures |= rest.textures if rest is not None else {}
        use_textures(program, textures)
        if decals is not None and images is not None:
            unit = len(textures)
            images.use(unit)
            set_uniform(program, "decal_images", unit)
            set_uniform(program, "decal_mapping", int(mapping))
            set_uniform(program, "decal_stiffness", stiffness)
            decals.use(program, unit + 1)
            if relief is not None:
                relief.use(program, lights)
            unit += 1 + decals.texture_count
            for name, data in (
                ("decal_materials", materials),
                ("decal_reliefs", relief),
                ("object_masks", masks),
                ("decal_walks", walks),
            ):
                if data is not None:
                    data.texture.use(unit)
                    set_uniform(program, name, unit)
                    unit += 1
        painting.run(rectangle.rows(part))

    def read_decal(self, tile: Tile) -> Float32Array:
        """Read owner, field and uv, ``float32[h, w, 4]``, the lowest row first."""
        return read_floats(self._framebuffer, 1, tile)

    def _pass(self, library: str, **variant: bool) -> PixelPass:
        """Return the pass with a library of decal formulas; an empty one is for scenes without decals."""
        key = library, *variant.values()
        if key not in self._passes:
            if variant["materials"] and not self.material_targets:
                self.material_targets["g_material"] = self._context.texture(self._size, "f4")
                self.material_targets["g_glow"] = self._context.texture(self._size, "f2")
            targets = [*self._targets, *(self.material_targets.values() if variant["materials"] else ())]
            program = decal_program(self._context, library, len(self._targets), **variant)
            self._passes[key] = PixelPass(self._context.gl, program, targets)
        return self._passes[key]

    def release(self) -> None:
        """Release the memory."""
        for painting in self._passes.values():
            painting.release()
        self._framebuffer.release()
        for target in (*self._targets, *self.material_targets.values()):
            target.release()


def decal_program(
    context: Context,
    library: str,
    targets: int = 1,
    *,
    posed: bool = False,
    limited: bool = False,
    filtered: bool = False,
    materials: bool = False,
    relief: bool = False,
) -> Program:
    """Return the program with a library of decal formulas; an empty one is for scenes without decals."""
    file = "filtered_decals.glsl" if filtered else "decals.glsl"
    slots = {"decals": f"//@ include {file}", "functions": library} if library else {}
    variants = {"DECALS": True, "POSED": posed, "LIMITED": limited, "FILTERED": filtered}
    variants |= {"MATERIALS": materials, "RELIEF": relief}
    slots |= {"relief": "//@ include relief.glsl"} if relief and library else {}
    defines = {name: value and bool(library) for name, value in variants.items()}
    return attach_camera(context.pixel_program(BODY, targets, slots=slots, defines=defines))


LIBRARY_FUNCTIONS = (
    single_layer_at,
    owner_at,
    owner_below,
    next_number_below,
    contact_at,
    uv_at,
    in_image,
    tangent_coordinates,
    unroll_step,
    fade_at,
)
"""Functions that ``shaders/decals.glsl`` calls."""


FILTER_FUNCTIONS = (
    *LIBRARY_FUNCTIONS,
    acts,
    contact_distance,
    power,
    balls_nested,
    is_above,
    lies_on_top,
    has_cells,
    pixel_line,
    inner_part,
    push_square_step,
    pushed_distance_step,
    image_steps,
    bump_at,
    join_bumps,
    image_shift,
)
"""Functions that ``shaders/filtered_decals.glsl`` calls."""


@cache
def decal_library(
    contact: AnyContact,
    *,
    layered: bool,
    limited: bool,
    nested: bool,
    walked: bool = False,
    filtered: bool = False,
) -> str:
    """Return the GLSL of all decal formulas, for the slot ``functions``, in one contact mode or law."""
    constants = (
        f"const float RIM = {float(RIM)!r};\n"
        f"const int decal_contact = {int(contact)};\n"
        f"const bool decal_nested = {str(nested and contact in (Contact.RADIAL, Contact.ELASTIC)).lower()};\n"
        f"const bool decal_limited = {str(limited).lower()};\n"
        f"const bool decal_walked = {str(walked).lower()};\n"
        f"const bool decal_layered = {str(layered).lower()};\n"
        f"const bool decal_single_layer = {str(not layered and contact != Contact.RADIAL).lower()};\n"
    )
    return constants + _translated_functions(contact if isinstance(contact, ContactLaw) else None, filtered)


@cache
def _translated_functions(law: ContactLaw | None, filtered: bool) -> str:
    functions: tuple[Any, ...] = FILTER_FUNCTIONS if filtered else LIBRARY_FUNCTIONS
    return translate_library(functions if law is None else map(law.formulas.function, functions))
