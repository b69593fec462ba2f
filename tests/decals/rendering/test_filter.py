"""Filtered pictures, with one sample a pixel, against the mean of many points of each pixel."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blobtree.transpile.python import plain_python, vector
from decals.field import pixel_filter
from decals.rendering.options import RenderOptions
from decals.rendering.renderer import Renderer
from decals.rendering.uploads import filled_corners
from tests.blobtree.transpile.warp_functions import python_function
from tests.decals.rendering.flat_views import FLAT, expected_picture, flat_view, peak_ratio, waves
from tests.oracles.pixels import share_above

SIZE = (64, 48)


@cache
def expected(angle: float, kind: str, contact: str) -> np.ndarray:
    """Means over 64 points of each pixel, from 0 to 255."""
    return expected_picture(flat_view(angle, kind), SIZE, contact)


def difference(drawer: Renderer, angle: float, kind: str, contact: str = "elastic") -> np.ndarray:
    """Differences of a filtered picture from the means, in levels of 255."""
    options = RenderOptions(SIZE, samples=1, filtered=True, contact=contact, lights=FLAT)
    pixels = drawer.render(flat_view(angle, kind), options)[..., :3]
    found: np.ndarray = np.abs(pixels - expected(angle, kind, contact)).max(axis=-1)
    return found


@pytest.mark.parametrize(
    ("angle", "kind", "contact", "least"),
    [
        (0, "waves", "elastic", 43),
        (80, "waves", "elastic", 33),  # decals of three pixels' height
        (45, "waves", "product", 37),  # footprints without contact
        (45, "waves", "radial", 41),
        (45, "layers", "elastic", 41),
        (60, "plain", "elastic", 39),
    ],
)
def test_one_sample_a_pixel_is_near_the_mean(
    drawer: Renderer, angle: float, kind: str, contact: str, least: float
) -> None:
    assert peak_ratio(difference(drawer, angle, kind, contact)) > least


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
