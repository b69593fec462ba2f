"""What a picture takes, one step after the other."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from decals.checks import member
from decals.errors import InvalidScene
from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render.decal_data import DecalData
from decals.render.drawables import Drawable
from decals.render.lamps import Lamps
from decals.render.parts import Step
from decals.render.targets import Targets
from decals.render.textures import ImageArray
from decals.render.tile import Tile
from decals.scenes.viewpoint import Bounds

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


@dataclass(frozen=True)
class Modes:
    """How images lie on curved surface, how decals push each other, and lamps, if not the studio's."""

    mapping: Mapping
    contact: Contact
    lamps: Lamps | None = None

    def __post_init__(self) -> None:
        member("mapping", self.mapping, Mapping, InvalidScene)
        member("contact", self.contact, Contact, InvalidScene)


def steps_of(uploaded: Uploaded, tile: Tile, targets: Targets, modes: Modes) -> list[Step]:
    """What a tile of a scene takes, in this order; the tile's camera must be bound."""
    gbuffer, paint = targets.gbuffer, targets.decal_pass.paint
    objects = sorted(enumerate(uploaded.drawables), key=lambda item: not item[1].rasterised)
    radius = AMBIENT_RADIUS * float(np.linalg.norm(np.subtract(*uploaded.bounds)))
    painted = gbuffer, tile, uploaded.decals, uploaded.images, modes.mapping, modes.contact
    return [
        partial(gbuffer.clear, tile.width, tile.height),
        *(partial(drawable.draw, number, tile, gbuffer) for number, drawable in objects),
        partial(targets.decal_pass.draw, *painted),
        partial(targets.light_pass.draw, gbuffer, paint, tile, radius, modes.lamps),
    ]
