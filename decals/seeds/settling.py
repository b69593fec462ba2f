"""Points put back onto the surfaces that they belong to, all in the memory of one device."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.launch import launch
from decals.seeds.crowd_kernels import lift
from decals.surfaces.ground import Ground, Scalars, Vectors, ground_of
from decals.surfaces.surface import Flags, Floats, Surface

LIFT = 1e-4
"""A point is hidden if it lies inside another surface after a lift along its own normal, by this share of its
surface's diagonal: so coincident surfaces do not hide each other, and touching faces do."""

Spans = list[tuple[int, int, int]]
"""Numbers of surfaces, and the first and the last but one of the points that belong to each."""

Barred = Callable[[Floats], Flags]
"""Which of the points, ``float32[n, 3]``, nobody may lie on."""


class Settling:
    """Surfaces on one device, and the rule who may lie where on them.

    Parameters
    ----------
    surfaces
        All of them.
    barred
        The user's own rule, if there is one; it is asked on the host.
    device
        Warp device.
    """

    def __init__(self, surfaces: Sequence[Surface], barred: Barred | None, device: str) -> None:
        self.device = device
        self._surfaces, self._barred = tuple(surfaces), barred
        self._grounds: dict[int, Ground] = {}
        self._boxes = np.array([surface.bounds for surface in surfaces]).reshape(-1, 2, 3)
        self._lifts = LIFT * np.linalg.norm(self._boxes[:, 1] - self._boxes[:, 0], axis=1)

    def settle(
        self,
        points: Vectors,
        reaches: Scalars,
        spans: Spans,
        positions: Vectors,
        normals: Vectors,
        forbidden: Scalars,
    ) -> None:
        """Write where the points lie on their surfaces, the normals there, and 1 where they may not lie."""
        for number, first, last in spans:
            here = slice(first, last)
            self._ground(number).project(points[here], reaches[here], positions[here], normals[here])
        self.forbid(spans, positions, normals, forbidden)

    def forbid(self, spans: Spans, positions: Vectors, normals: Vectors, forbidden: Scalars) -> None:
        """Write 1 where a point of a surface lies inside another one, or is barred; 0 elsewhere."""
        forbidden.zero_()
        for number, first, last in spans:
            others = self.overlapping(number)
            if others:
                lifted: Any = wp.empty(last - first, dtype=wp.vec3, device=self.device)
                inputs = [float(self._lifts[number]), positions[first:last], normals[first:last]]
                launch(lift, last - first, inputs, [lifted], device=self.device)
                for other in others:
                    self._ground(other).mark_inside(lifted, forbidden[first:last])
        if self._barred is not None and len(positions):
            flags = forbidden.numpy() | self._barred(positions.numpy())
            forbidden.assign(flags.astype(np.int32))

    def overlapping(self, number: int) -> list[int]:
        """Other surfaces whose boxes meet the box of this one."""
        low, high = self._boxes[number]
        meets: NDArray[np.bool_] = (self._boxes[:, 0] <= high) & (self._boxes[:, 1] >= low)
        return [int(other) for other in np.flatnonzero(meets.all(axis=1)) if other != number]

    def _ground(self, number: int) -> Ground:
        if number not in self._grounds:
            self._grounds[number] = ground_of(self._surfaces[number], self.device)
        return self._grounds[number]


def spans_of(surface_ids: NDArray[np.int32]) -> Spans:
    """Where each surface's points stand among points that are sorted by surface."""
    numbers, firsts = np.unique(surface_ids, return_index=True)
    ends = [*firsts.tolist(), len(surface_ids)][1:]
    return list(zip(numbers.tolist(), firsts.tolist(), ends, strict=True))
