"""Our renderer in one of pyvista's renderers: a plotter's window, or one of its subplots."""

from __future__ import annotations

import time
import warnings
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkCommand

from decals.errors import InvalidScene
from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render import Renderer, SceneLike
from decals.scenes.scene import Box, SceneObject, bounds_of
from decals.scenes.viewpoint import Floats, Projection
from decals.vtk.anchor import Anchor
from decals.vtk.boxes import box_around
from decals.vtk.camera import vtk_projection
from decals.vtk.context import WindowContext
from decals.vtk.frame import Frame, Look
from decals.vtk.injection import Injection
from decals.vtk.modes import complaints

INJECTED_TEXTURES = 5
"""Images, records and the three arrays of the index."""


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
        Depth in the window, from 0 to 1: larger than that of VTK's depth buffer where an actor lies in front.
    """

    object_id: int
    owner: int
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    uv: tuple[float, float]
    field: float
    depth: float


class Stage:
    """Draws a scene among the actors of one of pyvista's renderers.

    Everything may be changed at any time; the plotter's next ``render()`` shows it.

    Parameters
    ----------
    plotter
        The plotter that the renderer belongs to.
    renderer
        One of ``plotter.renderers``.
    context
        Gives the window's context, the same one for all its renderers, while VTK's is current.

    Attributes
    ----------
    frame_seconds
        How long our part of the last frame took; with ``measure``, until the card had finished.
    measure
        Whether to wait for the card, so as to know.
    drawing
        Whether VTK is drawing a frame of the renderer now.
    """

    def __init__(
        self, plotter: pv.BasePlotter, renderer: pv.Renderer, context: Callable[[], WindowContext]
    ) -> None:
        self.plotter, self.vtk_renderer = plotter, renderer
        self._samples, self._draw_scale = 2, 1.0
        self._mapping, self._contact = Mapping.CORRECTED, Contact.PAPER
        self.frame_seconds, self.measure = 0.0, False
        self.drawing = False
        self._scene: SceneLike | None = None
        self._context = context
        self._frame: Frame | None = None
        self._failed: object = None
        me = weakref.ref(self)
        self._anchor = Anchor(renderer, lambda: _draw(me))
        self._placed: tuple[object, ...] = ()
        self._injections: list[Injection] = []
        self._units: list[int] = []
        self._said: set[str] = set()
        self._tags = [
            renderer.AddObserver(vtkCommand.StartEvent, lambda *_: _prepare(me)),
            renderer.AddObserver(vtkCommand.EndEvent, lambda *_: _finish(me)),
        ]

    @property
    def scene(self) -> SceneLike | None:
        """What is shown; its camera is not asked, the plotter's is."""
        return self._scene

    @scene.setter
    def scene(self, scene: SceneLike | None) -> None:
        self._scene = scene
        self._failed = None
        if not self._anchor.there:
            self._placed = ()
        self._follow_objects(bounds_of)

    def _follow_objects(self, box: Callable[[Sequence[SceneObject]], Box]) -> None:
        """Stand around the scene's objects, if they are not those of before."""
        objects = () if self._scene is None else tuple(self._scene.objects)
        if len(objects) == len(self._placed) and all(
            a is b for a, b in zip(objects, self._placed, strict=True)
        ):
            return
        self._placed = objects
        if objects:
            self._anchor.place(box(cast(Sequence[SceneObject], objects)))
        else:
            self._anchor.leave()

    @property
    def draw_scale(self) -> float:
        """Size of what is drawn relative to the window's.

        Below 1, one sample a texel is drawn and magnified: for the time that things move.
        """
        return self._draw_scale

    @draw_scale.setter
    def draw_scale(self, scale: float) -> None:
        if not 0.0 < scale <= 1.0:
            raise InvalidScene(f"draw_scale must be above 0 and at most 1, got {scale}")
        self._draw_scale = float(scale)

    @property
    def samples(self) -> int:
        """Samples a pixel along each axis; where VTK itself draws larger than the window, one."""
        return self._samples

    @samples.setter
    def samples(self, samples: int) -> None:
        if not isinstance(samples, int | np.integer) or samples < 1:
            raise InvalidScene(f"samples must be a whole number from 1; got {samples!r}")
        self._samples = int(samples)

    @property
    def mapping(self) -> Mapping:
        """How images lie on curved surface; as for `decals.render.Renderer.render`."""
        return self._mapping

    @mapping.setter
    def mapping(self, mapping: Mapping) -> None:
        try:
            self._mapping = Mapping(mapping)
        except ValueError as error:
            names = ", ".join(f"Mapping.{one.name}" for one in Mapping)
            raise InvalidScene(f"mapping must be one of {names}; got {mapping!r}") from error

    @property
    def contact(self) -> Contact:
        """How decals push each other; as for `decals.render.Renderer.render`."""
        return self._contact

    @contact.setter
    def contact(self, contact: Contact) -> None:
        try:
            self._contact = Contact(contact)
        except ValueError as error:
            names = ", ".join(f"Contact.{one.name}" for one in Contact)
            raise InvalidScene(f"contact must be one of {names}; got {contact!r}") from error

    def apply(self, actor: Any, *, follow: bool = False) -> None:
        """Put the scene's decals into VTK's own shader of an actor; see `Component.apply`."""
        self.remove(actor)
        self._injections.append(Injection(self, actor, follow=follow))

    def remove(self, actor: Any) -> None:
        """Take the decals off an actor; nothing happens if it had none."""
        for injection in [item for item in self._injections if item.actor is actor]:
            injection.release()
            self._injections.remove(injection)

    def texture_units(self) -> list[int]:
        """Texture units that are ours until the end of this frame, as many as an injected shader reads."""
        manager = self.vtk_renderer.GetRenderWindow().GetTextureUnitManager()
        if not self._units:
            self._units = [manager.Allocate() for _ in range(INJECTED_TEXTURES)]
        return self._units

    def _finish(self) -> None:
        manager = self.vtk_renderer.GetRenderWindow().GetTextureUnitManager()
        for unit in self._units:
            manager.Free(unit)
        self._units = []
        self.drawing = False
        for injection in self._injections:
            injection.finish()

    def _prepare(self) -> None:
        self.drawing = True
        self._follow_objects(box_around)  # what changes in place may do so with every frame
        if self._scene is not None:
            for complaint in complaints(self.vtk_renderer):
                if complaint not in self._said:
                    self._said.add(complaint)
                    warnings.warn(complaint, stacklevel=2)
        if self._injections:
            with self.current():
                for injection in self._injections:
                    injection.prepare()

    @property
    def renderer(self) -> Renderer:
        """The renderer in the window's context; use it inside ``with stage.current():``."""
        return self._use_frame().renderer

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the window's context current, and keep VTK's state, within a ``with`` block."""
        with self._use_frame().context.current():
            yield

    def viewpoint(self) -> Projection:
        """VTK's camera, as the renderer sees it."""
        return vtk_projection(self.vtk_renderer, self.frame())

    @property
    def drawn(self) -> bool:
        """Whether the last frame was drawn; where nothing had changed, the one before was shown again."""
        return self._frame is not None and self._frame.drawn

    def frame(self) -> Floats:
        """The scene's coordinates to the world's: identity, unless somebody moved or scaled the whole."""
        return self._anchor.matrix()

    def viewport(self) -> tuple[int, int, int, int]:
        """Lower left corner and size of the part of the frame that VTK draws to now, in pixels."""
        return self._use_frame().context.viewport()

    def at(self, x: int, y: int) -> Hit | None:
        """Say what lies at a place in the window, in pixels from its lower left corner; None for nothing.

        That one pixel is drawn for it, at full resolution. Actors that lie in front do not count.

        Raises
        ------
        NoGraphics
            The window has not been rendered yet.
        """
        left, low = self.vtk_renderer.GetOrigin()
        width, height = self.vtk_renderer.GetSize()
        x, y = x - left, y - low
        if self._scene is None or not (0 <= x < width and 0 <= y < height):
            return None
        viewpoint = self.viewpoint()
        with self.current():
            found = self.renderer.buffers_at(
                self._scene,
                x,
                y,
                size=(width, height),
                mapping=self.mapping,
                contact=self.contact,
                viewpoint=viewpoint,
            )
        if found.object_id[0, 0] < 0:
            return None
        position = found.position[0, 0]
        clip = viewpoint.matrix @ np.append(position.astype(np.float64), 1.0)
        return Hit(
            object_id=int(found.object_id[0, 0]),
            owner=int(found.owner[0, 0]),
            position=position,
            normal=found.normal[0, 0],
            uv=(float(found.uv[0, 0, 0]), float(found.uv[0, 0, 1])),
            field=float(found.field[0, 0]),
            depth=float(0.5 * clip[2] / clip[3] + 0.5),
        )

    def draw(self) -> None:
        """Draw into the frame that VTK is drawing; called by the anchor."""
        scene = self._scene
        if scene is None or self.vtk_renderer.GetSelector() is not None or self._failed is scene:
            return
        begin = time.perf_counter()
        try:
            self._draw(scene)
        except Exception:
            self._failed = scene  # say it once, not with every frame
            raise
        self.frame_seconds = time.perf_counter() - begin

    def _draw(self, scene: SceneLike) -> None:
        frame = self._use_frame()
        viewport = frame.context.viewport()
        size, samples = self._drawn_size(viewport[2:])
        look = Look(size, max(samples, 1), self.mapping, self.contact)
        targets = frame.draw(scene, look, self.viewpoint(), wait=self.measure)
        frame.composite(self.vtk_renderer.GetRenderWindow(), viewport, targets, samples)

    def _drawn_size(self, viewport: tuple[int, int]) -> tuple[tuple[int, int], int]:
        """Size in pixels and samples of what is drawn; 0 samples where it is to be magnified."""
        if self.draw_scale < 1.0:
            width, height = (max(1, round(self.draw_scale * side)) for side in viewport)
            return (width, height), 0
        supersampled = viewport[0] > self.vtk_renderer.GetSize()[0]
        return viewport, 1 if supersampled else self.samples

    def _use_frame(self) -> Frame:
        """Give what draws; made anew where the window has another context than before."""
        if self._frame is None or self._frame.context.stale:
            self._frame = Frame(self._context())
        return self._frame

    def release(self) -> None:
        """Leave the renderer and give everything back; the window must still be there. Twice is harmless."""
        self._anchor.release()
        for tag in self._tags:
            self.vtk_renderer.RemoveObserver(tag)
        if self._frame is not None and not self._frame.context.stale:
            with self.current():
                for injection in self._injections:
                    injection.release()
        self._injections.clear()
        if self._frame is not None and not self._frame.context.stale:
            self._frame.release()
        self._frame = None
        self._scene = None


def _prepare(stage: weakref.ref[Stage]) -> None:
    """Let a stage prepare a frame, if it still exists."""
    alive = stage()
    if alive is not None:
        alive._prepare()


def _finish(stage: weakref.ref[Stage]) -> None:
    """Let a stage end a frame, if it still exists."""
    alive = stage()
    if alive is not None:
        alive._finish()


def _draw(stage: weakref.ref[Stage]) -> None:
    """Let a stage draw, if it still exists: VTK must not keep it alive."""
    alive = stage()
    if alive is not None:
        alive.draw()
