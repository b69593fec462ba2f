"""The regions in which a picture differs from the one in the targets; only these are drawn again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from blobtree._typing import Float64Array
from decals.index.change_log import affected_balls
from decals.index.editor import DecalEditor
from decals.model import Decals
from decals.rendering.options import RenderOptions, SceneLike, has_relief
from decals.rendering.pixel_pass import GROUP
from decals.rendering.viewpoint import Bounds, Rectangle, Tile

Regions = tuple[Rectangle, ...]

ROUNDING = 2.0**-20
"""Rounding of positions in the G-buffer, relative to the largest coordinate."""
MAX_RECTANGLES = 32
"""Rectangles that are drawn one by one; more become one."""
BALL_MARGIN = 1.0
"""Samples around the image of a ball: rasterisers round edges of triangles to a finer grid."""


def ball_extents(matrix: Float64Array, balls: ArrayLike) -> tuple[Float64Array, Float64Array] | None:
    """Return the boxes around the images of balls: least and greatest x and y in clip space.

    With rows a, b of ``matrix`` for x and w, a ball lies where x/w ≤ c if its centre lies R |a − c b| before
    the plane a = c b; so the c where it touches solve a quadratic equation, in perspective and without
    (Mara and McGuire, 2D Polyhedral Bounds of a Clipped, Perspective-Projected 3D Sphere, JCGT 2013).

    Parameters
    ----------
    matrix
        World to clip space, ``float64[4, 4]``, acting on columns.
    balls
        Centres and radii, ``float[n, 4]``.

    Returns
    -------
    (float64[n, 2], float64[n, 2]) or None
        None if a ball reaches behind the eye: its image may be anywhere.
    """
    rows = np.asarray(balls, np.float64).reshape(-1, 4)
    squared = rows[:, 3:] ** 2
    centres = rows[:, :3] @ matrix[:, :3].T + matrix[:, 3]
    across, depth = centres[:, :2], centres[:, 3:]
    slopes, away = matrix[:2, :3], matrix[3, :3]
    a = depth**2 - squared * (away @ away)
    if (depth <= 0.0).any() or (a <= 0.0).any():
        return None
    b = across * depth - squared * (slopes @ away)
    c = across**2 - squared * (slopes**2).sum(axis=1)
    half = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    return (b - half) / a, (b + half) / a


def regions_of(tile: Tile, balls: Float64Array, span: float) -> Regions:
    """Return rectangles of a tile, counted from its own corner, that enclose the images of all balls.

    They consist of whole groups of samples: some rasterisers filter images for several samples together, by
    the derivatives of one of them.

    Parameters
    ----------
    tile
        The tile that is drawn.
    balls
        Centres and radii, ``float64[n, 4]``.
    span
        The largest coordinate of the objects.
    """
    span = max(span, float(np.abs(tile.view.rays.origin).max()))
    extents = ball_extents(tile.matrix(), balls + np.array([0.0, 0.0, 0.0, ROUNDING * span]))
    if extents is None:
        return (Rectangle(0, 0, tile.width, tile.height),)
    size = np.array([tile.width, tile.height])
    low = np.floor(((0.5 * extents[0] + 0.5) * size - BALL_MARGIN) / GROUP) * GROUP
    high = np.ceil(((0.5 * extents[1] + 0.5) * size + BALL_MARGIN) / GROUP) * GROUP
    corners = np.clip(np.column_stack([low, high]), 0, np.tile(size, 2))
    corners = corners[(corners[:, 2:] > corners[:, :2]).all(axis=1)]
    if len(corners) > MAX_RECTANGLES:
        corners = np.concatenate([corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)])[None]
    rows = corners.astype(int).tolist()
    return joined([Rectangle(x, y, right - x, top - y) for x, y, right, top in rows])


def joined(rectangles: Sequence[Rectangle]) -> Regions:
    """Return rectangles that cover the same samples: two become one if that takes no more samples."""
    result: list[Rectangle] = []
    for rectangle in rectangles:
        union = rectangle
        for other in [*result]:
            both = union.around(other)
            if both.area <= union.area + other.area:
                result.remove(other)
                union = both
        result.append(union)
    return tuple(result)


def _inner_groups(tile: Tile) -> Rectangle:
    """Return the groups of samples, counted from the tile's own corner, that its inner rectangle touches."""
    inner = tile.inner
    left, low = (start // GROUP * GROUP for start in (inner.x - tile.x, inner.y - tile.y))
    right = min(-(-(inner.x - tile.x + inner.width) // GROUP) * GROUP, tile.width)
    top = min(-(-(inner.y - tile.y + inner.height) // GROUP) * GROUP, tile.height)
    return Rectangle(left, low, right - left, top - low)


class DirtyRegions(NamedTuple):
    """The rectangles of a tile in which surface, paint and light must be drawn."""

    surface: Regions
    paint: Regions
    light: Regions

    def work(self, tile: Tile) -> float:
        """Return the part of the work of the whole tile, 0 to 1, if the three passes take equally long."""
        return sum(part.area for regions in self for part in regions) / (3 * tile.width * tile.height)


@dataclass(frozen=True, eq=False)
class TargetState:
    """Everything that the picture of a tile depends on.

    Objects, images and decals do not change in place, except decals of an editor, which counts its versions.

    Attributes
    ----------
    objects, bounds
        The objects in the G-buffer, and the box around them.
    view
        The camera, the tile and the samples per pixel.
    decals
        The decals and the pixels of their images.
    formulas
        Everything that decides which formulas paint the decals.
    version
        Version of the editor.
    options
        Mapping, contact mode, stiffness, lights and environment.
    relief
        True if rays are followed over the surface, so that an edit may change pixels far from it.
    moved
        True if heights of decals move objects.
    """

    objects: tuple[object, ...]
    bounds: Bounds
    view: tuple[object, ...]
    decals: tuple[object, ...]
    formulas: tuple[object, ...]
    version: int
    options: RenderOptions
    relief: bool
    moved: bool

    @classmethod
    def of(cls, scene: SceneLike, bounds: Bounds, tile: Tile, options: RenderOptions, *, depth: bool) -> Self:
        """Return the state of a tile of a scene; ``depth``: the targets hold the depth of all objects."""
        decals, relief = scene.decals, has_relief(scene)
        return cls(
            tuple(scene.objects),
            bounds,
            (tile.block(), tile.x, tile.y, tile.width, tile.height, tile.inner, depth, options.samples),
            (
                decals,
                *(image if hasattr(image, "surface_texels") else image.pixels for image in scene.images),
            ),
            (
                options.rules,
                options.lights if relief else None,  # the first casts shadows
                *_editor_formulas(decals),
            ),
            decal_version(scene),
            options,
            relief,
            relief and any(hasattr(item, "tree") for item in scene.objects),
        )

    def dirty(self, previous: TargetState | None, tile: Tile) -> DirtyRegions:
        """Return the regions to draw in targets of a previous state; None for targets without a picture."""
        # Light reads the surface around the inner rectangle, but neither paint nor light there.
        whole: Regions = (_inner_groups(tile),)
        same_surface = previous is not None and same_objects(self.objects, previous.objects)
        if previous is not None and (self.moved or previous.moved):  # decals move trees
            same_surface = same_surface and self._same_decals(previous) and self.version == previous.version
        if previous is None or self.view != previous.view or not same_surface:
            return DirtyRegions((Rectangle(0, 0, tile.width, tile.height),), whole, whole)
        paint = self._edited(previous.version, tile) if self._same_decals(previous) else whole
        now, before = self.options, previous.options
        same_light = now.lights == before.lights and now.environment == before.environment
        return DirtyRegions((), paint, paint if same_light else whole)

    def _same_decals(self, previous: TargetState) -> bool:
        """Return True if the same formulas paint the same decals, but for edits."""
        return self.formulas == previous.formulas and same_objects(self.decals, previous.decals)

    def _edited(self, since: int, tile: Tile) -> Regions:
        """Return the rectangles that edits after a version reach."""
        editor = self.decals[0]
        if not isinstance(editor, DecalEditor) or since == self.version:
            return ()
        changed = editor.changed_balls(since)
        balls = None
        if changed is not None and not self.relief:
            balls = affected_balls(changed, self.options.contact, editor.max_influence)
        if balls is None:
            return (Rectangle(0, 0, tile.width, tile.height),)
        return regions_of(tile, balls, float(np.abs(np.asarray(self.bounds)).max()))


def _editor_formulas(decals: Decals | DecalEditor) -> tuple[object, ...]:
    """Return the properties of an editor's decals that decide which shader paints them."""
    if not isinstance(decals, DecalEditor):
        return ()
    return (decals.layered, decals.limited, decals.nested, len(decals) > 0)


def decal_version(scene: SceneLike) -> int:
    """Return the version of a scene's decals: an editor counts its edits, other decals have version 0."""
    return scene.decals.version if isinstance(scene.decals, DecalEditor) else 0


def same_objects(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    """Return True if two tuples hold identical objects."""
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))
