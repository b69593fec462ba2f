"""What rays read of a tree: a table of blocks, and the pruned tapes of those where the surface may be."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.formulas.vocabulary import Vocabulary
from blobtree.launch import known_device
from blobtree.sparse.cells import SparseCells, build_cells
from blobtree.sparse.grid import BRANCHING, grid_from
from blobtree.sparse.refine import SURELY_OUTSIDE
from blobtree.tapes.tape import Tape
from blobtree.tracing.rays import EMPTY

if TYPE_CHECKING:
    from blobtree.nodes.tree import Node

DEFAULT_TOLERANCE = 1e-5
"""Distance to the surface, relative to the model's size, at which a ray has arrived."""

BLOCKS_ALONG = 64
"""Finest blocks along the longest side of a tree's box."""

MOST_LAYERS = 16
"""Rays leap this many blocks at most."""

Ints = NDArray[np.int32]
Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]
Corner = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class TracingCells:
    """What a ray reads of a tree's sparse cells.

    Attributes
    ----------
    tape
        float32[m, 4]: the whole tape and the blocks' pruned ones, each behind a texel with its length.
    blocks
        int32[nx ny nz], the last axis fastest: the place of each block's tape, SURELY_INSIDE, or how far
        around it all is empty (`rays.EMPTY`).
    lower, block_size, counts
        The grid: lowest corner (3,), side of the blocks, how many lie along each axis.
    tolerance
        Distance to the surface at which a ray has arrived.
    vocabulary
        What the codes on the tape stand for.
    """

    tape: NDArray[np.float32]
    blocks: NDArray[np.int32]
    lower: NDArray[np.float32]
    block_size: float
    counts: tuple[int, int, int]
    tolerance: float
    vocabulary: Vocabulary


@dataclass(frozen=True, eq=False)
class DeviceCells:
    """`TracingCells` in the memory of a Warp device, as the parameters of `rays.trace_ray`."""

    lower: wp.vec3
    block_size: float
    counts: wp.vec3i
    tolerance: float
    tape: "wp.array[wp.vec4]"
    blocks: "wp.array[wp.int32]"
    vocabulary: Vocabulary

    @property
    def arguments(self) -> tuple[object, ...]:
        """What `rays.trace_ray` takes behind the ray."""
        return self.lower, self.block_size, self.counts, self.tolerance, self.tape, self.blocks


def tracing_cells(tree: "Node", *, device: str | None = None) -> TracingCells:
    """The cells that rays through `tree` walk, BLOCKS_ALONG finest blocks along its longest side.

    `device` is the Warp device that makes them, by default the current one.
    """
    return _tracing_cells(tree.tape, *_corners(tree), known_device(device))


def device_cells(tree: "Node", *, device: str | None = None) -> DeviceCells:
    """The same in a device's memory."""
    return _device_cells(tree.tape, *_corners(tree), known_device(device))


def trace_tolerance(bounds: Bounds) -> float:
    """Distance to the surface at which a ray has arrived, for a tree of these bounds."""
    return DEFAULT_TOLERANCE * float(np.linalg.norm(bounds[1] - bounds[0]))


def _corners(tree: "Node") -> tuple[Corner, Corner]:
    lower, upper = tree.bounds
    return tuple(lower.tolist()), tuple(upper.tolist())


@lru_cache(maxsize=16)
def _tracing_cells(tape: Tape, lower: Corner, upper: Corner, device: str) -> TracingCells:
    bounds = np.array(lower, np.float32), np.array(upper, np.float32)
    cell_size = float((bounds[1] - bounds[0]).max()) / (BLOCKS_ALONG * BRANCHING) * (1.0 + 1e-6)
    cells = build_cells(tape, grid_from(*bounds, cell_size), device=device)
    whole = np.array([[len(tape.data), 0.0, 0.0, 0.0]], np.float32)
    first_texels = cells.leaves.spans.numpy()[:, 0] + len(tape.data)
    block_size = cell_size * BRANCHING
    blocks = _table(cells, first_texels, np.ceil((bounds[1] - bounds[0]) / block_size).astype(int))
    return TracingCells(
        tape=np.concatenate([whole, tape.data, cells.leaves.tape.numpy()]),
        blocks=blocks.ravel(),
        lower=cells.grid.origin.astype(np.float32),
        block_size=block_size,
        counts=blocks.shape,
        tolerance=trace_tolerance(bounds),
        vocabulary=tape.vocabulary,
    )


def _table(cells: SparseCells, first_texels: Ints, counts: NDArray[np.intp]) -> Ints:
    """What rays are told of each of the finest blocks (nx, ny, nz): `TracingCells.blocks`."""
    known = np.zeros((1, 1, 1), np.int32)
    for level in cells.levels[1:]:
        known = _refined(known, level.children.numpy())
    x, y, z = np.maximum(counts, 1)
    known = known[:x, :y, :z]
    blocks = np.where(known >= 0, np.append(first_texels, 0)[known], known)
    empty = known == SURELY_OUTSIDE
    return np.where(empty, EMPTY - _layers(empty), blocks).astype(np.int32)


def _refined(known: Ints, children: Ints) -> Ints:
    """What is known of blocks (n, n, n), their places or why they have none, for all their children."""
    side = len(known)
    families = children.reshape(-1, BRANCHING, BRANCHING, BRANCHING)
    below = known.repeat(BRANCHING, 0).repeat(BRANCHING, 1).repeat(BRANCHING, 2)
    of_parents = below.reshape(side, BRANCHING, side, BRANCHING, side, BRANCHING).transpose(0, 2, 4, 1, 3, 5)
    of_parents[known >= 0] = families[known[known >= 0]]
    return below


def _layers(empty: NDArray[np.bool_]) -> Ints:
    """How many layers of blocks around each one (nx, ny, nz) are empty with it, MOST_LAYERS at most.

    The blocks of a column are bits of one word, 64 at most; beyond the grid nothing lies in the way.
    """
    columns = np.ones((*empty.shape[:2], BLOCKS_ALONG), np.bool_)
    columns[..., : empty.shape[2]] = empty
    words = np.packbits(columns, axis=2, bitorder="little").view("<u8")[..., 0]
    lowest, highest = np.uint64(1), np.uint64(1 << 63)
    layers = np.zeros(empty.shape, np.uint8)
    for _ in range(MOST_LAYERS):
        words = words & ((words << lowest) | lowest) & ((words >> lowest) | highest)
        for axis in (0, 1):
            along = np.moveaxis(words, axis, 0)
            eroded = along.copy()
            eroded[1:] &= along[:-1]
            eroded[:-1] &= along[1:]
            words = np.moveaxis(eroded, 0, axis)
        if not words.any():
            break
        bits = np.ascontiguousarray(words)[..., None].view(np.uint8)
        layers += np.unpackbits(bits, axis=2, bitorder="little")[..., : empty.shape[2]]
    return layers.astype(np.int32)


@lru_cache(maxsize=16)
def _device_cells(tape: Tape, lower: Corner, upper: Corner, device: str) -> DeviceCells:
    cells = _tracing_cells(tape, lower, upper, device)
    return DeviceCells(
        wp.vec3(*cells.lower.tolist()),
        cells.block_size,
        wp.vec3i(*cells.counts),
        cells.tolerance,
        wp.array(cells.tape, dtype=wp.vec4, device=device),
        wp.array(cells.blocks, dtype=wp.int32, device=device),
        cells.vocabulary,
    )
