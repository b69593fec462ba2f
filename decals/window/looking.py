"""Where a window's camera stands: rays through its pixels, and the camera as a scene has it."""

from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from decals.edit.tools import Ray
from decals.scenes.camera import Camera

if TYPE_CHECKING:
    from decals.vtk.stage import Stage


def ray_through(stage: "Stage", x: float, y: float) -> Ray | None:
    """The ray through the middle of a pixel of the window; None outside of the stage's subplot."""
    renderer: Any = stage.vtk_renderer
    (left, low), (width, height) = renderer.GetOrigin(), renderer.GetSize()
    x, y = x - left + 0.5, y - low + 0.5
    if not (0 <= x <= width and 0 <= y <= height):
        return None
    rays = stage.viewpoint().rays(width, height)
    return rays.origins(x, y), rays.directions(x, y)


def camera_of(stage: "Stage") -> Camera | None:
    """The camera to save: VTK's, if it is one of ours."""
    view = stage.vtk_renderer.camera
    if view.parallel_projection:
        return None
    return Camera(tuple(view.position), tuple(view.focal_point), tuple(view.up), view.view_angle)


def view_of(stage: "Stage") -> tuple[ArrayLike, ArrayLike]:
    """Where the eye is, and what it looks at."""
    view = stage.vtk_renderer.camera
    return view.position, view.focal_point
