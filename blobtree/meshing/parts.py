"""Thin parts: cells that are as small as the primitives that act in them.

A part thinner than a cell falls between the samples of a uniform grid. The tree knows how thin its primitives
are: a ball, a tube or a plate by its radius, a box by its shortest side too, all of them less under maps and
warps that shrink them. So the blocks in which a thin primitive acts are refined until their cells resolve it,
and all others keep their size. The result is a mesh of adaptive cells, which is closed where sizes meet.

Walls that differences and intersections leave are thinner than any primitive: `walls` finds them. Gaps
between parts may be narrower than cells: `gaps` finds these.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array, Float64Array, IndexArray
from blobtree.cells.grid import BRANCHING, CHILDREN, Grid
from blobtree.cells.sparse_cells import SparseCells, build_cells
from blobtree.cells.surface_box import longest_side, surface_box
from blobtree.declare.skeleton import BALL_CELLS
from blobtree.device import launch
from blobtree.errors import InvalidResolution
from blobtree.meshing.adaptive_cell_kernels import write_polygons
from blobtree.meshing.adaptive_cells import OCTANT_OF_CELL, AdaptiveCells
from blobtree.meshing.adaptive_kernels import place_on_surface
from blobtree.meshing.adaptive_mesh import NO_PLACES, AdaptiveMesher, OpenMesh
from blobtree.meshing.block_tree import BlockTree
from blobtree.meshing.crumbs import without_specks
from blobtree.meshing.dual_kernels import sample_blocks
from blobtree.meshing.gaps import CrossingEdges, Gaps, connected_blocks
from blobtree.meshing.mesh import Mesh
from blobtree.meshing.part_kernels import measure_parts
from blobtree.meshing.walls import Walls
from blobtree.progress import Progress
from blobtree.tape.bounds import leaf_boxes
from blobtree.tape.grown import GrownModel
from blobtree.tape.model import ImplicitModel, values_at
from blobtree.tape.operands import has_walls, leaves_of
from blobtree.tape.part_sizes import (
    WARP_MARGIN,
    fitting_scale,
    fitting_wall_scale,
    has_warps,
    part_sizes,
    sized_tape,
)
from blobtree.tape.program import (
    PROGRAM_CHILDREN,
    ProgramLeaf,
    ProgramNode,
    Run,
    compile_program,
    postorder,
)

PART_BYTES, BLOCK_BYTES = 2 << 30, 12 << 10
"""Memory that thin parts take at most, and the memory of a block: its samples, its leaves and their mesh."""

MAX_PART_BLOCKS = PART_BYTES // BLOCK_BYTES
"""Most blocks that thin parts take; the mesh has up to five million triangles then."""

SPARE_SHARE = 1 / 16
"""Part of these blocks that small parts take in any case, once larger ones have taken all."""

LEAST_CELL = 3e-5
"""Smallest cells, over the longest side of the surface's box; parts that need smaller ones are left out."""

FINE_CELL, MAX_FINE_CELLS = 5.5e-5, 100_000
"""Cells of walls thinner than a ten-thousandth, over the longest side of the surface's box. A wall that takes
more of them is left out."""

CROSSED_CELLS = 16.0
"""Cells of a block that a plane through its middle crosses."""

SHEET_GROWTH = 16.0
"""Blocks of the next level in each block that a plate crosses; a tube crosses fewer."""

MAX_GAP_BLOCKS = MAX_PART_BLOCKS // 4
"""Most blocks that gaps take."""

GAP_GROWTH = 4.0
"""Growth of the blocks at a gap from level to level, between surfaces that touch nearly in a point."""

MAX_PART_REPAIRS = 80
"""Most rounds in which cells are divided until the mesh is closed: a few, but many beside sharp rims."""

MAX_REPAIR_GROWTH = 1.4
"""Largest growth of the number of blocks in these rounds; a wall that memory does not allow takes more."""

MAX_REPAIRED_LEAVES = 20_000_000
"""Most leaves of all these rounds together: as long as half a minute."""

