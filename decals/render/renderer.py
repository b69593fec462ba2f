"""Scenes to pictures."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from decals.camera import Bounds
from decals.contact import Contact
from decals.errors import InvalidScene
from decals.mapping import Mapping
from decals.render.context import Context
from decals.render.decal_data import DecalData
from decals.render.decal_pass import DecalPass
from decals.render.drawables import Drawable, drawable_for
from decals.render.entry import Entry
from decals.render.gbuffer import GBuffer
from decals.render.kept import Kept
from decals.render.light_pass import LightPass
from decals.render.resolve import STUDIO, Background, ResolvePass
from decals.render.scene_like import SceneLike
from decals.render.textures import ImageArray
from decals.render.tile import MARGIN, MAX_TILE, CameraBuffer, Tile, largest_tile, tiles

Floats = NDArray[np.float32]
Size = tuple[int, int]

AMBIENT_RADIUS = 0.1
"""How far away surroundings may be to keep light out, relative to the scene's diagonal."""


@dataclass(frozen=True, eq=False)
class Buffers:
    """What lies behind every pixel of a picture; row 0 is at the top.

    Attributes
    ----------
    position, normal
        float32[h, w, 3], zero in the background; normals are unit and smooth.
    object_id
        int32[h, w], the object's index in the scene, -1 in the background.
    owner
        int32[h, w], the decal's index, -1 for none.
    field
        float32[h, w], the owner's field F after contact, ½ on its rim; zero without an owner.
    uv
        float32[h, w, 2], the owner's image coordinates, v upward; zero without an owner.
    color
        uint8[h, w, 4], what `Renderer.render` gives with one sample.
    """

    position: Floats
    normal: Floats
    object_id: NDArray[np.int32]
    owner: NDArray[np.int32]
    uv: Floats
    field: Floats
    color: NDArray[np.uint8]


