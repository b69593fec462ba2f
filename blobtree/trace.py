"""Sphere tracing with a proven step bound, through sparse cells: no ray passes through the surface unseen.

A ray leaps over blocks that hold no surface; in the others it reads their pruned tapes alone. At each place
the tape gives the value f and a bound L on the slope over a ball of radius r. Within the ball the field can
rise by at most L · distance, so the ray is free for min(r, (ISO − f) / L) (Hart 1996, with the global
Lipschitz constant replaced by one of the ball ahead, after Galin et al. 2020). The ball then takes twice the
length of the last step, so rays speed up through empty space and slow down near the surface.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from .cells import build_cells
from .errors import InvalidPoints
from .evaluate import field_bound, field_gradient
from .grid import BRANCHING, BRANCHING_BITS, CHILDREN, grid_from
from .kernel_options import KERNEL_OPTIONS
from .kernels import ISO
from .launch import launch
from .refine import SURELY_INSIDE
from .tape import Tape
from .validation import point_array
from .vocabulary import Vocabulary

if TYPE_CHECKING:
    from .tree import Node

wp.set_module_options(KERNEL_OPTIONS)

MAX_STEPS = 1024
"""A ray that grazes the surface for longer than this is a miss."""

DEFAULT_TOLERANCE = 1e-5
"""Distance to the surface, relative to the model's size, at which a ray has arrived."""

MISS = -1.0

BLOCKS_ALONG = 64
"""Finest blocks along the longest side of a tree's box."""

MAX_BLOCKS = 4096
"""More than any ray can cross."""

BLOCK_OVERLAP = 0.1
"""How far a ray reaches into the next block before it asks which one that is, in tolerances."""


@wp.func
def first_hit(
    origin: wp.vec3,
    direction: wp.vec3,
    t_min: wp.float32,
    t_max: wp.float32,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> wp.float32:
    """Distance along the unit `direction` to the first point inside within [t_min, t_max], else MISS.

    A ray that starts inside hits at t_min.
    """
    t = t_min
    reach = wp.max(t_max - t_min, 4.0 * tolerance)
    for _step in range(MAX_STEPS):
        if t > t_max:
            return MISS
        bound = field_bound(origin + direction * t, reach, tape, span)
        gap = ISO - bound[0]
        free = reach
        if bound[1] * reach > gap:
            free = gap / bound[1]
            if free <= tolerance:
                return refine_hit(origin, direction, t, tolerance, tape, span)
        t += free
        reach = 2.0 * free
    return MISS


@wp.func
def refine_hit(
    origin: wp.vec3,
    direction: wp.vec3,
    t: wp.float32,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    span: wp.vec2i,
) -> wp.float32:
    """One Newton step along the ray from a point within tolerance of the surface, 2 tolerances at most."""
    f = field_gradient(origin + direction * t, tape, span)
    rise = f[1] * direction[0] + f[2] * direction[1] + f[3] * direction[2]
    gap = ISO - f[0]
    if gap <= 0.0 or rise * tolerance * 2.0 <= gap:
        return t
    return t + gap / rise


@wp.func
def box_interval(origin: wp.vec3, direction: wp.vec3, lower: wp.vec3, upper: wp.vec3) -> wp.vec2:
    """Where a ray is inside a box: (t_enter ≥ 0, t_leave), t_leave < t_enter where it misses."""
    enter = float(0.0)
    leave = float(1e30)
    for axis in range(3):
        if direction[axis] == 0.0:
            if origin[axis] < lower[axis] or origin[axis] > upper[axis]:
                leave = -1.0
        else:
            near = (lower[axis] - origin[axis]) / direction[axis]
            far = (upper[axis] - origin[axis]) / direction[axis]
            enter = wp.max(enter, wp.min(near, far))
            leave = wp.min(leave, wp.max(near, far))
    return wp.vec2(enter, leave)


@wp.func
def find_node(place: wp.vec3i, depth: wp.int32, nodes: wp.array(dtype=wp.int32)) -> wp.vec2i:
    """(what is known of the finest block at `place`, log₂ of the size of the block that it is known of).

    Known is the first texel of a block's tape, or SURELY_OUTSIDE, SURELY_INSIDE.
    """
    node = int(0)
    shift = BRANCHING_BITS * depth
    for _level in range(depth):
        shift -= BRANCHING_BITS
        x = (place[0] >> shift) & (BRANCHING - 1)
        y = (place[1] >> shift) & (BRANCHING - 1)
        z = (place[2] >> shift) & (BRANCHING - 1)
        node = nodes[node * CHILDREN + (x << (2 * BRANCHING_BITS)) + (y << BRANCHING_BITS) + z]
        if node < 0:
            return wp.vec2i(node, shift)
    return wp.vec2i(node, shift)


@wp.func
def trace_ray(
    origin: wp.vec3,
    direction: wp.vec3,
    lower: wp.vec3,
    block_size: wp.float32,
    depth: wp.int32,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    nodes: wp.array(dtype=wp.int32),
) -> wp.vec3:
    """First hit of a ray: (distance or MISS, first texel of the tape that holds there, one past the last)."""
    side = 1 << (BRANCHING_BITS * depth)
    extent = block_size * float(side)
    inside = box_interval(origin, direction, lower, lower + wp.vec3(extent, extent, extent))
    entry = origin + direction * inside[0]  # distances are counted from here: an eye may be far away
    last = inside[1] - inside[0]
    t = float(0.0)
    for _block in range(MAX_BLOCKS):
        if t > last:
            return wp.vec3(MISS, 0.0, 0.0)
        p = (entry + direction * t - lower) / block_size
        place = wp.vec3i(
            wp.clamp(int(wp.floor(p[0])), 0, side - 1),
            wp.clamp(int(wp.floor(p[1])), 0, side - 1),
            wp.clamp(int(wp.floor(p[2])), 0, side - 1),
        )
        known = find_node(place, depth, nodes)
        size = block_size * float(1 << known[1])
        corner = lower + size * wp.vec3(
            float(place[0] >> known[1]), float(place[1] >> known[1]), float(place[2] >> known[1])
        )
        leave = box_interval(entry, direction, corner, corner + wp.vec3(size, size, size))[1]
        leave = wp.max(leave, t) + BLOCK_OVERLAP * tolerance
        if known[0] == SURELY_INSIDE:
            return wp.vec3(inside[0] + t, 1.0, 1.0 + tape[0][0])
        if known[0] >= 0:
            span = wp.vec2i(known[0] + 1, known[0] + 1 + int(tape[known[0]][0]))
            hit = first_hit(entry, direction, t, leave, tolerance, tape, span)
            if hit >= 0.0:
                return wp.vec3(inside[0] + hit, float(span[0]), float(span[1]))
        t = leave
    return wp.vec3(MISS, 0.0, 0.0)


@wp.kernel
def _trace(
    first: wp.int32,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    lower: wp.vec3,
    block_size: wp.float32,
    depth: wp.int32,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    nodes: wp.array(dtype=wp.int32),
    out: wp.array(dtype=wp.float32),
) -> None:
    i = first + wp.tid()
    direction = wp.normalize(directions[i])
    t = trace_ray(origins[i], direction, lower, block_size, depth, tolerance, tape, nodes)[0]
    if t < 0.0:
        t = wp.inf
    out[i] = t


Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]


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


