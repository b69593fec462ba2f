"""`DecalIndex`: all decals that can act at a point, exactly, in memory linear in the number of decals.

The index replaces the octree of the paper (section 3.4). It is a hash grid with several levels. A decal acts
in the ball of its neighbour reach ρ = NEIGHBOR_REACH·s. It is stored in every cell that this ball touches, on
the one level whose cells are larger than ρ and at most 2ρ wide: in at most 27 cells.

A look-up reads one cell of each level. Sizes therefore share levels in pairs where that leaves fewer levels:
the larger size then uses the cells of the smaller, half as wide. A decal then has at most 125 cells, and all
have at most 24 on average. A few small decals among many larger ones use the cells of these. Three arrays go
to the device:

    levels  float32[l, 4]   each level: (cells per unit length, cell size, lowest rank, highest rank)
    table   int32[2^k, 4]   slots of an open-addressing hash table: (x + level·2²⁴, y, z, head), or x < 0
    ids     int32[m]        lists: ids[head] is the length of a list, followed by the numbers of its decals in
                            draw order (decals/index/lookup.py)

Cell sizes are powers of two, and cells are counted from the origin of the world. The cell of a float32 point
is therefore exact, at any distance from the origin.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Int32Array, Int64Array
from blobtree.device import known_device
from blobtree.kernels import loaded
from decals.errors import InvalidDecals
from decals.index.build import build_index
from decals.index.decal_cells import LEVEL_SHIFT, NO_FLOOR, NO_PARITY
from decals.index.lookup import IndexedDecals, count_candidates, find_nested, list_candidates
from decals.model import DEFAULT_RANK, LAYER_LIMIT, MAX_COORDINATE, Decals
from decals.receivers import EVERYTHING
from decals.record import DEFAULT_STIFFNESS
from decals.validation import check_range, finite_array, instance, whole_array

MAX_INFLUENCE = 4.0 * MAX_COORDINATE
MAX_RANK = 8 * LAYER_LIMIT - 1
"""Upper bound of all ranks."""


@dataclass(frozen=True, eq=False)
class DecalIndex:
    """Hash grid over decals, for `evaluate` and for queries of candidates. `of` and `build` make one.

    Attributes
    ----------
    levels : float32[l, 4]
        Cells per unit length, cell size, lowest and highest rank of each level.
    table : int32[2**k, 4]
        Slots of the hash table: the key of a cell (three numbers), and where its list begins.
    ids : int32[m]
        Lists of decal numbers, each after its length.
    count : int
        Upper bound of the decal numbers in the lists.
    parity : int, optional
        Parity of the size exponents that keep their own level; the others share it. Default -1: no level is
        shared.
    floor : int, optional
        Exponent of the smallest cells, which smaller decals share.

    See Also
    --------
    DecalEditor : decals with an index that changes in place.

    Examples
    --------
    >>> import decals
    >>> disks = decals.Decals(
    ...     positions=[[0, 0, 0], [9, 0, 0]], normals=[[0, 0, 1]] * 2, tangents=[[1, 0, 0]] * 2, radii=[1, 1]
    ... )
    >>> index = decals.index.DecalIndex.of(disks)
    >>> offsets, numbers = index.candidates([[0.5, 0, 0], [5, 5, 5]])
    >>> offsets, numbers
    (array([0, 1, 1]), array([0], dtype=int32))
    """

    levels: Float32Array
    table: Int32Array
    ids: Int32Array
    count: int
    parity: int = NO_PARITY
    floor: int = NO_FLOOR

    @classmethod
    def build(cls, positions: ArrayLike, influence: ArrayLike, ranks: ArrayLike = DEFAULT_RANK) -> Self:
        """Build the index of decals from arrays.

        Parameters
        ----------
        positions : float32[n, 3]
            Centres in model units.
        influence : float32[n]
            Influence radii in model units.
        ranks : int32[n] or int, optional
            `Decals.ranks`. Default: contact decals of layer 0.

        Raises
        ------
        InvalidDecals
            Arrays of other shapes or lengths, NaN, infinity, or a radius below 0.
        """
        centres = finite_array("positions", positions, (-1, 3))
        reach = finite_array("influence", influence, (len(centres),))
        check_range("influence", reach, 0.0, MAX_INFLUENCE)
        order = np.full(len(centres), ranks) if np.ndim(ranks) == 0 else ranks
        order = whole_array("ranks", order, len(centres), low=0, high=MAX_RANK)
        arrays = build_index(*device_arrays(centres, reach, order, known_device("cpu")))
        lists = arrays.levels.numpy(), arrays.table.numpy(), arrays.ids.numpy()
        return cls(*lists, count=len(centres), parity=arrays.parity, floor=arrays.floor)

    @classmethod
    def of(cls, decals: Decals) -> Self:
        """Build the index of decals; raise InvalidDecals for any other object."""
        instance("decals", decals, Decals, InvalidDecals, "such as decals.scatter(...)")
        return cls.build(decals.positions, decals.influence, decals.ranks)

    @property
    def level_count(self) -> int:
        """Number of non-empty levels."""
        return len(self.levels)

    @property
    def mask(self) -> int:
        """Number of slots − 1, a power of two − 1."""
        return len(self.table) - 1

    @property
    def nbytes(self) -> int:
        """Size of all arrays in bytes."""
        return self.levels.nbytes + self.table.nbytes + self.ids.nbytes

    @property
    def longest_lists(self) -> Int64Array:
        """Length of the longest list of each level, int64[l]; their sum bounds the candidates of a point."""
        cells = self.table[self.table[:, 0] >= 0]
        longest = np.zeros(self.level_count, np.int64)
        np.maximum.at(longest, cells[:, 0] >> LEVEL_SHIFT, self.ids[cells[:, 3]])
        return longest

    def on(self, device: Any = None, *, records: Float32Array, layered: bool, copy: bool = True) -> Any:
        """Return the index with the records of its decals on a Warp device, an `IndexedDecals`.

        Parameters
        ----------
        device : optional
            Warp device; its default if not given.
        records : float32[4n, 4]
            `Decals.packed` of the indexed decals.
        layered : bool
            `Decals.layered` of these decals.
        copy : bool, optional
            If False, arrays that lie on the device already are shared.
        """
        arrays = self.levels, self.table, self.ids
        return indexed_decals(records, *arrays, layered=layered, device=device, copy=copy)

    def candidates(self, points: ArrayLike) -> tuple[Int64Array, Int32Array]:
        """Return the decals that may act at each of m points, ``float32[m, 3]``.

        Returns
        -------
        offsets : int64[m + 1]
            The candidates of point i are ids[offsets[i]:offsets[i + 1]].
        ids : int32[k]
            Decal numbers, level after level, in draw order within each level.
        """
        queries: Any = wp.array(np.asarray(points, np.float32).reshape(-1, 3), dtype=wp.vec3, device="cpu")
        index = self.on("cpu", records=np.zeros((0, 4), np.float32), layered=True, copy=False)
        counts = wp.zeros(len(queries), dtype=wp.int32, device="cpu")
        wp.launch(loaded(count_candidates, "cpu"), len(queries), [queries, index, counts], device="cpu")
        offsets = np.concatenate([[0], np.cumsum(counts.numpy(), dtype=np.int64)])
        ids = wp.zeros(int(offsets[-1]), dtype=wp.int32, device="cpu")
        starts: Any = wp.array(offsets[:-1], dtype=wp.int32, device="cpu")
        wp.launch(loaded(list_candidates, "cpu"), len(queries), [queries, index, starts, ids], device="cpu")
        return offsets, ids.numpy()


def index_on(decals: Decals, device: Any = None, *, reach: float = 1.0) -> Any:
    """Build the index of decals on a device, an `IndexedDecals`, without a copy on the host.

    `reach` multiplies the distance to which decals are listed, their neighbour reach.
    """
    placed = device_arrays(decals.positions, reach * decals.influence, decals.ranks, device)
    levels, table, ids, *_ = build_index(*placed)
    return indexed_decals(decals.packed(), levels, table, ids, layered=decals.layered, device=device)


def indexed_decals(
    records: Any, levels: Any, table: Any, ids: Any, *, layered: bool, device: Any, copy: bool = False
) -> Any:
    """Return an `IndexedDecals` of these arrays on a device."""
    index: Any = IndexedDecals()
    index.records = wp.array(records, dtype=wp.vec4, device=device, copy=copy)
    index.layered = layered
    index.level_count = len(levels)
    index.levels = wp.array(levels, dtype=wp.vec4, device=device, copy=copy)
    index.table = wp.array(table, dtype=wp.vec4i, device=device, copy=copy)
    index.mask = len(table) - 1
    index.ids = wp.array(ids, dtype=wp.int32, device=device, copy=copy)
    index.stiffness = DEFAULT_STIFFNESS
    index.nested = True
    index.limited, index.surface = False, EVERYTHING
    index.limits = wp.zeros(0, dtype=wp.vec4, device=device)
    index.walked, index.walks = False, index.limits
    return index


def has_nested(indexed: Any, count: int) -> bool:
    """Return True if two contact decals are nested among the first `count` of an index."""
    device = indexed.records.device
    found: Any = wp.zeros(1, dtype=wp.int32, device=device)
    wp.launch(loaded(find_nested, device), count, [indexed], [found], device=device)
    return bool(found.numpy()[0])


def device_arrays(positions: ArrayLike, influence: ArrayLike, ranks: ArrayLike, device: Any) -> list[Any]:
    """Return centres, reaches and ranks as arrays on a device, as `build_index` takes them."""
    centres = np.asarray(positions, np.float32).reshape(-1, 3)
    order = np.broadcast_to(np.asarray(ranks, np.int32), len(centres))
    reach = np.asarray(influence, np.float32).reshape(-1)
    return [
        wp.array(centres, dtype=wp.vec3, device=device),
        wp.array(reach, dtype=wp.float32, device=device),
        wp.array(order, dtype=wp.int32, device=device),
    ]
