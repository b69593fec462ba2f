"""Surfaces in the memory of a Warp device, where particles are put back onto them without leaving it."""

from typing import Any, Protocol, runtime_checkable

import numpy as np
import warp as wp

from decals.surfaces.surface import Floats, Surface

Vectors = Any
"""``wp.array`` of ``vec3`` on the ground's device."""

Scalars = Any
"""``wp.array`` of ``float32`` or ``int32`` on the ground's device."""


class Ground(Protocol):
    """What a surface answers to arrays on one device, without a copy to the host."""

    def project(self, points: Vectors, reaches: Scalars, positions: Vectors, normals: Vectors) -> None:
        """Write the surface points closest to the points, and the normals there.

        `reaches` are distances within which the surface is expected; where it is farther, it is found all
        the same, only later.
        """
        ...

    def mark_inside(self, points: Vectors, flags: Scalars) -> None:
        """Write 1 into the flags of points that lie inside; the others stay as they are."""
        ...


@runtime_checkable
class Grounded(Protocol):
    """A surface that knows how to lie on a device; a `Surface` need not."""

    def on(self, device: str) -> Ground:
        """Return the surface in the memory of a device."""
        ...


class HostGround:
    """Ground of a surface that answers on the host alone: points travel there and back."""

    def __init__(self, surface: Surface) -> None:
        self._surface = surface

    def project(self, points: Vectors, reaches: Scalars, positions: Vectors, normals: Vectors) -> None:
        """Ask the surface."""
        found, directions = self._surface.project(points.numpy(), within=reaches.numpy())
        positions.assign(found)
        normals.assign(directions)

    def mark_inside(self, points: Vectors, flags: Scalars) -> None:
        """Ask the surface."""
        flags.assign(np.maximum(flags.numpy(), self._surface.contains(points.numpy()).astype(np.int32)))


def ground_of(surface: Surface, device: str) -> Ground:
    """Return the surface on a device, or by way of the host if it does not lie there."""
    return surface.on(device) if isinstance(surface, Grounded) else HostGround(surface)


def vectors(rows: Floats, device: str) -> Vectors:
    """Rows ``[n, 3]`` on a device; on the CPU the rows themselves, not a copy."""
    return wp.array(rows, dtype=wp.vec3, device=device, copy=False)


def asked(ground: Ground, points: Floats, reaches: Floats, device: str) -> tuple[Floats, Floats]:
    """Positions and normals of a ground for points of the host."""
    positions: Any = wp.zeros(len(points), dtype=wp.vec3, device=device)
    normals: Any = wp.zeros(len(points), dtype=wp.vec3, device=device)
    if len(points):
        bounds: Any = wp.array(reaches, dtype=wp.float32, device=device, copy=False)
        ground.project(vectors(points, device), bounds, positions, normals)
    return positions.numpy(), normals.numpy()


def inside(ground: Ground, points: Floats, device: str) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Which points of the host lie inside."""
    flags: Any = wp.zeros(len(points), dtype=wp.int32, device=device)
    if len(points):
        ground.mark_inside(vectors(points, device), flags)
    marked: np.ndarray[Any, np.dtype[np.bool_]] = flags.numpy() == 1
    return marked
