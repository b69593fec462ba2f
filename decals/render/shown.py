"""What targets hold, so that a picture that differs little from it takes little drawing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from decals.grid.editor import DecalEditor
from decals.grid.trail import reach_of
from decals.model import Decals
from decals.render.modes import Modes
from decals.render.parts import Rectangle
from decals.render.region import Regions, regions_of
from decals.render.scene_like import SceneLike
from decals.render.tile import Tile
from decals.scenes.viewpoint import Bounds

Things = tuple[object, ...]
"""Told apart by identity."""


class Stale(NamedTuple):
    """What of a tile must be drawn: the rectangles where surface, paint and light are to change."""

    surface: Regions
    paint: Regions
    light: Regions

    def share(self, tile: Tile) -> float:
        """Part of the work of the whole tile, 0 to 1, if each of the three takes as long as the others."""
        return sum(part.area for regions in self for part in regions) / (3 * tile.width * tile.height)


@dataclass(frozen=True, eq=False)
class Shown:
    """All that a tile of a scene depends on; of objects, decals and images an editor alone changes in place.

    Attributes
    ----------
    objects, bounds
        What lies in the G-buffer, the box around it, and
    view
        how it is seen there.
    decals
        What it is painted with: decals and images,
    painting
        which formulas for them, and
    version
        after which edits.
    modes
        Lamps among them.
    """

    objects: Things
    bounds: Bounds
    view: tuple[object, ...]
    decals: Things
    painting: tuple[object, ...]
    version: int
    modes: Modes

    @classmethod
    def of(cls, scene: SceneLike, bounds: Bounds, tile: Tile, modes: Modes, *, depth: bool) -> Self:
        """What a tile of a scene depends on; ``depth``: it ends with the depth of all objects."""
        decals = scene.decals
        return cls(
            tuple(scene.objects),
            bounds,
            (tile.block(), tile.x, tile.y, tile.width, tile.height, depth),
            (decals, *(image.pixels for image in scene.images)),
            (modes.mapping, modes.contact, *_kind(decals)),
            version_of(scene),
            modes,
        )

    def stale(self, held: Shown | None, tile: Tile) -> Stale:
        """What must be drawn of it where targets hold something."""
        whole: Regions = (Rectangle(0, 0, tile.width, tile.height),)
        if held is None or self.view != held.view or not same(self.objects, held.objects):
            return Stale(whole, whole, whole)
        paint = whole
        if self.painting == held.painting and same(self.decals, held.decals):
            paint = self._edited(held.version, tile)
        return Stale((), paint, paint if self.modes.lamps == held.modes.lamps else whole)

    def _edited(self, since: int, tile: Tile) -> Regions:
        """Where edits after a version may show."""
        editor = self.decals[0]
        if not isinstance(editor, DecalEditor) or since == self.version:
            return ()
        touched = editor.touched(since)
        balls = None
        if touched is not None:
            balls = reach_of(touched, self.modes.contact, editor.largest_influence)
        if balls is None:
            return (Rectangle(0, 0, tile.width, tile.height),)
        return regions_of(tile, balls, float(np.abs(np.asarray(self.bounds)).max()))


def _kind(decals: Decals | DecalEditor) -> tuple[object, ...]:
    """What of an editor's decals decides which shader paints all of them."""
    return (decals.layered, len(decals) > 0) if isinstance(decals, DecalEditor) else ()


def version_of(scene: SceneLike) -> int:
    """Which of a scene's decals: an editor counts; others stay as they are."""
    return scene.decals.version if isinstance(scene.decals, DecalEditor) else 0


def same(one: Things, other: Things) -> bool:
    """Whether two rows of things are the same things."""
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))
