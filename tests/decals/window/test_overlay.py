"""Text in a window: it is to be read in narrow windows too, and leaves the picture its place."""

from typing import Any

import pytest

from decals import Scene
from decals.editing import KEYS
from tests.decals.editing.scenes import scene

LONG = "expected an existing folder for the scene, found none at 'a/folder/that/is/not/there'; make it first"


def box(actor: Any, renderer: Any) -> Any:
    """Left, right, bottom and top of a text, in pixels of its subplot."""
    corners = [0.0] * 4
    actor.GetBoundingBox(renderer, corners)
    left, bottom = actor.GetPosition()
    return left + corners[0], left + corners[1], bottom + corners[2], bottom + corners[3]


@pytest.mark.parametrize(
    "width", [240, *(pytest.param(width, marks=pytest.mark.slow) for width in (320, 640))]
)
def test_a_long_line_is_broken_where_the_window_ends(opened: Any, width: Any) -> None:
    window = opened().window
    window.plotter.window_size = (width, 480)
    window.plotter.render()
    window.overlay.show_status(LONG)
    _, right, _, _ = box(window.overlay._status, window.plotter.renderer)
    assert right <= width
    shown = window.overlay._status.GetInput()
    assert "".join(shown.split()) == "".join(LONG.split())  # a word longer than a line is cut
    assert window.overlay.status == LONG


def test_in_a_very_small_window_what_is_said_is_cut(opened: Any) -> None:
    window = opened().window
    window.overlay.show_status(LONG)
    _, right, _, top = box(window.overlay._status, window.plotter.renderer)
    assert right <= 180
    assert top <= 60
    assert window.overlay._status.GetInput().endswith(" …")
    assert window.overlay.status == LONG


def test_a_line_that_fits_is_left_as_it_is(opened: Any) -> None:
    window = opened().window
    window.overlay.show_status("h: help")
    assert window.overlay._status.GetInput() == "h: help"


@pytest.mark.slow_cases("size1-1")
@pytest.mark.parametrize(("size", "pages"), [((400, 300), 3), ((1200, 800), 1)])
def test_the_help_fits_into_the_window(opened: Any, size: tuple[int, int], pages: int) -> None:
    driver = opened(
        Scene(objects=scene().objects[1:], camera=scene().camera)
    )  # no decals: large pictures take long
    window, overlay = driver.window, driver.window.overlay
    window.plotter.window_size = size
    window.plotter.render()
    read = []
    for page in range(1, pages + 1):
        driver.key("h")
        assert window.actions.help_page == page
        left, right, bottom, top = box(overlay._help, window.plotter.renderer)
        assert 0 <= left < right <= size[0]
        assert 0 <= bottom < top <= size[1]
        read += overlay._help.GetInput().splitlines()
    assert window.actions.help_pages == pages
    assert set(KEYS.help_lines()) <= set(read)
    driver.key("h")
    assert not overlay.help_visible
