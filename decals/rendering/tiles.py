"""Tiles of a picture, each with its own part of the camera's view, and the camera's uniform block."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self, TypeVar

import moderngl
import numpy as np

from blobtree._typing import Float32Array, Float64Array
from decals.rendering.context import Context
from decals.rendering.pixel_pass import Program
from decals.rendering.regions import Rectangle
from decals.rendering.viewpoint import Bounds, Rays, Viewpoint

Compiled = TypeVar("Compiled", bound=Program)

CAMERA_BINDING = 0
"""Binding point of the uniform block in ``shaders/camera.glsl``."""
MAX_TILE = 2560
"""Samples along each side of a tile without its margin, at most; it bounds the memory."""
TILE_MARGIN = 320
"""Samples around a tile that are drawn too, so that passes which read neighbouring pixels show no seam."""


@dataclass(frozen=True, slots=True)
class PictureView:
    """View of a whole picture: its size in samples, the matrix to clip space, and the rays of the samples."""

    size: tuple[int, int]
    matrix: Float64Array
    rays: Rays

    @classmethod
    def of(cls, viewpoint: Viewpoint, size: tuple[int, int], bounds: Bounds) -> Self:
        """Return the view of a viewpoint in a picture of this size, in samples, of objects in a box."""
        return cls(size, viewpoint.clip_matrix(size, bounds), viewpoint.rays(*size))

    def whole(self) -> "Tile":
        """Return the picture as a single tile."""
        return self.part(Rectangle(0, 0, *self.size))

    def part(self, inner: Rectangle) -> "Tile":
        """Return a rectangle as a tile without margin."""
        return Tile(self, inner.x, inner.y, inner.width, inner.height, inner)


@dataclass(frozen=True, slots=True)
class Tile:
    """A rectangle of a picture's samples, counted from the picture's lower left corner.

    All of it is drawn; its inner rectangle (in the same coordinates) becomes pixels.
    """

    view: PictureView
    x: int
    y: int
    width: int
    height: int
    inner: Rectangle

    def matrix(self) -> Float64Array:
        """Return the matrix from the world to this tile's clip space, acting on columns."""
        width, height = self.view.size
        crop = np.eye(4)
        crop[0, 0], crop[1, 1] = width / self.width, height / self.height
        crop[0, 3] = (width - 2 * self.x) / self.width - 1
        crop[1, 3] = (height - 2 * self.y) / self.height - 1
        return np.asarray(crop @ self.view.matrix)

    def block(self) -> bytes:
        """Return the contents of ``CameraBlock`` in ``shaders/camera.glsl`` (std140)."""
        rays = self.view.rays
        rows = np.zeros((8, 4), np.float32)
        rows[:4] = self.matrix().T
        rows[4:, :3] = rays.origins(self.x, self.y), rays.directions(self.x, self.y), rays.right, rays.up
        rows[4, 3] = not rays.parallel
        return rows.tobytes()


def tiles(view: PictureView, samples: int, *, limit: int = MAX_TILE) -> Iterator[Tile]:
    """Divide a picture with ``samples`` along each axis of a pixel; no tile divides a pixel."""
    width, height = view.size
    step = _step(samples, limit)
    for y in range(0, height, step):
        for x in range(0, width, step):
            inner = Rectangle(x, y, min(step, width - x), min(step, height - y))
            left, right = max(x - TILE_MARGIN, 0), min(x + inner.width + TILE_MARGIN, width)
            low, high = max(y - TILE_MARGIN, 0), min(y + inner.height + TILE_MARGIN, height)
            yield Tile(view, left, low, right - left, high - low, inner)


def largest_tile(size: tuple[int, int], samples: int, *, limit: int = MAX_TILE) -> tuple[int, int]:
    """Return the size, in samples, of the largest tile of a picture with its margin."""
    longest = _step(samples, limit) + 2 * TILE_MARGIN
    return min(size[0] * samples, longest), min(size[1] * samples, longest)


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
        """Release the memory."""
        self._buffer.release()


def attach_camera(program: Compiled) -> Compiled:
    """Connect a program's ``CameraBlock``, if it has one, with the bound buffer."""
    block = program.get("CameraBlock", None)
    if isinstance(block, moderngl.UniformBlock):
        block.binding = CAMERA_BINDING
    return program


def set_uniform(program: Program, name: str, value: object) -> None:
    """Set a uniform; a name that the driver removed as unused is ignored."""
    uniform = program.get(name, None)
    if isinstance(uniform, moderngl.Uniform):
        uniform.value = value


def read_floats(framebuffer: moderngl.Framebuffer, attachment: int, tile: Tile) -> Float32Array:
    """Read the inner part of a tile from a target, ``float32[h, w, 4]``, the lowest row first."""
    inner = tile.inner
    part = inner.x - tile.x, inner.y - tile.y, inner.width, inner.height
    data = framebuffer.read(part, components=4, attachment=attachment, alignment=1, dtype="f4")
    return np.frombuffer(data, np.float32).reshape(inner.height, inner.width, 4)
