"""Canvas of the generated decal images: coordinates, noise, light and filtering.

An image is a function of continuous coordinates, lit as a height field. It is drawn on a grid finer than the
result, and averaged with premultiplied alpha, so that edges are smooth in every size.
"""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.floating[Any]]
Color = tuple[float, float, float]

WORK_SIZE = 768
"""Edge of the grid on which small images are drawn before averaging, in samples."""

MAX_SUPERSAMPLING = 16
"""Largest number of samples per pixel and axis."""

BAND_SAMPLES = 1 << 15
"""Samples of the rows that are drawn at once: arrays of so many fit into the cache of a core."""

Vector = tuple[float, float, float]

SUN: Vector = (-0.28, 0.36, 0.89)
"""Direction of the light in the images: nearly overhead, because decals are turned in any direction."""


@dataclass(frozen=True)
class Canvas:
    """Sample positions of some rows of a square drawing: x to the right (u), y up (v), both from -1 to 1.

    Attributes
    ----------
    x, y : float32[m, n]
        Coordinates; the decal's rim is the circle ``rho == 1``. Row 0 is the topmost.
    rho : float32[m, n]
        Distance from the centre.
    step : float
        Distance between neighbouring samples.
    """

    x: Field
    y: Field
    rho: Field
    step: float

    @classmethod
    def of_rows(cls, samples: int, first: int, last: int) -> "Canvas":
        """Return the rows ``first`` to ``last - 1`` of ``samples`` x ``samples`` positions."""
        step = 2.0 / samples
        ticks = ((np.arange(samples, dtype=np.float32) + 0.5) * step - 1.0).astype(np.float32)
        x, y = np.meshgrid(ticks, ticks[::-1][first:last])
        return cls(x, y, np.hypot(x, y), step)

    def below(self, value: Field, limit: float) -> Field:
        """Return the coverage of the region ``value < limit``, with an edge one sample wide."""
        return np.asarray(np.clip(0.5 + (np.float32(limit) - value) / np.float32(self.step), 0.0, 1.0))


Painter = Callable[[Canvas], tuple[Field, Field]]
"""Function of a canvas that returns colour float32[m, n, 3] and opacity float32[m, n], both in [0, 1].

A sample depends on its position alone, and on the height at its neighbours.
"""


