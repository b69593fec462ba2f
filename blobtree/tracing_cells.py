"""What rays read of a tree: its sparse cells as a table of blocks and their pruned tapes."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from .cells import build_cells
from .grid import BRANCHING, grid_from
from .tape import Tape
from .vocabulary import Vocabulary

if TYPE_CHECKING:
    from .tree import Node

DEFAULT_TOLERANCE = 1e-5
"""Distance to the surface, relative to the model's size, at which a ray has arrived."""

BLOCKS_ALONG = 64
"""Finest blocks along the longest side of a tree's box."""

Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]
Corner = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class TracingCells:
    """What a ray reads of a tree's sparse cells.

    Attributes
    ----------
    tape
        float32[m, 4]: the whole tape and the blocks' pruned ones, each behind a texel with its length.
    nodes
        int32[64 n]: for every child of every inner block, from the root on, the place of its own children
        (in blocks) or, at the finest level, of its tape; SURELY_OUTSIDE or SURELY_INSIDE where it has none.
    lower, block_size, depth
        The grid: lowest corner (3,), side of the finest blocks, levels below the root.
    tolerance
        Distance to the surface at which a ray has arrived.
    vocabulary
        What the codes on the tape stand for.
    """

    tape: NDArray[np.float32]
    nodes: NDArray[np.int32]
    lower: NDArray[np.float32]
    block_size: float
    depth: int
    tolerance: float
    vocabulary: Vocabulary


@dataclass(frozen=True, eq=False)
class DeviceCells:
    """`TracingCells` in the memory of a Warp device, as the parameters of `rays.trace_ray`."""

    lower: wp.vec3
    block_size: float
    depth: int
    tolerance: float
    tape: "wp.array[wp.vec4]"
    nodes: "wp.array[wp.int32]"
    vocabulary: Vocabulary

    @property
    def arguments(self) -> tuple[object, ...]:
        """What `rays.trace_ray` takes behind the ray."""
        return self.lower, self.block_size, self.depth, self.tolerance, self.tape, self.nodes


def tracing_cells(tree: "Node", *, device: str | None = None) -> TracingCells:
    """The cells that rays through `tree` walk, BLOCKS_ALONG finest blocks along its longest side.

    `device` is the Warp device that makes them, by default the current one.
    """
    return _tracing_cells(tree.tape, *_corners(tree), str(wp.get_device(device)))


def device_cells(tree: "Node", *, device: str | None = None) -> DeviceCells:
    """The same in a device's memory."""
    return _device_cells(tree.tape, *_corners(tree), str(wp.get_device(device)))


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
    tables = [level.children.numpy().copy() for level in cells.levels[1:]]
    first_child = 0
    for level, table in zip(cells.levels[:-1], tables, strict=True):
        first_child += len(level)
        table[table >= 0] += first_child
    first_texel = 1 + len(tape.data)
    leaf_texels = cells.leaves.spans.numpy()[:, 0] - 1 + first_texel
    tables[-1][tables[-1] >= 0] = leaf_texels
    return TracingCells(
        tape=np.concatenate([whole, tape.data, cells.leaves.tape.numpy()]),
        nodes=np.concatenate(tables),
        lower=cells.grid.origin.astype(np.float32),
        block_size=cell_size * BRANCHING,
        depth=len(tables),
        tolerance=trace_tolerance(bounds),
        vocabulary=tape.vocabulary,
    )


@lru_cache(maxsize=16)
def _device_cells(tape: Tape, lower: Corner, upper: Corner, device: str) -> DeviceCells:
    cells = _tracing_cells(tape, lower, upper, device)
    return DeviceCells(
        wp.vec3(*cells.lower.tolist()),
        cells.block_size,
        cells.depth,
        cells.tolerance,
        wp.array(cells.tape, dtype=wp.vec4, device=device),
        wp.array(cells.nodes, dtype=wp.int32, device=device),
        cells.vocabulary,
    )
