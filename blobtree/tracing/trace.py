"""Rays and a model: the distance of the first hit, and position, normal and colour there."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array
from blobtree.cells.sparse_cells import CELL_KERNELS
from blobtree.cells.surface_box import Corners
from blobtree.device import known_device, launch
from blobtree.errors import InvalidPoints
from blobtree.kernels import load_together
from blobtree.tape.bounds import is_endless
from blobtree.tape.instruction_set import InstructionSet
from blobtree.tape.model import ImplicitModel
from blobtree.tracing.ray_kernels import trace_rays
from blobtree.tracing.shade_kernels import shade_hits
from blobtree.tracing.tree_cells import DeviceCells, device_cells
from blobtree.validation import points_or_point, positive_number

BOX_MARGIN = 1e-3
"""Margin of the box around rays that end, over their length and their distance from the origin."""


@dataclass(frozen=True, eq=False)
class Hits:
    """The first hits of rays, as `Node.raycast` returns them.

    Attributes
    ----------
    distances
        float32[n] along the rays, in the model's units, inf for a miss.
    positions
        float32[n, 3]: points on the surface; 0 for a miss.
    normals
        float32[n, 3]: outward unit normals at the hits; 0 for a miss.
    colors
        float32[n, 3]: blended colours at the hits, from 0 to 1; 0 for a miss.

    Examples
    --------
    >>> from blobtree import Point
    >>> hits = Point((0, 0, 0), radius=1.0).raycast([(0, 0, 3), (5, 0, 3)], [(0, 0, -1), (0, 0, -1)])
    >>> hits.hit.tolist(), hits.distances.round(3).tolist()
    ([True, False], [2.0, inf])
    >>> hits.normals[:, 2].round(3).tolist()
    [1.0, 0.0]
    """

    distances: Float32Array
    positions: Float32Array
    normals: Float32Array
    colors: Float32Array

    @property
    def hit(self) -> BoolArray:
        """True for each ray that meets the surface (n,)."""
        return np.isfinite(self.distances)

    def __len__(self) -> int:
        return len(self.distances)


def trace(
    tree: ImplicitModel,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    far: float | None = None,
    device: str | None = None,
) -> Float32Array:
    """Return the distances (n,) of rays to the surface from `origins` (n, 3) along `directions` (n, 3).

    The distance of a miss is inf, and so is one beyond `far`. A ray that starts inside hits at once. `device`
    is the Warp device that traces, by default the current one.

    Raises
    ------
    InvalidPoints
        Origins and directions differ in number, or a direction is zero.
    """
    rays = _uploaded(origins, directions, device)
    load_ray_kernels(tree, str(rays[0].device), trace_rays)
    distances: Float32Array = _traced(tree, rays, far)[0].numpy()
    return distances


def raycast(
    tree: ImplicitModel,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    far: float | None = None,
    device: str | None = None,
) -> Hits:
    """Return the first hits of rays, with normals and colours; arguments and errors are those of `trace`."""
    rays = _uploaded(origins, directions, device)
    device = str(rays[0].device)
    load_ray_kernels(tree, device, trace_rays, shade_hits)
    distances, spans, cells = _traced(tree, rays, far)
    return Hits(*shaded(cells.instruction_set, cells.tape, rays, distances, spans))


def _traced(tree: ImplicitModel, rays: Sequence[Any], far: float | None) -> tuple[Any, Any, DeviceCells]:
    """Return what `trace_arrays` does, without hits beyond `far`, and the cells.

    Cells of a tree without an end are those around the rays.
    """
    device, within = str(rays[0].device), None
    limit = np.inf if far is None else positive_number("far", far)
    if far is not None and is_endless(tree.field_box):
        starts, ways = (array.numpy().astype(np.float64) for array in rays)
        ends = starts + limit * ways / np.linalg.norm(ways, axis=1)[:, None]
        ends = np.concatenate([starts, ends, np.zeros((int(not len(starts)), 3))])
        margin = BOX_MARGIN * (limit + np.abs(ends).max())
        low, high = np.clip(tree.field_box, ends.min(axis=0) - margin, ends.max(axis=0) + margin)
        within = low.astype(np.float32), high.astype(np.float32)
    origins, directions = rays
    distances, spans = trace_arrays(tree, origins, directions, within)
    if far is not None:
        found = distances.numpy()
        distances.assign(np.where(found <= limit, found, np.float32(np.inf)))
    return distances, spans, device_cells(tree, device=device, within=within)


def shaded(
    instruction_set: InstructionSet, tape: Any, rays: Sequence[Any], distances: Any, spans: Any
) -> list[Any]:
    """Return distances, positions, normals and colours of hits as NumPy arrays."""
    device, count = str(distances.device), len(distances)
    arrays = [wp.zeros(count, dtype=wp.vec3, device=device) for _ in range(3)]
    inputs = [*rays, distances, spans, tape]
    launch(instruction_set.kernel_for(shade_hits), count, inputs, arrays, device)
    return [distances.numpy(), *(array.numpy() for array in arrays)]


def trace_arrays(
    tree: ImplicitModel, origins: Any, directions: Any, within: Corners | None = None
) -> tuple[Any, Any]:
    """Do the same as `trace` for Warp arrays of vec3, without copies and checks, on their device.

    Return the distances, and for each hit the first texel of the tape that holds there and one past its last,
    in the tape of `device_cells` `within` a box.
    """
    device = str(origins.device)
    distances: wp.array[Any] = wp.empty(len(origins), dtype=wp.float32, device=device)
    spans: wp.array[Any] = wp.empty(len(origins), dtype=wp.vec2i, device=device)
    cells = device_cells(tree, device=device, within=within)
    inputs = [origins, directions, cells.arrays]
    launch(cells.instruction_set.kernel_for(trace_rays), len(origins), inputs, [distances, spans], device)
    return distances, spans


def load_ray_kernels(tree: ImplicitModel, device: str, *kernels: wp.Kernel) -> None:
    """Load kernels for rays, and those for cells, so that they compile at the same time."""
    kernel_for = tree.tape.instruction_set.kernel_for
    load_together([kernel_for(kernel) for kernel in (*kernels, *CELL_KERNELS)], device)


def _uploaded(origins: ArrayLike, directions: ArrayLike, device: str | None) -> list[Any]:
    """Return checked rays as arrays on a device."""
    rays = checked_rays(origins, directions)
    return [wp.array(array, dtype=wp.vec3, device=known_device(device)) for array in rays]


def checked_rays(origins: ArrayLike, directions: ArrayLike) -> tuple[Float32Array, Float32Array]:
    """Return origins and directions of rays (n, 3); raise InvalidPoints if they are none."""
    starts, vectors = points_or_point(origins)[0], points_or_point(directions)[0]
    if starts.shape != vectors.shape:
        raise InvalidPoints(f"directions: expected one per origin, {len(starts)}, got {len(vectors)}")
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    if not (largest > 0.0).all():
        raise InvalidPoints("directions: expected vectors with a length, got a zero vector")
    # Squares of tiny components vanish from a length. Scaling by powers of two changes no bit of a direction.
    return starts, np.ldexp(vectors, -np.frexp(largest)[1][:, None])
