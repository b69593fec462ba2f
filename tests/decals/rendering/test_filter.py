"""Filtered pictures, with one sample a pixel, against the mean of many points of each pixel."""

from dataclasses import replace
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from blobtree import Point
from blobtree.transpile.python import plain_python, vector
from decals import Camera, DecalImage, Decals, Scene, TreeObject
from decals.field import elastic, pixel_filter
from decals.rendering import Renderer, RenderOptions
from decals.rendering.image_array import filled_corners
from decals.rendering.pixel_pass import list_size
from decals.rendering.viewpoint import largest_tile
from tests.blobtree.transpile.warp_functions import python_function
from tests.decals.rendering.flat_views import FLAT, expected_picture, flat_view, grey, peak_ratio, waves
from tests.oracles.pixels import share_inside

SIZE = (64, 48)


@cache
def expected(angle: float, kind: str, contact: str) -> np.ndarray:
    """Means over 64 points of each pixel, from 0 to 255."""
    return expected_picture(flat_view(angle, kind), SIZE, contact)


@pytest.mark.ordinary_cases("fragment-0")
@pytest.mark.parametrize("layer", [0, 1])
def test_upper_images_end_at_their_length_along_the_surface(drawer: Renderer, layer: int) -> None:
    """On a ball, at 0.7 and not at the rim, 0.02 farther out, whether in a layer or nested."""
    centres = np.array([[0, 0, 1.0], [np.sin(0.3), 0, np.cos(0.3)]])
    decals = Decals(centres, centres, [[0, 1, 0]] * 2, [1.3, 0.7], images=[0, 1], layers=[0, layer])
    ball = TreeObject("ball", Point((0, 0, 0), radius=1.0))
    camera = Camera((0.0, 0.0, 8.0), up=(0, 1, 0), fov=10)
    images = [DecalImage(name, grey(level)) for name, level in (("light", 240), ("dark", 80))]
    scene = Scene(objects=[ball], camera=camera, decals=decals, images=images)
    options = RenderOptions((64, 64), samples=1, filtered=True, lights=FLAT)
    means = drawer.render(scene, replace(options, filtered=False, samples=5))
    error = np.abs(drawer.render(scene, options).astype(int) - means)
    y, x = np.mgrid[:64, :64] - 31.5
    assert (means[np.hypot(x, y) < 30, 0] < 100).any()
    assert error[np.hypot(x, y) < 30].max() <= 8


def difference(drawer: Renderer, angle: float, kind: str, contact: str = "elastic") -> np.ndarray:
    """Differences of a filtered picture from the means, in levels of 255."""
    options = RenderOptions(SIZE, samples=1, filtered=True, contact=contact, lights=FLAT)
    pixels = drawer.render(flat_view(angle, kind), options)[..., :3]
    found: np.ndarray = np.abs(pixels - expected(angle, kind, contact)).max(axis=-1)
    return found


@pytest.mark.slow_cases(
    "compute-45-layers-elastic-46",
    "compute-85-plain-elastic-50",
    "fragment-80-waves-elastic-46",
    "fragment-45-waves-radial-43",
    "fragment-45-layers-elastic-46",
    "fragment-85-plain-elastic-50",
    "compute-0-waves-elastic-44",
    "compute-80-waves-elastic-46",
    "compute-45-waves-product-42",
    "compute-45-waves-radial-43",
    "compute-45-nested-elastic-45",
)
@pytest.mark.parametrize(
    ("angle", "kind", "contact", "least"),
    [
        (0, "waves", "elastic", 44),
        (80, "waves", "elastic", 46),  # decals of three pixels' height
        (45, "waves", "product", 42),  # footprints without contact
        (45, "waves", "radial", 43),
        (45, "layers", "elastic", 46),
        (45, "plain", "product", 50),
        (85, "plain", "elastic", 50),
        (45, "nested", "elastic", 45),
    ],
)
def test_one_sample_a_pixel_is_near_the_mean(
    drawer: Renderer, angle: float, kind: str, contact: str, least: float
) -> None:
    apart = difference(drawer, angle, kind, contact)
    assert peak_ratio(apart) > least
    if kind == "nested":  # corners of images that others cut are less exact
        assert apart.max() <= 31
    if kind == "plain":  # rims and contact lines; 1 is the noise of 64 points
        assert apart.max() <= 9.1