def draw(paint: Painter, size: int) -> NDArray[np.uint8]:
    """Draw an image, averaged to ``size`` x ``size`` pixels.

    Parameters
    ----------
    paint : Painter
        Colour and opacity on a canvas.
    size : int
        Edge of the result in pixels.

    Returns
    -------
    uint8[size, size, 4]
        Straight (not premultiplied) RGBA, row 0 at the top.
    """
    factor = int(np.clip(WORK_SIZE // size, 1, MAX_SUPERSAMPLING))
    rows = max(1, BAND_SAMPLES // (size * factor**2))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        bands = pool.map(lambda first: _band(paint, size, factor, first, first + rows), range(0, size, rows))
        return np.concatenate(list(bands))


def _band(paint: Painter, size: int, factor: int, first: int, last: int) -> NDArray[np.uint8]:
    """Return the rows ``first`` to ``last - 1`` of pixels of an image, as `draw` does."""
    last = min(last, size)
    above, below = max(first * factor - 1, 0), min(last * factor + 1, size * factor)
    own = np.s_[first * factor - above : last * factor - above]  # without the rows of the slopes' neighbours
    color, alpha = (part[own] for part in paint(Canvas.of_rows(size * factor, above, below)))
    layers = np.concatenate([color * alpha[..., None], alpha[..., None]], axis=-1)
    mean = layers.reshape(last - first, factor, size, factor, 4).mean(axis=(1, 3))
    opacity = mean[..., 3:]
    straight = mean[..., :3] / np.maximum(opacity, 1e-3)
    if opacity.min() <= 1e-3:
        # A fully transparent pixel keeps the unweighted colour, so that filters read no black at the edge.
        plain = color.reshape(last - first, factor, size, factor, 3).mean(axis=(1, 3))
        straight = np.where(opacity > 1e-3, straight, plain)
    pixels = np.concatenate([straight, opacity], axis=-1)
    return np.asarray(np.rint(np.clip(pixels, 0.0, 1.0) * 255.0), dtype=np.uint8)


def rgb(code: str) -> Color:
    """Return ``"#rrggbb"`` as three numbers in [0, 1]."""
    red, green, blue = bytes.fromhex(code.removeprefix("#"))
    return red / 255.0, green / 255.0, blue / 255.0


def smoothstep(low: float, high: float, value: Field) -> Field:
    """Return the cubic step from 0 at ``low`` to 1 at ``high``, which may be the smaller one."""
    t = np.clip((value - np.float32(low)) / np.float32(high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), dtype=np.float32)


def mix(first: Field | Color, second: Field | Color, amount: Field) -> Field:
    """Return a blend of two colours, or colour fields, by amounts in [0, 1]: float32[n, n, 3]."""
    a, b = np.asarray(first, np.float32), np.asarray(second, np.float32)
    return np.asarray(a + (b - a) * amount[..., None], dtype=np.float32)


def light(canvas: Canvas, height: Field, *, ambient: float = 0.42, sun: Vector = SUN) -> Field:
    """Return the diffuse light on a height field, about 1 where it is level."""
    facing = _facing(canvas, height, np.asarray(sun, np.float32))
    level = ambient + (1.0 - ambient) * facing / np.float32(sun[2])
    return np.asarray(np.maximum(level, 0.25 * ambient), dtype=np.float32)


def shine(canvas: Canvas, height: Field, *, sharpness: float, sun: Vector = SUN) -> Field:
    """Return the specular highlight on a height field seen from above, from 0 to 1 (Blinn)."""
    glance = np.asarray(sun, np.float32) + np.asarray((0.0, 0.0, 1.0), np.float32)
    facing = np.maximum(_facing(canvas, height, glance / np.float32(math.hypot(*glance))), 0.0)
    return np.asarray(facing ** np.float32(sharpness), dtype=np.float32)


def _facing(canvas: Canvas, height: Field, direction: Field) -> Field:
    """Return the cosines between normals and a direction; not by BLAS, which rounds by the processor."""
    return np.asarray((_normals(canvas, height) * direction).sum(axis=-1), dtype=np.float32)


def _normals(canvas: Canvas, height: Field) -> Field:
    down, right = np.gradient(height, np.float32(canvas.step))
    normal = np.stack([-right, down, np.ones_like(height)], axis=-1)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True), dtype=np.float32)


def dark_ring(canvas: Canvas, color: Field, *, width: float) -> Field:
    """Return a colour field with the near-black border that becomes the contact line between neighbours.

    Contact deformation moves the circle ``rho == 1`` onto the contact line (paper, figure 8). The border
    extends to the corners of the square, so that filters blend no other colour into the line.
    """
    edge = smoothstep(1.0 - 1.45 * width, 1.0 - width, canvas.rho)
    return mix(color, rgb("#0b0a0a"), edge)


_U = np.uint32


def _hash(ix: NDArray[np.int32], iy: NDArray[np.int32], seed: int) -> Field:
    """Return pseudo-random numbers in [0, 1) of lattice points."""
    h = ix.astype(_U) * _U(0x8DA6B343) ^ iy.astype(_U) * _U(0xD8163841) ^ _U(seed * 0x9E3779B1 & 0xFFFFFFFF)
    h = (h ^ (h >> _U(15))) * _U(0x2C1B3C6D)
    h = (h ^ (h >> _U(12))) * _U(0x297A2D39)
    h ^= h >> _U(15)
    return np.asarray((h >> _U(8)).astype(np.float32) * np.float32(2.0**-24), dtype=np.float32)


def value_noise(x: Field, y: Field, *, seed: int) -> Field:
    """Return smooth noise in [0, 1] with features one unit wide."""
    left, below = np.floor(x), np.floor(y)
    fx, fy = x - left, y - below
    fx, fy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    rest_x, rest_y = 1.0 - fx, 1.0 - fy
    # Many samples share a lattice point, so each of these is hashed once.
    origin, end = (np.array([f(left), f(below)], np.int32) for f in (np.min, np.max))
    width, height = (end - origin + 2).tolist()
    ix, iy = np.meshgrid(*(np.arange(n, dtype=np.int32) for n in (width, height)))
    lattice = _hash(ix + origin[0], iy + origin[1], seed).reshape(-1)
    at = (below - below.min()).astype(np.intp) * width + (left - left.min()).astype(np.intp)
    low = lattice.take(at) * rest_x + lattice[1:].take(at) * fx
    high = lattice[width:].take(at) * rest_x + lattice[width + 1 :].take(at) * fx
    return np.asarray(low * rest_y + high * fy, dtype=np.float32)


def fractal_noise(x: Field, y: Field, *, octaves: int, seed: int) -> Field:
    """Return a sum of noises in [0, 1], each half as high and twice as fine as the one before."""
    total = np.zeros_like(x)
    weight, norm = 1.0, 0.0
    for octave in range(octaves):
        total += np.float32(weight) * value_noise(x, y, seed=seed + octave)
        norm += weight
        # Rotation and shift of each octave hide the lattice.
        x, y = 1.6 * x - 1.2 * y + 7.3, 1.2 * x + 1.6 * y - 3.1
        weight *= 0.5
    return np.asarray(total / np.float32(norm), dtype=np.float32)


def cell_noise(x: Field, y: Field, *, seed: int) -> tuple[Field, Field]:
    """Return distances to the two nearest of random points, one per unit square (Worley 1996)."""
    ix, iy = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
    first, second = np.full_like(x, 9.0), np.full_like(x, 9.0)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            px, py = ix + np.int32(dx), iy + np.int32(dy)
            gap_x = px.astype(np.float32) + _hash(px, py, seed) - x
            gap_y = py.astype(np.float32) + _hash(px, py, seed + 1) - y
            gap = np.hypot(gap_x, gap_y)
            second = np.minimum(second, np.maximum(first, gap))
            first = np.minimum(first, gap)
    return first, second
