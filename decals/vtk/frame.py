"""What a stage has in its window's context: the renderer, and the last frame that it drew."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any, Self

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render import Renderer, SceneLike, Size
from decals.render.beside import Beside
from decals.render.drawing import Drawing
from decals.render.lamps import Lamps
from decals.render.modes import Modes
from decals.render.pieces import Ahead
from decals.render.shown import Shown, same, version_of
from decals.render.targets import Targets
from decals.render.tile import CameraBuffer
from decals.scenes.viewpoint import Projection
from decals.vtk.composite import Composite
from decals.vtk.context import WindowContext
from decals.vtk.picking import texels_of

SPARE_SLOT = "spare"
"""Where a frame is drawn for the first time while its own targets hold what is shown."""


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
        self._given_samples = 0
        self._ready: set[Hashable] = set()
        self._beside: dict[Hashable, Beside] = {}
        self._coming: tuple[Seen, Drawing] | None = None
        with context.current():
            self.renderer = Renderer(context)
            self._composite = Composite(context)
            self.camera = CameraBuffer(context)

    def draw(self, scene: SceneLike, look: Look, viewpoint: Projection, *, wait: bool) -> Targets:
        """Draw a scene into the renderer's own targets; ``wait`` until the card has finished."""
        drawing = self._drawing(scene, look, viewpoint, look.slot)
        with self.context.current():
            drawing.complete()
            self.renderer.sweep()
            if wait and drawing.share:
                self.context.gl.finish()
        self.share = drawing.share
        if self.share:
            self._ready.add(self._ahead(scene, look).key)
        return drawing.targets

    def prepare(self, scene: SceneLike, look: Look, viewpoint: Projection, seconds: float) -> float | None:
        """Draw for about so long on a frame that is to come; once it is done, `draw` has nothing to do.

        Whatever changes meanwhile, it begins anew. What is shown stays. Gives the seconds that a whole frame
        has taken, none where some of it was there already; None while it is not done.
        """
        seen = Seen.of(scene, look, viewpoint)
        drawing = self._coming_of(seen, scene, look, viewpoint, look.slot)
        if drawing.left():
            with self.context.current():
                if not drawing.advance(seconds):
                    return None
        self._coming = None
        self._ready.add(self._ahead(scene, look).key)
        return drawing.seconds if drawing.share == 1.0 else 0.0

    def ready(self, scene: SceneLike, look: Look) -> bool:
        """Whether a frame needs nothing, such as a program, that takes long for the first time."""
        return self._ahead(scene, look).key in self._ready

    def warm(self, scene: SceneLike, look: Look, viewpoint: Projection, seconds: float) -> str | None:
        """Make for about so long what such a frame needs, and draw it once; what is shown stays.

        Says how far it is; None once the frame is `ready`.
        """
        ahead = self._ahead(scene, look)
        if ahead.key not in self._beside:
            self._beside[ahead.key] = Beside(ahead.pieces)
        if not self._beside[ahead.key].done(seconds):
            return self._beside[ahead.key].news
        seen = Seen.of(scene, look, viewpoint)
        free = self._held is None or self._held is not self.renderer.targets_of(look.slot)
        drawing = self._coming_of(seen, scene, look, viewpoint, look.slot if free else SPARE_SLOT)
        with self.context.current():
            if not drawing.advance(seconds):
                return drawing.news
        self._coming = None
        self._ready.add(ahead.key)
        return None

    def _coming_of(
        self, seen: Seen, scene: SceneLike, look: Look, viewpoint: Projection, slot: str
    ) -> Drawing:
        """Give the drawing that goes on, or another where something changed since."""
        if self._coming is None or not seen.same(self._coming[0]):
            self._coming = seen, self._drawing(scene, look, viewpoint, slot)
        return self._coming[1]

    def _ahead(self, scene: SceneLike, look: Look) -> Ahead:
        return self.renderer.ahead(scene, Modes(look.mapping, look.contact, look.lamps))

    def share_of(self, scene: SceneLike, look: Look, viewpoint: Projection) -> float:
        """Part of a whole frame's work, 0 to 1, that a frame would take now."""
        return self._drawing(scene, look, viewpoint, look.slot).left()

    def _drawing(self, scene: SceneLike, look: Look, viewpoint: Projection, slot: str) -> Drawing:
        return self.renderer.drawing(
            scene,
            size=look.size,
            samples=look.samples,
            mapping=look.mapping,
            contact=look.contact,
            viewpoint=viewpoint,
            lamps=look.lamps,
            slot=slot,
        )

    def nearest(self, x: int, y: int, size: Size) -> float:
        """Least depth put into VTK's frame, of this size, at a pixel: 1 for nothing, 0 for not known."""
        held = self._held
        if held is None:
            return 0.0
        magnified = self._given_samples == 0
        with self.context.current():
            return held.gbuffer.read_depth(texels_of(x, y, size, held.gbuffer.size, magnified=magnified))

    @property
    def _held(self) -> Targets | None:
        """What was put into VTK's frame last, if nothing else was drawn there since."""
        if self._given is None or self._given_shown is None or self._given.shown is not self._given_shown:
            return None
        return self._given

    def composite(
        self, window: Any, viewport: tuple[int, int, int, int], targets: Targets, samples: int
    ) -> None:
        """Put what was drawn into VTK's frame; see `Composite.draw`."""
        self._given, self._given_shown, self._given_samples = targets, targets.shown, samples
        self._composite.draw(window, viewport, targets, samples)

    def again(self, window: Any, viewport: tuple[int, int, int, int]) -> None:
        """Put into VTK's frame what was there before, as far as it is still there."""
        self.share, held = 0.0, self._held
        if held is not None:
            self._composite.draw(window, viewport, held, self._given_samples)

    def release(self) -> None:
        """Give everything back."""
        self._given = self._given_shown = self._coming = None
        for beside in self._beside.values():
            beside.end()
        with self.context.current():
            self.renderer.release()
            self._composite.release()
            self.camera.release()