MAX_SECOND_BLOCKS = 40_000
"""Most blocks of a mesh that did not close, for a second mesh to be tried."""

MAX_MESHES = 4
"""Most meshes that are tried: one of other cells, and two with fewer walls."""

OTHER_CELLS = 0.87
"""Size of the cells of the second mesh over that of the first; rims then lie elsewhere in cells."""

WARPED_BLOCKS = 64.0
"""Blocks along a leaf below a warp in which its thickness is measured."""

LATER_GROWTH = 0.6
"""Growth of a part's blocks in later levels, over that in the last one, which is larger at ends and edges."""

MAX_NAMED_PARTS = 3
"""Parts that a warning names."""

PART_KERNELS = (measure_parts, place_on_surface, write_polygons, sample_blocks)
"""Kernels of every mesh with thin parts, for `load_together`."""

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class ThinPart:
    """A part that is not resolved."""

    size: float
    """Size of the cells that it needs."""
    place: Float64Array
    """A place in it (3,)."""
    of_wall: ProgramLeaf | None = None
    """A leaf beside a wall that no primitive is as thin as."""
    is_gap: bool = False
    """True for a gap between parts, which the mesh bridges."""
    leaf: ProgramLeaf | None = None
    """The leaf that is too thin, where it is known."""


def needed_sizes(
    cells: SparseCells, grid: Grid, level: Any, begin: int, end: int, least: float
) -> Float32Array:
    """Return the sizes of cells that the parts in blocks of one level need, from number `begin` to `end`.

    Parts that need cells smaller than `least` are left out.
    """
    sizes = wp.empty(end - begin, dtype=wp.float32, device=cells.device)
    inputs = [begin, level, wp.vec3i(*grid.base_of(grid.depth)), wp.vec3(*grid.corner), 4 * grid.cell_size]
    inputs += [BALL_CELLS * least]
    kernel = cells.tape.instruction_set.kernel_for(measure_parts)
    launch(kernel, end - begin, inputs, [sizes], cells.device)
    result: Float32Array = sizes.numpy() / np.float32(BALL_CELLS)
    return result


def least_size(cells: SparseCells, least: float) -> float:
    """Return the size of the thinnest part, at least `least`, in the cells; their tape is a `sized_tape`."""
    needed = needed_sizes(cells, cells.grid, cells.leaves.arrays, 0, len(cells.leaves), least)
    return BALL_CELLS * float(needed.min(initial=np.inf))


