"""Pictures put together from tiles."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.render.resolve import STUDIO
from decals.render.targets import Size, Targets
from decals.render.tile import Tile

Floats = NDArray[np.float32]


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


class Canvas:
    """One array; tiles count its rows from below."""

    def __init__(self, size: Size, channels: int, dtype: type[np.generic]) -> None:
        self.pixels: NDArray[Any] = np.zeros((size[1], size[0], channels), dtype)

    def place(self, block: NDArray[Any], tile: Tile, samples: int = 1) -> None:
        """Put a tile's pixels, its lowest row first, where they belong."""
        left, bottom = tile.inner.x // samples, tile.inner.y // samples
        height, width = block.shape[:2]
        self.pixels[::-1][bottom : bottom + height, left : left + width] = block


class BufferCanvas:
    """Everything that lies behind the pixels, put together from tiles."""

    def __init__(self, size: Size) -> None:
        self._color = Canvas(size, 4, np.uint8)
        self._position, self._normal, self._decal = (Canvas(size, 4, np.float32) for _ in range(3))

    def place(self, targets: Targets, tile: Tile) -> None:
        """Read what the targets hold of a tile."""
        self._color.place(targets.resolve.pixels(targets.light_pass.light, tile, 1, STUDIO), tile)
        self._position.place(targets.gbuffer.read_position(tile), tile)
        self._normal.place(targets.gbuffer.read_normal(tile), tile)
        self._decal.place(targets.decal_pass.read_decal(tile), tile)

    @property
    def buffers(self) -> Buffers:
        """What was placed."""
        position, decal = self._position.pixels, self._decal.pixels
        return Buffers(
            position=position[..., :3],
            normal=self._normal.pixels[..., :3],
            object_id=position[..., 3].astype(np.int32) - 1,
            owner=decal[..., 0].astype(np.int32),
            field=decal[..., 1],
            uv=decal[..., 2:],
            color=self._color.pixels,
        )
