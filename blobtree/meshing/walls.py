"""Walls: parts between two surfaces of operands, which no primitive is as thin as.

What a difference leaves between its body and its tool, the lens of an intersection and the walls of a shell
have both their sides on surfaces of operands. These surfaces are far smoother than the wall is thin, so cells
as large as the operands' leaves show them. Points on them are the samples: from each, a ray into the solid
finds the other side. Where the wall is thin, more samples lie between them, as close as the blocks of the
next level.

A wedge is thin at its edge, whatever the size of cells. In a strip along it, a small part of a cell of the
base wide, cells are as large as at the strip's inner side.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree._typing import BoolArray, Float32Array, Float64Array, IndexArray
from blobtree.cells.grid import BRANCHING, Grid
from blobtree.cells.sparse_cells import SparseCells, build_cells
from blobtree.cells.surface_box import longest_side, surface_box
from blobtree.declare.skeleton import BALL_CELLS, PLATE_CELLS
from blobtree.device import launch
from blobtree.formulas.falloff import ISO
from blobtree.meshing.adaptive_cells import CELL_OFFSETS, CORNERS, cell_codes
from blobtree.meshing.block_tree import BlockTree, on_device
from blobtree.meshing.gaps import connected_blocks
from blobtree.meshing.part_kernels import UNLIMITED
from blobtree.meshing.patches import EDGES
from blobtree.meshing.wall_kernels import climb, measure_walls, place_samples
from blobtree.tape.bounds import leaf_boxes
from blobtree.tape.model import ImplicitModel
from blobtree.tape.operands import Operand, leaves_of, operands_of
from blobtree.tape.part_sizes import part_sizes
from blobtree.tape.program import ProgramLeaf
from blobtree.tape.tape import DeviceTape, Tape

WALL_CELLS = 2.0 * PLATE_CELLS
"""Cells across a wall, for the corners of cells to lie in it."""

RIM_SHARE, SMALL_RIM_SHARE = 1 / 16, 1 / 8
"""Width of the strip along the edge of a lens, over the lens's radius; of small lenses too."""

SMALL_LENS = 3.0
"""Radius of a lens, in cells of the base, below which it is small: it takes many cells for a small area."""

EDGE_SHARE = 1 / 4
"""Size of the smallest cells at the edges of a lens, over that of the thinnest parts."""

ENOUGH, MOST_SPREADS = 100, 3
"""Samples that tell the size of walls, and levels in which more are put between those of the first one."""

PARALLEL = np.radians(25.0)
"""Angle between the sides of a wall below which they are nearly parallel."""

THINNEST = 1e-6
"""Thickness of a wall over the longest side of the surface's box, from which float32 tells sides apart."""

FLAT = 2e-3
"""Angle between the sides of a wall below which it is as thin all around, and no edge of a wedge."""

WALL_OPPOSED, LENS_OPPOSED = 0.8, -0.2
"""Least cosine between the inward normal on one side of a wall and the outward one on the other side; thick
lenses have right angles at their edges."""

WALL_REACH, LENS_REACH = 2.0, 3.5
"""Largest radius of a wedge or a lens over that of its part with nearly parallel sides."""

THICK_SHARE = 0.75
"""Part of a wall's places that are as thin as this part of its thickest ones at most, which lenses have."""

THIN_SHARE = 0.1
"""Part of a wall's places that may be thinner than is expected of so large an area: at edges."""

CLIMBS = 3
"""Steps of samples toward the solid, before its thickness is measured."""

NEAR_CELLS = 2.0
"""Side of bins in cells: the other side of a wall is at most WALL_CELLS away, and so in one beside."""

LEAF_CELLS = 64.0
"""Most cells along a small leaf, with which its surface is found."""

MAX_BINS = 64
"""Most bins along a side."""

CROSSED_EDGE: IndexArray = np.array(
    [[(code >> a & 1) != (code >> b & 1) for a, b in EDGES] for code in range(256)]
).argmax(axis=1)
"""By code of a cell (256,), the first edge that the surface crosses."""

Ends = tuple[Float32Array, Float32Array]
"""Both ends of lines (n, 3)."""

