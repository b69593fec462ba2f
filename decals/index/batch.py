"""Many sets of decals on a device: their records and indices, which one launch reads."""

import copy
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import Int64Array
from blobtree.device import known_device
from blobtree.struct_rows import Part, struct_rows
from blobtree.validation import describe, items
from decals.errors import InvalidDecals
from decals.index.build import build_indices, starts_of
from decals.index.index import device_arrays, indexed_decals
from decals.index.lookup import IndexedDecals
from decals.model import Decals
from decals.receivers import EVERYTHING
from decals.record import RECORD


class DecalBatch:
    """k sets of decals with their indices on one Warp device, for several calls of `evaluate_batch`.

    Each set has the records and the index that it has alone. Two calls with a batch index the sets once.

    Parameters
    ----------
    sets : sequence of Decals
        The sets.
    device : optional
        Warp device. Default: Warp's default device.
    reach : float, optional
        Factor of the distance to which decals are listed.

    Raises
    ------
    InvalidDecals
        An item is not a set of decals.
    InvalidDevice
        Warp has no such device.

    Attributes
    ----------
    sets : tuple of Decals
        The sets.
    joined : Decals
        All decals, one set after the other.
    starts : int64[k + 1]
        First of them in each set, and the end.
    records : wp.array(dtype=vec4)
        Their records.
    modes : IndexedDecals
        Modes that all sets share: stiffness and image mapping.

    Examples
    --------
    >>> import decals
    >>> disk = decals.Decals([[0, 0, 0]], [[0, 0, 1]], [[1, 0, 0]], radii=1)
    >>> batch = decals.index.DecalBatch([disk, disk.replace(radii=0.3)])
    >>> for x in (0.2, 0.5):
    ...     decals.evaluate_batch(batch, [[x, 0, 0]], [[0, 0, 1]]).owner.tolist()
    [0, 0]
    [0, -1]
    """

    def __init__(self, sets: Iterable[Decals], device: Any = None, *, reach: float = 1.0) -> None:
        self.sets, self.device = checked_sets(sets), known_device(device)
        device = self.device
        self.joined = Decals.concatenate(self.sets)
        self.starts = starts_of([len(part) for part in self.sets])
        joined = self.joined
        centres, reaches, ranks = device_arrays(
            joined.positions, reach * joined.influence, joined.ranks, device
        )
        index = build_indices(centres, reaches, ranks, self.starts)
        self.records: Any = wp.array(joined.packed(), dtype=wp.vec4, device=device)
        self.modes: Any = indexed_decals(
            self.records, index.levels, index.table, index.ids, layered=False, device=device
        )
        self._parts: dict[str, Part] = {
            "levels": (index.levels, index.level_starts),
            "table": (index.table, index.table_starts),
        }
        self._values: dict[str, Any] = {
            "layered": self._layered(),
            "level_count": np.diff(index.level_starts),
            "mask": np.diff(index.table_starts) - 1,
        }

    def __len__(self) -> int:
        return len(self.sets)

    def _layered(self) -> Any:
        """Return `Decals.layered` of each set."""
        if not self.joined.layered:
            return np.zeros(len(self), np.bool_)
        return [part.layered for part in self.sets]

    def limit(self, masks: Sequence[int], *, always: bool) -> None:
        """Give the sets with receivers or fades their limits, and the mask of the surface; or all of them."""
        limited = np.array([always or part.limited for part in self.sets], np.bool_)
        if not limited.any():
            return
        rows = np.concatenate([part.limits for part in self.sets])
        self._parts["limits"] = wp.array(rows, dtype=wp.vec4, device=self.device), self.starts
        self._values |= {"limited": limited, "surface": np.where(limited, masks, EVERYTHING)}

    def copied(self) -> "DecalBatch":
        """Return the same sets with modes and limits of their own, to be set."""
        twin = copy.copy(self)
        (levels, _), (table, _) = self._parts["levels"], self._parts["table"]
        twin.modes = indexed_decals(
            self.records, levels, table, self.modes.ids, layered=False, device=self.device
        )
        twin._parts, twin._values = dict(self._parts), dict(self._values)
        return twin

    def with_reach(self, reach: float) -> "DecalBatch":
        """Return the same sets, listed to another distance, with the same limits, walks and modes."""
        wide = DecalBatch(self.sets, self.device, reach=reach)
        for name in ("stiffness", "mapping", "walked"):
            setattr(wide.modes, name, getattr(self.modes, name))
        wide._parts |= {name: self._parts[name] for name in ("limits", "walks") if name in self._parts}
        wide._values |= {name: self._values[name] for name in ("limited", "surface") if name in self._values}
        return wide

    def walk(self, texels: Any, starts: Int64Array) -> None:
        """Give the sets their walks; those of set i are texels ``starts[i]:starts[i + 1]``."""
        self.modes.walked = True
        self._parts["walks"] = wp.array(texels, dtype=wp.vec4, device=self.device), starts

    def rows(self) -> Any:
        """Return an array of `IndexedDecals`, one for each set."""
        parts = self._parts | {"records": (self.records, RECORD * self.starts)}
        return struct_rows(
            IndexedDecals, self.modes, len(self), self.device, parts=parts, values=self._values
        )


def checked_sets(sets: Any) -> tuple[Decals, ...]:
    """Return several sets of decals; raise InvalidDecals for other values."""
    listed = None if isinstance(sets, Decals | str) else items(sets)
    if listed is None:
        hint = "; evaluate takes one set" if isinstance(sets, Decals) else ""
        raise InvalidDecals(f"sets: expected several Decals, got {describe(sets)}{hint}")
    for number, part in enumerate(listed):
        if not isinstance(part, Decals):
            raise InvalidDecals(
                f"sets[{number}]: expected Decals, got {describe(part)}; a scene or an editor has .decals"
            )
    return listed
