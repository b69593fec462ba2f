"""What a picture takes, one step after the other."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from decals.render.decal_data import DecalData
from decals.render.drawables import Drawable
from decals.render.modes import Modes
from decals.render.parts import Step
from decals.render.scene_like import SceneLike
from decals.render.shown import Shown, same
from decals.render.targets import Size, Targets
from decals.render.textures import ImageArray
from decals.render.tile import Picture, Tile
from decals.scenes.viewpoint import Bounds, Viewpoint

AMBIENT_RADIUS = 0.1
"""How far away surroundings may be to keep light out, relative to the scene's diagonal."""


@dataclass(frozen=True, eq=False)
class Uploaded:
    """A scene on the graphics card."""

    drawables: list[Drawable]
    decals: DecalData | None
    images: ImageArray | None

    @cached_property
    def bounds(self) -> Bounds:
        """Box around all objects; around none of them, a point."""
        if not self.drawables:
            return np.zeros(3), np.zeros(3)
        lower, upper = zip(*(drawable.bounds for drawable in self.drawables), strict=True)
        return np.min(lower, axis=0), np.max(upper, axis=0)


@dataclass(frozen=True, eq=False)
class Order:
    """A picture that somebody wants: its size in samples, in one tile, with the depth of all objects."""

    scene: SceneLike
    viewpoint: Viewpoint
    size: Size
    modes: Modes

    def tile(self, bounds: Bounds) -> Tile:
        """Give the tile, if there is such a box around the objects."""
        return Picture.of(self.viewpoint, self.size, bounds).whole()

    def share(self, targets: Targets | None) -> float:
        """Part of the work, 0 to 1, that is left in targets that hold something."""
        held = None if targets is None else targets.shown
        fits = targets is not None and targets.gbuffer.size == self.size
        if held is None or not fits or not same(tuple(self.scene.objects), held.objects):
            return 1.0
        tile = self.tile(held.bounds)
        shown = Shown.of(self.scene, held.bounds, tile, self.modes, depth=True)
        return shown.stale(held, tile).share(tile)


@dataclass(frozen=True, eq=False)
class Plan:
    """What is to be drawn so that targets show something.

    Attributes
    ----------
    shown
        What they show then.
    steps
        In this order; none where they show it already.
    share
        Part of the work of a whole tile, 0 to 1.
    """

    shown: Shown
    steps: list[Step]
    share: float


def plan_of(
    scene: SceneLike,
    uploaded: Uploaded,
    tile: Tile,
    modes: Modes,
    targets: Targets,
    held: Shown | None,
    *,
    depth: bool,
) -> Plan:
    """What must be drawn of a tile in targets that hold something; the tile's camera must be bound.

    ``depth``: objects that were not rasterised get their depth too.
    """
    shown = Shown.of(scene, uploaded.bounds, tile, modes, depth=depth)
    stale = shown.stale(held, tile)
    steps = _surface(uploaded, tile, targets, depth=depth) if stale.surface else []
    gbuffer, paint = targets.gbuffer, targets.decal_pass.paint
    painted = gbuffer, uploaded.decals, uploaded.images, modes.mapping, modes.contact
    steps += [partial(targets.decal_pass.draw, part, *painted) for part in stale.paint]
    radius = AMBIENT_RADIUS * float(np.linalg.norm(np.subtract(*uploaded.bounds)))
    lit = gbuffer, paint, tile, radius, modes.lamps
    steps += [partial(targets.light_pass.draw, part, *lit) for part in stale.light]
    return Plan(shown, steps, stale.share(tile))


def _surface(uploaded: Uploaded, tile: Tile, targets: Targets, *, depth: bool) -> list[Step]:
    """All objects into the G-buffer."""
    gbuffer = targets.gbuffer
    objects = sorted(enumerate(uploaded.drawables), key=lambda item: not item[1].rasterised)
    steps: list[Step] = [
        partial(gbuffer.clear, tile.width, tile.height),
        *(partial(drawable.draw, number, tile, gbuffer) for number, drawable in objects),
    ]
    if depth and not all(drawable.rasterised for drawable in uploaded.drawables):
        steps.append(partial(gbuffer.complete_depth, tile.width, tile.height))
    return steps