SPREAD: dict[int, Float64Array] = {
    count: np.stack(np.meshgrid(*2 * [(np.arange(count) + 0.5) / count - 0.5]), axis=-1).reshape(-1, 2)
    for count in (2, 4)
}
"""Places in a square of `count`² samples, in sides of it."""


@dataclass(frozen=True)
class _Samples:
    """Thin places of the surface of one operand."""

    operand: Operand
    tape: DeviceTape
    rim: float
    """Width of the strip along the edge of a wedge in which cells are as large as at its inner side."""
    places: Float32Array
    """Points on the surface (n, 3)."""
    normals: Float32Array
    """Inward normals (n, 3)."""
    needed: Float32Array
    """Sizes of the cells that the wall needs (n,)."""
    turns: Float32Array
    """Angles between the sides of the wall (n,)."""

    @staticmethod
    def none(operand: Operand, device: str) -> "_Samples":
        """Return no samples."""
        numbers, points = np.empty(0, np.float32), np.empty((0, 3), np.float32)
        return _Samples(operand, operand.tape.on(device), 0.0, points, points, numbers, numbers)

    def chosen(self, among: BoolArray | IndexArray) -> "_Samples":
        """Return some of the samples."""
        columns = ("places", "normals", "needed", "turns")
        return replace(self, **{name: getattr(self, name)[among] for name in columns})

    def thinned(self, spacing: float) -> "_Samples":
        """Return one sample in each cube of this side: many of them climb to one place."""
        cubes = np.floor(self.places / spacing).astype(np.int64)
        return self.chosen(np.unique(cubes, axis=0, return_index=True)[1])

    @property
    def both_sides(self) -> Float64Array:
        """The places, and those on the other side of the wall (2 n, 3)."""
        across = self.normals.astype(np.float64) * (WALL_CELLS * self.needed)[:, None]
        return np.concatenate([self.places, self.places + across])

    def spread(self, spacing: float, count: int) -> Ends:
        """Return lines across the surface, count² around each place, in a square of this side."""
        first = np.cross(self.normals, np.eye(3)[np.abs(self.normals).argmin(axis=1)])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(self.normals, first)
        offsets = spacing * SPREAD[count]
        places = self.places[:, None] + offsets[:, :1] * first[:, None] + offsets[:, 1:] * second[:, None]
        across = 0.5 * spacing * self.normals[:, None]
        low, high = ((places + side * across).reshape(-1, 3).astype(np.float32) for side in (-1, 1))
        return low, high


@dataclass(frozen=True)
class ThinWall:
    """A thin wall beside an operand."""

    operand: Operand
    facing: Operand
    """The one on the other side; the same for walls between parts of one."""
    thickness: float
    """The least thickness that a sample shows."""


