"""Filtered pictures, with one sample a pixel, against the mean of many points of each pixel."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blobtree.transpile.python import plain_python, vector
from decals.field import pixel_filter
from decals.images.load import decode_srgb
from decals.model import Decals
from decals.rendering.lights import Lighting
from decals.rendering.options import RenderOptions
from decals.rendering.renderer import Renderer
from decals.rendering.uploads import filled_corners
from decals.scenes.camera import Camera
from tests.blobtree.transpile.warp_functions import python_function
from tests.decals.shapes import Picture, Shape, View
from tests.oracles.pixels import display, pixel_means, share_above

SIZE = (64, 48)
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


def black() -> np.ndarray:
    return np.array([0, 0, 0, 255], np.uint8) * np.ones((4, 4, 1), np.uint8)


def flat_view(angle: float, kind: str) -> View:
    """Ten decals on the plane: alone, in pairs, three that meet, and a small one on a large one."""
    places = [(-1.7, 0.9), (-0.6, 1.0), (0.4, 1.1), (1.5, 0.8), (2.1, 0.1), (-1.6, -0.5), (-0.6, -0.4)]
    places += [(0.5, -0.3), (0.45, -0.35), (-0.1, -1.2)]
    count = len(places)
    images = [np.full((4, 4, 4), 255, np.uint8), black()] if kind == "plain" else [waves()]
    rng = np.random.default_rng(3)
    columns: dict[str, Any] = {"images": np.arange(count) % len(images)}
    if kind == "layers":
        columns |= {"layers": rng.integers(0, 3, count), "interactions": rng.integers(0, 3, count)}
    turn = 1.3 * np.arange(count)
    decals = Decals(
        np.column_stack([places, np.zeros(count)]).astype(np.float32),
        [[0, 0, 1]] * count,
        np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)]),
        np.array([0.55, 0.6, 0.7, 0.5, 0.5, 0.6, 0.65, 0.8, 0.3, 0.6], np.float32),
        **columns,
    )
    a, roll = np.radians(angle), 0.4
    direction = np.array([np.sin(a) * np.cos(roll), np.sin(a) * np.sin(roll), np.cos(a)])
    camera = Camera(tuple(12.0 * direction), up=(0.3, 0.2, 1.0), fov=15)
    return View((SQUARE,), camera, decals, tuple(map(Picture, images)))


@cache
def expected(angle: float, kind: str, contact: str) -> np.ndarray:
    """Means over 64 points of each pixel, from 0 to 255."""
    view = flat_view(angle, kind)
    images = [picture.pixels for picture in view.images]
    ground = float(decode_srgb(np.array([GROUND]))[0])
    return display(pixel_means(view.decals, images, view.camera, SIZE, ground, samples=64, contact=contact))


def difference(drawer: Renderer, angle: float, kind: str, contact: str = "elastic") -> np.ndarray:
    """Differences of a filtered picture from the means, in levels of 255."""
    options = RenderOptions(SIZE, samples=1, filtered=True, contact=contact, lights=FLAT)
    pixels = drawer.render(flat_view(angle, kind), options)[..., :3]
    found: np.ndarray = np.abs(pixels - expected(angle, kind, contact)).max(axis=-1)
    return found


def ratio(difference: np.ndarray) -> float:
    """Peak signal to noise in decibels."""
    return float(10 * np.log10(255**2 / np.mean(difference**2)))


@pytest.mark.parametrize(
    ("angle", "kind", "contact", "least"),
    [
        (0, "waves", "elastic", 43),
        (80, "waves", "elastic", 33),  # decals of three pixels' height
        (45, "waves", "product", 39),
        (45, "waves", "radial", 41),
        (45, "layers", "elastic", 41),
        (60, "plain", "elastic", 39),
    ],
)
def test_one_sample_a_pixel_is_near_the_mean(
    drawer: Renderer, angle: float, kind: str, contact: str, least: float
) -> None:
    assert ratio(difference(drawer, angle, kind, contact)) > least


@given(st.floats(-2, 2), st.tuples(*[st.floats(-1, 1)] * 2).filter(lambda a: max(map(abs, a)) > 1e-3))
def test_shares_of_a_pixel_are_exact(value: float, along: tuple[float, float]) -> None:
    part = plain_python(python_function(pixel_filter.positive_part))(value, vector(*along))
    share, mean = share_above(value, along)
    assert part[0] == pytest.approx(share, abs=3e-3)
    if 0.01 < share < 1.0:
        scale = abs(along[0]) + abs(along[1])
        assert value + part[1] * along[0] + part[2] * along[1] == pytest.approx(mean, abs=0.01 * scale)


def test_images_do_not_show_what_lies_outside_their_disc() -> None:
    image = waves(64)
    y, x = np.mgrid[:64, :64] + 0.5
    outside = np.hypot(x - 32, y - 32) > 33.5
    image[outside] = (255, 0, 255, 255)
    filled = filled_corners(image)
    np.testing.assert_array_equal(filled[~outside], image[~outside])
    assert not (filled[outside] == (255, 0, 255, 255)).all(axis=-1).any()
