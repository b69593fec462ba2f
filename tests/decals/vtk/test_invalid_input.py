"""What `plotter.decals`, its stages and an edit window cannot use is named in one line."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import decals
from decals.editing import (
    Actions,
    Document,
    EditSession,
    PointerTools,
    first_hit,
    nearest_points,
    outline,
    pick,
)
from decals.errors import ImplicitDecalsError
from decals.window import EditWindow, FrameBudget, browser_keys, press_key
from tests.decals.editing.scenes import one, scene
from tests.decals.vtk.conftest import Factory, plotter

__all__ = ["plotter"]
GREY = np.zeros((2, 2))
OTHERS: tuple[Any, ...] = (None, "x", b"x", {}, object(), [None], GREY, int, one())
WRONG = (-1, float("nan"), 10**400, *OTHERS)


def refused(call: Callable[[Any], object], *fits: object) -> None:
    """Every value that does not fit is refused, in one line of ours."""
    for wrong in WRONG:
        if any(wrong is one for one in fits):
            continue
        with pytest.raises(ImplicitDecalsError) as caught:
            call(wrong)
        assert "\n" not in str(caught.value), wrong
        assert "expected" in str(caught.value) or "must be" in str(caught.value), caught.value


def test_a_plotter(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_scene(scene(), camera=True)
    pl.render()
    subplot = pl.decals.subplot
    refused(lambda wrong: pl.decals.add_scene(scene(), camera=wrong))
    refused(lambda wrong: pl.decals.add(one(), images=[wrong]), "x", GREY)
    refused(lambda wrong: setattr(pl.decals, "lights", wrong))
    refused(lambda wrong: setattr(pl.decals, "scene", wrong), None)
    refused(lambda wrong: setattr(pl.decals, "contakt", wrong))
    refused(lambda wrong: setattr(pl.decals, "samples", wrong))
    refused(lambda wrong: setattr(subplot, "contakt", wrong))
    pl.decals.contact, pl.decals.stiffness, pl.decals.mapping = "radial", 3, "chord"
    assert (subplot.contact, subplot.stiffness) == (decals.Contact.RADIAL, 3.0)
    assert pl.decals.mapping is subplot.mapping is decals.ImageMapping.CHORD
    refused(lambda wrong: subplot.covers(wrong, 3), -1)
    refused(lambda wrong: subplot.at(3, wrong), -1)
    refused(lambda wrong: subplot.hidden(wrong, 3, (0, 0, 0)), -1)
    assert not subplot.covers(1e300, 3)
    assert not subplot.covers(-1e300, 3)


def test_a_window(plotter: Factory) -> None:
    window = EditWindow(scene(), plotter=plotter())
    window.show()
    refused(lambda wrong: window.tools.at(wrong, 3), -1)
    refused(lambda wrong: window.tools.press(wrong, 3), -1)
    refused(lambda wrong: window.tools.move(wrong, 3), -1)
    refused(lambda wrong: window.tools.key(wrong, 3, 3), "x")
    refused(lambda wrong: window.tools.key("z", wrong, 3), -1)
    refused(lambda wrong: press_key(window, wrong), "x")
    refused(lambda wrong: press_key(window, "z", position=wrong), None)
    refused(lambda wrong: press_key(wrong, "z"))
    refused(browser_keys)
    assert press_key(window, "PageUp", position=(0.5, 0.5))
    assert not press_key(window, "F7", shift=True, position=(7, -7))
    window.close()


def test_sizes_of_frames() -> None:
    refused(FrameBudget)
    refused(lambda wrong: FrameBudget().record(wrong, 0.1))
    refused(lambda wrong: FrameBudget().record(1.0, wrong))
    refused(lambda wrong: FrameBudget().record(1.0, 0.1, wrong))
    refused(lambda wrong: FrameBudget().expected(wrong))
    for scale in (0, 0.0, -0.0, 1e300, float("inf")):
        with pytest.raises(ImplicitDecalsError, match="scale: expected"):
            FrameBudget().record(scale, 0.1)
    quality = FrameBudget()
    quality.record(1.0, 0.0)  # a clock that stands still
    assert quality.scale == 1.0


def test_picks_outlines_and_places() -> None:
    document = Document.from_scene(scene())
    refused(lambda wrong: pick(wrong, (0, 0, 5), (0, 0, -1)))
    refused(lambda wrong: outline(wrong, 1))
    refused(lambda wrong: outline(document, 1, contact=wrong))
    refused(lambda wrong: outline(document, 1, mapping=wrong))
    refused(lambda wrong: nearest_points(wrong, [(0, 0, 1)]))
    refused(lambda wrong: first_hit(wrong, (0, 0, 5), (0, 0, -1)))


def test_actions_and_sessions() -> None:
    session = EditSession(scene())
    refused(Actions)
    refused(lambda wrong: Actions(session).perform(wrong, lambda: None))
    refused(lambda wrong: PointerTools(wrong, lambda _x, _y: None))
    refused(session.subscribe, int)
    refused(session.adopt)
    with pytest.raises(ImplicitDecalsError, match="one of the key table"):
        Actions(session).perform("move", lambda: None)  # a drag is no single action