class Walls:
    """The thin walls of a tree, sampled level by level as its blocks are refined."""

    def __init__(self, tree: ImplicitModel, blocks: BlockTree, least: float) -> None:
        """Find the walls; `least` is the size of the smallest cells."""
        self._blocks, self._least = blocks, EDGE_SHARE * least
        self._thinnest = THINNEST * longest_side(surface_box(tree))
        cells = blocks.cells
        self._device, self._kernel = cells.device, cells.tape.instruction_set.kernel_for
        self._operands = operands = operands_of(tree._program, tree.tape)
        leaves = self._small_leaves(tree) if operands else {}
        lines = [
            _joined([self._lines(one.tape, cells.grid), *(leaves[at] for at in one.numbers if at in leaves)])
            for one in operands
        ]
        self._samples: list[_Samples] = []
        self._thick: list[float] = []
        """Cells that the thicker places of each operand's walls need."""
        for operand, (low, high), near in zip(
            operands, lines, self._near_others(operands, lines), strict=True
        ):
            samples, thick = _Samples.none(operand, self._device), np.inf
            samples = self._first_samples(samples, low[near], high[near])
            if (samples.needed >= self._least).any():
                needed, radius = self._closely(samples)
                small = radius <= SMALL_LENS * cells.grid.cell_size
                rim = (SMALL_RIM_SHARE if small else RIM_SHARE) * radius
                thick = float(np.quantile(needed, THICK_SHARE))
                samples = self._first_samples(replace(samples, rim=rim), low[near], high[near])
            self._samples.append(samples)
            self._thick.append(thick)

    def _lines(self, tape: Tape, grid: Grid) -> Ends:
        """Return both ends of an edge of each cell of a grid that the surface of a tape crosses."""
        return _crossed_edges(build_cells(tape, grid, device=self._device))

    def _small_leaves(self, tree: ImplicitModel) -> dict[int, Ends]:
        """Return lines across the surfaces of leaves that fall between the samples of the base."""
        grid, radii = self._blocks.cells.grid, part_sizes(tree)[0]
        small = np.flatnonzero(radii < grid.cell_size)
        if not len(small):
            return {}
        lower, upper = leaf_boxes(tree._program)
        needed = np.maximum(radii / BALL_CELLS, (upper - lower).max(axis=1) / LEAF_CELLS)
        tapes, result = list(leaves_of(tree._program, tree.tape)), dict[int, Ends]()
        for number in small[needed[small] < grid.cell_size].tolist():
            divisions = math.ceil(math.log(grid.cell_size / needed[number], BRANCHING))
            result[number] = self._lines(tapes[number], grid.divided(divisions))
        return result

    def _closely(self, samples: _Samples) -> tuple[Float64Array, float]:
        """Return the sizes of cells that the walls of an operand need in enough places, and their radius.

        Walls may be small beside cells.
        """
        level, spacing, closer = 0, self._blocks.grid(0).cell_size, samples
        while 0 < len(closer.needed) < ENOUGH and level < MOST_SPREADS:
            samples, spacing = closer, _spacing(self._blocks.grid(level).cell_size, level)
            level += 1
            closer = self._thin(samples, *samples.spread(spacing, 4), level)
        if len(closer.needed):
            samples, spacing = closer, _spacing(self._blocks.grid(level).cell_size, level)
        cubes = np.unique(np.floor(samples.places / spacing).astype(np.int64), axis=0)
        return samples.needed.astype(np.float64), spacing * float(np.sqrt(len(cubes) / np.pi))

    def _near_others(self, operands: list[Operand], lines: list[Ends]) -> list[BoolArray]:
        """Return which lines of each operand are near the tree's surface, and near another operand's.

        A tool of several primitives counts as another one to itself.
        """
        grid, blocks = self._blocks.cells.grid, self._blocks.coordinates
        lowest, highest = blocks.min(axis=0, initial=1 << 30), blocks.max(axis=0, initial=0)
        side = max(NEAR_CELLS, 4.0 * float((highest - lowest).max(initial=0) + 1) / MAX_BINS)
        count = np.maximum(4.0 * (highest - lowest + 1) / side, 0.0).astype(np.int64) + 5

        def bins_of(cells: Float64Array) -> tuple[IndexArray, ...]:
            return tuple((np.floor((cells - 4 * lowest) / side) + 2.0).clip(0, count - 1).astype(np.int64).T)

        tree = np.zeros(count, bool)
        for offset in np.ndindex(2, 2, 2):
            tree[bins_of(4.0 * blocks + 2.0 * np.array(offset) + 1.0)] = True
        first, last = np.full(count, len(lines)), np.full(count, -1)
        of_lines = [bins_of((low - grid.origin) / grid.cell_size) for low, _ in lines]
        for number, at in enumerate(of_lines):
            first[at], last[at] = np.minimum(first[at], number), number
        for axis in range(3):
            tree = _of_neighbors(tree, np.logical_or, axis)
            first, last = _of_neighbors(first, np.minimum, axis), _of_neighbors(last, np.maximum, axis)
        shared, alone = tree & (first < last), tree & (first <= last)
        return [
            (alone if operand.faces_itself else shared)[at]
            for operand, at in zip(operands, of_lines, strict=True)
        ]

    @property
    def sizes(self) -> Float32Array:
        """Sizes of the cells that walls need, at all samples, without walls that are too thin for cells."""
        needed = np.concatenate([np.empty(0, np.float32), *(samples.needed for samples in self._samples)])
        return needed[needed >= self._least]

    @property
    def too_thin(self) -> list[tuple[float, Float64Array, ProgramLeaf]]:
        """The same as `thinnest` where cells cannot be as small as the wall needs."""
        return [wall for wall in self.thinnest if wall[0] < self._least]

    @property
    def thin(self) -> list["ThinWall"]:
        """The thin walls, each as its operands see it."""
        from scipy.spatial import cKDTree  # most meshes have no thin walls

        samples = [samples for samples in self._samples if len(samples.needed)]
        operands = [
            o for o, samples in zip(self._operands, self._samples, strict=True) if len(samples.needed)
        ]
        searches = [cKDTree(one.places) for one in samples]
        result = []
        for number, one in enumerate(samples):
            far = np.split(one.both_sides, 2)[1]
            gaps = [search.query(far)[0] for search in searches]
            gaps[number][:] = np.inf
            facing = np.bincount(np.argmin(gaps, axis=0)).argmax() if len(samples) > 1 else number
            thickness = WALL_CELLS * float(one.needed.min())
            result.append(ThinWall(operands[number], operands[facing], thickness))
        return result

    @property
    def thinnest(self) -> list[tuple[float, Float64Array, ProgramLeaf]]:
        """Size of cells, place and leaf of the sample of each operand where its wall is thinnest."""
        return [self._thinnest_of(samples) for samples in self._samples if len(samples.needed)]

    @staticmethod
    def _thinnest_of(samples: _Samples) -> tuple[float, Float64Array, ProgramLeaf]:
        """Return size of cells, place and leaf of the sample where a wall is thinnest."""
        at = int(samples.needed.argmin())
        return float(samples.needed[at]), samples.places[at].astype(np.float64), samples.operand.leaf

    def needed(self, first: int) -> Float32Array:
        """Return the sizes of cells that walls need in blocks of the finest level, from number `first` on."""
        needed = np.full(len(self._blocks) - first, UNLIMITED, np.float32)
        for samples in self._samples:
            rows, wish = self._rows(samples.both_sides, first), np.tile(samples.needed, 2)
            found = (rows >= 0) & (wish >= self._least)
            np.minimum.at(needed, rows[found], wish[found])
        return self._spread_to_neighbors(needed, first)

    def _spread_to_neighbors(self, needed: Float32Array, first: int) -> Float32Array:
        """Return sizes of cells, with the least one of its neighbours for each block without a sample."""
        thin = np.flatnonzero(needed < UNLIMITED)
        at = self._blocks.coordinates[first:][thin].astype(np.int64)
        index = _Index(self._blocks.coordinates[first:].astype(np.int64))
        result = np.full_like(needed, UNLIMITED)
        for offset in np.ndindex(3, 3, 3):
            rows = index.find(at + offset - 1)
            np.minimum.at(result, rows[rows >= 0], needed[thin[rows >= 0]])
        return np.where(needed < UNLIMITED, needed, result)

    def refine(self, first: int, refined: IndexArray) -> None:
        """Put more samples into blocks that are refined, of those from number `first` on at their level."""
        blocks = self._blocks
        level = int(blocks.levels[refined[0]])
        spacing = _spacing(blocks.grid(level).cell_size, level)
        chosen = np.zeros(len(blocks) + 1, bool)
        chosen[refined] = True
        for number, samples in enumerate(self._samples):
            rows = self._rows(samples.both_sides, first).reshape(2, -1)
            either = np.any(chosen[np.where(rows >= 0, first + rows, -1)], axis=0)
            kept = samples.chosen(np.flatnonzero(either))
            ends = kept.spread(spacing, 2 if level == 0 else 4)
            self._samples[number] = self._thin(samples, *ends, level + 1)

    def leave_out_large(
        self, most: float, finest: float, most_fine: float
    ) -> list[tuple[float, Float64Array, ProgramLeaf]]:
        """Forget walls that need more cells than `most`, or than `most_fine` cells below `finest`.

        Return size of cells, place and leaf of each. To be called before blocks are refined. Beside other
        parts a wall may be thick, so its thickest places do not tell whether it is fine.
        """
        left_out, area = [], self._blocks.grid(0).cell_size ** 2
        for number, samples in enumerate(self._samples):
            if not len(samples.needed):
                continue
            needed = samples.needed.astype(np.float64)
            cells = (area / needed.clip(np.quantile(needed, THIN_SHARE)) ** 2).sum()
            if cells > (most_fine if self._thick[number] < THICK_SHARE * finest else most):
                left_out.append(self._thinnest_of(samples))
                self._samples[number] = samples.chosen(np.empty(0, np.intp))
        return left_out

    def leave_out_near(self, places: Float64Array | None) -> list[tuple[float, Float64Array, ProgramLeaf]]:
        """Forget the walls nearest to places (n, 3), each in all blocks of the base that it connects.

        Without places, forget all walls. Return size of cells, place and leaf of each. To be called before
        blocks are refined.
        """
        from scipy.spatial import cKDTree  # most meshes have no thin walls

        samples, grid = np.concatenate([one.places for one in self._samples]), self._blocks.grid(0)
        places = samples if places is None else places
        if not len(samples):
            return []
        at = np.floor((samples - grid.origin) / (4 * grid.cell_size)).astype(np.int32)
        blocks, of_samples = np.unique(at, axis=0, return_inverse=True)
        groups = connected_blocks(blocks)[of_samples.ravel()]
        near = np.isin(groups, groups[cKDTree(samples).query(places)[1]])
        ends, left_out = np.cumsum([len(one.places) for one in self._samples])[:-1], []
        for number, (one, out) in enumerate(zip(self._samples, np.split(near, ends), strict=True)):
            if out.any():
                left_out.append(self._thinnest_of(one.chosen(out)))
                self._samples[number] = one.chosen(~out)
        return left_out

    def leaf_at(self, place: Float64Array, size: float) -> ProgramLeaf | None:
        """Return a leaf of the operand with a sample nearest to a place whose wall needs cells of a size.

        None if no wall there needs cells as small.
        """
        nearest, result = 4.0 * self._blocks.grid(0).cell_size, None
        for samples in self._samples:
            gaps = np.linalg.norm(samples.places[samples.needed <= size] - place, axis=1)
            if gaps.min(initial=np.inf) < nearest:
                nearest, result = gaps.min(), samples.operand.leaf
        return result

    def _rows(self, places: Float64Array, first: int) -> IndexArray:
        """Return the blocks of the finest level that hold places, counted from number `first`, or −1."""
        blocks = self._blocks
        if first == len(blocks):
            return np.full(len(places), -1)
        grid = blocks.grid(int(blocks.levels[first]))
        at = np.floor((places - grid.origin) / (4 * grid.cell_size)).astype(np.int64)
        return _Index(blocks.coordinates[first:].astype(np.int64)).find(at)

    def _thin(self, like: _Samples, starts: Float32Array, ends: Float32Array, level: int) -> _Samples:
        """Return the samples between `starts` and `ends` where a wall is too thin for cells of a level.

        The operand and the strip are those of other samples.
        """
        count, device = len(starts), self._device
        size, limit = (self._blocks.grid(at).cell_size for at in (level, max(level - 1, 0)))
        low, high = (on_device(array, wp.vec3, device) for array in (starts, ends))
        places, moved, normals = (wp.zeros(count, dtype=wp.vec3, device=device) for _ in range(3))
        thicknesses, angles = (wp.zeros(count, dtype=wp.float32, device=device) for _ in range(2))
        arrays = self._blocks.arrays()
        of_operand = [like.tape.data, like.tape.span]
        launch(self._kernel(place_samples), count, [low, high, 0.5 * size, *of_operand], [places], device)
        for _climb in range(CLIMBS):
            launch(self._kernel(climb), count, [places, size, *of_operand, arrays], [moved], device)
            places, moved = moved, places
        inputs = [places, size, WALL_CELLS * limit, self._thinnest, WALL_CELLS * self._least, like.rim]
        inputs += [LENS_OPPOSED if like.operand.meets else WALL_OPPOSED, arrays]
        launch(self._kernel(measure_walls), count, inputs, [moved, normals, thicknesses, angles], device)
        needed, turns = np.abs(thicknesses.numpy()) / np.float32(WALL_CELLS), angles.numpy()
        thin = (needed < limit) & ((needed >= self._least) | (turns < FLAT))
        samples = replace(like, places=moved.numpy(), normals=normals.numpy(), needed=needed, turns=turns)
        return samples.chosen(thin).thinned(0.5 * _spacing(size, level))

    def _first_samples(self, like: _Samples, starts: Float32Array, ends: Float32Array) -> _Samples:
        """Return the samples of the base near nearly parallel sides; all others are only sharp edges."""
        from scipy.spatial import cKDTree  # most meshes have no thin walls

        level, spacing = 0, self._blocks.grid(0).cell_size
        samples = closer = self._thin(like, starts, ends, 0)
        most = MOST_SPREADS if like.operand.meets else 0
        while level < most and 0 < len(closer.turns) < ENOUGH and closer.turns.min() >= PARALLEL:
            level += 1
            closer = self._thin(closer, *closer.spread(spacing, 4), level)
            spacing = _spacing(self._blocks.grid(level).cell_size, level)
        seeds = closer.places[closer.turns < PARALLEL]
        if not len(seeds):
            return samples.chosen(np.empty(0, np.intp))
        reach = (LENS_REACH if like.operand.meets else WALL_REACH) * float(np.sqrt(len(seeds) / np.pi))
        reach = reach * spacing + 2.0 * self._blocks.grid(0).cell_size
        return samples.chosen(cKDTree(seeds).query(samples.places)[0] < reach)


