"""The textures that all passes draw into."""

from collections.abc import Iterator
from typing import Any

from decals.rendering.context import DEPTH, Context
from decals.rendering.decal_pass import DecalPass
from decals.rendering.dirty_regions import TargetState, same_objects
from decals.rendering.drawable import has_rest_pose
from decals.rendering.effect import BUFFERS
from decals.rendering.gbuffer import GBuffer
from decals.rendering.light_pass import LightPass, ResolvePass, ShownPixels
from decals.rendering.options import Size
from decals.rendering.uploads import UploadedScene

TEXTURE_KINDS = ("f4", "f4", "f2", DEPTH, "f2", "f2")
"""Kinds of the textures of targets without buffers."""


class Targets:
    """The targets of all passes, for tiles up to a size.

    Attributes
    ----------
    state
        Everything that the picture in the targets depends on; None while it is incomplete.
    frame
        The frame that is being drawn; None if it is complete.
    shown
        The pixels of a frame that stays on the card; None before the first.
    """

    def __init__(self, context: Context, size: Size, *, buffers: bool) -> None:
        self.buffers = buffers
        self.state: TargetState | None = None
        self.frame: object = None
        self.gbuffer = GBuffer(context, size)
        self._context = context
        self._rest: Any = None
        self.decal_pass = DecalPass(context, size, buffers=buffers)
        self.light_pass = LightPass(context, size)
        self.shown: ShownPixels | None = None
        self._resolve: ResolvePass | None = None

    @property
    def resolve(self) -> ResolvePass:
        """What reads the pixels."""
        if self._resolve is None:
            self._resolve = ResolvePass(self._context, self.gbuffer.size)
        return self._resolve

    def shown_for(self, samples: int) -> ShownPixels:
        """Return the pixels of frames with so many samples along each axis; others are released."""
        if self.shown is None or self.shown.samples != samples:
            if self.shown is not None:
                self.shown.release()
            self.shown = ShownPixels(self._context, self.gbuffer.size, samples)
        return self.shown

    def rest_for(self, uploaded: UploadedScene) -> Any:
        """Return the rest buffer if some objects are posed, or moved by heights, else None."""
        drawables = uploaded.drawables
        if not any(map(has_rest_pose, drawables)) and not any(map(uploaded.moves, drawables)):
            return None
        if self._rest is None:
            self._rest = BUFFERS["rest"](self._context, self.gbuffer)
        return self._rest

    def release(self) -> None:
        """Release the memory."""
        self.state = self.frame = None
        parts = self._rest, self.gbuffer, self.decal_pass, self.light_pass, self.shown, self._resolve
        for part in parts:
            if part is not None:
                part.release()


WHOLE_SLOT, BUFFERS_SLOT = "whole", "buffers"
"""Slots of pictures that are drawn at once, and of pictures with buffers."""


class TargetPool:
    """The targets of a renderer, by slot: each keeps its targets while its pictures have the same size."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._targets: dict[str, Targets] = {}

    def get(self, slot: str) -> Targets | None:
        """Return the targets of a slot's last picture; None before the first."""
        return self._targets.get(slot)

    def of(self, slot: str, size: Size) -> Targets:
        """Return targets of a size; those of the slot's last picture if they have it."""
        targets = self._targets.get(slot)
        if targets is None or targets.gbuffer.size != size:
            if targets is not None:
                targets.release()
            targets = self._targets[slot] = Targets(self._context, size, buffers=slot == BUFFERS_SLOT)
        return targets

    def make(self, slot: str, size: Size) -> Iterator[Targets | None]:
        """Yield None after each new texture, for memory is allocated slowly, and targets of a size last."""
        targets = self._targets.get(slot)
        if targets is None or targets.gbuffer.size != size:
            if targets is not None:
                self._targets.pop(slot).release()
            self._context.clear_spare_textures()
            for kind in TEXTURE_KINDS:
                self._context.prepare_texture(size, kind)
                yield None
        yield self.of(slot, size)

    def forget(self) -> None:
        """Draw the next pictures from the beginning."""
        for targets in self._targets.values():
            targets.state = None

    def forget_others(self, shown: Targets) -> None:
        """Forget the pictures of other objects than the shown ones; the next frames reuse nothing of them."""
        for targets in self._targets.values():
            if targets.state and shown.state and not same_objects(targets.state.objects, shown.state.objects):
                targets.state = None

    def release(self, *slots: str) -> None:
        """Release the memory of slots, by default of all."""
        for slot in slots or (*self._targets,):
            if slot in self._targets:
                self._targets.pop(slot).release()
