"""The decal index: which decals may act at a point, exactly, without a cap, in memory linear in their number.

It replaces the paper's octree (section 3.4). Each decal is stored once for every cell that its ball of
radius ρ = REACH·s touches, on the one level whose cells are larger than ρ and at most 2ρ wide: at most 27
cells. A look-up reads one cell per level, so sizes join in pairs where that leaves fewer levels: the larger
of two takes the cells of the smaller, half as wide, which also have fewer candidates. A decal then has at
most 125 cells, and they have 24 on average at most. Three flat arrays go to the device:

    levels  float32[l, 4]   per level: (cells per unit length, cell size, lowest rank, highest rank)
    table   int32[2^k, 4]   slots of an open-addressing hash table: (x + level·2²⁴, y, z, head), x < 0: empty
    ids     int32[m]        lists: ids[head] is a count, that many decal numbers follow, in
                            the order in which they are drawn (decals/field/stack.py)

Cell sizes are powers of two and cells are counted from the world's origin, so the cell of a float32 point is
found without any rounding: no decal is ever lost to it, near or far from the origin.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from decals.columns import check_range, floats, whole
from decals.grid.build import build_index
from decals.grid.cells import ALONE, LEVEL_SHIFT
from decals.grid.lookup import count_candidates, list_candidates
from decals.model import DEFAULT_RANK, LARGEST, LAYERS, Decals

Ints = NDArray[np.int32]
Wide = NDArray[np.int64]

MOST_INFLUENCE = 4.0 * LARGEST
MOST_RANK = 8 * LAYERS - 1
"""Of the highest layer, and more than any `Interaction` adds."""


@dataclass(frozen=True)
class DeviceIndex:
    """An index on a device, in the order in which `cell_range` and its callers take it."""

    level_count: int
    levels: Any
    table: Any
    mask: int
    ids: Any

    def arguments(self) -> list[Any]:
        """Arguments of the look-up functions, after the point."""
        return [self.level_count, self.levels, self.table, self.mask, self.ids]

    @classmethod
    def of(cls, decals: Decals, device: Any = None) -> Self:
        """Index decals on a device, without a copy elsewhere."""
        placed = _device_arrays(decals.positions, decals.influence, decals.ranks, device)
        levels, table, ids, _ = build_index(*placed)
        return cls(len(levels), levels, table, len(table) - 1, ids)


@dataclass(frozen=True, eq=False)
class DecalIndex:
    """Hash grid of as many levels as there are size classes, or pairs of them (`cells.joined`).

    Attributes
    ----------
    levels, table, ids
        As in the head of this file.
    count
        Decals that it is of: the numbers in its lists are smaller.
    parity
        Which sizes join larger ones (`cells.joined`).
    """

    levels: NDArray[np.float32]
    table: Ints
    ids: Ints
    count: int
    parity: int = ALONE

    @classmethod
    def build(cls, positions: ArrayLike, influence: ArrayLike, ranks: ArrayLike = DEFAULT_RANK) -> Self:
        """Index decals by position (float32[n, 3]), radius of influence (float32[n]) and rank (int32[n]).

        Raises
        ------
        InvalidDecals
            Arrays of other shapes or lengths, NaN, infinity, or a radius below 0.
        """
        centres = floats("positions", positions, (-1, 3))
        reach = floats("influence", influence, (len(centres),))
        check_range("influence", reach, 0.0, MOST_INFLUENCE)
        order = np.full(len(centres), ranks) if np.ndim(ranks) == 0 else ranks
        order = whole("ranks", order, len(centres), low=0, high=MOST_RANK, default=DEFAULT_RANK)
        arrays = build_index(*_device_arrays(centres, reach, order, "cpu"))
        lists = arrays.levels.numpy(), arrays.table.numpy(), arrays.ids.numpy()
        return cls(*lists, count=len(centres), parity=arrays.parity)

    @classmethod
    def of(cls, decals: Decals) -> Self:
        """Index decals."""
        return cls.build(decals.positions, decals.influence, decals.ranks)

    @property
    def level_count(self) -> int:
        """Number of non-empty levels."""
        return len(self.levels)

    @property
    def mask(self) -> int:
        """Number of slots − 1; a power of two − 1."""
        return len(self.table) - 1

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return self.levels.nbytes + self.table.nbytes + self.ids.nbytes

    @property
    def longest_lists(self) -> Wide:
        """Most decals of any cell, for each level; together, the most candidates that a point can have."""
        cells = self.table[self.table[:, 0] >= 0]
        longest = np.zeros(self.level_count, np.int64)
        np.maximum.at(longest, cells[:, 0] >> LEVEL_SHIFT, self.ids[cells[:, 3]])
        return longest

    def on(self, device: Any = None, *, copy: bool = True) -> DeviceIndex:
        """Copy the arrays to a Warp device; without ``copy``, share those that are on it already."""
        return DeviceIndex(
            self.level_count,
            wp.array(self.levels, dtype=wp.vec4, device=device, copy=copy),
            wp.array(self.table, dtype=wp.vec4i, device=device, copy=copy),
            self.mask,
            wp.array(self.ids, dtype=wp.int32, device=device, copy=copy),
        )

    def candidates(self, points: ArrayLike) -> tuple[Wide, Ints]:
        """List the decals that may act at each of m points.

        Returns
        -------
        offsets : int64[m + 1]
            Point i's candidates are ids[offsets[i]:offsets[i + 1]].
        ids : int32[...]
            Decal numbers, level after level, each level's in the order in which they are drawn.
        """
        where: Any = wp.array(np.asarray(points, np.float32).reshape(-1, 3), dtype=wp.vec3, device="cpu")
        arguments = self.on("cpu").arguments()
        counts = wp.zeros(len(where), dtype=wp.int32, device="cpu")
        wp.launch(count_candidates, len(where), [where, *arguments, counts], device="cpu")
        offsets = np.concatenate([[0], np.cumsum(counts.numpy(), dtype=np.int64)])
        found = wp.zeros(int(offsets[-1]), dtype=wp.int32, device="cpu")
        starts: Any = wp.array(offsets[:-1], dtype=wp.int32, device="cpu")
        wp.launch(list_candidates, len(where), [where, *arguments, starts, found], device="cpu")
        return offsets, found.numpy()


def _device_arrays(positions: ArrayLike, influence: ArrayLike, ranks: ArrayLike, device: Any) -> list[Any]:
    centres = np.asarray(positions, np.float32).reshape(-1, 3)
    order = np.broadcast_to(np.asarray(ranks, np.int32), len(centres))
    reach = np.asarray(influence, np.float32).reshape(-1)
    return [
        wp.array(centres, dtype=wp.vec3, device=device),
        wp.array(reach, dtype=wp.float32, device=device),
        wp.array(order, dtype=wp.int32, device=device),
    ]
