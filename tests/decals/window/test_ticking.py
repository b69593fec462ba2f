"""In a loop of asyncio's a window ticks by itself: for as long as something goes on, and not after that."""

import asyncio
import gc
import threading
import weakref
from typing import Any

import numpy as np
import pytest

from decals import Contact, ImageMapping
from decals.editing.scatter_commands import decals_on
from decals.field import Walks
from decals.window import EditWindow
from decals.window.frames import FrameState
from tests.decals.editing.scenes import scene
from tests.decals.vtk.conftest import Factory, plotter
from tests.decals.window.driver import Driver

__all__ = ["plotter"]


def tasks() -> list[asyncio.Task[Any]]:
    return [task for task in asyncio.all_tasks() if "EditWindow" in task.get_name()]


async def rested(window: EditWindow) -> None:
    async with asyncio.timeout(60):
        while tasks():
            await asyncio.sleep(0.01)
    assert not window.busy


@pytest.mark.slow
def test_scattered_decals_are_applied_and_the_drawing_is_reported(plotter: Factory) -> None:
    pl = plotter()
    drawn: list[object] = []
    pl.add_on_render_callback(drawn.append)

    async def play() -> None:
        window = EditWindow(scene(), plotter=pl)
        window.show()
        await rested(window)
        driver = Driver(window)
        on_tree = set(decals_on(driver.document, [0]).tolist())
        at = next(at for number, at in driver.visible() if number in on_tree)
        driver.key("g", at)
        assert window.background.busy
        assert len(tasks()) == 1
        count = len(drawn)
        await rested(window)
        assert driver.session.labels == ("scatter",)
        assert len(drawn) > count
        assert not on_tree & set(driver.document.decals.numbers.tolist())
        window.close()

    asyncio.run(play())


def test_frames_become_whole_by_themselves_once_nothing_moves(plotter: Factory) -> None:
    pl = plotter()

    async def play() -> None:
        window = EditWindow(scene(), plotter=pl)
        window.show()
        await rested(window)
        first = np.asarray(pl.screenshot(None, return_img=True))
        window.frames.budget.record(1.0, 10.0)  # as on a slow machine
        window.begin_motion()  # as the camera does
        pl.render()
        assert window.subplot.draw_scale < 1.0
        await rested(window)
        assert (window.subplot.draw_scale, window.subplot.samples) == (1.0, window.frames.samples)
        pl.render()
        np.testing.assert_array_equal(np.asarray(pl.image), first)
        window.close()

    asyncio.run(play())


def test_closing_ends_the_ticks_and_nothing_keeps_a_window(plotter: Factory) -> None:
    async def play() -> None:
        window = EditWindow(scene(), plotter=plotter())
        window.show()
        assert len(tasks()) == 1
        window.close()
        await asyncio.sleep(0)
        assert not tasks()
        other = EditWindow(scene(), plotter=plotter())
        other.show()
        other.redraw(whole=False)
        gone = weakref.ref(other)
        del other
        gc.collect()
        assert gone() is None  # with its task still there
        await asyncio.sleep(0.1)
        assert not tasks()

    asyncio.run(play())


def test_a_loop_that_ended_leaves_the_next_one_to_tick(plotter: Factory) -> None:
    window = EditWindow(scene(), plotter=plotter())

    async def begin() -> None:
        window.show()
        assert window.ticking

    async def go_on() -> None:
        window.redraw(whole=False)
        assert len(tasks()) == 1
        await rested(window)

    asyncio.run(begin())
    assert not window.ticking
    asyncio.run(go_on())
    asyncio.run(begin())
    window.close()


@pytest.mark.parametrize("looping", [False, True])
def test_a_window_of_our_own_without_a_screen_does_not_wait(looping: bool) -> None:
    async def play() -> None:
        with EditWindow(scene(), off_screen=True, size=(60, 40)) as window:
            window.show()
            assert window.ticking is looping

    if looping:
        asyncio.run(play())
    else:
        with pytest.raises(StopIteration):
            play().send(None)


def test_input_is_answered_while_walks_are_computed(
    plotter: Factory, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready, of_rows = threading.Event(), Walks.of_rows

    def late(*given: Any, **options: Any) -> Walks:
        assert ready.wait(60)
        return of_rows(*given, **options)

    monkeypatch.setattr(Walks, "of_rows", late)
    pl = plotter()

    async def play() -> None:
        window = EditWindow(scene(), plotter=pl)
        window.show()
        await rested(window)
        subplot, driver = window.subplot, Driver(window)
        corrected = np.asarray(pl.screenshot(None, return_img=True))
        subplot.mapping = ImageMapping.WALKED
        window.redraw(whole=True)
        number, at = next(driver.visible())
        driver.click(at)
        assert window.actions.state.selection == (number,)
        assert (subplot.mapping.name, subplot.shown_mapping.name) == ("WALKED", "CORRECTED")
        assert window.busy
        ready.set()
        await rested(window)
        assert subplot.shown_mapping.name == "WALKED"
        driver.key("Escape")
        await rested(window)
        pl.render()
        seen = np.asarray(pl.image)
        subplot.walks_in_thread = False
        pl.render()
        np.testing.assert_array_equal(np.asarray(pl.image), seen)
        assert (seen != corrected).any()
        window.close()

    asyncio.run(play())


def test_a_window_shown_before_its_loop_prepares_frames_in_slices(opened: Any) -> None:
    """As that of a server: its loop begins once the window is shown."""
    window = opened().window
    assert not window.subplot.keep_previous_frame
    assert not window.subplot.walks_in_thread

    async def play() -> None:
        window.subplot.contact = Contact.RADIAL
        window.redraw(whole=True)
        assert window.subplot.warming_up
        assert window.subplot.walks_in_thread
        assert len(tasks()) == 1
        await rested(window)
        assert window.frames.state is FrameState.WHOLE

    asyncio.run(play())
    window.subplot.contact = Contact.MIN
    window.redraw(whole=True)
    assert not window.subplot.warming_up
