"""Scenes on the GPU, and their caches."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from decals.index.editor import DecalEditor
from decals.receivers import object_mask
from decals.rendering.context import Context, GpuCache
from decals.rendering.data_texture import DataTexture
from decals.rendering.decal_data import DecalData
from decals.rendering.drawable import Drawable, can_be_moved, drawable_for
from decals.rendering.effect import EFFECTS, DecalTexture, Effect, LightTextures, ReliefEffect
from decals.rendering.image_array import ImageArray
from decals.rendering.options import (
    Drawing,
    SceneLike,
    check_scene,
    drawn_objects,
    is_limited,
    needed_effects,
    relief_lookups,
)
from decals.rendering.viewpoint import Bounds
from decals.rendering.warmup import WarmupTask


@dataclass(frozen=True, eq=False)
class UploadedScene:
    """A scene on the GPU."""

    drawables: list[Drawable]
    decals: DecalData | None
    images: ImageArray | None
    masks: DataTexture | None = None
    materials: DecalTexture | None = None
    relief: ReliefEffect | None = None
    walks: DecalTexture | None = None
    environment: LightTextures | None = None

    @cached_property
    def bounds(self) -> Bounds:
        """Box around all objects; a point for a scene without objects."""
        if not self.drawables:
            return np.zeros(3), np.zeros(3)
        boxes = []
        for drawable in self.drawables:
            lower, upper = (np.asarray(corner) for corner in drawable.bounds)
            growth = self.relief.reach if self.relief is not None and self.moves(drawable) else 0.0
            boxes.append((lower - growth, upper + growth))
        lowest, highest = zip(*boxes, strict=True)
        return np.min(lowest, axis=0), np.max(highest, axis=0)

    def moves(self, drawable: Drawable) -> bool:
        """Return True if heights of decals move the surface of an object."""
        return self.relief is not None and can_be_moved(drawable)


class Uploads:
    """Objects, decals and images of scenes on the GPU; they stay until a `sweep` after which they are unused.

    The context must be current.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._drawables: GpuCache[Drawable] = GpuCache()
        self._decals: GpuCache[DecalData] = GpuCache()
        self._images: GpuCache[ImageArray] = GpuCache()
        self._effects: dict[str, Effect] = {}
        self._masks: tuple[tuple[int, ...], DataTexture] | None = None

    def scene(self, scene: SceneLike, drawing: Drawing) -> UploadedScene:
        """Return a whole scene, with what a way of drawing needs; errors are those of `check_scene`."""
        check_scene(scene)
        objects = drawn_objects(scene)
        drawables = [self.drawable(item) for item in objects]
        masks = self._masks_of(scene, objects)
        images = self.images(scene)
        effects = self._needed(scene, drawing)
        extended: dict[str, Any] = {name: effect.of(scene, drawing) for name, effect in effects.items()}
        return UploadedScene(drawables, self.decals(scene), images, masks, **extended)

    def effect_tasks(self, scene: SceneLike, drawing: Drawing) -> list[WarmupTask]:
        """Return the tasks of a warm-up that effects add."""
        effects = self._needed(scene, drawing).values()
        return [task for effect in effects for task in effect.tasks(scene, drawing)]

    def ready(self, scene: SceneLike) -> bool:
        """Return True if no effect of a scene waits for a computation in a thread."""
        return all(self._effect(name).ready(scene) for name in EFFECTS)

    def _needed(self, scene: SceneLike, drawing: Drawing) -> dict[str, Effect]:
        """Return the effects that a picture needs, by their fields of `UploadedScene`."""
        return {name: self._effect(name) for name in needed_effects(scene, drawing) if name in EFFECTS}

    def _effect(self, name: str) -> Effect:
        if name not in self._effects:
            self._effects[name] = EFFECTS[name](self)
        return self._effects[name]

    def _masks_of(self, scene: SceneLike, objects: Sequence[object]) -> DataTexture | None:
        """Return the masks of objects of a scene; None if its decals are not limited."""
        if not is_limited(scene):
            return None
        table = scene.decals.receiver_table
        masks = tuple(object_mask(item, table) for item in objects)
        if self._masks is None or self._masks[0] != masks:
            self._release_masks()
            self._masks = masks, DataTexture(self.context, np.array(masks, np.int32))
        return self._masks[1]

    def _release_masks(self) -> None:
        if self._masks is not None:
            self._masks[1].release()
        self._masks = None

    def drawable(self, item: object) -> Drawable:
        """Return the drawable of an object."""
        return self._drawables.get(lambda: drawable_for(self.context, item), item)

    def decals(self, scene: SceneLike) -> DecalData | None:
        """Return the data of a scene's decals; None without decals."""
        decals = scene.decals
        if not len(decals):
            return None
        limited = is_limited(scene)
        lookups = relief_lookups(scene)
        data = self._decals.get(
            lambda: DecalData(self.context, decals, limited=limited, lookups=lookups),
            decals,
            limited,
            lookups,
        )
        if isinstance(decals, DecalEditor):
            data.update(decals)
        return data

    def nested(self, scene: SceneLike) -> bool:
        """Return True if decals of a scene are nested, as far as known without their index."""
        if isinstance(scene.decals, DecalEditor):
            return scene.decals.nested
        data = self._decals.find(scene.decals, is_limited(scene), relief_lookups(scene))
        return data is not None and data.nested

    def images(self, scene: SceneLike) -> ImageArray | None:
        """Return the images of a scene's decals; None without decals."""
        if not len(scene.decals):
            return None
        pixels = [image.pixels for image in scene.images]
        return self._images.get(lambda: ImageArray(self.context, pixels), *pixels)

    def sweep(self) -> None:
        """Release everything that was not used since the last sweep."""
        for held in self._held():
            held.sweep()

    def release(self) -> None:
        """Release everything."""
        for held in self._held():
            held.release()
        self._release_masks()

    def _held(self) -> Iterator[GpuCache[Any] | Effect]:
        yield from (self._drawables, self._decals, self._images)
        yield from self._effects.values()
