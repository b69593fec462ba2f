"""Decals on the GPU: their records, their index, and the GLSL functions that read them."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from blobtree._typing import Int64Array
from blobtree.formulas.falloff import RIM
from blobtree.transpile.glsl import translate_library
from decals.errors import TooMuchData
from decals.field.mapping import in_image, tangent_coordinates, unroll_step
from decals.field.ownership import complement_at, owner_at, owner_below, single_layer_at, uv_at
from decals.index.editor import DecalEditor
from decals.index.index import DecalIndex
from decals.index.lookup import next_number_below
from decals.model import Decals
from decals.record import Contact
from decals.rendering.context import Context
from decals.rendering.pixel_pass import Program
from decals.rendering.textures import DataTexture
from decals.rendering.tiles import set_uniform

WALKS_PER_CANDIDATE = 8
"""Greatest number of walks over all candidates of a pixel."""

SEARCH_OVERHEAD = 3
"""Iterations of a binary search besides its halvings."""


class LoopLimit:
    """The greatest number of loop iterations that a driver allows a pixel; None for no limit.

    Measuring the lists of an index takes as long as many edits. A result therefore stays valid for as many
    versions as cannot reach the limit: each edit adds at most one entry to a list.
    """

    def __init__(self, max_iterations: int | None) -> None:
        self._max_iterations = max_iterations
        self._table = np.zeros((0, 4), np.int32)
        self._shape = (0, False)
        self._valid_until = 0

    def check(self, index: DecalIndex, *, layered: bool, version: int = 0) -> None:
        """Raise TooMuchData if an index needs more iterations; ``version`` counts its edits."""
        shape = index.level_count, layered
        valid = index.table is self._table and shape == self._shape and version <= self._valid_until
        if self._max_iterations is None or valid:
            return
        lengths = index.longest_lists
        candidates, allowed = (
            int(lengths.sum()),
            self._max_iterations // _iterations(lengths, layered=layered),
        )
        if candidates > allowed:
            raise TooMuchData(
                f"{candidates:,} decals reach the same place; expected at most {allowed:,}: "
                "software rendering cuts off the rest; spread them, draw on a graphics card, or use evaluate"
            )
        spare = allowed - candidates
        while (
            spare
            and _iterations(lengths + spare, layered=layered) * (candidates + spare) > self._max_iterations
        ):
            spare //= 2
        self._table, self._shape, self._valid_until = index.table, shape, version + spare


def _iterations(lengths: Int64Array, *, layered: bool) -> int:
    """Return the iterations for each candidate; with layers, each candidate takes a search in every list."""
    searches = sum(int(length).bit_length() + SEARCH_OVERHEAD for length in lengths)
    return WALKS_PER_CANDIDATE + searches * layered


LIBRARY_FUNCTIONS = (
    single_layer_at,
    owner_at,
    owner_below,
    next_number_below,
    complement_at,
    uv_at,
    in_image,
    tangent_coordinates,
    unroll_step,
)
"""Functions that ``shaders/decals.glsl`` calls."""


class DecalData:
    """Records and index of a set of decals, as ``shaders/decals.glsl`` reads them."""

    def __init__(self, context: Context, decals: Decals | DecalEditor) -> None:
        self._context = context
        self._version = 0
        self._loop_limit = LoopLimit(context.max_loop_iterations)
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
        self._loop_limit.check(index, layered=decals.layered, version=self._version)
        self._textures = {name: DataTexture(context, array) for name, array in arrays.items()}
        self._read_uniforms(decals, index)

    def _read_uniforms(self, decals: Decals | DecalEditor, index: DecalIndex) -> None:
        self.layered = decals.layered
        self._uniforms = {"index_level_count": index.level_count, "index_mask": index.mask}

    def update(self, editor: DecalEditor) -> int:
        """Upload the changes of an editor since the last call; return the number of bytes.

        The data must have been made of the same editor. Several data may follow one editor.

        Raises
        ------
        TooMuchData
            If more decals reach one point than the driver allows; nothing is uploaded.
        """
        index = editor.index
        self._loop_limit.check(index, layered=editor.layered, version=editor.version)
        byte_count, since, self._version = 0, self._version, editor.version
        for name, ranges in editor.changed_rows(since).items():
            array = editor.arrays[name]
            if self._textures[name].count != len(array):
                self._textures[name].release()
                self._textures[name] = DataTexture(self._context, array)
                byte_count += array.nbytes
                continue
            for first, end in ranges:
                self._textures[name].write(first, array[first:end])
                byte_count += array[first:end].nbytes
        self._read_uniforms(editor, index)
        return byte_count

    def use(self, program: Program, first_unit: int) -> None:
        """Bind all textures to the units from ``first_unit`` on, and set the uniforms of a program."""
        units = range(first_unit, first_unit + len(self._textures))
        for name, value in self.bind(units).items():
            set_uniform(program, name, value)

    def bind(self, units: Sequence[int]) -> dict[str, int]:
        """Bind the textures to four units; return the uniforms of a program by their names."""
        samplers = dict(zip(self._textures, units, strict=True))
        for name, unit in samplers.items():
            self._textures[name].use(unit)
        return samplers | self._uniforms

    def release(self) -> None:
        """Release the memory."""
        for texture in self._textures.values():
            texture.release()


@cache
def decal_library(contact: Contact, *, layered: bool) -> str:
    """Return the GLSL of all decal formulas, for the slot ``functions``, in one contact mode."""
    constants = (
        f"const float RIM = {float(RIM)!r};\n"
        f"const int decal_contact = {int(contact)};\n"
        f"const bool decal_layered = {str(layered).lower()};\n"
        f"const bool decal_single_layer = {str(not layered and contact != Contact.RADIAL).lower()};\n"
    )
    return constants + _translated_functions()


@cache
def _translated_functions() -> str:
    return translate_library(LIBRARY_FUNCTIONS)
