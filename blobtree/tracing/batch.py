"""`raycast_batch`: rays through many trees, in few launches where a loop would starve a device."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any, overload

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Int64Array
from blobtree.cells.grid import BRANCHING
from blobtree.cells.joint_cells import build_joint_cells
from blobtree.cells.sparse_cells import MAX_TEXELS, SparseCells
from blobtree.cells.surface_box import surface_box
from blobtree.device import known_device, launch
from blobtree.errors import InvalidPoints, InvalidResolution
from blobtree.joint_work import checked_trees, is_small, work_together
from blobtree.struct_rows import struct_rows
from blobtree.tape.model import ImplicitModel
from blobtree.tracing.batch_kernels import trace_rays_of_models
from blobtree.tracing.ray_kernels import RayCells
from blobtree.tracing.shade_kernels import shade_hits
from blobtree.tracing.tables import device_tables, numpy_tables
from blobtree.tracing.trace import Hits, checked_rays, load_ray_kernels, raycast, shaded
from blobtree.tracing.tree_cells import (
    BLOCKS_ALONG,
    block_counts,
    blocks_of,
    cells_grid,
    trace_tolerance,
)
from blobtree.validation import axis_count, describe, items

MAX_JOINT_MODELS = 64
"""Most models whose cells are built at once; the cells of a model take about 5 MB."""

MAX_JOINT_RAYS = 1 << 22
"""Most rays that are traced at once."""


@dataclass(frozen=True, eq=False)
class BatchHits(Sequence[Hits]):
    """The first hits of rays through many trees, as `raycast_batch` returns them.

    ``batch[i]`` are the `Hits` of tree i, as `Node.raycast` returns them for this tree alone. The arrays hold
    the rays of all trees, one tree after the other. Where all trees have the same m rays,
    ``batch.distances.reshape(len(batch), m)`` has a row for each tree.

    Attributes
    ----------
    offsets : int64[k + 1]
        Rays ``offsets[i]:offsets[i + 1]`` are those of tree i.
    distances, positions, normals, colors
        See `Hits`.

    Examples
    --------
    >>> from blobtree import Point, raycast_batch
    >>> balls = [Point((0, 0, 0), radius=radius) for radius in (1, 2)]
    >>> batch = raycast_batch(balls, [[0, 0, 5], [1.5, 0, 5]], [[0, 0, -1], [0, 0, -1]])
    >>> batch.hit.reshape(2, 2).tolist(), batch[1].distances.round(2)
    ([[True, False], [True, True]], array([3.  , 3.68], dtype=float32))
    """

    offsets: Int64Array
    distances: Float32Array
    positions: Float32Array
    normals: Float32Array
    colors: Float32Array

    @property
    def hit(self) -> BoolArray:
        """True for each ray that meets the surface (n,)."""
        return np.isfinite(self.distances)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @overload
    def __getitem__(self, number: int) -> Hits: ...

    @overload
    def __getitem__(self, number: slice) -> list[Hits]: ...

    def __getitem__(self, number: int | slice) -> Hits | list[Hits]:
        """Return the hits on one tree, or on several; they share the memory of the batch."""
        numbers = range(len(self))[number]
        if isinstance(numbers, range):
            return [self[each] for each in numbers]
        rays = slice(*self.offsets[numbers : numbers + 2].tolist())
        return Hits(*(getattr(self, field.name)[rays] for field in fields(Hits)))


def raycast_batch(
    trees: Iterable[ImplicitModel],
    origins: ArrayLike | Sequence[ArrayLike],
    directions: ArrayLike | Sequence[ArrayLike],
    *,
    device: str | None = None,
) -> BatchHits:
    """Return the first intersections of rays with many trees, as `Node.raycast` does for each alone.

    Trees of the same kinds of nodes are traced together, in few launches. On a graphics card that is much
    faster than a loop over small trees. On a processor the results equal those of a loop bit for bit. Trees
    of very many primitives, and flat and long ones of many, are traced alone.

    Parameters
    ----------
    trees : iterable of Node
        k models, in any order.
    origins : float[m, 3] or (3,), or k arrays float[mᵢ, 3]
        Starts of the rays of all trees, or of each tree.
    directions : float[m, 3] or (3,), or k arrays float[mᵢ, 3]
        Directions of any length above 0.
    device : str, optional
        Warp device that does the work; the current one by default.

    Returns
    -------
    BatchHits
        A sequence of the `Hits` of each tree.

    Raises
    ------
    InvalidNode
        An item of `trees` is not a model.
    InvalidPoints
        Origins and directions differ in number, or are not one array for each tree; or a direction has no
        length.
    InvalidDevice
        Warp has no such device.

    See Also
    --------
    Node.raycast : one tree.
    polygonize_batch : the meshes of many trees.

    Examples
    --------
    >>> from blobtree import Point, raycast_batch
    >>> blends = [Point((0, 0, 0), radius=1) + Point((x, 0, 0), radius=1) for x in (0.5, 1.0, 1.5)]
    >>> raycast_batch(blends, [5, 0, 0], [-1, 0, 0]).distances.round(2)
    array([3.38, 2.99, 2.5 ], dtype=float32)
    """
    models = checked_trees(trees)
    device = known_device(device)
    rays = _rays_of_each(origins, directions, len(models))
    counts = [len(starts) for starts, _ in rays]

    def kind(tree: ImplicitModel) -> Hashable | None:
        if not is_small(tree) or blocks_of(tree, *surface_box(tree, device)) > BLOCKS_ALONG:
            return None
        return id(tree.tape.instruction_set), cells_grid(*surface_box(tree, device)).depth

    def joint(numbers: list[int]) -> list[Hits]:
        return _joint_hits([models[n] for n in numbers], [rays[n] for n in numbers], device)

    def single(number: int) -> Hits:
        return raycast(models[number], *rays[number], device=device)

    sizes = [max(1.0 / MAX_JOINT_MODELS, count / MAX_JOINT_RAYS) for count in counts]
    hits = work_together(list(map(kind, models)), sizes, 1.0, joint, single)
    empty = Hits(np.zeros(0, np.float32), *(np.zeros((0, 3), np.float32) for _ in range(3)))
    arrays = (
        np.concatenate([getattr(part, field.name) for part in (empty, *hits)]) for field in fields(Hits)
    )
    return BatchHits(np.cumsum([0, *counts], dtype=np.int64), *arrays)


def _rays_of_each(origins: Any, directions: Any, count: int) -> list[tuple[Float32Array, Float32Array]]:
    """Return checked rays of each model; one array is for all models."""
    each = [axis_count(values) > 2 or _is_ragged(values) for values in (origins, directions)]
    if not any(each):
        return [checked_rays(origins, directions)] * count
    given = {"origins": (origins, each[0]), "directions": (directions, each[1])}
    listed = [_each_of(name, *values, count) for name, values in given.items()]
    rays = []
    for number, pair in enumerate(zip(*listed, strict=True)):
        try:
            rays.append(checked_rays(*pair))
        except InvalidPoints as error:
            raise InvalidPoints(f"rays of trees[{number}]: {error}") from None
    return rays


def _is_ragged(values: Any) -> bool:
    """Return True for a list of arrays of rays, the first of which may be empty."""
    return isinstance(values, list | tuple) and bool(values) and axis_count(values[0]) > 1


def _each_of(name: str, values: Any, is_each: bool, count: int) -> Sequence[Any]:
    if not is_each:
        return [values] * count
    listed = items(values)
    if listed is None or len(listed) != count:
        got = describe(values) if listed is None else f"{len(listed)}"
        raise InvalidPoints(
            f"{name}: expected one array for each of {count} trees, or one array (m, 3) for all, got {got}"
        )
    return listed


def _joint_hits(
    models: Sequence[ImplicitModel], rays: Sequence[tuple[Float32Array, Float32Array]], device: str
) -> list[Hits]:
    """Return the hits of models with one instruction set, in grids of one depth."""
    load_ray_kernels(models[0], device, trace_rays_of_models, shade_hits)
    counts = [len(starts) for starts, _ in rays]
    numbers = np.repeat(np.arange(len(models), dtype=np.int32), counts)
    arrays: list[Any] = [
        wp.array(np.concatenate(part), dtype=wp.vec3, device=device) for part in zip(*rays, strict=True)
    ]
    table = _ray_tables(models, device)
    distances: Any = wp.empty(len(numbers), dtype=wp.float32, device=device)
    spans: Any = wp.empty(len(numbers), dtype=wp.vec2i, device=device)
    instruction_set = models[0].tape.instruction_set
    inputs = [*arrays, wp.array(numbers, dtype=wp.int32, device=device), table]
    kernel = instruction_set.kernel_for(trace_rays_of_models)
    launch(kernel, len(numbers), inputs, [distances, spans], device)
    found = shaded(instruction_set, table.kept[0].tape, arrays, distances, spans)
    ends = np.cumsum(counts)[:-1]
    return [Hits(*part) for part in zip(*(np.split(array, ends) for array in found), strict=True)]


def _ray_tables(models: Sequence[ImplicitModel], device: str) -> Any:
    """Return an array of `RayCells`, one for each model, see `tree_cells.TracingCells`."""
    boxes = [surface_box(model, device) for model in models]
    grids = [cells_grid(*box) for box in boxes]
    cells = build_joint_cells(models, grids, device)
    example: Any = RayCells()
    example.tape, starts = _joined_tapes(cells, [len(model.tape.data) - model.tape.start for model in models])
    shift = len(example.tape) - len(cells.leaves.tape)
    size = [grid.cell_size * BRANCHING for grid in grids]
    counts = np.array([block_counts(*box, one) for box, one in zip(boxes, size, strict=True)])
    tables_on = numpy_tables if wp.get_device(device).is_cpu else device_tables
    blocks, ends = tables_on(cells, counts, shift)
    return struct_rows(
        RayCells,
        example,
        len(models),
        device,
        parts={"blocks": (blocks, ends)},
        values={
            "lower": [grid.origin for grid in grids],
            "block_size": size,
            "counts": counts,
            "tolerance": [trace_tolerance(box) for box in boxes],
            "start": starts,
        },
    )


def _joined_tapes(cells: SparseCells, lengths: Sequence[int]) -> tuple[Any, Int64Array]:
    """Return all whole tapes, each behind a texel with its length, then those of blocks; and their starts.

    Raises
    ------
    InvalidResolution
        There are more texels than float32 counts.
    """
    whole, blocks, start = cells.levels[0].tape.numpy(), cells.leaves.tape, cells.tape.start
    ends = start + np.cumsum([0, *lengths])
    headers = np.zeros((len(lengths), 4), np.float32)
    headers[:, 0] = lengths
    texels = np.insert(whole, ends[:-1], headers, axis=0)
    size = len(texels) + len(blocks) - start
    if size > MAX_TEXELS:
        raise InvalidResolution(f"expected tapes of at most {MAX_TEXELS:,} texels, got {size:,}")
    joined: Any = wp.empty(size, dtype=wp.vec4, device=cells.device)
    wp.copy(joined, wp.array(texels, dtype=wp.vec4, device=cells.device))
    wp.copy(joined, blocks, dest_offset=len(texels), src_offset=start, count=len(blocks) - start)
    return joined, ends[:-1] + np.arange(len(lengths))
