"""Pixels in float64: their rays, and averages of decals over points of a plane, each with its own owner."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.oracles.decals import colors_at

Floats = NDArray[np.float64]


def middle_rays(camera: Any, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Origin, and directions [h w, 3], of the rays through the middles of pixels, from the upper left one."""
    width, height = size
    x, y = np.meshgrid(np.arange(width) + 0.5, height - np.arange(height) - 0.5)
    rays = camera.rays(width, height)
    return rays.origin, rays.directions(x, y).reshape(-1, 3)


def pixel_means(
    decals: Any,
    images: Sequence[NDArray[np.uint8]],
    camera: Any,
    size: tuple[int, int],
    ground: float,
    *,
    samples: int = 256,
    contact: str = "elastic",
) -> Floats:
    """Mean linear colours, [h, w, 3], of the plane z = 0 in a linear grey under decals, row 0 at the top.

    The points of each pixel lie in different rows and columns of it.
    """
    width, height = size
    rays = camera.rays(width, height)
    column, row, i = np.meshgrid(np.arange(width), np.arange(height)[::-1], np.arange(samples))
    bits = samples.bit_length() - 1
    mirrored = sum(((i >> k) & 1) << (bits - 1 - k) for k in range(bits))
    x, y = column + (i + 0.5) / samples, row + (mirrored + 0.5) / samples
    directions = rays.directions(x, y).reshape(-1, 3)
    origins = np.broadcast_to(rays.origins(x, y), (*x.shape, 3)).reshape(-1, 3)
    points = origins - directions * (origins[:, 2:] / directions[:, 2:])
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    front = colors_at(
        decals, points, up, lambda numbers, uv: _texels(decals, images, numbers, uv), contact=contact
    )
    colors = front[:, :3] + (1 - front[:, 3:]) * ground
    means: Floats = colors.reshape(height, width, samples, 3).mean(axis=2)
    return means


def _texels(decals: Any, images: Sequence[NDArray[np.uint8]], numbers: NDArray[Any], uv: Floats) -> Floats:
    """Premultiplied linear colours of the images of decals, read bilinearly; without tint and opacity."""
    colors = np.zeros((len(numbers), 4))
    layers = np.asarray(decals.images)[numbers]
    for layer, image in enumerate(images):
        rows = layers == layer
        srgb = image[::-1].astype(np.float64) / 255
        linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        texels = np.concatenate([linear[..., :3] * srgb[..., 3:], srgb[..., 3:]], axis=-1)
        height, width = image.shape[:2]
        x = np.clip(uv[rows, 0] * width - 0.5, 0, width - 1)
        y = np.clip(uv[rows, 1] * height - 0.5, 0, height - 1)
        left, low = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
        a, b = (x - left)[:, None], (y - low)[:, None]
        lower = (1 - a) * texels[low, left] + a * texels[low, left + 1]
        upper = (1 - a) * texels[low + 1, left] + a * texels[low + 1, left + 1]
        colors[rows] = (1 - b) * lower + b * upper
    return colors


def display(linear: Floats) -> Floats:
    """Linear light as sRGB from 0 to 255."""
    light = np.clip(linear, 0, 1)
    srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    result: Floats = 255 * srgb
    return result


def share_inside(lines: Sequence[tuple[float, float, float]]) -> tuple[float, float, float]:
    """Area and centre of the part of a unit square in which all value + a·x + b·y > 0; exact, by clipping."""
    points = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    for value, a, b in lines:
        levels = [value + a * x + b * y for x, y in points]
        kept: list[tuple[float, float]] = []
        for k in range(len(points)):
            p, q, here, before = points[k], points[k - 1], levels[k], levels[k - 1]
            if (here > 0) != (before > 0):
                t = here / (here - before)
                kept.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
            if here > 0:
                kept.append(p)
        points = kept
    if len(points) < 3:
        return 0.0, 0.0, 0.0
    corners = np.array(points)
    following = np.roll(corners, -1, axis=0)
    crosses = corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]
    area = 0.5 * crosses.sum()
    if area < 1e-12:
        return 0.0, 0.0, 0.0
    centre = ((corners + following) * crosses[:, None]).sum(axis=0) / (6 * area)
    return float(area), float(centre[0]), float(centre[1])
