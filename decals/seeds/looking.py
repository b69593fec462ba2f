"""Looking around on one device: how near the nearest particle is, and who stands out."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.launch import launch
from decals.model import FACING_LIMIT
from decals.seeds.crowd import Crowd
from decals.seeds.repulsion import WIDENING, make_grid
from decals.seeds.rims import Walls
from decals.seeds.search_kernels import nearest_facing, peaks, rings_around
from decals.surfaces.ground import Scalars, Vectors, vectors
from decals.surfaces.surface import Flags, Floats


class Lookout:
    """Sees who is near any point, among the particles of a crowd as they lie now.

    Parameters
    ----------
    crowd
        The particles.
    reach
        How far it sees, in spacings.
    """

    def __init__(self, crowd: Crowd, reach: float) -> None:
        self._crowd, self._reach = crowd, reach
        self._grid = make_grid(crowd.count, crowd.device)
        self.refresh()

    def refresh(self) -> None:
        """Particles have moved."""
        self._grid.build(self._crowd.positions, self._reach * self._crowd.spacing)

    @property
    def _seen(self) -> list[Any]:
        """What kernels need to look at the crowd."""
        crowd = self._crowd
        widening = WIDENING if crowd.varied else 1.0
        return [
            *(self._grid.id, crowd.positions, crowd.normals, crowd.sizes),
            *(FACING_LIMIT, self._reach, widening),
        ]

    def nearness(
        self,
        points: Vectors,
        normals: Vectors,
        sizes: Scalars,
        own: Scalars,
        walls: Walls,
        *,
        enough: float = 0.0,
    ) -> Scalars:
        """Distance of each point to the nearest particle that faces it, in their spacing, on the device.

        At most the reach. `own` are particles that do not count, -1 for none; below `enough` any number
        serves that is not larger than that. A point's own image beyond one of its walls counts as well.
        """
        crowd = self._crowd
        found: Any = wp.empty(len(points), dtype=wp.float32, device=crowd.device)
        inputs = [*self._seen, enough, own, points, normals, sizes, *walls]
        launch(nearest_facing, len(points), inputs, [found], device=crowd.device)
        return found

    def rings(
        self, points: Vectors, normals: Vectors, sizes: Scalars, own: Scalars, walls: Walls
    ) -> tuple[Scalars, Scalars]:
        """Distance of each point to the nearest particle that faces it, and the mean of the six nearest.

        As `nearness`, on the device; each distance is at most the reach.
        """
        crowd = self._crowd
        found: tuple[Any, Any] = (
            wp.empty(len(points), dtype=wp.float32, device=crowd.device),
            wp.empty(len(points), dtype=wp.float32, device=crowd.device),
        )
        inputs = [*self._seen, own, points, normals, sizes, *walls]
        launch(rings_around, len(points), inputs, found, device=crowd.device)
        return found

    def nearness_of(self, rows: NDArray[np.int64]) -> Floats:
        """The same for some particles of the crowd, ``float32[k]``."""
        crowd = self._crowd
        own = whole_numbers(rows, crowd.device)
        given = [crowd.positions, crowd.normals, crowd.sizes, crowd.owners, crowd.may_move]
        if len(rows) < crowd.count:
            given = [array[own].contiguous() for array in given]
        places, ways, sizes, _, _ = given
        found: Floats = self.nearness(places, ways, sizes, own, crowd.walls(*given)).numpy()
        return found


def outstanding(points: Floats, values: Floats, radii: Floats, *, device: str) -> Flags:
    """Whether each point has the largest value within its radius, ``bool[n]``; of equals the first has."""
    if len(points) == 0:
        return np.zeros(0, np.bool_)
    places = vectors(np.ascontiguousarray(points), device)
    grid = make_grid(len(points), device)
    grid.build(places, float(np.median(radii)))
    given: list[Any] = [
        wp.array(np.ascontiguousarray(rows, dtype=np.float32), dtype=wp.float32, device=device)
        for rows in (values, radii)
    ]
    flags: Any = wp.zeros(len(points), dtype=wp.int32, device=device)
    launch(peaks, len(points), [grid.id, places, *given], [flags], device=device)
    found: Flags = flags.numpy() == 1
    return found


def whole_numbers(rows: NDArray[np.integer], device: str) -> Scalars:
    """Rows as an array of a device."""
    return wp.array(rows.astype(np.int32), dtype=wp.int32, device=device)
