"""What lies at a place in a window, as far as nothing of VTK's hides it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from decals.checks import finite
from decals.errors import InvalidPoints
from decals.render import Size
from decals.render.parts import Rectangle
from decals.scenes.viewpoint import Floats

if TYPE_CHECKING:
    from decals.vtk.stage import Stage

ROUNDING = 1e-6
"""Differences of depth that tell nothing: depth buffers of 24 bits, and matrices in float32."""


@dataclass(frozen=True, eq=False)
class Hit:
    """What lies behind a place in a window.

    Attributes
    ----------
    object_id
        Index of the object in the scene.
    owner
        Number of the topmost decal there, -1 for none.
    position, normal
        float32[3] each, in the scene's coordinates.
    uv
        Place in the owner's image; zero without an owner.
    field
        The owner's field after contact; zero without an owner.
    depth
        Depth in the window, from 0 to 1, as VTK's depth buffer counts it.
    """

    object_id: int
    owner: int
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    uv: tuple[float, float]
    field: float
    depth: float


def hit_at(stage: Stage, x: float, y: float) -> Hit | None:
    """Say what a stage shows at a place in its window; see `Stage.at`."""
    column, row = math.floor(finite("x", x, InvalidPoints)), math.floor(finite("y", y, InvalidPoints))
    left, low = stage.vtk_renderer.GetOrigin()
    width, height = stage.vtk_renderer.GetSize()
    inside = 0 <= column - left < width and 0 <= row - low < height
    if stage.scene is None or not inside:
        return None
    with stage.current():
        found = stage.renderer.buffers_at(
            stage.scene,
            column - left,
            row - low,
            size=(width, height),
            mapping=stage.mapping,
            contact=stage.contact,
            viewpoint=stage.viewpoint(),
        )
    position = found.position[0, 0]
    if found.object_id[0, 0] < 0 or hidden(stage, column, row, position):
        return None
    return Hit(
        object_id=int(found.object_id[0, 0]),
        owner=int(found.owner[0, 0]),
        position=position,
        normal=found.normal[0, 0],
        uv=(float(found.uv[0, 0, 0]), float(found.uv[0, 0, 1])),
        field=float(found.field[0, 0]),
        depth=depth_of(stage.viewpoint().matrix, position),
    )


def depth_of(matrix: Floats, position: ArrayLike) -> float:
    """Depth in the window, from 0 to 1, of a point that a matrix takes to clip space."""
    clip = matrix @ np.append(np.asarray(position, np.float64), 1.0)
    return float(0.5 * clip[2] / clip[3] + 0.5)


def hidden(stage: Stage, x: int, y: int, position: ArrayLike) -> bool:
    """Whether an actor of VTK's hid a point of ours at a pixel of the last frame.

    VTK's depth there is compared with what we put into it ourselves: at a grazing angle, or in a coarse
    frame, that may lie far before the point. Text over the picture stands at depth zero and hides nothing.
    """
    x, y = (math.floor(finite(name, place, InvalidPoints)) for name, place in (("x", x), ("y", y)))
    if not _in_company(stage, x, y):
        return False
    left, low = stage.vtk_renderer.GetOrigin()
    own = stage.depth_at(x - left, y - low)
    if own == 0.0:
        return False
    seen = float(stage.vtk_renderer.GetZ(x, y))
    return 0.0 < seen < min(own, depth_of(stage.viewpoint().matrix, position)) - ROUNDING


def _in_company(stage: Stage, x: int, y: int) -> bool:
    """Whether anything but us may have left depth at a pixel; to read it, one waits for the card."""
    ours = stage.vtk_renderer
    return any(
        other.GetDraw() and other.IsInViewport(x, y)
        for other in ours.GetRenderWindow().GetRenderers()
        if other is not ours
    ) or any(prop is not stage.actor and _leaves_depth(prop) for prop in ours.GetViewProps())


def _leaves_depth(prop: Any) -> bool:
    """Whether a prop may; text does not, nor do translucent actors."""
    if not prop.GetVisibility() or prop.IsA("vtkActor2D"):
        return False
    return not (prop.IsA("vtkActor") and prop.HasTranslucentPolygonalGeometry())


def texels_of(x: int, y: int, pixels: Size, texels: Size, *, magnified: bool) -> Rectangle:
    """Texels of a picture that make a pixel of a frame; where it is magnified, between them."""
    (left, right), (low, high) = (
        _span(place, count, of, magnified) for place, count, of in zip((x, y), pixels, texels, strict=True)
    )
    return Rectangle(left, low, right - left, high - low)


def _span(place: int, pixels: int, texels: int, magnified: bool) -> tuple[int, int]:
    """First texel along an axis, and past the last."""
    if not magnified:
        return place * texels // pixels, -(-(place + 1) * texels // pixels)
    begin, end = (edge * texels / pixels - 0.5 for edge in (place, place + 1))
    return max(math.floor(begin), 0), min(math.floor(end) + 2, texels)
