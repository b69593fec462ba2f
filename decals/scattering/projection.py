"""Projection of points onto their own surfaces, and the test where particles are forbidden, on one device."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import warp as wp

from blobtree._typing import BoolArray, Float32Array, Int32Array
from blobtree.device import launch
from decals.scattering.step_kernels import offset_points
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import DeviceSurface, Scalars, Surface, Vectors, on_device, vectors

HIDING_OFFSET = 1e-4
"""Offset of a point along its normal before the test whether it lies inside another surface, in diagonals of
its surface. It keeps coincident surfaces from hiding each other, while touching faces do hide each other."""

Spans: TypeAlias = list[tuple[int, int, int]]
"""Index of a surface, and the range (first, last + 1) of its points, for each surface that has points."""

Forbidden: TypeAlias = Callable[[Float32Array], BoolArray]
"""A function of ``points[n, 3]`` that returns True where particles are forbidden, ``bool[n]``."""


class SurfaceProjection:
    """Surfaces on one device, with the rule where on them particles are forbidden.

    Parameters
    ----------
    surfaces
        All surfaces.
    forbidden
        The user's own rule, if any; it runs on the host.
    device
        Warp device.
    """

    def __init__(self, surfaces: Sequence[Surface], forbidden: Forbidden | None, device: str) -> None:
        self.device = device
        self._surfaces, self._forbidden = tuple(surfaces), forbidden
        self._device_surfaces: dict[int, DeviceSurface] = {}
        self._boxes = np.array([surface.bounds for surface in surfaces]).reshape(-1, 2, 3)
        self._heights = HIDING_OFFSET * np.linalg.norm(self._boxes[:, 1] - self._boxes[:, 0], axis=1)

    def project(
        self,
        points: Vectors,
        reaches: Scalars,
        spans: Spans,
        positions: Vectors,
        normals: Vectors,
        forbidden: Scalars,
    ) -> None:
        """Write the closest positions on the points' own surfaces, the normals there, and 1 where forbidden.

        `reaches` bound the distances to the surfaces, as in `decals.surfaces.surface`.
        """
        for index, first, last in spans:
            rows = slice(first, last)
            self._on_device(index).project(points[rows], reaches[rows], positions[rows], normals[rows])
        self.mark_forbidden(spans, positions, normals, forbidden)

    def mark_forbidden(self, spans: Spans, positions: Vectors, normals: Vectors, forbidden: Scalars) -> None:
        """Write 1 where a point lies inside another surface or breaks the user's rule; 0 elsewhere."""
        forbidden.zero_()
        for index, first, last in spans:
            others = self.overlapping(index)
            if others:
                points: Any = wp.empty(last - first, dtype=wp.vec3, device=self.device)
                inputs = [float(self._heights[index]), positions[first:last], normals[first:last]]
                launch(offset_points, last - first, inputs, [points], device=self.device)
                for other in others:
                    self._on_device(other).mark_inside(points, forbidden[first:last])
            if self.shells(index):
                self._mark_behind(index, positions[first:last], normals[first:last], forbidden[first:last])
        if self._forbidden is not None and len(positions):
            flags = forbidden.numpy() | self._forbidden(positions.numpy())
            forbidden.assign(flags.astype(np.int32))

    def shells(self, index: int) -> tuple[MeshSurface, ...]:
        """Return the closed parts of a mesh that may hide its other parts; none for other surfaces."""
        surface = self._surfaces[index]
        return surface.shells if isinstance(surface, MeshSurface) else ()

    def _mark_behind(self, index: int, positions: Vectors, normals: Vectors, forbidden: Scalars) -> None:
        """Write 1 where a point lies inside a part of its own surface.

        A part whose normals point inward contains the side above its own points, so it hides only points both
        of whose sides it contains. Only points in the box of a part, which are often few, are tested.
        """
        height, places, flags = float(self._heights[index]), positions.numpy(), forbidden.numpy().copy()
        for shell in self.shells(index):
            lower, upper = shell.bounds
            near = ((places >= lower - 2.0 * height) & (places <= upper + 2.0 * height)).all(axis=1)
            rows = np.flatnonzero(near & (flags == 0))
            if len(rows) == 0:
                continue
            own = [vectors(array.numpy()[rows], self.device) for array in (positions, normals)]
            hidden = np.ones(len(rows), np.int32)
            for sign in (1.0, -1.0) if shell.inverted else (1.0,):
                points: Any = wp.empty(len(rows), dtype=wp.vec3, device=self.device)
                launch(offset_points, len(rows), [sign * height, *own], [points], device=self.device)
                inside: Any = wp.zeros(len(rows), dtype=wp.int32, device=self.device)
                on_device(shell, self.device).mark_inside(points, inside)
                hidden &= inside.numpy()
            flags[rows] = hidden
        forbidden.assign(flags)

    def overlapping(self, index: int) -> list[int]:
        """Return the other surfaces whose boxes intersect the box of this one."""
        lower, upper = self._boxes[index]
        intersects: BoolArray = (self._boxes[:, 0] <= upper) & (self._boxes[:, 1] >= lower)
        return [int(other) for other in np.flatnonzero(intersects.all(axis=1)) if other != index]

    def _on_device(self, index: int) -> DeviceSurface:
        if index not in self._device_surfaces:
            self._device_surfaces[index] = on_device(self._surfaces[index], self.device)
        return self._device_surfaces[index]


def spans_of(surface_ids: Int32Array) -> Spans:
    """Return the range of each surface's points among points that are sorted by surface."""
    indices, firsts = np.unique(surface_ids, return_index=True)
    ends = [*firsts.tolist(), len(surface_ids)][1:]
    return list(zip(indices.tolist(), firsts.tolist(), ends, strict=True))
