"""A picture is drawn in tiles, each of which sees its own part of the camera's view."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from decals.render.context import Context
from decals.render.entry import Program
from decals.render.parts import Rectangle
from decals.scenes.viewpoint import Bounds, Floats, Rays, Viewpoint

Compiled = TypeVar("Compiled", bound=Program)

CAMERA_BINDING = 0
"""Binding point of the uniform block in ``shaders/camera.glsl``."""
MAX_TILE = 2560
"""Tiles, without their margins, are at most this many samples wide and high; it bounds the memory."""
MARGIN = 320
"""Samples around a tile that are drawn too, so that what looks at its neighbours never meets a seam."""


@dataclass(frozen=True, slots=True)
class Picture:
    """How a whole picture sees the world: its size in samples, clip space, and the rays of the samples."""

    size: tuple[int, int]
    matrix: Floats
    rays: Rays

    @classmethod
    def of(cls, viewpoint: Viewpoint, size: tuple[int, int], bounds: Bounds) -> Self:
        """Give what a viewpoint sees in a picture of this size, in samples, of what is in a box."""
        return cls(size, viewpoint.clip_matrix(size, bounds), viewpoint.rays(*size))

    def whole(self) -> "Tile":
        """Give a single tile."""
        return self.part(Rectangle(0, 0, *self.size))

    def part(self, inner: Rectangle) -> "Tile":
        """Give a rectangle as a tile without margins."""
        return Tile(self, inner.x, inner.y, inner.width, inner.height, inner)


@dataclass(frozen=True, slots=True)
class Tile:
    """A rectangle of a picture's samples, counted from the picture's lower left corner.

    All of it is drawn; of that, the inner rectangle (in the same coordinates) becomes pixels.
    """

    picture: Picture
    x: int
    y: int
    width: int
    height: int
    inner: Rectangle

    def matrix(self) -> NDArray[np.float64]:
        """World to this tile's clip space, acting on columns."""
        width, height = self.picture.size
        crop = np.eye(4)
        crop[0, 0], crop[1, 1] = width / self.width, height / self.height
        crop[0, 3] = (width - 2 * self.x) / self.width - 1
        crop[1, 3] = (height - 2 * self.y) / self.height - 1
        return np.asarray(crop @ self.picture.matrix)

    def block(self) -> bytes:
        """Give the contents of ``CameraBlock`` in ``shaders/camera.glsl`` (std140)."""
        rays = self.picture.rays
        rows = np.zeros((8, 4), np.float32)
        rows[:4] = self.matrix().T
        rows[4:, :3] = rays.origins(self.x, self.y), rays.directions(self.x, self.y), rays.right, rays.up
        rows[4, 3] = not rays.parallel
        return rows.tobytes()


def tiles(picture: Picture, samples: int, *, limit: int = MAX_TILE) -> Iterator[Tile]:
    """Cut a picture with ``samples`` per axis of a pixel; no tile cuts through a pixel."""
    width, height = picture.size
    step = _step(samples, limit)
    for y in range(0, height, step):
        for x in range(0, width, step):
            inner = Rectangle(x, y, min(step, width - x), min(step, height - y))
            left, right = max(x - MARGIN, 0), min(x + inner.width + MARGIN, width)
            low, high = max(y - MARGIN, 0), min(y + inner.height + MARGIN, height)
            yield Tile(picture, left, low, right - left, high - low, inner)


def largest_tile(size: tuple[int, int], samples: int, *, limit: int = MAX_TILE) -> tuple[int, int]:
    """Give a size, in samples, that holds each of a picture's tiles."""
    most = _step(samples, limit) + 2 * MARGIN
    return min(size[0] * samples, most), min(size[1] * samples, most)


def _step(samples: int, limit: int) -> int:
    return max(limit // samples, 1) * samples


class CameraBuffer:
    """The uniform block from which every program reads the tile's camera."""

    def __init__(self, context: Context) -> None:
        self._buffer = context.gl.buffer(reserve=128)

    def use(self, tile: Tile) -> Self:
        """Fill the block for a tile and bind it."""
        self._buffer.write(tile.block())
        self._buffer.bind_to_uniform_block(CAMERA_BINDING)
        return self

    def release(self) -> None:
        """Give the memory back."""
        self._buffer.release()


def attach_camera(program: Compiled) -> Compiled:
    """Let a program read its ``CameraBlock``, if it has one, from the bound buffer."""
    block = program.get("CameraBlock", None)
    if isinstance(block, moderngl.UniformBlock):
        block.binding = CAMERA_BINDING
    return program


def set_uniform(program: Program, name: str, value: object) -> None:
    """Set a uniform; one that the driver found unused is passed over."""
    uniform = program.get(name, None)
    if isinstance(uniform, moderngl.Uniform):
        uniform.value = value


def read_floats(framebuffer: moderngl.Framebuffer, attachment: int, tile: Tile) -> NDArray[np.float32]:
    """Read the inner part of a tile from a target, ``float32[h, w, 4]``, the lowest row first."""
    inner = tile.inner
    part = inner.x - tile.x, inner.y - tile.y, inner.width, inner.height
    data = framebuffer.read(part, components=4, attachment=attachment, alignment=1, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(inner.height, inner.width, 4)
