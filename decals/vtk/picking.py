"""Picks: the surface point and decal at a pixel of a window, unless another actor occludes it."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float32Array, Float64Array
from decals.errors import InvalidPoints
from decals.field.mapping import ImageMapping
from decals.record import Contact
from decals.rendering import Renderer, SceneLike
from decals.rendering.options import RenderOptions
from decals.rendering.viewpoint import Projection
from decals.validation import finite_number

DEPTH_TOLERANCE = 1e-6
"""Difference of equal depths: depth buffers have 24 bits, matrices are float32."""


@dataclass(frozen=True, eq=False)
class PickResult:
    """The surface point at a pixel.

    Attributes
    ----------
    object_id : int
        Index of the object in the scene.
    owner : int
        Number of the decal that shows there; −1 for none.
    position, normal : float32, shape (3,)
        Point and unit normal, in scene coordinates.
    uv : (float, float)
        Coordinates in the owner's image, from 0 to 1; zero without an owner.
    field : float
        The owner's field after contact; zero without an owner.
    depth : float
        Depth in the window, from 0 to 1, as in VTK's depth buffer.

    Examples
    --------
    >>> import decals, pyvista
    >>> from blobtree import Point
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=20, images=["eye"])
    >>> plotter = pyvista.Plotter(off_screen=True, window_size=(80, 60))
    >>> scene = plotter.decals.add_scene(scene)
    >>> plotter.show(auto_close=False)
    >>> pick = plotter.decals.subplot.at(40, 30)
    >>> pick.position.shape, 0 < pick.depth < 1
    ((3,), True)
    >>> plotter.close()
    """

    object_id: int
    owner: int
    position: Float32Array
    normal: Float32Array
    uv: tuple[float, float]
    field: float
    depth: float


class PickableSubplot(Protocol):
    """What picking reads of a subplot."""

    @property
    def vtk_renderer(self) -> Any: ...  # noqa: D102
    @property
    def scene(self) -> SceneLike | None: ...  # noqa: D102
    @property
    def renderer(self) -> Renderer: ...  # noqa: D102
    @property
    def actor(self) -> Any: ...  # noqa: D102
    @property
    def mapping(self) -> ImageMapping: ...  # noqa: D102
    @property
    def contact(self) -> Contact: ...  # noqa: D102
    def current(self) -> AbstractContextManager[None]: ...  # noqa: D102
    def viewpoint(self) -> Projection: ...  # noqa: D102
    def depth_at(self, x: int, y: int) -> float: ...  # noqa: D102


def pick_at(subplot: PickableSubplot, x: float, y: float) -> PickResult | None:
    """Return what a subplot shows at a pixel; see `SubplotRenderer.at`."""
    column, row = (
        math.floor(finite_number("x", x, InvalidPoints)),
        math.floor(finite_number("y", y, InvalidPoints)),
    )
    left, low = subplot.vtk_renderer.GetOrigin()
    width, height = subplot.vtk_renderer.GetSize()
    inside = 0 <= column - left < width and 0 <= row - low < height
    if subplot.scene is None or not inside:
        return None
    with subplot.current():
        buffers = subplot.renderer.buffers_at(
            subplot.scene,
            column - left,
            row - low,
            RenderOptions(size=(width, height), mapping=subplot.mapping, contact=subplot.contact),
            viewpoint=subplot.viewpoint(),
        )
    position = buffers.position[0, 0]
    if buffers.object_id[0, 0] < 0 or is_occluded(subplot, column, row, position):
        return None
    return PickResult(
        object_id=int(buffers.object_id[0, 0]),
        owner=int(buffers.owner[0, 0]),
        position=position,
        normal=buffers.normal[0, 0],
        uv=(float(buffers.uv[0, 0, 0]), float(buffers.uv[0, 0, 1])),
        field=float(buffers.field[0, 0]),
        depth=depth_of(subplot.viewpoint().matrix, position),
    )


def depth_of(matrix: Float64Array, position: ArrayLike) -> float:
    """Return the depth in the window, from 0 to 1, of a point; the matrix maps it to clip space."""
    clip = matrix @ np.append(np.asarray(position, np.float64), 1.0)
    return float(0.5 * clip[2] / clip[3] + 0.5)


def is_occluded(subplot: PickableSubplot, x: int, y: int, position: ArrayLike) -> bool:
    """Return True if an actor of VTK hid a surface point at a pixel of the last frame.

    VTK's depth is compared with the subplot's own: at a grazing angle, or in a coarse frame, that depth may
    be far in front of the point. Text has depth zero and occludes nothing.
    """
    x, y = (math.floor(finite_number(name, value, InvalidPoints)) for name, value in (("x", x), ("y", y)))
    if not _others_write_depth(subplot, x, y):
        return False
    left, low = subplot.vtk_renderer.GetOrigin()
    own = subplot.depth_at(x - left, y - low)
    if own == 0.0:
        return False
    depth = float(subplot.vtk_renderer.GetZ(x, y))
    return 0.0 < depth < min(own, depth_of(subplot.viewpoint().matrix, position)) - DEPTH_TOLERANCE


def _others_write_depth(subplot: PickableSubplot, x: int, y: int) -> bool:
    """Return True if other actors may have written depth at a pixel; reading depth stalls the card."""
    own = subplot.vtk_renderer
    others = (other for other in own.GetRenderWindow().GetRenderers() if other is not own)
    if any(other.GetDraw() and other.IsInViewport(x, y) for other in others):
        return True
    return any(prop is not subplot.actor and _writes_depth(prop) for prop in own.GetViewProps())


def _writes_depth(prop: Any) -> bool:
    """Return True if a prop may write depth; text and translucent actors do not."""
    if not prop.GetVisibility() or prop.IsA("vtkActor2D"):
        return False
    return not (prop.IsA("vtkActor") and prop.HasTranslucentPolygonalGeometry())
