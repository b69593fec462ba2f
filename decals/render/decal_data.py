"""Decals on the graphics card: their records and their index, and the functions that read them."""

from collections.abc import Sequence
from functools import cache

from blobtree.formulas.kernels import RIM
from blobtree.typed.glsl import translate_library
from decals.field.contact import Contact
from decals.field.mapping import in_image, tangent_coordinates, turned_back
from decals.field.ownership import complement_at, owner_at, owner_below, uv_at
from decals.field.sheet import sheet_at
from decals.field.stack import number_below
from decals.grid.editor import DecalEditor
from decals.grid.index import DecalIndex
from decals.model import Decals
from decals.render.buffers import DataTexture
from decals.render.context import Context
from decals.render.entry import Program
from decals.render.tile import set_uniform
from decals.render.turns import Turns

FUNCTIONS = (
    sheet_at,
    owner_at,
    owner_below,
    number_below,
    complement_at,
    uv_at,
    in_image,
    tangent_coordinates,
    turned_back,
)
"""What ``shaders/decals.glsl`` calls."""


class DecalData:
    """Records and index of a set of decals, as ``shaders/decals.glsl`` reads them."""

    def __init__(self, context: Context, decals: Decals | DecalEditor) -> None:
        self._context = context
        self._version = 0
        self._turns = Turns(context.most_turns)
        if isinstance(decals, DecalEditor):
            self._version = decals.version
            arrays, index = decals.arrays, decals.index
        else:
            index = DecalIndex.of(decals)
            arrays = {
                "decal_records": decals.packed(),
                "index_levels": index.levels,
                "index_table": index.table,
                "index_ids": index.ids,
            }
        self._turns.check(index, layered=decals.layered, version=self._version)
        self._textures = {name: DataTexture(context, array) for name, array in arrays.items()}
        self._describe(decals, index)

    def _describe(self, decals: Decals | DecalEditor, index: DecalIndex) -> None:
        self.layered = decals.layered
        self._numbers = {"index_level_count": index.level_count, "index_mask": index.mask}

    def update(self, editor: DecalEditor) -> int:
        """Bring over what an editor changed since the last time; the number of bytes that went to the card.

        These must be the data of the same editor; any number of them may follow one.

        Raises
        ------
        TooMuchData
            More decals reach one place than the driver goes through; nothing is brought over.
        """
        index = editor.index
        self._turns.check(index, layered=editor.layered, version=editor.version)
        sent, since, self._version = 0, self._version, editor.version
        for name, ranges in editor.changes(since).items():
            array = editor.arrays[name]
            if self._textures[name].count != len(array):
                self._textures[name].release()
                self._textures[name] = DataTexture(self._context, array)
                sent += array.nbytes
                continue
            for first, end in ranges:
                self._textures[name].write(first, array[first:end])
                sent += array[first:end].nbytes
        self._describe(editor, index)
        return sent

    def use(self, program: Program, first_unit: int) -> None:
        """Bind everything for a program, textures from a unit on."""
        units = range(first_unit, first_unit + len(self._textures))
        for name, number in self.bind(units).items():
            set_uniform(program, name, number)

    def bind(self, units: Sequence[int]) -> dict[str, int]:
        """Bind the textures to four units; all uniforms that a program then wants, by their names."""
        samplers = dict(zip(self._textures, units, strict=True))
        for name, unit in samplers.items():
            self._textures[name].use(unit)
        return samplers | self._numbers

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
        f"const bool decal_sheet = {str(not layered and contact != Contact.RADIAL).lower()};\n"
    )
    return constants + _formulas()


@cache
def _formulas() -> str:
    return translate_library(FUNCTIONS)
