"""The drawing board of the generated decal images: coordinates, noise, light and the final filtering.

An image is drawn as a function of continuous coordinates on a grid finer than the result, lit from a height
field, and averaged down with premultiplied alpha, so edges are smooth at every size.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.floating[Any]]
Color = tuple[float, float, float]

WORK_SIZE = 768
"""Edge of the grid that small images are drawn on before they are averaged down, in samples."""

MAX_SUPERSAMPLING = 16
"""Most samples per pixel and axis; beyond it a tiny image gains nothing."""

Vector = tuple[float, float, float]

SUN: Vector = (-0.28, 0.36, 0.89)
"""Where the light painted into the images comes from: mostly overhead, as decals lie in any direction."""


@dataclass(frozen=True)
class Canvas:
    """Sample positions of a square drawing: x to the right (u), y up (v), both from -1 to 1.

    Attributes
    ----------
    x, y : float32[n, n]
        Coordinates; the decal's rim is the circle ``rho == 1``. Row 0 is the top of the image.
    rho : float32[n, n]
        Distance from the centre.
    step : float
        Distance between neighbouring samples.
    """

    x: Field
    y: Field
    rho: Field
    step: float

    @classmethod
    def of_size(cls, samples: int) -> "Canvas":
        """Make the canvas of ``samples`` x ``samples`` sample positions."""
        step = 2.0 / samples
        ticks = ((np.arange(samples, dtype=np.float32) + 0.5) * step - 1.0).astype(np.float32)
        x, y = np.meshgrid(ticks, ticks[::-1])
        return cls(x, y, np.hypot(x, y), step)

    def below(self, value: Field, limit: float) -> Field:
        """Coverage of the region ``value < limit``, one sample soft; ``value`` is a distance."""
        return np.asarray(np.clip(0.5 + (np.float32(limit) - value) / np.float32(self.step), 0.0, 1.0))


Painter = Callable[[Canvas], tuple[Field, Field]]
"""Gives colour float32[n, n, 3] and opacity float32[n, n], both in [0, 1], on a canvas."""


def draw(paint: Painter, size: int) -> NDArray[np.uint8]:
    """Draw an image and average it down to ``size`` x ``size`` pixels.

    Parameters
    ----------
    paint : Painter
        What to draw.
    size : int
        Edge of the result in pixels.

    Returns
    -------
    uint8[size, size, 4]
        Straight (not premultiplied) RGBA, row 0 at the top.
    """
    factor = int(np.clip(WORK_SIZE // size, 1, MAX_SUPERSAMPLING))
    color, alpha = paint(Canvas.of_size(size * factor))
    layers = np.concatenate([color * alpha[..., None], alpha[..., None]], axis=-1)
    mean = layers.reshape(size, factor, size, factor, 4).mean(axis=(1, 3))
    opacity = mean[..., 3:]
    # A fully transparent pixel keeps the unweighted colour, so that filtering finds no black behind the edge.
    plain = color.reshape(size, factor, size, factor, 3).mean(axis=(1, 3))
    straight = np.where(opacity > 1e-3, mean[..., :3] / np.maximum(opacity, 1e-3), plain)
    pixels = np.concatenate([straight, opacity], axis=-1)
    return np.asarray(np.rint(np.clip(pixels, 0.0, 1.0) * 255.0), dtype=np.uint8)


def rgb(code: str) -> Color:
    """Turn ``"#rrggbb"`` into three numbers in [0, 1]."""
    red, green, blue = bytes.fromhex(code.removeprefix("#"))
    return red / 255.0, green / 255.0, blue / 255.0


def smoothstep(low: float, high: float, value: Field) -> Field:
    """Rise from 0 at ``low`` to 1 at ``high``, with level ends; ``low > high`` falls instead."""
    t = np.clip((value - np.float32(low)) / np.float32(high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), dtype=np.float32)


def mix(first: Field | Color, second: Field | Color, amount: Field) -> Field:
    """Blend two colours (or colour fields) by a field of amounts in [0, 1]: float32[n, n, 3]."""
    a, b = np.asarray(first, np.float32), np.asarray(second, np.float32)
    return np.asarray(a + (b - a) * amount[..., None], dtype=np.float32)


def light(canvas: Canvas, height: Field, *, ambient: float = 0.42, sun: Vector = SUN) -> Field:
    """Diffuse light on a height field, about 1 where it is level."""
    normal = _normals(canvas, height)
    level = ambient + (1.0 - ambient) * (normal @ np.asarray(sun, np.float32)) / np.float32(sun[2])
    return np.asarray(np.maximum(level, 0.25 * ambient), dtype=np.float32)


def shine(canvas: Canvas, height: Field, *, sharpness: float, sun: Vector = SUN) -> Field:
    """Specular highlight on a height field seen from above, from 0 to 1 (Blinn's half-way vector)."""
    glance = np.asarray(sun, np.float32) + np.asarray((0.0, 0.0, 1.0), np.float32)
    facing = np.maximum(_normals(canvas, height) @ (glance / np.linalg.norm(glance)), 0.0)
    return np.asarray(facing ** np.float32(sharpness), dtype=np.float32)


def _normals(canvas: Canvas, height: Field) -> Field:
    down, right = np.gradient(height, np.float32(canvas.step))
    normal = np.stack([-right, down, np.ones_like(height)], axis=-1)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True), dtype=np.float32)


def dark_ring(canvas: Canvas, color: Field, *, width: float) -> Field:
    """Close an image with the near-black border that becomes the contact line between neighbours.

    Contact deformation squeezes the whole disc into the decal's cell, so whatever lies at ``rho == 1`` is
    what two neighbours meet with (the paper's figure 8). The border runs on to the corners of the square,
    so that no filter bleeds anything else into the line.
    """
    edge = smoothstep(1.0 - 1.45 * width, 1.0 - width, canvas.rho)
    return mix(color, rgb("#0b0a0a"), edge)