@pytest.mark.parametrize("target", [(-1.32, 1.06, 0.0), (-1.35, 1.09, 0.0)])
def test_two_layers_whose_rims_meet_in_grazing_pixels(
    drawer: Renderer, target: tuple[float, float, float]
) -> None:
    """The upper decal covers the middle of parts in which the lower one ends as well."""
    view = flat_view(85, "layers")
    view = replace(view, camera=replace(view.camera, target=target, fov=0.8))
    options = RenderOptions((24, 12), samples=1, filtered=True, lights=FLAT)
    pixels = drawer.render(view, options)[..., :3]
    assert np.abs(pixels - expected_picture(view, (24, 12), samples=256)).max() <= 5


SLOPES = st.tuples(*[st.floats(-1, 1)] * 2).filter(lambda a: max(map(abs, a)) > 1e-3)


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(-1, 1), SLOPES), min_size=1, max_size=3))
def test_parts_of_a_pixel_inside_lines_are_exact(lines: list[tuple[float, tuple[float, float]]]) -> None:
    directions = [np.array(along) / np.hypot(*along) for _, along in lines]
    # two lines that coincide are counted twice
    assume(all(abs(a[0] * b[1] - a[1] * b[0]) > 1e-4 for a, b in combinations(directions, 2)))
    pixel_line, inner_part = formulas(pixel_filter.pixel_line, pixel_filter.inner_part)
    drawn = [pixel_line(value, vector(*along)) for value, along in lines]
    part = inner_part(*drawn, *[vector(1.0, 0.0, 0.0)] * (3 - len(lines)))
    share, x, y = share_inside([(value, *along) for value, along in lines])
    assert part[0] == pytest.approx(share, abs=2e-4)
    if share > 0.01:
        assert (part[1], part[2]) == pytest.approx((x, y), abs=2e-3)


def formulas(*functions: object) -> list[Any]:
    """Return typed functions as plain Python, in double precision."""
    return [plain_python(python_function(function)) for function in functions]


def test_steps_of_elastic_contact_are_those_of_its_distance() -> None:
    gradient, push, square = formulas(pixel_filter.push_gradient, elastic.plane_push, elastic.square_of_push)
    steps, pushed = formulas(pixel_filter.pushed_steps, elastic.pushed_distance)
    rng, h, pushing = np.random.default_rng(0), 1e-5, 0
    for stiffness in np.tile([1.0, 2.0, 3.5], 60):
        radius, other = rng.uniform(0.8, 1.2, 2)
        apart = rng.normal(size=3)
        w = 0.4 * apart / np.linalg.norm(apart) + 0.15 * rng.normal(size=3)

        def value(at: Any) -> float:
            distance = np.linalg.norm(at)
            along = push(vector(*at / distance), distance, vector(*apart), radius, other, stiffness)  # noqa: B023
            found: float = square(distance, along)
            return found

        expected = [(value(w + h * axis) - value(w - h * axis)) / (2 * h) for axis in np.eye(3)]
        if not 1e-3 < value(w) < 1e4 or np.linalg.norm(w) > 0.95:
            continue
        pushing += 1
        found = list(gradient(vector(*w), vector(*apart), radius, other, stiffness))
        assert found == pytest.approx([*expected, value(w)], rel=1e-3, abs=1e-4 * np.abs(expected).max())
        distance, squares = float(np.linalg.norm(w)), value(w)
        step, change = rng.normal(size=2)
        along = (pushed(distance + h * step, squares + h * change) - pushed(distance, squares)) / h
        assert steps(distance, vector(step, 0.0), vector(squares, change, 0.0))[1] == pytest.approx(
            along, rel=1e-2, abs=1e-3
        )
    assert pushing > 10


def test_lists_of_pixels_are_no_larger_than_the_picture_that_they_are_of() -> None:
    largest = largest_tile((20_000, 20_000), 2)
    for count in (1, 2, 3, 16, 17, 4_200_000, largest[0] * largest[1]):
        width, height = list_size(count)
        assert width * height >= count > width * (height - 1)
        assert max(width, height) <= max(largest)


def test_images_do_not_show_what_lies_outside_their_disc() -> None:
    image = waves(64)
    y, x = np.mgrid[:64, :64] + 0.5
    outside = np.hypot(x - 32, y - 32) > 33.5
    image[outside] = (255, 0, 255, 255)
    filled = filled_corners(image)
    np.testing.assert_array_equal(filled[~outside], image[~outside])
    assert not (filled[outside] == (255, 0, 255, 255)).all(axis=-1).any()
