"""What a stage has in its window's context: the renderer, and the last frame that it drew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.grid.editor import DecalEditor
from decals.render import Renderer, SceneLike, Size
from decals.render.drawing import Drawing
from decals.render.lamps import Lamps
from decals.render.renderer import WHOLE_SLOT
from decals.render.targets import Targets
from decals.render.tile import CameraBuffer
from decals.scenes.viewpoint import Projection
from decals.vtk.composite import Composite
from decals.vtk.context import WindowContext
from decals.vtk.picking import texels_of


@dataclass(frozen=True)
class Look:
    """How a frame is drawn: size in pixels, samples a pixel along each axis, modes, lamps of VTK's."""

    size: Size
    samples: int
    mapping: Mapping
    contact: Contact
    lamps: Lamps | None


@dataclass(frozen=True, eq=False)
class Seen:
    """All that a picture depends on: things that are told apart by identity, and values."""

    things: tuple[object, ...]
    values: tuple[object, ...]

    @classmethod
    def of(cls, scene: SceneLike, look: Look, viewpoint: Projection) -> Self:
        """What a picture of a scene depends on; of that an editor alone changes, and counts its versions."""
        things = (*scene.objects, scene.decals, *(image.pixels for image in scene.images))
        return cls(things, (look, viewpoint.matrix.tobytes(), _version(scene)))

    @classmethod
    def tried(cls, scene: SceneLike, *how: object) -> Self:
        """What it depends on whether a scene can be drawn at all, not how it is seen and lit."""
        return cls((scene, scene.objects, scene.images, scene.decals), (*how, _version(scene)))

    def same(self, other: Seen | None) -> bool:
        """Whether two pictures are the same."""
        return (
            other is not None
            and self.values == other.values
            and len(self.things) == len(other.things)
            and all(a is b for a, b in zip(self.things, other.things, strict=True))
        )


def _version(scene: SceneLike) -> int:
    """Which of a scene's decals: an editor counts; others stay as they are."""
    return scene.decals.version if isinstance(scene.decals, DecalEditor) else 0


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
        self._shown: Seen | None = None
        self._targets: Targets | None = None
        self._given: Targets | None = None
        self._magnified = False
        self._coming: tuple[Seen, Drawing] | None = None
        with context.current():
            self.renderer = Renderer(context)
            self._composite = Composite(context)
            self.camera = CameraBuffer(context)

    def draw(self, scene: SceneLike, look: Look, viewpoint: Projection, *, wait: bool) -> Targets:
        """Draw a scene into the renderer's own targets; ``wait`` until the card has finished."""
        seen = Seen.of(scene, look, viewpoint)
        if self._targets is not None and self._shows(seen):
            self.drawn = False
            return self._targets
        with self.context.current():
            drawing = self._drawing(scene, look, viewpoint, WHOLE_SLOT)
            drawing.complete()
            self.renderer.sweep()
            if wait:
                self.context.gl.finish()
        self._show(seen, drawing)
        self.drawn = True
        return drawing.targets

    def prepare(self, scene: SceneLike, look: Look, viewpoint: Projection, seconds: float) -> float | None:
        """Draw for about so long on a frame that is to come; once it is done, `draw` has nothing to do.

        Whatever changes meanwhile, it begins anew. What is shown stays. Gives the seconds that the frame has
        taken, none where it is shown already; None while it is not done.
        """
        seen = Seen.of(scene, look, viewpoint)
        if self._shows(seen):
            return 0.0
        with self.context.current():
            if self._coming is None or not seen.same(self._coming[0]):
                self._coming = seen, self._drawing(scene, look, viewpoint, f"samples {look.samples}")
            drawing = self._coming[1]
            if not drawing.advance(seconds):
                return None
        self._coming = None
        self._show(seen, drawing)
        return drawing.seconds

    def _shows(self, seen: Seen) -> bool:
        return seen.same(self._shown) and self._targets is not None and self._targets.picture is self

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

    def _show(self, seen: Seen, drawing: Drawing) -> None:
        self._shown, self._targets = seen, drawing.targets
        drawing.targets.picture = self

    def nearest(self, x: int, y: int, size: Size) -> float:
        """Least depth put into VTK's frame, of this size, at a pixel: 1 for nothing, 0 for not known."""
        if self._given is None or self._given.picture is not self:
            return 0.0
        with self.context.current():
            gbuffer = self._given.gbuffer
            return gbuffer.read_depth(texels_of(x, y, size, gbuffer.size, magnified=self._magnified))

    def composite(
        self, window: Any, viewport: tuple[int, int, int, int], targets: Targets, samples: int
    ) -> None:
        """Put what was drawn into VTK's frame; see `Composite.draw`."""
        self._given, self._magnified = targets, samples == 0
        self._composite.draw(window, viewport, targets, samples)

    def release(self) -> None:
        """Give everything back."""
        self._shown = self._targets = self._given = self._coming = None
        with self.context.current():
            self.renderer.release()
            self._composite.release()
            self.camera.release()
