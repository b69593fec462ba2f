"""Colours by name, code and numbers."""

from typing import Any

import numpy as np
import pytest
import pyvista as pv
from PIL import ImageColor

from blobtree import Point, from_json, to_json
from blobtree.colors import color_rgb, color_rgba
from blobtree.errors import InvalidNode


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        pytest.param("red", (1, 0, 0), id="name"),
        pytest.param("Tomato", (255 / 255, 99 / 255, 71 / 255), id="css"),
        pytest.param("tab:blue", (31 / 255, 119 / 255, 180 / 255), id="matplotlib"),
        pytest.param("#336699", (0.2, 0.4, 0.6), id="code"),
        pytest.param(pv.Color("lime"), (0, 1, 0), id="pyvista"),
        pytest.param([0.25, 0.5, 1], (0.25, 0.5, 1), id="list"),
        pytest.param(np.array([0.25, 0.5, 1.0]), (0.25, 0.5, 1), id="array"),
    ],
)
def test_a_colour(value: Any, expected: tuple[float, ...]) -> None:
    assert color_rgb("color", value) == pytest.approx(expected)
    assert color_rgba("color", value) == pytest.approx((*expected, 1.0))
    assert Point((0, 0, 0), radius=1.0, color=value).color == pytest.approx(expected)


def test_names_of_css_are_those_of_pyvista() -> None:
    for name in ImageColor.colormap:
        assert color_rgba("color", name) == pv.Color(name).float_rgba


def test_alpha() -> None:
    assert color_rgba("color", "#33669980") == pytest.approx((0.2, 0.4, 0.6, 128 / 255))
    assert color_rgba("color", (0, 0, 0, 0)) == (0, 0, 0, 0)
    for value in ("#33669980", (0.1, 0.1, 0.1, 1.0)):
        with pytest.raises(InvalidNode, match="color: expected red, green, blue"):
            color_rgb("color", value)


@pytest.mark.parametrize("wrong", ["reddish", "", (1, 2, 3), (255, 0, 0), (1, 1), None, 5, {"r": 1}, float])
def test_what_is_no_colour(wrong: Any) -> None:
    for convert in (color_rgb, color_rgba):
        with pytest.raises(InvalidNode, match=r"fill: expected .* or a name, got .*; give a name such as"):
            convert("fill", wrong)


def test_a_named_colour_survives_a_file() -> None:
    ball = Point((0, 0, 0), radius=1.0, color="tomato")
    assert from_json(to_json(ball)) == ball
    np.testing.assert_allclose(ball.colors([0, 0, 0]), (1, 99 / 255, 71 / 255), atol=1e-6)
