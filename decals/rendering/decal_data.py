"""The records and the index of decals on the GPU."""

from collections.abc import Sequence

import numpy as np

from blobtree._typing import Int64Array
from decals.errors import TooMuchData
from decals.index.editor import LIMITS, DecalArrays, DecalEditor
from decals.index.index import DecalIndex
from decals.model import Decals
from decals.rendering.context import Context
from decals.rendering.data_texture import DataTexture
from decals.rendering.pixel_pass import Program, set_uniform

WALKS_PER_CANDIDATE = 8
"""Greatest number of walks over all candidates of a pixel."""

SEARCH_OVERHEAD = 3
"""Iterations of a binary search besides its halvings."""

STORED = ("decal_records", "index_levels", "index_table", "index_ids")
"""Arrays that storage buffers hold too, bound from 1 on, for compute shaders with many look-ups a pixel."""


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
        candidates = int(lengths.sum())
        allowed = self._max_iterations // _iterations(lengths, layered=layered)
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


def stored(library: str) -> str:
    """Return GLSL of decal formulas that reads storage buffers, by functions of ``decal_data.glsl``."""
    for name in STORED:
        library = library.replace(f"texelFetch({name}, ", f"fetch_{name}(")
    return library


class DecalData:
    """Records and index of a set of decals, as ``shaders/decals.glsl`` reads them.

    ``lookups`` is the number of points that are looked up for a pixel; ``version`` is that of an editor.
    """

    def __init__(
        self, context: Context, decals: Decals | DecalEditor, *, limited: bool = False, lookups: int = 1
    ) -> None:
        self._context = context
        self.limited = limited
        iterations = context.max_loop_iterations
        self._loop_limit = LoopLimit(None if iterations is None else iterations // lookups)
        data = DecalArrays.of(decals)
        self._loop_limit.check(data.index, layered=data.layered, version=data.version)
        self._textures = {
            name: DataTexture(context, array)
            for name, array in data.arrays.items()
            if limited or name != LIMITS
        }
        self._read(data)

    def _read(self, data: DecalArrays) -> None:
        self.layered, self.nested, self.version = data.layered, data.nested, data.version
        self._uniforms = data.uniforms

    def update(self, editor: DecalEditor) -> int:
        """Upload the changes of an editor since the last call; return the number of bytes.

        The data must have been made of the same editor. Several data may follow one editor.

        Raises
        ------
        TooMuchData
            If more decals reach one point than the driver allows; nothing is uploaded.
        """
        data, byte_count = DecalArrays.of(editor), 0
        self._loop_limit.check(data.index, layered=data.layered, version=data.version)
        for name, ranges in editor.changed_rows(self.version).items():
            if name not in self._textures:
                continue
            array = data.arrays[name]
            if self._textures[name].count != len(array):
                self._textures[name].release()
                self._textures[name] = DataTexture(self._context, array)
                byte_count += array.nbytes
                continue
            for first, end in ranges:
                self._textures[name].write(first, array[first:end])
                byte_count += array[first:end].nbytes
        self._read(data)
        return byte_count

    @property
    def texture_count(self) -> int:
        """Number of textures."""
        return len(self._textures)

    def use(self, program: Program, first_unit: int) -> None:
        """Bind all textures to the units from ``first_unit`` on, and set the uniforms of a program."""
        units = range(first_unit, first_unit + len(self._textures))
        for name, value in self.bind(units).items():
            set_uniform(program, name, value)

    def store(self) -> None:
        """Bind the storage buffers `STORED`."""
        for binding, name in enumerate(STORED, 1):
            self._textures[name].store(binding)

    def bind(self, units: Sequence[int]) -> dict[str, int]:
        """Bind the textures to `texture_count` units; return the uniforms of a program by their names."""
        samplers = dict(zip(self._textures, units, strict=True))
        for name, unit in samplers.items():
            self._textures[name].use(unit)
        return samplers | self._uniforms

    def release(self) -> None:
        """Release the memory."""
        for texture in self._textures.values():
            texture.release()
