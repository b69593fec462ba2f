"""The renderer of a subplot: a scene among the actors of one of pyvista's renderers."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum, auto
from typing import Any, cast

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkRenderingCore import vtkActor

from blobtree._typing import Float64Array
from decals.errors import InvalidPoints
from decals.rendering import Renderer, RenderOptions, SceneLike, Size
from decals.rendering.lights import Lighting
from decals.rendering.options import check_scene
from decals.rendering.tiles import CameraBuffer
from decals.rendering.viewpoint import Projection
from decals.scenes.objects import Box, SceneObject, bounds_of
from decals.validation import finite_number
from decals.vtk.camera import vtk_projection
from decals.vtk.context import WindowContext
from decals.vtk.frame import FrameKey, FrameOptions, FrameRenderer
from decals.vtk.injection import InjectedDecals
from decals.vtk.lights import TOO_MANY, Lights, too_many_lights, vtk_lamps
from decals.vtk.picking import PickResult, is_occluded, pick_at
from decals.vtk.proxy_actor import ProxyActor, box_around
from decals.vtk.settings import SubplotSettings
from decals.vtk.unsupported import complaints
from decals.vtk.weak_callback import weak_callback

MAX_COORDINATE = 2.0**30
"""Largest pixel coordinate that VTK accepts."""


class FrameStatus(Enum):
    """Result of the last frame."""

    EMPTY = auto()
    """No frame was drawn yet."""
    WARMING_UP = auto()
    """The frame needs a warm-up, such as the compilation of shaders; the picture before it still shows."""
    DRAWN = auto()
    """The frame was drawn."""


class SubplotRenderer(SubplotSettings):
    """Draws a scene among the actors of one of pyvista's renderers; ``plotter.decals.subplot`` is one.

    Everything may be changed at any time. The plotter's next ``render()`` shows it.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        The plotter.
    renderer : pyvista.Renderer
        One of ``plotter.renderers``.
    context : callable
        Returns the window's context, the same for all its renderers, while VTK's is current.

    Attributes
    ----------
    status : FrameStatus
        Result of the last frame.
    applied : InjectedDecals
        VTK's actors that show the decals.

    Examples
    --------
    >>> import decals, pyvista
    >>> from blobtree import Point
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=20, images=["eye"])
    >>> plotter = pyvista.Plotter(off_screen=True, window_size=(80, 60))
    >>> scene = plotter.decals.add_scene(scene)
    >>> plotter.show(auto_close=False)
    >>> plotter.decals.subplot.at(40, 30).object_id
    0
    >>> plotter.close()
    """

    def __init__(
        self, plotter: pv.BasePlotter, renderer: pv.Renderer, context: Callable[[], WindowContext]
    ) -> None:
        super().__init__()
        self.plotter, self.vtk_renderer = plotter, renderer
        self.status = FrameStatus.EMPTY
        self._scene: SceneLike | None = None
        self._context = context
        self._frames: FrameRenderer | None = None
        self._failed: FrameKey | None = None
        self._drawn_size: Size | None = None
        self._proxy_actor = ProxyActor(renderer, weak_callback(self.draw))
        self._enclosed: tuple[object, ...] = ()
        self.applied = InjectedDecals(self)
        self._warned: set[str] = set()
        self._tags = [
            renderer.AddObserver(vtkCommand.StartEvent, weak_callback(self._begin_frame)),
            renderer.AddObserver(vtkCommand.EndEvent, weak_callback(self._end_frame)),
        ]

    # -- scene ------------------------------------------------------------------------------------------

    @property
    def scene(self) -> SceneLike | None:
        """The shown scene; the camera is the plotter's. None after ``plotter.clear()``."""
        self._drop_cleared_scene()
        return self._scene

    @scene.setter
    def scene(self, scene: SceneLike | None) -> None:
        if scene is not None:
            check_scene(scene)
        self._drop_cleared_scene()
        self._scene, self._failed = scene, None
        if scene is None:
            self._proxy_actor.remove()
        self._enclose_objects(bounds_of)

    def _drop_cleared_scene(self) -> None:
        """Drop the scene if the proxy actor was removed, for example by ``plotter.clear()``."""
        if self._scene is not None and not self._proxy_actor.present:
            self._scene = None
            self.applied.clear()

    def _enclose_objects(self, box: Callable[[Sequence[SceneObject]], Box]) -> None:
        """Give the proxy actor the bounds of the scene's objects, if they changed."""
        if self._scene is None:
            return
        objects = tuple(self._scene.objects)
        same = len(objects) == len(self._enclosed) and all(
            a is b for a, b in zip(objects, self._enclosed, strict=True)
        )
        if same and self._proxy_actor.present:
            return
        self._enclosed = objects
        self._proxy_actor.enclose(box(cast(Sequence[SceneObject], objects)) if objects else None)

    def apply(self, actor: Any, *, follow: bool = False) -> None:
        """Show the decals on an actor of VTK; see `DecalsComponent.apply`."""
        self.applied.apply(actor, follow=follow)

    def remove(self, actor: Any) -> None:
        """Remove the decals from an actor; an actor without decals stays as it is."""
        self.applied.remove(actor)

    # -- coordinates ------------------------------------------------------------------------------------

    def frame(self) -> Float64Array:
        """Return the matrix from scene to world coordinates, (4, 4): the proxy actor's."""
        return self._proxy_actor.matrix()

    def viewpoint(self) -> Projection:
        """Return VTK's camera for the renderer."""
        return vtk_projection(self.vtk_renderer, self.frame())

    def lamps(self) -> Lighting | None:
        """Return the lights for the renderer; None for the studio light."""
        return vtk_lamps(self.vtk_renderer, self.frame()) if self.lights is Lights.VTK else None

    @property
    def actor(self) -> vtkActor:
        """The proxy actor of the objects among the renderer's actors."""
        return self._proxy_actor.actor

    def viewport(self) -> tuple[int, int, int, int]:
        """Return lower left corner and size of the part of the frame that VTK draws to now, in pixels."""
        return self._current_frames().context.viewport()

    # -- picking ----------------------------------------------------------------------------------------

    def at(self, x: float, y: float) -> PickResult | None:
        """Return what is visible at a pixel, or None.

        The pixel is drawn for it, at full resolution. Objects behind an actor of VTK are not visible;
        translucent actors and text hide nothing.

        Parameters
        ----------
        x, y
            Pixel of the window, from its lower left corner.

        Raises
        ------
        NoGraphics
            The window was not rendered yet.
        InvalidPoints
            The coordinates are not finite numbers.
        """
        return pick_at(self, x, y)

    def covers(self, x: int, y: int) -> bool:
        """Return True if a pixel of the window is in this subplot."""
        coordinates = (finite_number(name, value, InvalidPoints) for name, value in (("x", x), ("y", y)))
        column, row = (int(np.clip(value, -1.0, MAX_COORDINATE)) for value in coordinates)
        return bool(self.vtk_renderer.IsInViewport(column, row))

    def hidden(self, x: int, y: int, position: ArrayLike) -> bool:
        """Return True if an actor of VTK hid a surface point at a pixel of the last frame."""
        return is_occluded(self, x, y, position)

    def depth_at(self, x: int, y: int) -> float:
        """Return the least depth that the subplot wrote at a pixel of the renderer: 1 for no object.

        It is 0 if it is unknown because something else was drawn since.
        """
        width, height = self.vtk_renderer.GetSize()
        return 0.0 if self._frames is None else self._frames.least_depth(x, y, (width, height))

    # -- graphics context -------------------------------------------------------------------------------

    @property
    def renderer(self) -> Renderer:
        """The renderer in the window's context; use it inside ``with subplot.current():``."""
        return self._current_frames().renderer

    @property
    def camera(self) -> CameraBuffer:
        """Uniform block with the camera, for VTK's shaders."""
        return self._current_frames().camera

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the window's context current within a ``with`` block, and keep VTK's state."""
        with self._current_frames().context.current():
            yield

    @contextmanager
    def current_if_present(self) -> Iterator[None]:
        """Make the window's context current if it contains resources of the subplot."""
        if self._frames is None or self._frames.context.stale:
            yield
        else:
            with self._frames.context.current():
                yield

    def _current_frames(self) -> FrameRenderer:
        """Return the frame renderer, a new one if the window has a new context."""
        if self._frames is None or self._frames.context.stale:
            self._frames = FrameRenderer(self._context())
        return self._frames

    # -- frames -----------------------------------------------------------------------------------------

    @property
    def warming_up(self) -> bool:
        """True if the last frame needs a warm-up; see `warm`."""
        return self.status is FrameStatus.WARMING_UP

    @property
    def drawn_fraction(self) -> float:
        """Part of a whole frame's work, 0 to 1, that the last frame needed; 0 if nothing had changed."""
        return 0.0 if self._frames is None else self._frames.drawn_fraction

    def work_fraction(self, samples: int) -> float:
        """Return the part of a whole frame's work, 0 to 1, that a frame needs now.

        Parameters
        ----------
        samples
            Samples per pixel along each axis, at the window's size.
        """
        scene = self.scene
        if scene is None or self._drawn_size is None:
            return 1.0
        options = self._frame_options(self._drawn_size, 1.0, samples)
        return self._current_frames().work_fraction(scene, options, self.viewpoint())

    def _begin_frame(self) -> None:
        if self.scene is not None:
            self._enclose_objects(box_around)  # an edited document may change with every frame
            self._warn_of_unsupported()
        self.applied.begin_frame()

    def _end_frame(self) -> None:
        self.applied.end_frame()

    def _warn_of_unsupported(self) -> None:
        """Warn once of each mode of VTK that the subplot does not support."""
        messages = complaints(self.vtk_renderer)
        if self.lights is Lights.VTK and too_many_lights(self.vtk_renderer):
            messages.append(TOO_MANY)
        for message in messages:
            if message not in self._warned:
                self._warned.add(message)
                warnings.warn(message, stacklevel=2)

    def draw(self) -> None:
        """Draw into the frame that VTK is drawing; the proxy actor calls it."""
        scene = self._scene
        if scene is None or self.vtk_renderer.GetSelector() is not None:
            return
        with self._attempt(scene, self.draw_scale, self.samples) as possible:
            if possible:
                self._draw(scene)

    def _draw(self, scene: SceneLike) -> None:
        frames = self._current_frames()
        viewport = frames.context.viewport()
        if 0 in viewport[2:]:  # a tile of a large screenshot without this subplot
            return
        options = self._frame_options(viewport[2:], self.draw_scale, self.samples)
        self._drawn_size = viewport[2:]
        window = self.vtk_renderer.GetRenderWindow()
        if self.keep_previous_frame and not frames.is_warm(scene, options):
            self.status = FrameStatus.WARMING_UP
            frames.composite_again(window, viewport)
            return
        self.status = FrameStatus.DRAWN
        targets = frames.draw(scene, options, self.viewpoint(), wait=self.wait_for_gpu)
        samples = 0 if self.draw_scale < 1.0 else options.options.samples  # 0: magnified
        frames.composite(window, viewport, targets, samples)

    def _frame_options(self, size: Size, scale: float, samples: int) -> FrameOptions:
        """Return the options of a frame for a part of a window of some size."""
        if scale < 1.0:
            width, height = (max(1, round(scale * side)) for side in size)
            return FrameOptions(self._render_options((width, height), 1), magnified=True)
        supersampled = size[0] > self.vtk_renderer.GetSize()[0]
        return FrameOptions(self._render_options(size, 1 if supersampled else samples))

    def _render_options(self, size: Size, samples: int) -> RenderOptions:
        return RenderOptions(size, samples, self.contact, self.mapping, lights=self.lamps())

    def prepare(self, samples: int, seconds: float) -> float | None:
        """Draw a slice of a later frame of the window's size, without showing it.

        Once it is complete, frames with a `draw_scale` of 1 and these samples show it. Any change starts it
        again.

        Parameters
        ----------
        samples
            Samples per pixel along each axis.
        seconds
            Duration of the slice, approximately.

        Returns
        -------
        float or None
            Duration of the whole frame in seconds, 0 if parts were kept; None while it is incomplete.
        """
        scene = self.scene
        if scene is None or self._drawn_size is None:
            return 0.0
        with self._attempt(scene, 1.0, samples) as possible:
            if possible:
                options = self._frame_options(self._drawn_size, 1.0, samples)
                return self._current_frames().prepare(scene, options, self.viewpoint(), seconds)
        return 0.0

    def warm(self, seconds: float) -> str | None:
        """Warm up for a slice: compile and upload what the last frame lacked.

        Parameters
        ----------
        seconds
            Duration of the slice, approximately.

        Returns
        -------
        str or None
            Status such as ``"shaders 3 of 7"``; None once the frame can be drawn, or if it cannot be drawn.
            An error is raised only once.
        """
        scene = self.scene
        self.status = FrameStatus.DRAWN
        if scene is None or self._drawn_size is None:
            return None
        with self._attempt(scene, self.draw_scale, self.samples) as possible:
            if not possible:
                return None
            options = self._frame_options(self._drawn_size, self.draw_scale, self.samples)
            status = self._current_frames().warm(scene, options, self.viewpoint(), seconds)
        if status is not None:
            self.status = FrameStatus.WARMING_UP
        return status

    @contextmanager
    def _attempt(self, scene: SceneLike, scale: float, samples: int) -> Iterator[bool]:
        """Yield False for a frame that already failed; raise its error only once."""
        size = tuple(self.vtk_renderer.GetSize())
        key = FrameKey.of_attempt(scene, size, scale, samples, self.mapping, self.contact)
        try:
            yield not key.same(self._failed)
        except Exception:
            self._failed = key
            raise

    def release(self) -> None:
        """Leave the renderer and release all resources; the window must still exist. Twice is harmless."""
        self.applied.clear()
        self._proxy_actor.release()
        for tag in self._tags:
            self.vtk_renderer.RemoveObserver(tag)
        if self._frames is not None and not self._frames.context.stale:
            self._frames.release()
        self._frames = None
        self._scene = None