class Renderer:
    """Draws scenes; owns everything that it puts on the graphics card.

    What it uploads for an object, for the decals or for the images stays for the next picture of the same
    ones. Use it as a context manager, or call `release`.

    Parameters
    ----------
    context
        Where to draw; without one, a standalone context that the renderer owns.
    max_tile
        Pictures with more samples than this per axis are drawn in parts.

    Raises
    ------
    NoGraphics
        No context can be made.
    """

    def __init__(self, context: Context | None = None, *, max_tile: int = MAX_TILE) -> None:
        self._owned = context is None
        self.context = context or Context.standalone()
        self._max_tile = min(max_tile, self.context.max_texture_size - 2 * MARGIN)
        self._drawables: Kept[Drawable] = Kept()
        self._decals: Kept[DecalData] = Kept()
        self._images: Kept[ImageArray] = Kept()
        self._targets: _Targets | None = None
        with self.context.current():
            self._camera = CameraBuffer(self.context)

    def render(
        self,
        scene: SceneLike,
        *,
        size: Size = (800, 600),
        samples: int = 2,
        background: Background = STUDIO,
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
    ) -> NDArray[np.uint8]:
        """Draw a scene.

        Parameters
        ----------
        scene
            Objects, decals, images and camera.
        size
            Width and height in pixels.
        samples
            Samples per pixel along each axis; 2 means 4 a pixel.
        background
            What is behind the objects.
        mapping
            How images are laid onto curved surface.
        contact
            How contact decals push each other.

        Returns
        -------
        uint8[h, w, 4]
            sRGB and alpha, row 0 at the top.

        Raises
        ------
        InvalidScene
            The scene holds an object of unknown kind, or size or samples are none.
        """
        _check_size(size, samples)
        picture = _Picture(size, 4, np.uint8)
        for tile, targets in self._tiles(scene, size, samples, mapping, contact, buffers=False):
            light = targets.light_pass.light
            picture.place(targets.resolve.pixels(light, tile, samples, background), tile, samples)
        return picture.pixels

    def buffers(
        self,
        scene: SceneLike,
        *,
        size: Size = (800, 600),
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
    ) -> Buffers:
        """Give what lies behind every pixel's centre; arguments and errors as for `render`."""
        _check_size(size, 1)
        color = _Picture(size, 4, np.uint8)
        position, normal, decal = (_Picture(size, 4, np.float32) for _ in range(3))
        for tile, targets in self._tiles(scene, size, 1, mapping, contact, buffers=True):
            color.place(targets.resolve.pixels(targets.light_pass.light, tile, 1, STUDIO), tile)
            position.place(targets.gbuffer.read_position(tile), tile)
            normal.place(targets.gbuffer.read_normal(tile), tile)
            decal.place(targets.decal_pass.read_decal(tile), tile)
        return Buffers(
            position=position.pixels[..., :3],
            normal=normal.pixels[..., :3],
            object_id=position.pixels[..., 3].astype(np.int32) - 1,
            owner=decal.pixels[..., 0].astype(np.int32),
            field=decal.pixels[..., 1],
            uv=decal.pixels[..., 2:],
            color=color.pixels,
        )

    def time_frame(
        self,
        scene: SceneLike,
        *,
        size: Size = (800, 600),
        mapping: Mapping = Mapping.CORRECTED,
        contact: Contact = Contact.PAPER,
    ) -> float:
        """Give the seconds that one picture takes to draw, one sample a pixel, without reading it back.

        What a scene uploads is counted where it is drawn for the first time. Arguments and errors as for
        `render`.
        """
        _check_size(size, 1)
        with self.context.current():
            self.context.gl.finish()
            begin = time.perf_counter()
            for _ in self._tiles(scene, size, 1, mapping, contact, buffers=False):
                pass
            self.context.gl.finish()
            return time.perf_counter() - begin

    @property
    def entry(self) -> Entry:
        """How passes over all pixels are run: as fragment or as compute shaders."""
        with self.context.current():
            return self.context.entry

    def _tiles(
        self,
        scene: SceneLike,
        size: Size,
        samples: int,
        mapping: Mapping,
        contact: Contact,
        *,
        buffers: bool,
    ) -> Iterator[tuple[Tile, _Targets]]:
        """Draw tile after tile; the targets hold a tile until the next is asked for."""
        with self.context.current():
            drawables = [self._drawable(thing) for thing in scene.objects]
            data, images = self._uploads(scene)
            bounds = _union([drawable.bounds for drawable in drawables])
            clip_range = scene.camera.clip_range(bounds)
            ambient_radius = AMBIENT_RADIUS * _diagonal(bounds)
            targets = self._targets_for(largest_tile(size, samples, limit=self._max_tile), buffers=buffers)
            for tile in tiles(scene.camera, size, samples, clip_range, limit=self._max_tile):
                self._camera.use(tile)
                targets.gbuffer.begin(tile.width, tile.height)
                for object_id, drawable in enumerate(drawables):
                    drawable.draw(object_id, tile)
                targets.decal_pass.draw(targets.gbuffer, tile, data, images, mapping, contact)
                targets.light_pass.draw(targets.gbuffer, targets.decal_pass.paint, tile, ambient_radius)
                yield tile, targets
            for kept in (self._drawables, self._decals, self._images):
                kept.sweep()

    def _drawable(self, thing: object) -> Drawable:
        return self._drawables.get(lambda: drawable_for(self.context, thing), thing)

    def _uploads(self, scene: SceneLike) -> tuple[DecalData | None, ImageArray | None]:
        if not len(scene.decals):
            return None, None
        pixels = [image.pixels for image in scene.images]
        images = self._images.get(lambda: ImageArray(self.context, pixels), *pixels)
        return self._decals.get(lambda: DecalData(self.context, scene.decals), scene.decals), images

    def _targets_for(self, size: Size, *, buffers: bool) -> _Targets:
        """Give targets of a size; those of the last picture if they fit exactly."""
        if self._targets is None or (self._targets.gbuffer.size, self._targets.buffers) != (size, buffers):
            if self._targets is not None:
                self._targets.release()
            self._targets = _Targets(self.context, size, buffers=buffers)
        return self._targets

    def release(self) -> None:
        """Give everything back. Calling twice is harmless."""
        with self.context.current():
            if self._targets is not None:
                self._targets.release()
                self._targets = None
            for kept in (self._drawables, self._decals, self._images):
                kept.release()
            self._camera.release()
        if self._owned:
            self.context.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


class _Targets:
    """What one tile is drawn into."""

    def __init__(self, context: Context, size: Size, *, buffers: bool) -> None:
        self.buffers = buffers
        self.gbuffer = GBuffer(context, size)
        self.decal_pass = DecalPass(context, size, buffers=buffers)
        self.light_pass = LightPass(context, size)
        self.resolve = ResolvePass(context, size)

    def release(self) -> None:
        self.gbuffer.release()
        self.decal_pass.release()
        self.light_pass.release()
        self.resolve.release()


class _Picture:
    """A picture put together from tiles, which count rows from below."""

    def __init__(self, size: Size, channels: int, dtype: type[np.generic]) -> None:
        self.pixels: NDArray[Any] = np.zeros((size[1], size[0], channels), dtype)

    def place(self, block: NDArray[Any], tile: Tile, samples: int = 1) -> None:
        left, bottom = tile.inner.x // samples, tile.inner.y // samples
        height, width = block.shape[:2]
        self.pixels[::-1][bottom : bottom + height, left : left + width] = block


def _union(boxes: Sequence[Bounds]) -> Bounds:
    """Box around boxes; around none of them, a point."""
    if not boxes:
        return np.zeros(3), np.zeros(3)
    lower, upper = zip(*boxes, strict=True)
    return np.min(lower, axis=0), np.max(upper, axis=0)


def _diagonal(bounds: Bounds) -> float:
    return float(np.linalg.norm(np.subtract(bounds[1], bounds[0])))


def _check_size(size: Size, samples: int) -> None:
    if len(size) != 2 or min(size) < 1 or samples < 1:
        raise InvalidScene(
            f"a picture needs a width, a height and samples of at least 1, got {size}, {samples}"
        )
