"""How large a window's frames are, and when they become whole."""

import numpy as np
import pytest


def test_on_a_screen_what_only_selects_keeps_the_whole_frame(driver):
    window = driver.window
    driver.shot()
    window.quality.saw(2.0, 10.0)
    window.plotter.off_screen = False
    number, at = next(driver.visible())
    window.tools.press(*at)
    window.tools.release(*at)
    window.redraw(whole=True)
    assert window.actions.selection == (number,)
    assert window.stage.draw_scale == 1
    window.tools.key("Delete", *at)
    window.redraw(whole=True)
    assert window.stage.draw_scale < 1


def test_things_that_move_are_drawn_smaller_where_the_card_is_slow(driver):
    window = driver.window
    window.quality.saw(2.0, 10.0)
    _, at = next(driver.visible())
    driver.click(at)
    driver.event("LeftButtonPressEvent", at)
    driver.event("MouseMoveEvent", (at[0] + 9, at[1]))
    assert window.stage.draw_scale < 1
    driver.event("LeftButtonReleaseEvent", (at[0] + 9, at[1]))
    assert window.stage.draw_scale == 1
    assert window.stage.samples == 2
    window.quality.saw(2.0, 10.0)
    driver.event("LeftButtonPressEvent", (2, 2))
    driver.event("MouseMoveEvent", (20, 9))
    assert window.stage.draw_scale < 1
    driver.event("LeftButtonReleaseEvent", (20, 9))
    assert window.stage.draw_scale == 1


def knows(quality, monkeypatch):
    """Let it be sure that frames of the window's size take longer than they may."""
    quality.saw(1.0, 0.1)
    quality.saw(2.0, 0.4)
    monkeypatch.setattr(quality, "saw", lambda *_: None)


def test_a_drag_keeps_the_picture_whole_where_little_changes_however_slow_frames_are(driver, monkeypatch):
    """A whole frame would take too long, and none is drawn: each step draws around what it moved."""
    window, stage = driver.window, driver.window.stage
    _, at = next(driver.visible())
    driver.click(at)
    driver.shot()
    knows(window.quality, monkeypatch)
    driver.event("LeftButtonPressEvent", at)
    for step in range(4, 16, 3):
        driver.event("MouseMoveEvent", (at[0] + step, at[1]))
        assert (stage.draw_scale, stage.samples) == (1.0, 2)
        assert 0.0 < stage.drawn < 0.2
        assert not window._moved, "nothing is left to be drawn once the hand rests"
    assert window.quality.expected(2.0) > 0.2
    during = np.asarray(driver.plotter.screenshot(None, return_img=True))
    stage.renderer._targets.forget()
    driver.plotter.render()
    np.testing.assert_array_equal(np.asarray(driver.plotter.screenshot(None, return_img=True)), during)
    assert stage.drawn == 1.0
    driver.event("LeftButtonReleaseEvent", (at[0] + 15, at[1]))


def test_a_drag_over_a_coarse_picture_stays_coarse_until_the_hand_rests(driver, monkeypatch):
    window, stage = driver.window, driver.window.stage
    _, at = next(driver.visible())
    driver.click(at)
    knows(window.quality, monkeypatch)
    driver.plotter.camera.Azimuth(3.0)
    window.moving()
    driver.plotter.render()
    _, at = next((n, place) for n, place in driver.visible() if n in window.actions.selection)
    driver.event("LeftButtonPressEvent", at)
    scales = []
    for step in range(4, 16, 3):
        driver.event("MouseMoveEvent", (at[0] + step, at[1]))
        scales.append(stage.draw_scale)
    assert len(set(scales)) == 1
    assert stage.draw_scale < 1.0
    assert stage.drawn < 0.3
    monkeypatch.setattr("decals.window.window.REST", 0.0)
    while window._moved:
        window.tick()
    driver.event("MouseMoveEvent", (at[0] + 18, at[1]))
    assert (stage.draw_scale, stage.samples) == (1.0, 2)
    driver.event("LeftButtonReleaseEvent", (at[0] + 18, at[1]))


def test_frames_that_are_shown_again_say_nothing_of_the_machine(driver):
    driver.shot()
    driver.window.quality.saw(2.0, 10.0)
    driver.window.rest()
    assert not driver.window.stage.drawn
    assert driver.window.quality.expected(2.0) == pytest.approx(10.0)


def test_what_rests_is_drawn_better_slice_by_slice(opened, monkeypatch):
    """Ticks draw parts, never a frame; whoever moves something in between waits for none of it."""
    driver, other = opened(samples=3), opened()
    window, stage = driver.window, driver.window.stage
    window.samples = 2
    whole = other.shot()
    monkeypatch.setattr("decals.window.window.SLICE", 0.0)
    window.quality.saw(2.0, 10.0)
    window.redraw(whole=False)
    window.tick()
    assert stage.draw_scale < 1
    monkeypatch.setattr("decals.window.window.REST", 0.0)
    frames = []
    drawing = stage.draw

    def counted():
        drawing()
        frames.append((stage.draw_scale, stage.samples, stage.drawn))

    monkeypatch.setattr(stage, "draw", counted)
    for _ in range(100):
        window.tick()
    assert frames == []
    window.redraw(whole=False)
    ticks = 0
    while window._moved:
        window.tick()
        ticks += 1
    assert ticks > 500
    assert [look for *look, _ in frames[1:]] == [[1.0, 1], [1.0, 2]]
    assert not any(drawn for *_, drawn in frames[1:])
    np.testing.assert_array_equal(driver.shot(), whole)
