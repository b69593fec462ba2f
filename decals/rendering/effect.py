"""Effects: what extends the passes, such as relief and environments. Each registers itself in `EFFECTS`."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import moderngl

from decals.rendering.context import Context, GpuCache
from decals.rendering.decal_data import DecalData
from decals.rendering.gbuffer import GBuffer
from decals.rendering.image_array import ImageArray
from decals.rendering.options import Drawing, SceneLike
from decals.rendering.pixel_pass import Program
from decals.rendering.warmup import WarmupTask


class DecalTexture(Protocol):
    """A texture that decals read beside their images."""

    @property
    def texture(self) -> moderngl.Texture | moderngl.TextureArray: ...  # noqa: D102


class ReliefEffect(DecalTexture, Protocol):
    """Heights of the images of decals."""

    @property
    def reach(self) -> float:
        """Greatest distance, in model units, by which the surface moves in or out."""
        ...

    def use(self, program: Program, lights: Any) -> None:
        """Set the uniforms of a program but for the samplers; the first of the lights casts shadows."""
        ...


class LightTextures(Protocol):
    """Textures that light reads, by the names of their samplers."""

    @property
    def textures(self) -> Mapping[str, moderngl.Texture]: ...  # noqa: D102


class SceneUploads(Protocol):
    """What every picture needs of a scene on the GPU."""

    @property
    def context(self) -> Context: ...  # noqa: D102
    def decals(self, scene: SceneLike) -> DecalData | None: ...  # noqa: D102
    def images(self, scene: SceneLike) -> ImageArray | None: ...  # noqa: D102


class Effect:
    """What an effect needs of scenes on the GPU; it stays until a `sweep` after which it is unused."""

    def __init__(self, uploads: SceneUploads) -> None:
        self._uploads = uploads
        self._cache: GpuCache[Any] = GpuCache()

    def of(self, scene: SceneLike, drawing: Drawing) -> Any:
        """Return the effect's field of `UploadedScene`."""
        raise NotImplementedError

    def tasks(self, scene: SceneLike, drawing: Drawing) -> list[WarmupTask]:
        """Return the slow parts of `of` as tasks of a warm-up."""
        return []

    def ready(self, scene: SceneLike) -> bool:
        """Return True if `of` need not wait; otherwise a thread computes what it needs."""
        return True

    def sweep(self) -> None:
        """Release everything that was not used since the last sweep."""
        self._cache.sweep()

    def release(self) -> None:
        """Release everything."""
        self._cache.release()


EFFECTS: dict[str, type[Effect]] = {}
"""Classes of effects by their fields of `UploadedScene`, which are the names of `needed_effects`."""

BUFFERS: dict[str, Callable[[Context, GBuffer], Any]] = {}
"""Buffers beside the G-buffer, by name; ``"rest"``: places at rest of objects that are posed or moved."""
