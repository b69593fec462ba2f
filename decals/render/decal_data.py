"""Decals on the graphics card: their records and their index, and the functions that read them."""

from functools import cache

import moderngl

from blobtree.glsl import translate_library
from blobtree.kernels import RIM
from decals.contact import (
    NOWHERE,
    add_push,
    contact_complement,
    contact_push,
    contact_uv,
    field_complement,
    rim_distance,
)
from decals.index import DecalIndex
from decals.lookup import cell_range
from decals.mapping import surface_offset, tangent_coordinates
from decals.model import Decals
from decals.render.buffers import DataTexture
from decals.render.context import Context
from decals.render.tile import set_uniform

FUNCTIONS = (
    cell_range,
    field_complement,
    contact_push,
    add_push,
    contact_complement,
    rim_distance,
    contact_uv,
    surface_offset,
    tangent_coordinates,
)
"""What ``shaders/decals.glsl`` calls."""


class DecalData:
    """Records and index of a set of decals, as ``shaders/decals.glsl`` reads them."""

    def __init__(self, context: Context, decals: Decals) -> None:
        index = DecalIndex.build(decals.positions, decals.influence)
        self._textures = {
            "decal_records": DataTexture(context, decals.packed()),
            "index_levels": DataTexture(context, index.levels),
            "index_table": DataTexture(context, index.table),
            "index_ids": DataTexture(context, index.ids),
        }
        self._numbers = {"index_level_count": index.level_count, "index_mask": index.mask}

    def use(self, program: moderngl.Program, first_unit: int) -> None:
        """Bind everything for a program, textures from a unit on."""
        for unit, (name, texture) in enumerate(self._textures.items(), first_unit):
            texture.use(unit)
            set_uniform(program, name, unit)
        for name, number in self._numbers.items():
            set_uniform(program, name, number)

    def release(self) -> None:
        """Give the memory back."""
        for texture in self._textures.values():
            texture.release()


@cache
def library() -> str:
    """Give the GLSL of all decal formulas, for the slot ``functions``."""
    constants = f"const float NOWHERE = {float(NOWHERE)!r};\nconst float RIM = {float(RIM)!r};\n"
    return constants + translate_library(FUNCTIONS)  # type: ignore[arg-type]  # Warp's decorator hides its result's type
