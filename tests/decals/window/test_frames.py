"""How large a window's frames are, and when they become whole."""

from typing import Any

import numpy as np
import pytest

from decals.window.frames import FrameState
from tests.decals.window.driver import Driver


def test_on_a_screen_what_only_selects_keeps_the_whole_frame(driver: Driver) -> None:
    window = driver.window
    driver.shot()
    window.frames.budget.record(2.0, 10.0)
    window.plotter.off_screen = False
    number, at = next(driver.visible())
    window.tools.press(*at)
    window.tools.release(*at)
    window.redraw(whole=True)
    assert window.actions.state.selection == (number,)
    assert window.subplot.draw_scale == 1
    window.tools.key("Delete", *at)
    window.redraw(whole=True)
    assert window.subplot.draw_scale < 1


def test_things_that_move_are_drawn_smaller_where_the_card_is_slow(driver: Driver) -> None:
    window = driver.window
    window.frames.budget.record(2.0, 10.0)
    _, at = next(driver.visible())
    driver.click(at)
    driver.event("LeftButtonPressEvent", at)
    driver.event("MouseMoveEvent", (at[0] + 9, at[1]))
    assert window.subplot.draw_scale < 1
    driver.event("LeftButtonReleaseEvent", (at[0] + 9, at[1]))
    assert window.subplot.draw_scale == 1
    assert window.subplot.samples == 2
    window.frames.budget.record(2.0, 10.0)
    driver.event("LeftButtonPressEvent", (2, 2))
    driver.event("MouseMoveEvent", (20, 9))
    assert window.subplot.draw_scale < 1
    driver.event("LeftButtonReleaseEvent", (20, 9))
    assert window.subplot.draw_scale == 1


def knows(quality: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let it be sure that frames of the window's size take longer than they may."""
    quality.record(1.0, 0.1)
    quality.record(2.0, 0.4)
    monkeypatch.setattr(quality, "record", lambda *_: None)


def test_a_drag_keeps_the_picture_whole_where_little_changes_however_slow_frames_are(
    driver: Driver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A whole frame would take too long, and none is drawn: each step draws around what it moved."""
    window, subplot = driver.window, driver.window.subplot
    _, at = list(driver.visible())[1]
    driver.click(at)
    driver.shot()
    knows(window.frames.budget, monkeypatch)
    driver.event("LeftButtonPressEvent", at)
    for step in range(4, 16, 3):
        driver.event("MouseMoveEvent", (at[0] + step, at[1]))
        assert (subplot.draw_scale, subplot.samples) == (1.0, 2)
        assert 0.0 < subplot.drawn_fraction < 0.2
        assert window.frames.state is FrameState.WHOLE, "nothing is left to be drawn once the hand rests"
    assert window.frames.budget.expected(2.0) > 0.2
    during = np.asarray(driver.plotter.screenshot(None, return_img=True))
    subplot.renderer._targets.forget()
    driver.plotter.render()
    np.testing.assert_array_equal(np.asarray(driver.plotter.screenshot(None, return_img=True)), during)
    assert subplot.drawn_fraction == 1.0
    driver.event("LeftButtonReleaseEvent", (at[0] + 15, at[1]))


def test_a_drag_over_a_coarse_picture_stays_coarse_until_the_hand_rests(
    driver: Driver, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, subplot = driver.window, driver.window.subplot
    _, at = list(driver.visible())[1]
    driver.click(at)
    knows(window.frames.budget, monkeypatch)
    driver.plotter.camera.Azimuth(3.0)
    window.begin_motion()
    driver.plotter.render()
    _, at = next((n, place) for n, place in driver.visible() if n in window.actions.state.selection)
    driver.event("LeftButtonPressEvent", at)
    scales = []
    for step in range(4, 16, 3):
        driver.event("MouseMoveEvent", (at[0] + step, at[1]))
        scales.append(subplot.draw_scale)
    assert len(set(scales)) == 1
    assert subplot.draw_scale < 1.0
    assert subplot.drawn_fraction < 0.3
    monkeypatch.setattr("decals.window.frames.REFINE_DELAY", 0.0)
    while window.frames.state is FrameState.COARSE:
        window.tick()
    driver.event("MouseMoveEvent", (at[0] + 18, at[1]))
    assert (subplot.draw_scale, subplot.samples) == (1.0, 2)
    driver.event("LeftButtonReleaseEvent", (at[0] + 18, at[1]))


def test_frames_that_are_shown_again_say_nothing_of_the_machine(driver: Driver) -> None:
    driver.shot()
    driver.window.frames.budget.record(2.0, 10.0)
    driver.window.draw_whole_frame()
    assert not driver.window.subplot.drawn_fraction
    assert driver.window.frames.budget.expected(2.0) == pytest.approx(10.0)


@pytest.mark.slow
def test_what_rests_is_drawn_better_slice_by_slice(opened: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks draw parts, never a whole frame, so user input in between is not delayed."""
    driver, other = opened(samples=3), opened()
    window, subplot = driver.window, driver.window.subplot
    window.frames.samples = 2
    whole = other.shot()
    monkeypatch.setattr("decals.window.frames.SLICE_SECONDS", 0.0)
    window.frames.budget.record(2.0, 10.0)
    window.redraw(whole=False)
    window.tick()
    assert subplot.draw_scale < 1
    monkeypatch.setattr("decals.window.frames.REFINE_DELAY", 0.0)
    frames = []
    drawing = subplot.draw

    def counted() -> None:
        drawing()
        frames.append((subplot.draw_scale, subplot.samples, subplot.drawn_fraction))

    monkeypatch.setattr(subplot, "draw", counted)
    for _ in range(100):
        window.tick()
    assert frames == []
    window.redraw(whole=False)
    ticks = 0
    while window.frames.state is FrameState.COARSE:
        window.tick()
        ticks += 1
    assert ticks > 500
    assert [look for *look, _ in frames[1:]] == [[1.0, 1], [1.0, 2]]
    assert not any(drawn for *_, drawn in frames[1:])
    np.testing.assert_array_equal(driver.shot(), whole)


@pytest.mark.parametrize("whole_is_fast", [False, True])
def test_another_view_is_drawn_in_time(
    opened: Any, monkeypatch: pytest.MonkeyPatch, whole_is_fast: bool
) -> None:
    driver = opened()
    window, subplot = driver.window, driver.window.subplot
    driver.shot()
    monkeypatch.setattr(type(window), "ticking", True)
    for scale in (1.0, float(window.frames.samples)):
        window.frames.budget.record(scale, 0.001 if whole_is_fast else 10.0 * scale)
    driver.plotter.camera.Azimuth(90.0)
    window.redraw(whole=True)
    assert (subplot.draw_scale == 1.0) == whole_is_fast