def tracing_cells(tree: "Node") -> TracingCells:
    """The cells that rays through `tree` walk, BLOCKS_ALONG finest blocks along its longest side."""
    lower, upper = (tuple(corner.tolist()) for corner in tree.bounds)
    return _tracing_cells(tree.tape, lower, upper)


@lru_cache(maxsize=16)
def _tracing_cells(tape: Tape, lower: tuple[float, ...], upper: tuple[float, ...]) -> TracingCells:
    bounds = np.array(lower, np.float32), np.array(upper, np.float32)
    cell_size = float((bounds[1] - bounds[0]).max()) / (BLOCKS_ALONG * BRANCHING) * (1.0 + 1e-6)
    cells = build_cells(tape, grid_from(*bounds, cell_size), device="cpu")
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


def trace_tolerance(bounds: Bounds) -> float:
    """Distance to the surface at which a ray has arrived, for a tree of these bounds."""
    return DEFAULT_TOLERANCE * float(np.linalg.norm(bounds[1] - bounds[0]))


def trace(tree: "Node", origins: ArrayLike, directions: ArrayLike) -> NDArray[np.float32]:
    """Distances (n,) from `origins` (n, 3) along `directions` (n, 3) to the surface, inf where a ray misses.

    Raises
    ------
    InvalidPoints
        Origins and directions differ in number, or a direction has no length.
    """
    starts, headings = point_array(origins), point_array(directions)
    if starts.shape != headings.shape:
        raise InvalidPoints(f"directions: expected one per origin, {len(starts)}, got {len(headings)}")
    if not (np.abs(headings).max(axis=1, initial=0.0) > 0.0).all():
        raise InvalidPoints("directions: expected vectors with a length, got a zero vector")
    cells = tracing_cells(tree)
    out: wp.array[Any] = wp.empty(len(starts), dtype=wp.float32, device="cpu")
    launch(
        cells.vocabulary.kernel(_trace),
        len(starts),
        [
            *(wp.array(array, dtype=wp.vec3, device="cpu") for array in (starts, headings)),
            wp.vec3(*cells.lower.tolist()),
            cells.block_size,
            cells.depth,
            cells.tolerance,
            wp.array(cells.tape, dtype=wp.vec4, device="cpu"),
            wp.array(cells.nodes, dtype=wp.int32, device="cpu"),
        ],
        [out],
        "cpu",
    )
    distances: NDArray[np.float32] = out.numpy()
    return distances