class PartCells(AdaptiveCells):
    """Adaptive cells that are small where parts are thin."""

    def __init__(self, first: "FirstCells", tolerance: float, least: float) -> None:
        tree, walls = first.blocks, first.walls
        super().__init__(tree, tolerance)
        self._least, self._walls, self._box = least, walls, first.box
        self.unresolved: list[ThinPart] = []
        """Parts for whose cells there is no room."""
        self._in_walls = np.empty(0, bool)
        self._counts: dict[int, int] = {}
        self._dropped: list[int] = []
        tape = tree.cells.tape
        self._varied = any(tape.instruction_set.fields[code].part_size for code in tape.fields)
        """True if a solid says how thin it is in a block: cells as small as memory allows show most of it."""
        self._gaps = Gaps(tree)
        self._in_gap = np.zeros(len(tree.cells.leaves))
        """Edges across gaps in each block of the base, when it was last divided for them."""
        self._given_up = np.zeros(len(tree.cells.leaves), bool)
        """Blocks of the base at gaps for which there is no room."""
        self._gap_blocks = 0
        if walls is not None:
            fine = FINE_CELL / LEAST_CELL * least
            large = walls.leave_out_large(CROSSED_CELLS * MAX_PART_BLOCKS, fine, MAX_FINE_CELLS)
            self.unresolved += [ThinPart(*wall) for wall in large]
        self._divide_thin_parts()

    def _divide_thin_parts(self) -> None:
        """Divide the leaves that are too large for the parts in them."""
        tree, level, growth, first = self.tree, 0, SHEET_GROWTH, 0
        blocks, needed = np.arange(len(tree)), self._needed(0)
        finer: list[tuple[IndexArray, Float32Array, float]] = []
        while True:
            size = tree.grid(level).cell_size
            deep = np.flatnonzero(needed < size)
            deep = deep[self._affordable(blocks[deep], needed[deep], growth)]
            if not len(deep):
                break
            if self._walls is not None:
                self._walls.refine(first, blocks[deep])
            first, level = len(tree), level + 1
            tree.refine((blocks[deep, None] * CHILDREN + np.arange(CHILDREN)).ravel())
            growth = max(1.0, (len(tree) - first) / len(deep))
            blocks, needed = np.arange(first, len(tree)), self._needed(first)
            small = needed < size
            blocks, needed = blocks[small], needed[small]
            finer.append((blocks, needed, 2.0 * tree.grid(level).cell_size))
        for blocks, needed, largest in finer:
            kept = self._in_walls[blocks] | ~np.isin(_size_keys(needed), self._dropped)
            self.replace(blocks[kept], largest > needed[kept])

    def _outside(self, grid: Grid, first: int) -> BoolArray:
        """Return True for blocks without surface: bounds of warps are loose beyond its box."""
        side, (lower, upper) = 4 * grid.cell_size, self._box
        corners = grid.origin + self.tree.coordinates[first:] * side
        return np.asarray(((corners > upper) | (corners + side < lower)).any(axis=1))

    def _needed(self, first: int) -> Float32Array:
        """Return the sizes of cells that the blocks of the finest level need, from number `first` on."""
        tree, count = self.tree, len(self.tree)
        if first == count:
            return np.empty(0, np.float32)
        grid = tree.grid(int(tree.levels[first]))
        needed = needed_sizes(tree.cells, grid, tree.level_arrays(), first, count, self._least)
        needed[self._outside(grid, first)] = np.inf
        of_walls = np.full_like(needed, np.inf) if self._walls is None else self._walls.needed(first)
        self._in_walls = np.append(self._in_walls[:first], of_walls < needed)
        return np.minimum(needed, of_walls)

    def _affordable(self, blocks: IndexArray, needed: Float32Array, growth: float) -> BoolArray:
        """Return True for the blocks to refine, without the parts with most blocks if there are too many."""
        tree = self.tree
        if not len(blocks) or tree.levels[blocks[0]] >= tree.max_level:
            room = 0.0
        else:
            refined = len(tree) - len(tree.cells.leaves)
            room = max(MAX_PART_BLOCKS - refined, SPARE_SHARE * MAX_PART_BLOCKS) / growth
        keys, of_key, counts = np.unique(_size_keys(needed), return_inverse=True, return_counts=True)
        before = np.array([self._counts.get(key, 0) for key in keys.tolist()])
        self._counts = dict(zip(keys.tolist(), counts.tolist(), strict=True))
        parts = self._parts_of(keys)
        part = parts[of_key]
        sizes, earlier = (
            np.bincount(parts, weights=numbers).astype(np.float64) for numbers in (counts, before)
        )
        expected = sizes * self._later_growth(blocks, keys, part, sizes, earlier)
        order = np.argsort(expected, kind="stable")
        fits = np.empty(len(expected), bool)
        fits[order] = np.cumsum(expected[order]) <= room
        for number in np.flatnonzero(~fits):
            dropped = np.flatnonzero(part == number)
            size, middle = float(needed[dropped].min()), self._middle(blocks[dropped])
            of_wall = None if self._walls is None else self._walls.leaf_at(middle, 4.0 * size)
            self.unresolved.append(ThinPart(size, middle, of_wall))
            if not self._varied:
                self._dropped += keys[parts == number].tolist()
        return np.asarray(fits[part], bool)

    def _parts_of(self, keys: IndexArray) -> IndexArray:
        """Return numbers of the parts to which ascending keys of sizes belong.

        Below warps, a part has many sizes next to each other.
        """
        apart = 1 if self.tree.cells.tape.warps else 0
        parts: IndexArray = np.cumsum(np.diff(keys, prepend=keys[:1]) > apart)
        return parts

    def _later_growth(
        self,
        blocks: IndexArray,
        keys: IndexArray,
        part: IndexArray,
        counts: Float64Array,
        before: Float64Array,
    ) -> Float64Array:
        """Return the factors by which the blocks of parts are expected to grow after this level.

        The last level shows how they grow. Walls need cells of many sizes, so nothing is known of theirs.
        """
        growth = np.where(before > 0.0, counts / np.maximum(before, 1.0), 1.0)
        growth[np.unique(part[self._in_walls[blocks]])] = 1.0
        if not len(blocks):
            return growth
        size = self.tree.grid(int(self.tree.levels[blocks[0]])).cell_size
        finest = np.full(len(counts), np.inf)
        np.minimum.at(finest, self._parts_of(keys), keys)
        later = np.ceil(0.5 * np.log2(size) - 0.125 * finest).clip(min=1.0) - 1.0
        factors: Float64Array = np.maximum(LATER_GROWTH * growth, 1.0) ** later
        return factors

    def divide_gaps(self) -> bool:
        """Divide the leaves that bridge gaps, where there is room; return False if there are none."""
        tree, gaps, divided = self.tree, self._gaps, False
        while True:
            self._extend()
            edges = gaps.edges((self.links < 0) & np.repeat(self._reached(), CHILDREN))
            edges = edges.chosen(~self._given_up[gaps.roots(edges.blocks)])
            if len(edges):
                edges = edges.chosen(self._fitting(edges))
            if not len(edges):
                return divided
            cells, before, divided = np.unique(edges.cells), len(tree), True
            blocks, slots = np.divmod(cells[cells >= 0], CHILDREN)
            merged = ~self.divided[blocks, OCTANT_OF_CELL[slots]]
            self.divided[blocks[merged], OCTANT_OF_CELL[slots[merged]]] = True
            self.divide(blocks[~merged], slots[~merged], np.zeros(np.count_nonzero(~merged), bool))
            self._gap_blocks += len(tree) - before

    def _fitting(self, edges: CrossingEdges) -> BoolArray:
        """Return the edges across gaps for which there is room; gaps with the fewest blocks come first."""
        tree, count = self.tree, len(self._given_up)
        roots = self._gaps.roots(edges.blocks)
        used, of_root = np.unique(roots, return_inverse=True)
        gap = connected_blocks(tree.coordinates[used])[of_root]
        numbers, found = np.bincount(gap), np.bincount(roots, minlength=count).astype(np.float64)
        earlier = np.bincount(gap, weights=(self._in_gap[roots] / found[roots]))
        self._in_gap = found
        narrowest, sizes = (np.full(len(numbers), np.inf) for _ in range(2))
        np.minimum.at(narrowest, gap, edges.widths)
        np.minimum.at(sizes, gap, tree.grid(0).cell_size / 4.0 ** tree.levels[edges.blocks])
        growth = np.where(earlier > 0.0, numbers / np.maximum(earlier, 1.0), GAP_GROWTH).clip(1.0)
        later = np.ceil(0.5 * np.log2(sizes / narrowest)).clip(1.0) - 1.0
        expected = np.where(sizes < 4.0 * self._least, np.inf, numbers * growth**later)
        order = np.argsort(expected, kind="stable")
        fits = np.empty(len(numbers), bool)
        fits[order] = np.cumsum(expected[order]) <= MAX_GAP_BLOCKS - self._gap_blocks
        for number in np.flatnonzero(~fits):
            least = np.flatnonzero(gap == number)[edges.widths[gap == number].argmin()]
            self.unresolved.append(ThinPart(float(edges.widths[least]), edges.places[least], is_gap=True))
        self._given_up[roots[~fits[gap]]] = True
        return np.asarray(fits[gap], bool)

    def _middle(self, blocks: IndexArray) -> Float64Array:
        """Return the centre of the middle one of blocks."""
        tree, block = self.tree, blocks[len(blocks) // 2]
        grid = tree.grid(int(tree.levels[block]))
        middle: Float64Array = grid.origin + (tree.coordinates[block] + 0.5) * 4 * grid.cell_size
        return middle


@dataclass(frozen=True)
class FirstCells:
    """The first cells of a tree, before any is divided, and the walls that they show."""

    blocks: BlockTree
    walls: Walls | None
    """None for a tree without operators that leave walls."""
    box: tuple[Float32Array, Float32Array]
    """Lower and upper corner of the box of the surface."""


def first_cells(
    tree: ImplicitModel, grid_of: Callable[[float], Grid], device: str | None, report: Progress
) -> FirstCells:
    """Return the first cells, with the size at which thin parts take the fewest; `grid_of` scales cells."""
    longest = longest_side(surface_box(tree, device))
    scale = fitting_scale(tree, grid_of(1.0).cell_size, longest)
    return _sampled(tree, grid_of(scale), device, report)


def _sampled(tree: ImplicitModel, grid: Grid, device: str | None, report: Progress) -> FirstCells:
    """Return cells of a grid, and the walls that they show."""
    blocks = BlockTree(build_cells(sized_tape(tree), grid, device=device, report=report))
    walls = Walls(tree, blocks, _least_cell(tree)) if has_walls(tree._program) else None
    return FirstCells(blocks, walls, surface_box(tree))


def _least_cell(tree: ImplicitModel) -> float:
    """Return the size of the smallest cells."""
    return LEAST_CELL * longest_side(surface_box(tree))


def mesh_of_parts(
    tree: ImplicitModel,
    grid_of: Callable[[float], Grid],
    device: str | None,
    creases: bool,
    report: Progress,
    first: FirstCells | None = None,
    expendable: Literal["none", "some", "all"] = "all",
) -> tuple[Mesh | None, list[ThinPart]]:
    """Return a mesh of cells that are smaller where parts are thin, and the parts that it does not show.

    There is no mesh if the cells of `grid_of(1.0)` show all parts, or if none closes, not even without
    the walls that are `expendable`: some, at which repairs stopped, or all. Rims of these may be too sharp
    for any cells. `grid_of` returns a grid whose cells are smaller by a factor. `first` are the
    `first_cells` if these are known.
    """
    smallest, size = _least_cell(tree), grid_of(1.0).cell_size
    if first is None:
        first = first_cells(tree, grid_of, device, report)
    blocks, walls = first.blocks, first.walls
    needed = walls.sizes if walls is not None else np.empty(0, np.float32)
    unresolved = _too_thin(tree, blocks.cells, smallest)
    if walls is not None:
        unresolved += [ThinPart(*wall) for wall in walls.too_thin]
    if len(needed):
        first = _sampled(
            tree, grid_of(fitting_wall_scale(needed, size, CROSSED_CELLS * len(blocks))), device, report
        )
    elif least_size(blocks.cells, smallest) >= BALL_CELLS * blocks.cells.grid.cell_size and not len(
        Gaps(blocks).edges()
    ):
        return None, unresolved
    scale = first.blocks.cells.grid.cell_size / size
    stops, left_out = NO_PLACES, list[ThinPart]()
    for attempt in range(MAX_MESHES):
        try:
            mesh, others = _closed_mesh(first, smallest, creases, report)
        except InvalidResolution as error:
            if attempt == 0 and len(first.blocks) <= MAX_SECOND_BLOCKS:
                first = _sampled(tree, grid_of(OTHER_CELLS * scale), device, report)
                continue
            at = error.places if isinstance(error, OpenMesh) and attempt < 2 else NO_PLACES
            if first.walls is None or expendable == "none" or (expendable == "some" and not len(at)):
                break
            first = _sampled(tree, grid_of(scale), device, report)
            assert first.walls is not None
            stops = np.concatenate([stops, at])
            left_out = [ThinPart(*wall) for wall in first.walls.leave_out_near(stops if len(at) else None)]
        else:
            return mesh, others + unresolved + left_out
    return None, unresolved + left_out + _all_parts(first, smallest)


def _closed_mesh(
    first: FirstCells, smallest: float, creases: bool, report: Progress
) -> tuple[Mesh, list[ThinPart]]:
    """Return a closed mesh, and the parts and gaps for whose cells there is no room.

    Raises
    ------
    InvalidResolution
        The mesh does not close.
    """
    parts = PartCells(first, 0.0, smallest)
    parts.divide_gaps()
    mesher = AdaptiveMesher(parts, creases)
    mesh = mesher.mesh(report, MAX_PART_REPAIRS, MAX_REPAIR_GROWTH, MAX_REPAIRED_LEAVES)
    while parts.divide_gaps():  # repairs have made cells so small that they bridge gaps
        mesh = mesher.mesh(report, MAX_PART_REPAIRS, MAX_REPAIR_GROWTH, MAX_REPAIRED_LEAVES)
    return without_specks(mesh.mesh(creases)), parts.unresolved


def _all_parts(first: FirstCells, least: float) -> list[ThinPart]:
    """Return the thinnest places: one of all primitives, and one of the walls of each operand."""
    cells, walls = first.blocks.cells, first.walls
    found = [] if walls is None else [ThinPart(size, place, leaf) for size, place, leaf in walls.thinnest]
    needed = needed_sizes(cells, cells.grid, cells.leaves.arrays, 0, len(cells.leaves), least)
    grid = cells.grid
    thinnest = int(needed.argmin())
    if needed[thinnest] < grid.cell_size:
        found.append(ThinPart(float(needed[thinnest]), _block_middle(cells, thinnest)))
    return found


def _size_keys(needed: Float32Array) -> IndexArray:
    """Return numbers that tell sizes of cells apart, as sizes of different parts."""
    keys: IndexArray = np.round(4.0 * np.log2(needed)).astype(np.int64)
    return keys


def _too_thin(tree: ImplicitModel, cells: SparseCells, smallest: float) -> list[ThinPart]:
    """Return the leaves that need cells below `smallest`, here or there.

    Tips of cones are left out: only their end is missing.
    """
    needed, (lower, upper) = part_sizes(tree)[1] / BALL_CELLS, leaf_boxes(tree._program)
    leaves, middles = _leaves(tree), 0.5 * (lower + upper)
    found = {at: ThinPart(float(needed[at]), middles[at]) for at in np.flatnonzero(needed < smallest)}
    if has_warps(tree):
        tapes = list(leaves_of(tree._program, cells.tape))
        extents = (upper - lower).max(axis=1)
        for at in np.flatnonzero(needed < WARP_MARGIN * smallest):
            divisions = math.ceil(
                math.log(max(4.0 * WARPED_BLOCKS * cells.grid.cell_size / extents[at], 1.0), BRANCHING)
            )
            own = build_cells(tapes[at], cells.grid.divided(divisions), device=cells.device)
            sizes = needed_sizes(own, own.grid, own.leaves.arrays, 0, len(own.leaves), 0.0)
            if sizes.min(initial=np.inf) < smallest:
                least = int(sizes.argmin())
                found[at] = ThinPart(float(sizes[least]), _block_middle(own, least))
    return [replace(part, leaf=leaves[at]) for at, part in sorted(found.items())]


def _block_middle(cells: SparseCells, number: int) -> Float64Array:
    """Return the centre of a block of the finest level."""
    grid, at = cells.grid, cells.leaves.blocks.numpy()[number]
    middle: Float64Array = grid.origin + (at + 0.5) * 4 * grid.cell_size
    return middle


def warn_of_thin_parts(tree: ImplicitModel, unresolved: list[ThinPart]) -> None:
    """Log a warning that names unresolved parts, the thinnest first, and another that names gaps."""
    gaps = [part for part in unresolved if part.is_gap]
    parts = [part for part in unresolved if not part.is_gap]
    if parts:
        _logger.warning(
            "parts are too thin for the cells that memory allows, so their meshes are not complete: %s; make "
            "them thicker, or mesh them alone",
            _wishes(tree, parts),
        )
    if gaps:
        _logger.warning(
            "gaps are too narrow for the cells that memory allows, so the mesh bridges them: %s; make them "
            "wider, or mesh the parts alone",
            _wishes(tree, gaps),
        )


def _wishes(tree: ImplicitModel, unresolved: list[ThinPart]) -> str:
    """Return names of parts with the resolutions that they need, the thinnest first."""
    longest = longest_side(surface_box(tree))
    texts: dict[str, str] = {}
    for part in sorted(unresolved, key=lambda part: part.size):
        at = ", ".join(f"{x:.4g}" for x in part.place)
        wish = f"near ({at}), which needs a resolution of {longest / part.size:,.0f}"
        texts.setdefault(_name_of_part(tree, part), wish)
    named = [f"{name} {wish}" for name, wish in list(texts.items())[:MAX_NAMED_PARTS]]
    more = len(texts) - len(named)
    return ", and ".join(named) + (f", and {more} more" if more else "")


def _name_of_part(tree: ImplicitModel, part: ThinPart) -> str:
    """Return the class and the path of a part: a leaf, or the node whose operator leaves a wall."""
    if part.of_wall is not None:
        beside = part.of_wall
        path, node = _last_on_way(
            tree, lambda child: _has_leaf(child, beside) and has_walls(compile_program(child))
        )
        return f"a wall of the {type(node).__name__} at path {path}"
    if part.leaf is not None:
        return _name_of_leaf(tree, part.leaf)
    leaves = _leaves(tree)
    if part.is_gap:
        fields = [values_at(tape, part.place[None])[0] for tape in leaves_of(tree._program, tree.tape)]
        nearest = np.argsort(fields)[::-1][:2].tolist()
        return "one between " + " and ".join(sorted(_name_of_leaf(tree, leaves[at]) for at in nearest))
    least, most = np.log(part_sizes(tree)) - np.log(BALL_CELLS * part.size)
    misfit = np.round(np.maximum(least, -most).clip(0.0), 1)
    lower, upper = leaf_boxes(tree._program)
    gaps = np.linalg.norm(np.maximum(lower - part.place, part.place - upper).clip(0.0), axis=1)
    return _name_of_leaf(tree, leaves[np.lexsort([gaps, misfit])[0]])


def _leaves(tree: ImplicitModel) -> list[ProgramLeaf]:
    """Return the leaves, in the order of the program."""
    return [placed.primitive for run in tree._program if isinstance(run, Run) for placed in run.primitives]


def _name_of_leaf(tree: ImplicitModel, leaf: ProgramLeaf) -> str:
    """Return the class and the path of a leaf."""
    path, node = _last_on_way(tree, lambda child: _has_leaf(child, leaf))
    return f"the {type(node).__name__} at path {path}"


def _last_on_way(
    tree: ImplicitModel, leads: Callable[[ProgramNode], bool]
) -> tuple[tuple[int, ...], ProgramNode]:
    """Return path and node at the end of the way from the root through children for which `leads` is true."""
    path: tuple[int, ...] = ()
    node: ProgramNode = tree.tree if isinstance(tree, GrownModel) else tree
    while True:
        step = next((at for at, child in enumerate(node.children) if leads(child)), None)
        if step is None:
            return path, node
        path, node = (*path, step), node.children[step]


def _has_leaf(node: ProgramNode, leaf: ProgramLeaf) -> bool:
    """Return True if a leaf is below a node in programs."""
    return any(below is leaf for below in postorder(node, below=PROGRAM_CHILDREN))