def _joined(lines: list[Ends]) -> Ends:
    """Return all lines as one list."""
    starts, ends = zip(*lines, strict=True)
    return np.concatenate(starts), np.concatenate(ends)


def _of_neighbors(values: NDArray[Any], pick: np.ufunc, axis: int) -> NDArray[Any]:
    """Return what `pick` makes of each value of a volume and of its two neighbours along an axis."""
    along = np.moveaxis(values, axis, 0)
    result = along.copy()
    result[1:] = pick(result[1:], along[:-1])
    result[:-1] = pick(result[:-1], along[1:])
    return np.moveaxis(result, 0, axis)


def _spacing(size: float, level: int) -> float:
    """Return the distance between samples in blocks of a level with cells of a size."""
    return size if level == 0 else 2.0 * size


def _crossed_edges(cells: SparseCells) -> Ends:
    """Return both ends of an edge of each cell that a surface crosses."""
    blocks = BlockTree(cells)
    codes = cell_codes(np.ascontiguousarray(np.moveaxis(blocks.values, 0, -1)) >= ISO)
    rows, offsets = np.nonzero((codes > 0) & (codes < 255))
    lowest = blocks.coordinates[rows] * 4 + CELL_OFFSETS[offsets]
    edges = np.array(EDGES)[CROSSED_EDGE[codes[rows, offsets]]]
    low, high = (cells.grid.origin + (lowest + CORNERS[end]) * cells.grid.cell_size for end in edges.T)
    return low.astype(np.float32), high.astype(np.float32)


class _Index:
    """Rows of integer coordinates (n, 3)."""

    def __init__(self, coordinates: IndexArray) -> None:
        keys = _keys(coordinates)
        self._order = np.argsort(keys)
        self._keys = keys[self._order]

    def find(self, coordinates: IndexArray) -> IndexArray:
        """Return the row of each of other coordinates (m, 3); −1 for coordinates that have no row."""
        wanted = _keys(coordinates)
        at = np.searchsorted(self._keys, wanted).clip(max=len(self._keys) - 1)
        rows: IndexArray = np.where(self._keys[at] == wanted, self._order[at], -1)
        return rows


def _keys(coordinates: IndexArray) -> IndexArray:
    """Return numbers (n,) that tell integer coordinates (n, 3) apart."""
    x, y, z = coordinates.clip(-1, (1 << 20) - 2).T + 1
    keys: IndexArray = (x << 42) + (y << 21) + z
    return keys
