"""Decals on a plane under no light, seen at any angle, for comparisons with the means of pixels."""

from typing import Any

import numpy as np

from decals import Camera, Decals
from decals.images.texels import decode_srgb
from decals.rendering import Lighting
from tests.decals.shapes import Picture, Shape, View
from tests.oracles.pixels import display, pixel_means

GROUND = 0.5
FLAT = Lighting((), tuple(np.eye(4).ravel().tolist()))
SIDE = 500.0
SQUARE = Shape(
    np.array([[-SIDE, -SIDE, 0], [SIDE, -SIDE, 0], [SIDE, SIDE, 0], [-SIDE, SIDE, 0]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    (GROUND, GROUND, GROUND),
)


def waves(size: int = 128) -> np.ndarray:
    """Coloured stripes, opaque everywhere."""
    y, x = np.mgrid[:size, :size] / size
    channels = [0.5 + 0.45 * np.sin(k * (x + s * y)) for k, s in ((6, 0.5), (9, -1), (4, 2))]
    return np.dstack([*(255 * c for c in channels), np.full_like(x, 255)]).astype(np.uint8)


def grey(level: int, alpha: int = 255) -> np.ndarray:
    """One level everywhere; not black, whose share of 1/256 would be 13 levels of sRGB."""
    return np.array([level, level, level, alpha], np.uint8) * np.ones((4, 4, 1), np.uint8)


def flat_view(angle: float, kind: str) -> View:
    """Ten decals on the plane: alone, in pairs, three that meet, and a small one on a large one.

    Of the kind "nested", small ones on large ones: beside others that cut them, and transparent ones.
    """
    places = [(-1.7, 0.9), (-0.6, 1.0), (0.4, 1.1), (1.5, 0.8), (2.1, 0.1), (-1.6, -0.5), (-0.6, -0.4)]
    places += [(0.5, -0.3), (0.45, -0.35), (-0.1, -1.2)]
    count = len(places)
    images = [grey(240), grey(80)] if kind == "plain" else [waves()]
    rng = np.random.default_rng(3)
    columns: dict[str, Any] = {"images": np.arange(count) % len(images)}
    radii = [0.55, 0.6, 0.7, 0.5, 0.5, 0.6, 0.65, 0.8, 0.3, 0.6]
    if kind == "nested":
        places = [(-0.7, 0.6), (-0.2, 0.8), (0.7, 0.7), (0.3, -0.7), (0.6, -0.9), (1.6, -0.9), (-1.3, -0.6)]
        places += [(-1.2, -0.5), (-1.9, -0.8), (1.9, 0.6)]
        radii = [0.9, 0.4, 0.8, 0.8, 0.35, 0.8, 0.6, 0.3, 0.5, 0.3]
        images = [grey(240), grey(80), grey(240, alpha=0), grey(240, alpha=80)]
        columns = {"images": [1, 0, 1, 1, 2, 1, 1, 3, 1, 0]}
    if kind == "layers":
        columns |= {"layers": rng.integers(0, 3, count), "interactions": rng.integers(0, 3, count)}
    turn = 1.3 * np.arange(count)
    decals = Decals(
        np.column_stack([places, np.zeros(count)]).astype(np.float32),
        [[0, 0, 1]] * count,
        np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)]),
        np.array(radii, np.float32),
        **columns,
    )
    a, roll = np.radians(angle), 0.4
    direction = np.array([np.sin(a) * np.cos(roll), np.sin(a) * np.sin(roll), np.cos(a)])
    camera = Camera(tuple(22.0 * direction), up=(0.3, 0.2, 1.0), fov=8)
    return View((SQUARE,), camera, decals, tuple(map(Picture, images)))


def expected_picture(
    view: View, size: tuple[int, int], contact: str = "elastic", *, samples: int = 64
) -> np.ndarray:
    """Means over points of each pixel, as sRGB from 0 to 255."""
    images = [picture.pixels for picture in view.images]
    ground = float(decode_srgb(np.array([GROUND]))[0])
    means = pixel_means(view.decals, images, view.camera, size, ground, samples=samples, contact=contact)
    return display(means)


def peak_ratio(difference: np.ndarray) -> float:
    """Peak signal to noise of differences in levels of 255, in decibels."""
    return float(10 * np.log10(255**2 / np.mean(difference**2)))
