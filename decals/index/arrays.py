"""Records and index of decals as the arrays that graphics devices read."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from decals.index.editable_index import IDS, LEVELS, TABLE
from decals.index.editor import LIMITS, RECORDS, DecalEditor
from decals.index.index import DecalIndex, has_nested
from decals.model import Decals


@dataclass(frozen=True, eq=False)
class DecalArrays:
    """Arrays of a set of decals, and what decides the form of a shader that reads them.

    Attributes
    ----------
    arrays
        Those of `DecalEditor.arrays`; an editor's change in place.
    index
        The index, for its number of levels and the mask of its table.
    layered, nested
        See `DecalEditor`.
    version
        Version of the editor, 0 without one.
    """

    arrays: dict[str, NDArray[Any]]
    index: DecalIndex
    layered: bool
    nested: bool
    version: int = 0

    @classmethod
    def of(cls, decals: Decals | DecalEditor) -> "DecalArrays":
        """Return the arrays of decals, or those in an editor's own memory."""
        if isinstance(decals, DecalEditor):
            return cls(decals.arrays, decals.index, decals.layered, decals.nested, decals.version)
        index, records = DecalIndex.of(decals), decals.packed()
        arrays: dict[str, NDArray[Any]] = {RECORDS: records, LIMITS: decals.limits}
        arrays |= {LEVELS: index.levels, TABLE: index.table, IDS: index.ids}
        indexed = index.on("cpu", records=records, layered=decals.layered, copy=False)
        return cls(arrays, index, decals.layered, has_nested(indexed, len(decals)))

    @property
    def uniforms(self) -> dict[str, int]:
        """Uniforms of the index, by their names."""
        return {"index_level_count": self.index.level_count, "index_mask": self.index.mask}
