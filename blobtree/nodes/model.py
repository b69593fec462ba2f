"""What the core can say of a tree beside values: its surface's box, bounds on the field, and rays."""

from typing import Any, cast

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array
from blobtree.cells.prune_kernels import measure_range
from blobtree.errors import InvalidNode, InvalidPoints
from blobtree.kernels import loaded
from blobtree.lazy import Lazy
from blobtree.meshing.polygonize import polygonize
from blobtree.tape.model import ImplicitModel
from blobtree.tracing.trace import Hits, raycast
from blobtree.validation import point_array

COORDINATE_MARGIN = 2.0**-21
"""Margin around a box of `Model.interval`, over its largest coordinate, for the rounding of its centre."""


class Model(ImplicitModel):
    """A field with a surface; `blobtree.Node` is the class to use."""

    @Lazy
    def bounds(self) -> tuple[Float32Array, Float32Array]:
        """Lower and upper corner of the surface, float32[3] each; `support` is the larger box of the field.

        The box of the vertices of ``polygonize(self)``, which lie on the surface. It may be too small by a
        cell at most, a 64th of the longest side of the support, or of a box around a surface that takes less
        than an eighth of it. A tree without a surface raises `InvalidNode`.

        Examples
        --------
        >>> from blobtree import Point
        >>> lower, upper = Point((0, 0, 0), radius=1.0).bounds
        >>> upper.round(2).tolist()
        [1.0, 1.0, 1.0]
        """
        vertices = polygonize(self).vertices
        if not len(vertices):
            raise InvalidNode(
                "bounds: expected a tree with a surface, got none in 64 cells; `support` is its field's box"
            )
        return vertices.min(axis=0), vertices.max(axis=0)

    def interval(self, lower: ArrayLike, upper: ArrayLike) -> tuple[float, float]:
        """Return bounds on the field over a box, by interval arithmetic.

        They hold for the cube around the box too, so a box of equal sides gives the tightest ones.

        Parameters
        ----------
        lower, upper : array-like (3,)
            Corners of the box, in model units.

        Returns
        -------
        tuple[float, float]
            A lower and an upper bound of the values; the values need not reach them.

        Raises
        ------
        InvalidPoints
            The corners are not finite, or `lower` exceeds `upper`.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=1.0).interval((5, 5, 5), (6, 6, 6))
        (0.0, 0.0)
        """
        corners = point_array(cast(Any, [lower, upper])).astype(np.float64)
        if (corners[0] > corners[1]).any():
            raise InvalidPoints(f"box: expected lower ≤ upper, got {lower!r} and {upper!r}")
        center, half = corners.mean(axis=0), float((corners[1] - corners[0]).max()) / 2.0
        pad = float(np.abs(corners).max()) * COORDINATE_MARGIN
        uploaded = self.tape.on("cpu")
        out = wp.empty(1, dtype=wp.vec4, device="cpu")
        inputs = [wp.vec3(*center), half + pad, uploaded.data, uploaded.span]
        kernel = self.tape.instruction_set.kernel_for(measure_range)
        wp.launch(loaded(kernel, "cpu"), dim=1, inputs=inputs, outputs=[out], device="cpu")
        smallest, largest, _, _ = out.numpy()[0].tolist()
        return smallest, largest

    def raycast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        far: float | None = None,
        device: str | None = None,
    ) -> Hits:
        """Return the first intersections of rays with the surface.

        Newton's method takes hits to the surface, up to about 1e-6 of the model's diagonal. Rays that pass
        beside an edge or a round surface hit as well, within about 1e-5 of the diagonal of `support`.

        Parameters
        ----------
        origins : array-like (n, 3) or (3,)
            Starts of the rays, or of one ray. A ray that starts inside hits at once.
        directions : array-like (n, 3) or (3,)
            Directions of any length above 0.
        far : float, optional
            Distance beyond which rays hit nothing. A tree without an end, such as an `EndlessRepeat`, needs
            one; hits are exact to about 4e-5 of it there.
        device : str, optional
            Warp device that does the work; the current one by default.

        Returns
        -------
        Hits
            Distances, positions, normals and colours.

        Raises
        ------
        InvalidPoints
            Origins and directions differ in number, or a direction has no length.
        InvalidNode
            `far` is not a number above 0, or missing although the tree has no end.
        InvalidDevice
            Warp has no such device.

        Examples
        --------
        >>> from blobtree import Point
        >>> hits = Point((0, 0, 0), radius=1.0).raycast([[5, 0, 0]], [[-1, 0, 0]])
        >>> hits.distances.round(3).tolist()
        [4.0]
        """
        return raycast(self, origins, directions, far=far, device=device)
