"""The decal index: which decals may act at a point, exactly, without a cap, in memory linear in their number.

It replaces the paper's octree (section 3.4). Each decal is stored once for every cell that its ball of
radius ρ = REACH·s touches, on the one level whose cells are larger than ρ and at most 2ρ wide: at most 27
cells. A look-up reads one cell per level. Three flat arrays go to the device:

    levels  float32[l, 4]   per level: (cells per unit length, cell size, lowest rank, highest rank)
    table   int32[4 · 2^k]  slots of an open-addressing hash table: (x + level·2²⁴, y, z, head), x < 0: empty
    ids     int32[m]        lists: ids[head] is a count, that many decal numbers follow, in
                            the order in which they are drawn (decals/stack.py)

Cell sizes are powers of two and cells are counted from the world's origin, so the cell of a float32 point is
found without any rounding: no decal is ever lost to it, near or far from the origin.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from decals.contact import REACH
from decals.lookup import HALF_RANGE, MIX_ALL, MIX_X, MIX_Y, MIX_Z, count_candidates, list_candidates
from decals.model import DEFAULT_RANK, Decals

SLACK = 1e-5
"""Relative growth of each ball, above the rounding of a float32 distance."""

FINEST = 22
"""Cells are at least the largest coordinate / 2²²: about the spacing of float32 numbers there."""

_EMPTY = -1
_CHUNK = 1 << 16
_NEIGHBOURHOOD = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)

Ints = NDArray[np.int32]
Wide = NDArray[np.int64]
Doubles = NDArray[np.float64]


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


@dataclass(frozen=True, eq=False)
class DecalIndex:
    """Hash grid of as many levels as there are size classes."""

    levels: NDArray[np.float32]
    table: Ints
    ids: Ints

    @classmethod
    def build(cls, positions: ArrayLike, influence: ArrayLike, ranks: ArrayLike = DEFAULT_RANK) -> Self:
        """Index decals by position (float32[n, 3]), radius of influence (float32[n]) and rank (int32[n])."""
        centres = np.asarray(positions, np.float64).reshape(-1, 3)
        reach = np.asarray(influence, np.float64).reshape(-1) * (REACH * (1.0 + SLACK))
        exponents = _exponents(centres, reach)
        used, level = np.unique(exponents, return_inverse=True)
        keys, owners = _entries(centres, reach, np.exp2(exponents), level)
        rank = np.broadcast_to(np.asarray(ranks, np.int64), len(centres))
        order = np.lexsort((rank[owners], *keys.T))
        keys, owners = keys[order], owners[order]
        starts = np.flatnonzero((np.diff(keys, axis=0, prepend=_EMPTY) != 0).any(axis=1))
        ids, heads = _lists(owners, starts)
        levels = np.zeros((len(used), 4), np.float32)
        levels[:, 0] = np.exp2(-used)
        levels[:, 1] = np.exp2(used)
        levels[:, 2] = [rank[level == number].min() for number in range(len(used))]
        levels[:, 3] = [rank[level == number].max() for number in range(len(used))]
        return cls(levels, _hash_table(keys[starts], heads), ids)

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
        return len(self.table) // 4 - 1

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return self.levels.nbytes + self.table.nbytes + self.ids.nbytes

    def on(self, device: Any = None) -> DeviceIndex:
        """Copy the arrays to a Warp device."""
        return DeviceIndex(
            self.level_count,
            wp.array(self.levels, dtype=wp.vec4, device=device),
            wp.array(self.table, dtype=wp.int32, device=device),
            self.mask,
            wp.array(self.ids, dtype=wp.int32, device=device),
        )

    def candidates(self, points: ArrayLike) -> tuple[Wide, Ints]:
        """List the decals that may act at each of m points.

        Returns
        -------
        offsets : int64[m + 1]
            Point i's candidates are ids[offsets[i]:offsets[i + 1]].
        ids : int32[...]
            Decal numbers, ascending within each level.
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


def _exponents(centres: Doubles, reach: Doubles) -> Wide:
    """Each decal's e with cell size 2^e in (ρ, 2ρ], or larger where float32 positions are coarser."""
    _, by_size = np.frexp(reach)
    _, by_place = np.frexp(np.abs(centres).max(axis=1, initial=0.0) + reach)
    exponents: Wide = np.maximum(by_size, by_place - FINEST).astype(np.int64)
    return exponents


def _entries(centres: Doubles, reach: Doubles, size: Doubles, level: Wide) -> tuple[Wide, Ints]:
    """Keys int64[m, 3] of all cells that the balls touch, and whose ball it is; ascending decals."""
    keys, owners = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int32)]
    for begin in range(0, len(centres), _CHUNK):
        part = slice(begin, begin + _CHUNK)
        middle, radius, width = centres[part, None], reach[part, None, None], size[part, None, None]
        lowest = np.floor((middle - radius) / width)
        cells = lowest + _NEIGHBOURHOOD
        nearest = np.clip(middle, cells * width, (cells + 1.0) * width)
        touched = ((nearest - middle) ** 2).sum(axis=2) <= radius[..., 0] ** 2
        row, _ = np.nonzero(touched)
        key = cells[touched].astype(np.int64) + int(HALF_RANGE)
        key[:, 0] += level[part][row] << 24
        keys.append(key)
        owners.append((row + begin).astype(np.int32))
    return np.concatenate(keys), np.concatenate(owners)


def _lists(owners: Ints, starts: Wide) -> tuple[Ints, Wide]:
    """Put a count before every list; where each list begins (its head)."""
    counts = np.diff(starts, append=len(owners))
    heads = starts + np.arange(len(starts))
    ids = np.empty(len(owners) + len(starts), np.int32)
    ids[heads] = counts
    ids[np.arange(len(owners)) + np.repeat(np.arange(len(starts)), counts) + 1] = owners
    return ids, heads


def _hash_table(cells: Wide, heads: Wide) -> Ints:
    """Place all cells at once: each takes the first free slot from its own on, as linear probing finds it."""
    slots = 1 << (2 * len(cells)).bit_length()
    occupant = np.full(slots, _EMPTY, np.int64)
    pending = np.arange(len(cells))
    place = _hash(cells) & (slots - 1)
    while len(pending):
        free = pending[occupant[place[pending]] == _EMPTY]
        occupant[place[free]] = free
        pending = pending[occupant[place[pending]] != pending]
        place[pending] = (place[pending] + 1) & (slots - 1)
    table = np.full((slots, 4), _EMPTY, np.int32)
    full = occupant != _EMPTY
    table[full, :3] = cells[occupant[full]]
    table[full, 3] = heads[occupant[full]]
    return table.reshape(-1)


def _hash(cells: Wide) -> Wide:
    """`cell_hash` of the look-up, for many cells."""
    x, y, z = cells.astype(np.uint32).T
    h = (x * np.uint32(MIX_X)) ^ (y * np.uint32(MIX_Y)) ^ (z * np.uint32(MIX_Z))
    h = (h ^ (h >> np.uint32(15))) * np.uint32(MIX_ALL)
    mixed: Wide = (h ^ (h >> np.uint32(13))).astype(np.int64)
    return mixed
