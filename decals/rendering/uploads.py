"""Scenes on the GPU, and their caches."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from decals.field.mapping import ImageMapping
from decals.index.editor import DecalEditor
from decals.receivers import object_mask
from decals.rendering.context import Context
from decals.rendering.data_texture import DataTexture
from decals.rendering.decal_data import DecalData
from decals.rendering.drawable import Drawable, can_be_moved, drawable_for
from decals.rendering.environment import Environment
from decals.rendering.image_array import ImageArray
from decals.rendering.light_pass import EnvironmentTextures
from decals.rendering.materials import RELIEF_LOOKUPS, MaterialArray, Relief, ReliefArray
from decals.rendering.options import (
    Drawing,
    SceneLike,
    check_scene,
    drawn_objects,
    has_materials,
    has_relief,
    is_limited,
)
from decals.rendering.viewpoint import Bounds
from decals.rendering.walk_cache import WalkCache


class Releasable(Protocol):
    """A resource on the GPU."""

    def release(self) -> None:
        """Release the memory."""
        ...


Resource = TypeVar("Resource", bound=Releasable)


class GpuCache(Generic[Resource]):
    """Resources on the GPU, each made once for the (immutable) objects that it represents.

    Objects are compared by identity, and kept alive as long as their resources.
    """

    def __init__(self) -> None:
        self._entries: dict[Hashable, tuple[tuple[object, ...], Resource]] = {}
        self._used: set[Hashable] = set()

    def get(self, make: Callable[[], Resource], *objects: object) -> Resource:
        """Return the resource of these objects; make it at the first call."""
        key = tuple(id(item) for item in objects)
        if key not in self._entries:
            self._entries[key] = objects, make()
        self._used.add(key)
        return self._entries[key][1]

    def find(self, *objects: object) -> Resource | None:
        """Return the resource of these objects, or None before the first call of `get`."""
        return self._entries.get(tuple(id(item) for item in objects), (None, None))[1]

    def sweep(self) -> None:
        """Release the resources that `get` did not return since the last sweep."""
        for key in set(self._entries) - self._used:
            self._entries.pop(key)[1].release()
        self._used.clear()

    def release(self) -> None:
        """Release everything."""
        self._used.clear()
        self.sweep()


@dataclass(frozen=True, eq=False)
class UploadedScene:
    """A scene on the GPU."""

    drawables: list[Drawable]
    decals: DecalData | None
    images: ImageArray | None
    masks: DataTexture | None = None
    materials: MaterialArray | None = None
    relief: Relief | None = None
    walks: DataTexture | None = None
    environment: EnvironmentTextures | None = None

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

    Attributes
    ----------
    walk_cache
        The walks of the last scene in the mapping WALKED.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._drawables: GpuCache[Drawable] = GpuCache()
        self._decals: GpuCache[DecalData] = GpuCache()
        self._images: GpuCache[ImageArray] = GpuCache()
        self._materials: GpuCache[MaterialArray] = GpuCache()
        self._reliefs: GpuCache[ReliefArray] = GpuCache()
        self._environments: GpuCache[EnvironmentTextures] = GpuCache()
        self._walks: GpuCache[DataTexture] = GpuCache()
        self._caches: tuple[GpuCache[Any], ...] = (
            self._drawables,
            self._decals,
            self._images,
            self._materials,
            self._reliefs,
            self._environments,
            self._walks,
        )
        self._masks: tuple[tuple[int, ...], DataTexture] | None = None
        self._relief: tuple[ReliefArray, DecalData, int, Relief] | None = None
        self.walk_cache = WalkCache()

    def scene(self, scene: SceneLike, drawing: Drawing) -> UploadedScene:
        """Return a whole scene, with what a way of drawing needs; errors are those of `check_scene`."""
        check_scene(scene)
        objects = drawn_objects(scene)
        drawables = [self.drawable(item) for item in objects]
        masks = self._masks_of(scene, objects)
        images = self.images(scene)
        materials = self._materials_of(scene, images)
        relief, walks = self._relief_of(scene, images), self.walks(scene, drawing.mapping)
        environment = self.environment(drawing.environment)
        decals = self.decals(scene)
        return UploadedScene(drawables, decals, images, masks, materials, relief, walks, environment)

    def environment(self, environment: Environment | None) -> EnvironmentTextures | None:
        """Return the textures of an environment."""
        if environment is None:
            return None
        panorama, visible = environment.picture, environment.visible
        return self._environments.get(
            lambda: EnvironmentTextures(self.context, panorama, visible), panorama, visible
        )

    def walks(self, scene: SceneLike, mapping: ImageMapping) -> DataTexture | None:
        """Return the walks of a scene's decals; None in other mappings, or without decals."""
        if mapping is not ImageMapping.WALKED or not len(scene.decals):
            return None
        walks = self.walk_cache.get(scene)
        return self._walks.get(lambda: DataTexture(self.context, walks.texels), walks)

    def _materials_of(self, scene: SceneLike, images: ImageArray | None) -> MaterialArray | None:
        """Return the maps of a scene's images; None without any."""
        if images is None or not has_materials(scene):
            return None
        shape = images.height, images.width
        return self._materials.get(
            lambda: MaterialArray(self.context, scene.images, shape), images, *scene.images
        )

    def _relief_of(self, scene: SceneLike, images: ImageArray | None) -> Relief | None:
        """Return the relief of a scene's decals; None without any."""
        if images is None or not has_relief(scene):
            self._relief = None
            return None
        heights, widths = zip(*(image.pixels.shape[:2] for image in scene.images), strict=True)
        shape = min(max(heights), images.height), min(max(widths), images.width)  # no texel is averaged
        array = self._reliefs.get(
            lambda: ReliefArray(self.context, scene.images, shape), images, *scene.images
        )
        decals = self.decals(scene)
        assert decals is not None
        kept, stepped = self._relief, decals.layered or decals.nested or decals.limited
        if kept is None or kept[:2] != (array, decals) or kept[2] != decals.version:
            self._relief = kept = array, decals, decals.version, Relief(array, scene, stepped=stepped)
        return kept[3]

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
        lookups = RELIEF_LOOKUPS if has_relief(scene) else 1
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
        lookups = RELIEF_LOOKUPS if has_relief(scene) else 1
        data = self._decals.find(scene.decals, is_limited(scene), lookups)
        return data is not None and data.nested

    def images(self, scene: SceneLike) -> ImageArray | None:
        """Return the images of a scene's decals; None without decals."""
        if not len(scene.decals):
            return None
        pixels = [image.pixels for image in scene.images]
        return self._images.get(lambda: ImageArray(self.context, pixels), *pixels)

    def sweep(self) -> None:
        """Release everything that was not used since the last sweep."""
        for cache in self._caches:
            cache.sweep()
        self.walk_cache.sweep()

    def release(self) -> None:
        """Release everything."""
        for cache in self._caches:
            cache.release()
        self._release_masks()
        self.walk_cache.release()
