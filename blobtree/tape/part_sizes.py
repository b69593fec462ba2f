"""Sizes of parts: how thin the primitives of a tree are.

The size of a primitive is half its least thickness: the radius of a ball, a tube or a plate, and for a box
half its shortest side too. Maps shrink it. Warps do so by an amount that depends on the place; the kernels of
`meshing.part_kernels` know it.
"""

from dataclasses import replace

import numpy as np

from blobtree._typing import Float32Array, Float64Array
from blobtree.declare.skeleton import BALL_CELLS, PLATE_CELLS, TUBE_CELLS, Skeleton
from blobtree.formulas.falloff import RIM
from blobtree.tape.bounds import leaf_boxes
from blobtree.tape.model import ImplicitModel
from blobtree.tape.operands import operands_of
from blobtree.tape.program import (
    EnterWarp,
    PlacedPrimitive,
    ProgramField,
    ProgramLeaf,
    Run,
    distinct_placements,
    influence_radii,
)
from blobtree.tape.tape import Tape

WARP_MARGIN = 8.0
"""How much thinner warps make a part, up to which blocks of cells are looked at."""


CELL_SCALES = (1.0, 2.0**-0.25, 2.0**-0.5, 2.0**-0.75)
"""Sizes of cells to choose from, over the first one: each division halves them."""

_DIMENSIONS = {TUBE_CELLS: 1.0, PLATE_CELLS: 2.0}
"""By `Skeleton.cells`, the power of its length with which the area of a thin primitive grows."""


def part_sizes(tree: ImplicitModel) -> tuple[Float64Array, Float64Array]:
    """Return the least and the largest radius (n,) of each leaf, as `size` of the kernel, without warps."""
    runs = [step for step in tree._program if isinstance(step, Run)]
    both = [_sizes_of_run(run) for run in runs]
    return np.concatenate([least for least, _ in both]), np.concatenate([most for _, most in both])


def _sizes_of_run(run: Run) -> tuple[Float64Array, Float64Array]:
    """Return the least and the largest sizes of the primitives of one run, in the space around their maps."""
    placements, placed_by = distinct_placements(run.primitives)
    linear = np.array([placement.matrix[:3, :3] for placement in placements])
    scales = np.linalg.svd(linear, compute_uv=False)[placed_by, -1]
    breadths = _breadths(run)
    if not isinstance(run.kind, Skeleton):
        return breadths * scales, breadths * scales
    radii = RIM * influence_radii(run.primitives)
    return (breadths + radii.min(axis=1)) * scales, (breadths + radii.max(axis=1)) * scales


def _breadths(run: Run) -> Float64Array:
    """Return what to add to the radii of primitives for the size that cells must resolve, in their own space.

    Solids are thicker than their radii. Tubes and plates take fewer cells than balls, which counts as if they
    were thicker.
    """
    leaves = [placed.primitive for placed in run.primitives]
    breadths = leaves[0].inradii(leaves)
    if not isinstance(run.kind, Skeleton):
        for number, placed in enumerate(run.primitives):
            if placed.placement.uniform_scale is None and bounded_by_slabs(placed.primitive):
                breadths[number] = _stretched_breadth(placed)
        return breadths
    if run.kind.cells == BALL_CELLS:
        return breadths
    breadths += (BALL_CELLS / run.kind.cells - 1.0) * RIM * influence_radii(run.primitives).min(axis=1)
    return breadths


def bounded_by_slabs(leaf: ProgramLeaf) -> bool:
    """Return True for a block between three pairs of flat faces, at right angles in its own space."""
    return isinstance(leaf, ProgramField) and len(leaf.slabs) == 3


def _stretched_breadth(placed: PlacedPrimitive) -> float:
    """Return half the least distance of a block's faces around its map, over the least scale of the map."""
    leaf, placement = placed
    assert isinstance(leaf, ProgramField)
    least = np.linalg.svd(placement.matrix[:3, :3], compute_uv=False)[-1]
    return float(min(slab.placed(placement).half for slab in leaf.slabs) / least)


