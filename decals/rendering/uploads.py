"""Scenes on the GPU: caches of their drawables, decals and images."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, Protocol, TypeVar

import numpy as np

from decals.index.editor import DecalEditor
from decals.rendering.context import Context
from decals.rendering.decal_data import DecalData
from decals.rendering.drawables import Drawable, drawable_for
from decals.rendering.options import SceneLike, check_scene
from decals.rendering.textures import ImageArray
from decals.rendering.viewpoint import Bounds


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

    @cached_property
    def bounds(self) -> Bounds:
        """Box around all objects; a point for a scene without objects."""
        if not self.drawables:
            return np.zeros(3), np.zeros(3)
        lower, upper = zip(*(drawable.bounds for drawable in self.drawables), strict=True)
        return np.min(lower, axis=0), np.max(upper, axis=0)


class Uploads:
    """Objects, decals and images of scenes on the GPU; they stay until a `sweep` after which they are unused.

    The context must be current.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self._drawables: GpuCache[Drawable] = GpuCache()
        self._decals: GpuCache[DecalData] = GpuCache()
        self._images: GpuCache[ImageArray] = GpuCache()

    def scene(self, scene: SceneLike) -> UploadedScene:
        """Return a whole scene; errors are those of `decals.rendering.options.check_scene`."""
        check_scene(scene)
        drawables = [self.drawable(item) for item in scene.objects]
        return UploadedScene(drawables, self.decals(scene), self.images(scene))

    def drawable(self, item: object) -> Drawable:
        """Return the drawable of an object."""
        return self._drawables.get(lambda: drawable_for(self.context, item), item)

    def decals(self, scene: SceneLike) -> DecalData | None:
        """Return the data of a scene's decals; None without decals."""
        decals = scene.decals
        if not len(decals):
            return None
        data = self._decals.get(lambda: DecalData(self.context, decals), decals)
        if isinstance(decals, DecalEditor):
            data.update(decals)
        return data

    def images(self, scene: SceneLike) -> ImageArray | None:
        """Return the images of a scene's decals; None without decals."""
        if not len(scene.decals):
            return None
        pixels = [image.pixels for image in scene.images]
        return self._images.get(lambda: ImageArray(self.context, pixels), *pixels)

    def sweep(self) -> None:
        """Release everything that was not used since the last sweep."""
        for cache in (self._drawables, self._decals, self._images):
            cache.sweep()

    def release(self) -> None:
        """Release everything."""
        for cache in (self._drawables, self._decals, self._images):
            cache.release()
