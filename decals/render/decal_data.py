"""Decals on the graphics card: their records and their index, and the functions that read them."""

from functools import cache

from blobtree.glsl import translate_library
from blobtree.kernels import RIM
from decals.contact import Contact
from decals.index import DecalIndex
from decals.mapping import tangent_coordinates
from decals.model import Decals
from decals.ownership import complement_at, owner_at, owner_below, uv_at
from decals.render.buffers import DataTexture
from decals.render.context import Context
from decals.render.entry import Program
from decals.render.tile import set_uniform
from decals.stack import number_below

FUNCTIONS = (owner_at, owner_below, number_below, complement_at, uv_at, tangent_coordinates)
"""What ``shaders/decals.glsl`` calls."""


class DecalData:
    """Records and index of a set of decals, as ``shaders/decals.glsl`` reads them."""

    def __init__(self, context: Context, decals: Decals) -> None:
        index = DecalIndex.of(decals)
        self.layered = decals.layered
        self._textures = {
            "decal_records": DataTexture(context, decals.packed()),
            "index_levels": DataTexture(context, index.levels),
            "index_table": DataTexture(context, index.table),
            "index_ids": DataTexture(context, index.ids),
        }
        self._numbers = {"index_level_count": index.level_count, "index_mask": index.mask}

    def use(self, program: Program, first_unit: int) -> None:
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
def library(contact: Contact, *, layered: bool) -> str:
    """Give the GLSL of all decal formulas, for the slot ``functions``, in one mode of contact."""
    constants = (
        f"const float RIM = {float(RIM)!r};\n"
        f"const int decal_contact = {int(contact)};\n"
        f"const bool decal_layered = {str(layered).lower()};\n"
    )
    return constants + translate_library(FUNCTIONS)