def has_small_parts(tree: ImplicitModel, size: float) -> bool:
    """Return True if a leaf may be thinner than `size`, whatever warps do to it."""
    least, _ = part_sizes(tree)
    return bool(least.min() < size * (WARP_MARGIN if has_warps(tree) else 1.0))


def has_small_bodies(tree: ImplicitModel, size: float) -> bool:
    """Do the same for leaves that are not removed from others: small tools leave no thin parts."""
    operands = operands_of(tree._program, tree.tape)
    tools = [number for operand in operands if operand.tool for number in operand.numbers]
    least = np.delete(part_sizes(tree)[0], tools).min(initial=np.inf)
    return bool(least < size * (WARP_MARGIN if has_warps(tree) else 1.0))


def has_warps(tree: ImplicitModel) -> bool:
    """Return True if a warp changes sizes of leaves."""
    return any(isinstance(step, EnterWarp) for step in tree._program)


def fitting_scale(tree: ImplicitModel, size: float, longest: float) -> float:
    """Return the factor of `size`, one of CELL_SCALES, with which thin parts take the fewest cells.

    `longest` is the longest side of the box of the tree's surface.
    Cells are halved until they are small enough. So a part may take four times the triangles that it needs.
    """
    sizes = part_sizes(tree)[0] / BALL_CELLS
    lower, upper = leaf_boxes(tree._program)
    lengths = np.linalg.norm(upper - lower, axis=1) / sizes
    runs = [step for step in tree._program if isinstance(step, Run)]
    powers = np.repeat(
        [_DIMENSIONS.get(getattr(run.kind, "cells", 0.0), 0.0) for run in runs],
        [len(run.primitives) for run in runs],
    )
    whole = (longest / size) ** 2
    return _cheapest_scale(size, sizes, lengths**powers, whole)


def fitting_wall_scale(walls: Float32Array, size: float, crossed: float) -> float:
    """Return the factor of `size` with which walls take the fewest cells; `walls` are sizes they need.

    The surface crosses `crossed` cells of the size.
    """
    needed = walls.astype(np.float64)
    return _cheapest_scale(size, needed, (size / needed) ** 2.0, max(crossed - len(needed), 0.0))


def _cheapest_scale(size: float, needed: Float64Array, cells: Float64Array, whole: float) -> float:
    """Return the scale of `size` with the fewest cells, for parts that take `cells` of the size needed."""
    costs = []
    for scale in CELL_SCALES:
        halvings = np.ceil(np.log2(np.maximum(scale * size / needed, 1.0)))
        fineness = needed / (scale * size) * 2.0**halvings
        costs.append(whole / scale**2 + (cells * fineness**2)[halvings > 0].sum())
    return CELL_SCALES[int(np.argmin(costs))]


def sized_tape(tree: ImplicitModel) -> Tape:
    """Return the tree's tape with the breadths of its leaves behind their colours, for `part_kernels`."""
    tape, program = tree.tape, tree._program
    data = tape.data.copy()
    ends = [*tape.headers[1:].tolist(), len(data)]
    for step, header, end in zip(program, tape.headers.tolist(), ends, strict=True):
        if isinstance(step, Run):
            count = len(step.primitives)
            stride = (end - header - 1) // count
            data[header + stride * np.arange(1, count + 1), 3] = _breadths(step) * _folded_scales(step)
    return replace(tape, data=data)


def _folded_scales(run: Run) -> Float64Array:
    """Return the factors (n,) of the maps that fold into the parameters of a run's primitives."""
    placements, placed_by = distinct_placements(run.primitives)
    folds = isinstance(run.kind, Skeleton) and not run.stretched
    scales = [placement.uniform_scale or 1.0 if folds else 1.0 for placement in placements]
    return np.array(scales)[placed_by]
