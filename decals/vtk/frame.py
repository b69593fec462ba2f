"""What a stage has in its window's context: the renderer, and the last frame that it drew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.grid.editor import DecalEditor
from decals.render import Renderer, SceneLike, Size
from decals.render.targets import Targets
from decals.render.tile import CameraBuffer
from decals.scenes.viewpoint import Projection
from decals.vtk.composite import Composite
from decals.vtk.context import WindowContext
from decals.vtk.picking import texels_of


@dataclass(frozen=True)
class Look:
    """How a frame is drawn: size in pixels, samples a pixel along each axis, modes."""

    size: Size
    samples: int
    mapping: Mapping
    contact: Contact


class Frame:
    """Draws frames; one in which nothing changed since the last is not drawn again.

    Parameters
    ----------
    context
        The window's.

    Attributes
    ----------
    drawn
        Whether the last call of `draw` drew.
    camera
        The block from which VTK's shaders read the camera, where they show our decals.
    """

    def __init__(self, context: WindowContext) -> None:
        self.context = context
        self.drawn = False
        self._shown: tuple[object, ...] = ()
        self._values: tuple[object, ...] = ()
        self._targets: Targets | None = None
        self._magnified = False
        with context.current():
            self.renderer = Renderer(context)
            self._composite = Composite(context)
            self.camera = CameraBuffer(context)

    def draw(self, scene: SceneLike, look: Look, viewpoint: Projection, *, wait: bool) -> Targets:
        """Draw a scene into the renderer's own targets; ``wait`` until the card has finished."""
        shown = _shown(scene)
        version = scene.decals.version if isinstance(scene.decals, DecalEditor) else 0
        values = (look, viewpoint.matrix.tobytes(), version)
        same = len(shown) == len(self._shown) and all(a is b for a, b in zip(shown, self._shown, strict=True))
        if same and values == self._values and self._targets is not None and self._targets.picture is self:
            self.drawn = False
            return self._targets
        with self.context.current():
            self._targets = self.renderer.draw(
                scene,
                size=look.size,
                samples=look.samples,
                mapping=look.mapping,
                contact=look.contact,
                viewpoint=viewpoint,
            )
            if wait:
                self.context.gl.finish()
        self._targets.picture = self
        self._shown, self._values, self.drawn = shown, values, True
        return self._targets

    def nearest(self, x: int, y: int, size: Size) -> float:
        """Least depth that was drawn at a pixel of a frame of this size: 1 for nothing, 0 for not known."""
        if self._targets is None or self._targets.picture is not self:
            return 0.0
        with self.context.current():
            gbuffer = self._targets.gbuffer
            return gbuffer.read_depth(texels_of(x, y, size, gbuffer.size, magnified=self._magnified))

    def composite(
        self, window: Any, viewport: tuple[int, int, int, int], targets: Targets, samples: int
    ) -> None:
        """Put what was drawn into VTK's frame; see `Composite.draw`."""
        self._magnified = samples == 0
        self._composite.draw(window, viewport, targets, samples)

    def release(self) -> None:
        """Give everything back."""
        self._targets = None
        self._shown = ()
        with self.context.current():
            self.renderer.release()
            self._composite.release()
            self.camera.release()


def _shown(scene: SceneLike) -> tuple[object, ...]:
    """The values, frozen but for an editor's, that a picture of a scene depends on."""
    return (*scene.objects, scene.decals, *(image.pixels for image in scene.images))
