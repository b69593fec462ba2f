"""What one tile is drawn into."""

from decals.render.context import DEPTH, Context
from decals.render.decal_pass import DecalPass
from decals.render.gbuffer import GBuffer
from decals.render.light_pass import LightPass
from decals.render.resolve import ResolvePass
from decals.render.shown import Shown

Size = tuple[int, int]

KINDS = ("f4", "f4", "f2", DEPTH, "f2", "f2", "f1")
"""Of the textures that targets without buffers are made of."""


class Targets:
    """The targets of all passes, for tiles up to a size."""

    def __init__(self, context: Context, size: Size, *, buffers: bool) -> None:
        self.buffers = buffers
        self.shown: Shown | None = None
        """What the picture in here is of; None while it is being made."""
        self.drawing: object = None
        """Who made it, or does so now."""
        self.gbuffer = GBuffer(context, size)
        self.decal_pass = DecalPass(context, size, buffers=buffers)
        self.light_pass = LightPass(context, size)
        self.resolve = ResolvePass(context, size)

    def release(self) -> None:
        """Give the memory back."""
        self.shown = self.drawing = None
        self.gbuffer.release()
        self.decal_pass.release()
        self.light_pass.release()
        self.resolve.release()
