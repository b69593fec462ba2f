"""The renderer of a subplot: a scene among the actors of a pyvista renderer, its settings, and picks."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Any, cast

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkRenderingCore import vtkActor

from blobtree._typing import Float32Array, Float64Array
from blobtree.progress import displayed, reporting
from decals.errors import InvalidPoints, InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.images.load import AnyImage
from decals.receivers import label_names
from decals.rendering import Environment, Renderer, RenderOptions, SceneLike, Size
from decals.rendering.dirty_regions import same_objects
from decals.rendering.lights import Lighting
from decals.rendering.options import Drawing, check_scene, drawing_of
from decals.rendering.viewpoint import Projection
from decals.scenes.objects import Box, SceneObject, as_crease_angle, bounds_of
from decals.scenes.origin import WORLD
from decals.scenes.scene import Scene
from decals.surfaces.normals import CREASE_ANGLE
from decals.surfaces.windings import MeshOrientation
from decals.validation import KnownAttributes, any_number, count_number, member
from decals.vtk.adapters import Lights, unsupported_modes, vtk_lighting, vtk_projection, weak_callback
from decals.vtk.extras import ACTORS
from decals.vtk.frame import FrameKey, FrameOptions, FrameRenderer, WindowContext
from decals.vtk.proxy_actor import ProxyActor, box_around
from decals.vtk.window_title import WindowTitle

MAX_SAMPLES = 16
"""Samples per pixel along each axis, at most: graphics cards have no larger targets for usual windows."""

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


def depth_of(matrix: Float64Array, position: ArrayLike) -> float:
    """Return the depth in the window, from 0 to 1, of a point; the matrix maps it to clip space."""
    clip = matrix @ np.append(np.asarray(position, np.float64), 1.0)
    return float(0.5 * clip[2] / clip[3] + 0.5)


def _pixel(x: float, y: float) -> tuple[int, int]:
    """Return the pixel that contains a position in the window, or raise `InvalidPoints`."""
    return math.floor(any_number("x", x, InvalidPoints)), math.floor(any_number("y", y, InvalidPoints))


def _writes_depth(prop: Any) -> bool:
    """Return True if a prop may write depth; text and translucent actors do not."""
    if not prop.GetVisibility() or prop.IsA("vtkActor2D"):
        return False
    return not (prop.IsA("vtkActor") and prop.HasTranslucentPolygonalGeometry())


PICKERS = (
    "pyvista's pickers find VTK's own actors only, not the objects of plotter.decals; "
    "call plotter.decals.enable_picking(callback) for these"
)

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


class _Substitution:
    """A scene that is drawn with other objects in place of its own."""

    def __init__(self, scene: SceneLike, objects: Sequence[object]) -> None:
        self._scene, self.objects = scene, tuple(objects)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._scene, name)


class SubplotRenderer(KnownAttributes):
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
    wait_for_gpu : bool
        If True, frames end when the graphics card has finished, so that they can be timed.
    keep_previous_frame : bool
        If True, the previous frame stays while shaders compile; see `warm`.
    walks_in_thread : bool
        If True, the mapping WALKED is drawn as CORRECTED while the walks of decals are computed in a thread.

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

    plotter: pv.BasePlotter
    vtk_renderer: pv.Renderer
    wait_for_gpu: bool
    keep_previous_frame: bool
    walks_in_thread: bool
    status: FrameStatus
    applied: Any

    def __init__(
        self, plotter: pv.BasePlotter, renderer: pv.Renderer, context: Callable[[], WindowContext]
    ) -> None:
        self.plotter, self.vtk_renderer = plotter, renderer
        self._samples, self._draw_scale = 2, 1.0
        self._settings: dict[str, Any] = {}
        self._lights = Lights.SCENE
        self.wait_for_gpu = self.keep_previous_frame = self.walks_in_thread = False
        self._walking = False
        self.status = FrameStatus.EMPTY
        self._scene: SceneLike | None = None
        self._substitution: _Substitution | None = None
        self._context = context
        self._frames: FrameRenderer | None = None
        self._failed: FrameKey | None = None
        self._drawn_size: Size | None = None
        self._proxy_actor = ProxyActor(renderer, weak_callback(self.draw))
        self._enclosed: tuple[object, ...] = ()
        self.applied = ACTORS["decals"](self)
        self._warned: set[str] = set()
        self._title = WindowTitle(plotter)
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
        self.applied.check_mapping(self._drawing_of(scene).mapping)
        self._scene, self._failed, self._substitution = scene, None, None
        if scene is None:
            self._proxy_actor.remove()
        self._enclose_objects(bounds_of)

    @property
    def drawn_objects(self) -> Sequence[object] | None:
        """Objects that are drawn in place of those of the scene, such as their meshes; None for its own.

        Picks go on to meet the objects of the scene.
        """
        return None if self._substitution is None else self._substitution.objects

    @drawn_objects.setter
    def drawn_objects(self, objects: Sequence[object] | None) -> None:
        scene, self._substitution = self._scene, None
        if scene is not None and objects is not None:
            self._substitution = _Substitution(scene, objects)

    @property
    def _drawn_scene(self) -> SceneLike | None:
        """The scene as it is drawn."""
        return self.scene if self._substitution is None or self.scene is None else self._substitution

    def _drop_cleared_scene(self) -> None:
        """Drop the scene if the proxy actor was removed, for example by ``plotter.clear()``."""
        if self._scene is not None and not self._proxy_actor.present:
            self._scene = None
            self.applied.clear()

    def _enclose_objects(self, box: Callable[[Sequence[SceneObject]], Box]) -> bool:
        """Give the proxy actor the bounds of the scene's objects; return True if there are others now."""
        if self._scene is None:
            return False
        # a window draws its document in the document's own coordinates, in which outlines and handles are
        self._proxy_actor.place(self._scene.origin if isinstance(self._scene, Scene) else WORLD)
        objects = tuple(self._scene.objects)
        if same_objects(objects, self._enclosed) and self._proxy_actor.present:
            return False
        self._enclosed = objects
        self._proxy_actor.enclose(box(cast(Sequence[SceneObject], objects)) if objects else None)
        return bool(objects)

    def apply(
        self,
        actor: Any,
        *,
        follow: bool = False,
        crease_angle: float = CREASE_ANGLE,
        labels: str | Iterable[str] | None = None,
        orientation: MeshOrientation | str = MeshOrientation.OUTWARD,
    ) -> None:
        """Show the decals on an actor of VTK; see `DecalsComponent.apply`."""
        names = None if labels is None else label_names("labels", labels, InvalidScene)
        angle = as_crease_angle(crease_angle)
        rule = member("orientation", orientation, MeshOrientation, InvalidScene)
        self.applied.apply(actor, follow=follow, crease_angle=angle, labels=names, orientation=rule)

    def remove(self, actor: Any) -> None:
        """Remove the decals from an actor; see `DecalsComponent.remove`."""
        self.applied.remove(actor)

    # -- settings, from the next frame on ---------------------------------------------------------------

    @property
    def draw_scale(self) -> float:
        """Size of the picture relative to the window, in (0, 1].

        Below 1, the picture has one sample per texel and is magnified.
        """
        return self._draw_scale

    @draw_scale.setter
    def draw_scale(self, scale: float) -> None:
        number = any_number("draw_scale", scale, InvalidScene)
        if not 0.0 < number <= 1.0:
            raise InvalidScene(f"draw_scale: expected a number above 0 and at most 1, got {number}")
        self._draw_scale = number

    @property
    def samples(self) -> int:
        """Samples per pixel along each axis; one in screenshots that VTK draws larger than the window."""
        return self._samples

    @samples.setter
    def samples(self, samples: int) -> None:
        self._samples = count_number("samples", samples, 1, MAX_SAMPLES, InvalidScene)

    @property
    def drawing(self) -> Drawing:
        """How the scene is drawn: as it says, with the modes that were set here in place of its own.

        A document that is edited takes over these modes, and can change them.
        """
        return self._drawing_of(self._scene)

    def _drawing_of(self, scene: SceneLike | None) -> Drawing:
        """Return how a scene would be drawn."""
        drawing = drawing_of(scene)
        return drawing if hasattr(scene, "draw_as") else replace(drawing, **self._settings)

    def _draw_with(self, name: str, value: Any) -> None:
        """Set a mode, also of an edited document, which saves it."""
        drawing = replace(self.drawing, **{name: value})
        draw_as = getattr(self._scene, "draw_as", None)
        if draw_as is not None:
            draw_as(drawing)
        self._settings[name] = getattr(drawing, name)

    @property
    def mapping(self) -> ImageMapping:
        """Image mapping; see `decals.ImageMapping`."""
        return self.drawing.mapping

    @mapping.setter
    def mapping(self, mapping: ImageMapping | str) -> None:
        mapping = member("mapping", mapping, ImageMapping, InvalidScene)
        self.applied.check_mapping(mapping)
        self._draw_with("mapping", mapping)

    @property
    def shown_mapping(self) -> ImageMapping:
        """Image mapping of a frame that is drawn now: CORRECTED while walks are computed in a thread."""
        mapping, scene = self.mapping, self._drawn_scene
        if mapping is not ImageMapping.WALKED or not self.walks_in_thread or scene is None:
            return mapping
        if self._frames is None or self._frames.renderer.walks_ready(scene):
            return mapping
        self._walking = True
        return ImageMapping.CORRECTED

    @property
    def walking(self) -> bool:
        """True while walks are computed in a thread, until `end_walking`."""
        return self._walking

    def end_walking(self) -> bool:
        """Return True once after the end of walks that were computed in a thread: another frame is due."""
        if not self._walking or self.shown_mapping is not self.mapping:
            return False
        self._walking = False
        return True

    @property
    def contact(self) -> AnyContact:
        """Contact mode; see `decals.Contact`."""
        return self.drawing.contact

    @contact.setter
    def contact(self, contact: AnyContact | str) -> None:
        self._draw_with("contact", contact)

    @property
    def stiffness(self) -> float:
        """Stiffness of elastic contact, from 1: how close to contact lines images are compressed."""
        return self.drawing.stiffness

    @stiffness.setter
    def stiffness(self, stiffness: float) -> None:
        self._draw_with("stiffness", stiffness)

    @property
    def environment(self) -> Environment | None:
        """Environment in place of the studio light; see `decals.rendering.Environment`."""
        return self.drawing.environment

    @environment.setter
    def environment(self, environment: Environment | AnyImage | None) -> None:
        self._draw_with("environment", environment)

    @property
    def lights(self) -> Lights:
        """Lights: the studio light, or the plotter's lights; see `Lights`."""
        return self._lights

    @lights.setter
    def lights(self, lights: Lights | str) -> None:
        self._lights = member("lights", lights, Lights, InvalidScene)

    # -- coordinates ------------------------------------------------------------------------------------

    def world_matrix(self) -> Float64Array:
        """Return the matrix from scene to world coordinates, (4, 4): the proxy actor's."""
        return self._proxy_actor.matrix()

    def viewpoint(self) -> Projection:
        """Return VTK's camera for the renderer."""
        return vtk_projection(self.vtk_renderer, self.world_matrix())

    def lighting(self) -> Lighting | None:
        """Return the lights for the renderer; None for the studio light."""
        if self.lights is Lights.VTK:
            return vtk_lighting(self.vtk_renderer, self.world_matrix())
        return self.drawing.lights

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
        column, row = _pixel(x, y)
        left, low = self.vtk_renderer.GetOrigin()
        width, height = self.vtk_renderer.GetSize()
        inside = 0 <= column - left < width and 0 <= row - low < height
        if self.scene is None or not inside:
            return None
        options = self._shown_drawing.at((width, height))
        with self.current():
            buffers = self.renderer.buffers_at(
                self.scene, column - left, row - low, options, viewpoint=self.viewpoint()
            )
        position = buffers.position[0, 0]
        if buffers.object_id[0, 0] < 0 or self.hidden(column, row, position):
            return None
        return PickResult(
            object_id=int(buffers.object_id[0, 0]),
            owner=int(buffers.owner[0, 0]),
            position=position,
            normal=buffers.normal[0, 0],
            uv=(float(buffers.uv[0, 0, 0]), float(buffers.uv[0, 0, 1])),
            field=float(buffers.field[0, 0]),
            depth=depth_of(self.viewpoint().matrix, position),
        )

    def covers(self, x: int, y: int) -> bool:
        """Return True if a pixel of the window is in this subplot."""
        coordinates = (any_number(name, value, InvalidPoints) for name, value in (("x", x), ("y", y)))
        column, row = (int(np.clip(value, -1.0, MAX_COORDINATE)) for value in coordinates)
        return bool(self.vtk_renderer.IsInViewport(column, row))

    def hidden(self, x: float, y: float, position: ArrayLike) -> bool:
        """Return True if an actor of VTK hid a surface point at a pixel of the last frame.

        VTK's depth is compared with the subplot's own: at a grazing angle, or in a coarse frame, that depth
        may be far in front of the point. Text has depth zero and hides nothing.
        """
        column, row = _pixel(x, y)
        if not self._others_write_depth(column, row):
            return False
        left, low = self.vtk_renderer.GetOrigin()
        own = self.depth_at(column - left, row - low)
        if own == 0.0:
            return False
        depth = float(self.vtk_renderer.GetZ(column, row))
        return 0.0 < depth < min(own, depth_of(self.viewpoint().matrix, position)) - DEPTH_TOLERANCE

    def _others_write_depth(self, x: int, y: int) -> bool:
        """Return True if other actors may have written depth at a pixel; reading depth stalls the card."""
        own = self.vtk_renderer
        others = (other for other in own.GetRenderWindow().GetRenderers() if other is not own)
        if any(other.GetDraw() and other.IsInViewport(x, y) for other in others):
            return True
        return any(prop is not self.actor and _writes_depth(prop) for prop in own.GetViewProps())

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
        scene = self._drawn_scene
        if scene is None or self._drawn_size is None:
            return 1.0
        options = self._frame_options(self._drawn_size, 1.0, samples)
        return self._current_frames().work_fraction(scene, options, self.viewpoint())

    def _begin_frame(self) -> None:
        if self.scene is not None:
            if self._enclose_objects(box_around):  # an edited document may change with every frame
                self._widen_clipping_range()
            self._warn_of_unsupported()
        if self.applied.injections:
            self.applied.begin_frame()

    def _widen_clipping_range(self) -> None:
        """Reset the camera's near and far planes if an edit has moved objects beyond them."""
        camera = self.vtk_renderer.camera
        sides = np.reshape(self._proxy_actor.actor.GetBounds(), (3, 2))
        corners = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 3)
        depths = (corners - camera.position) @ camera.GetDirectionOfProjection()
        near, far = camera.clipping_range
        if depths.min() < near or depths.max() > far:
            self.vtk_renderer.ResetCameraClippingRange()

    def _end_frame(self) -> None:
        if self.applied.injections:
            self.applied.end_frame()
        if self._frames is not None and not self._proxy_actor.visible:  # frames that are drawn do it
            with self._frames.context.current():
                self._frames.renderer.sweep()

    def _warn_of_unsupported(self) -> None:
        """Warn once of each mode of VTK and pyvista that the subplot does not support."""
        messages = unsupported_modes(self.vtk_renderer, self.lights)
        picking = getattr(getattr(self.plotter, "picking", None), "_picker_in_use", False)
        if picking and self._enclosed:
            messages = [*messages, PICKERS]
        if self.drawing.walked and self.applied.injections:  # an edited document has changed its own
            messages = [*messages, self.applied.refusal]
        for message in messages:
            if message not in self._warned:
                self._warned.add(message)
                warnings.warn(message, stacklevel=2)

    def draw(self) -> None:
        """Draw into the frame that VTK is drawing; the proxy actor calls it."""
        scene = self._drawn_scene
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
        with self._first_frame_reported(frames.is_warm(scene, options)):
            targets = frames.draw(scene, options, self.viewpoint(), wait=self.wait_for_gpu)
        frames.composite(window, viewport, targets)

    @contextmanager
    def _first_frame_reported(self, warm: bool) -> Iterator[None]:
        """Report the work of a frame that needs a warm-up, on a screen in the title of the window."""
        with ExitStack() as stack:
            if not warm:
                if self._title.visible:
                    stack.enter_context(displayed(self._title.show))
                stack.enter_context(reporting())("preparing the picture", 0.0)
            yield

    def _frame_options(self, size: Size, scale: float, samples: int) -> FrameOptions:
        """Return the options of a frame for a part of a window of some size."""
        if scale < 1.0:
            width, height = (max(1, round(scale * side)) for side in size)
            return FrameOptions(self._render_options((width, height), 1), magnified=True)
        supersampled = size[0] > self.vtk_renderer.GetSize()[0]
        return FrameOptions(self._render_options(size, 1 if supersampled else samples))

    @property
    def _shown_drawing(self) -> Drawing:
        return replace(self.drawing, mapping=self.shown_mapping)

    def _render_options(self, size: Size, samples: int) -> RenderOptions:
        return replace(self._shown_drawing, samples=samples, lights=self.lighting()).at(size)

    def prepare(self, samples: int, seconds: float) -> float | None:
        """Draw a slice of a later frame of the window's size, without showing it.

        Once it is complete, frames with a `draw_scale` of 1 and these samples show it. Any change starts it
        again. Nothing is drawn while the proxy actor is hidden.

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
        scene = self._drawn_scene
        if scene is None or self._drawn_size is None or not self._proxy_actor.visible:
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
        scene = self._drawn_scene
        self.status = FrameStatus.DRAWN
        if scene is None or self._drawn_size is None or not self._proxy_actor.visible:
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
