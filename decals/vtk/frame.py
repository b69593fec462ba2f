"""What a stage has in its window's context: the renderer, and the last frame that it drew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render import Renderer, SceneLike, Size
from decals.render.drawing import Drawing
from decals.render.lamps import Lamps
from decals.render.shown import Shown, same, version_of
from decals.render.targets import Targets
from decals.render.tile import CameraBuffer
from decals.scenes.viewpoint import Projection
from decals.vtk.composite import Composite
from decals.vtk.context import WindowContext
from decals.vtk.picking import texels_of


@dataclass(frozen=True)
class Look:
    """How a frame is drawn: size, samples a pixel along each axis, modes, VTK's lamps, whether magnified."""

    size: Size
    samples: int
    mapping: Mapping
    contact: Contact
    lamps: Lamps | None
    magnified: bool = False

    @property
    def slot(self) -> str:
        """Which targets it is drawn into: small frames, and first ones of one sample, leave fine ones be."""
        return "small" if self.magnified else "one sample" if self.samples == 1 else "several"


@dataclass(frozen=True, eq=False)
class Seen:
    """All that a picture depends on: things that are told apart by identity, and values."""

    things: tuple[object, ...]
    values: tuple[object, ...]

    @classmethod
    def of(cls, scene: SceneLike, look: Look, viewpoint: Projection) -> Self:
        """What a picture of a scene depends on; of that an editor alone changes, and counts its versions."""
        things = (*scene.objects, scene.decals, *(image.pixels for image in scene.images))
        return cls(things, (look, viewpoint.matrix.tobytes(), version_of(scene)))

    @classmethod
    def tried(cls, scene: SceneLike, *how: object) -> Self:
        """What it depends on whether a scene can be drawn at all, not how it is seen and lit."""
        return cls((scene, scene.objects, scene.images, scene.decals), (*how, version_of(scene)))

    def same(self, other: Seen | None) -> bool:
        """Whether two pictures are the same."""
        return other is not None and self.values == other.values and same(self.things, other.things)


class Frame:
    """Draws frames; what did not change since the last one of the same look is not drawn again.

    Parameters
    ----------
    context
        The window's.

    Attributes
    ----------
    share
        Part of a whole frame's work, 0 to 1, that the last call of `draw` had to do.
    camera
        The block from which VTK's shaders read the camera, where they show our decals.
    """

    def __init__(self, context: WindowContext) -> None:
        self.context = context
        self.share = 0.0
        self._given: Targets | None = None
        self._given_shown: Shown | None = None
        self._magnified = False
        self._coming: tuple[Seen, Drawing] | None = None
        with context.current():
            self.renderer = Renderer(context)
            self._composite = Composite(context)
            self.camera = CameraBuffer(context)

    def draw(self, scene: SceneLike, look: Look, viewpoint: Projection, *, wait: bool) -> Targets:
        """Draw a scene into the renderer's own targets; ``wait`` until the card has finished."""
        drawing = self._drawing(scene, look, viewpoint)
        self.share = drawing.share
        if self.share:
            with self.context.current():
                drawing.complete()
                self.renderer.sweep()
                if wait:
                    self.context.gl.finish()
        return drawing.targets

    def prepare(self, scene: SceneLike, look: Look, viewpoint: Projection, seconds: float) -> float | None:
        """Draw for about so long on a frame that is to come; once it is done, `draw` has nothing to do.

        Whatever changes meanwhile, it begins anew. What is shown stays. Gives the seconds that a whole frame
        has taken, none where some of it was there already; None while it is not done.
        """
        seen = Seen.of(scene, look, viewpoint)
        if self._coming is None or not seen.same(self._coming[0]):
            self._coming = seen, self._drawing(scene, look, viewpoint)
        drawing = self._coming[1]
        if drawing.share:
            with self.context.current():
                if not drawing.advance(seconds):
                    return None
        self._coming = None
        return drawing.seconds if drawing.share == 1.0 else 0.0

    def share_of(self, scene: SceneLike, look: Look, viewpoint: Projection) -> float:
        """Part of a whole frame's work, 0 to 1, that a frame would take now."""
        return self._drawing(scene, look, viewpoint).share

    def _drawing(self, scene: SceneLike, look: Look, viewpoint: Projection) -> Drawing:
        return self.renderer.drawing(
            scene,
            size=look.size,
            samples=look.samples,
            mapping=look.mapping,
            contact=look.contact,
            viewpoint=viewpoint,
            lamps=look.lamps,
            slot=look.slot,
        )

    def nearest(self, x: int, y: int, size: Size) -> float:
        """Least depth put into VTK's frame, of this size, at a pixel: 1 for nothing, 0 for not known."""
        if self._given is None or self._given_shown is None or self._given.shown is not self._given_shown:
            return 0.0
        with self.context.current():
            gbuffer = self._given.gbuffer
            return gbuffer.read_depth(texels_of(x, y, size, gbuffer.size, magnified=self._magnified))

    def composite(
        self, window: Any, viewport: tuple[int, int, int, int], targets: Targets, samples: int
    ) -> None:
        """Put what was drawn into VTK's frame; see `Composite.draw`."""
        self._given, self._given_shown, self._magnified = targets, targets.shown, samples == 0
        self._composite.draw(window, viewport, targets, samples)

    def release(self) -> None:
        """Give everything back."""
        self._given = self._given_shown = self._coming = None
        with self.context.current():
            self.renderer.release()
            self._composite.release()
            self.camera.release()
