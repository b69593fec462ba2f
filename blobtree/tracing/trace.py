"""Rays and a tree: where they hit, and what is there."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree.errors import InvalidPoints
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.launch import known_device, launch
from blobtree.tapes.evaluate import field_color, field_gradient
from blobtree.tracing.cells import device_cells
from blobtree.tracing.rays import trace_ray
from blobtree.validation import point_array

if TYPE_CHECKING:
    from blobtree.nodes.tree import Node

wp.set_module_options(KERNEL_OPTIONS)

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Hits:
    """What rays meet first.

    Attributes
    ----------
    distances
        float32[n] along the rays, in the model's units, inf where a ray misses.
    positions, normals, colors
        float32[n, 3]: places on the surface, outward unit normals and blended colours there; 0 for a miss.
    """

    distances: Floats
    positions: Floats
    normals: Floats
    colors: Floats

    @property
    def hit(self) -> NDArray[np.bool_]:
        """Which rays meet the surface (n,)."""
        return np.isfinite(self.distances)

    def __len__(self) -> int:
        return len(self.distances)


@wp.kernel
def _trace(
    first: wp.int32,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    lower: wp.vec3,
    block_size: wp.float32,
    counts: wp.vec3i,
    tolerance: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    blocks: wp.array(dtype=wp.int32),
    distances: wp.array(dtype=wp.float32),
    spans: wp.array(dtype=wp.vec2i),
) -> None:
    i = first + wp.tid()
    direction = wp.normalize(directions[i])
    hit = trace_ray(origins[i], direction, lower, block_size, counts, tolerance, tape, blocks)
    t = hit[0]
    if t < 0.0:
        t = wp.inf
    distances[i] = t
    spans[i] = wp.vec2i(int(hit[1]), int(hit[2]))


@wp.kernel
def _look(
    first: wp.int32,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    distances: wp.array(dtype=wp.float32),
    spans: wp.array(dtype=wp.vec2i),
    tape: wp.array(dtype=wp.vec4),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    colors: wp.array(dtype=wp.vec3),
) -> None:
    i = first + wp.tid()
    if wp.isfinite(distances[i]):
        position = origins[i] + wp.normalize(directions[i]) * distances[i]
        slope = field_gradient(position, tape, spans[i])
        color = field_color(position, tape, spans[i])
        positions[i] = position
        normals[i] = -wp.normalize(wp.vec3(slope[1], slope[2], slope[3]))
        colors[i] = wp.vec3(color[1], color[2], color[3])


def trace(
    tree: "Node", origins: ArrayLike, directions: ArrayLike, *, device: str | None = None
) -> NDArray[np.float32]:
    """Distances (n,) from `origins` (n, 3) along `directions` (n, 3) to the surface, inf where a ray misses.

    A ray that starts inside hits at once. `device` is the Warp device that does the work, by default the
    current one.

    Raises
    ------
    InvalidPoints
        Origins and directions differ in number, or a direction has no length.
    """
    rays = _uploaded(origins, directions, device)
    distances: NDArray[np.float32] = trace_arrays(tree, *rays)[0].numpy()
    return distances


def raycast(tree: "Node", origins: ArrayLike, directions: ArrayLike, *, device: str | None = None) -> Hits:
    """What rays meet first, with normals and colours there; arguments and errors as for `trace`."""
    rays = _uploaded(origins, directions, device)
    distances, spans = trace_arrays(tree, *rays)
    place = str(distances.device)
    seen = [wp.zeros(len(distances), dtype=wp.vec3, device=place) for _ in range(3)]
    cells = device_cells(tree, device=place)
    inputs = [*rays, distances, spans, cells.tape]
    launch(cells.vocabulary.kernel(_look), len(distances), inputs, seen, place)
    return Hits(distances.numpy(), *(array.numpy() for array in seen))


def trace_arrays(tree: "Node", origins: Any, directions: Any) -> tuple[Any, Any]:
    """`trace` for Warp arrays of vec3, without a copy and unchecked: distances, and the tapes at the hits.

    The work is done where `origins` are. A tape is given by its first texel and one past its last, in the
    cells' tape (`cells.device_cells`).
    """
    place = str(origins.device)
    distances: wp.array[Any] = wp.empty(len(origins), dtype=wp.float32, device=place)
    spans: wp.array[Any] = wp.empty(len(origins), dtype=wp.vec2i, device=place)
    cells = device_cells(tree, device=place)
    inputs = [origins, directions, *cells.arguments]
    launch(cells.vocabulary.kernel(_trace), len(origins), inputs, [distances, spans], place)
    return distances, spans


def _uploaded(origins: ArrayLike, directions: ArrayLike, device: str | None) -> list[Any]:
    """Rays on a device."""
    starts, headings = point_array(origins), point_array(directions)
    if starts.shape != headings.shape:
        raise InvalidPoints(f"directions: expected one per origin, {len(starts)}, got {len(headings)}")
    largest = np.abs(headings).max(axis=1, initial=0.0)
    if not (largest > 0.0).all():
        raise InvalidPoints("directions: expected vectors with a length, got a zero vector")
    # Squares of tiny components would vanish from a length; powers of two change no bit of a direction.
    headings = np.ldexp(headings, -np.frexp(largest)[1][:, None])
    place = known_device(device)
    return [wp.array(array, dtype=wp.vec3, device=place) for array in (starts, headings)]
