"""The first frames of a window: what they take is made slice by slice, and what is seen then is the same."""

import gc
import threading
import weakref
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np
import pytest

from blobtree import Point
from decals import TreeObject
from decals.editing import AddObject, EditSession, ScaleDecals
from decals.errors import TooMuchData
from decals.rendering import Context, RenderOptions
from decals.rendering.background_compiler import GL, BackgroundCompiler
from decals.rendering.current_context import system_library
from decals.rendering.decal_library import decal_library
from decals.rendering.pixel_pass import compile_program
from decals.rendering.progressive import DRAWING
from decals.rendering.warmup import with_status
from decals.shaders import CompileError
from decals.vtk.frame import SPARE_SLOT
from decals.window import EditWindow
from decals.window.frames import FrameState
from tests.decals.editing.scenes import scene
from tests.decals.window.driver import Driver

SIZE = (180, 120)


class Ticking(EditWindow):
    """A window without a screen that comes as on one: the test is the timer."""

    ticking = True


@pytest.fixture
def waiting(opened: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Open a window that is preparing; a look at the clock is a second, so that slices are short."""
    opened()  # skips where there is no OpenGL
    made = []

    def open_window(shown: Any = None) -> Any:
        window = Ticking(shown or scene(), off_screen=True, size=SIZE, samples=2)
        made.append(window)
        window.begin()
        window._end_screenshots()  # pyvista takes one while it shows the window
        window.plotter.show(auto_close=False, interactive=False)
        # The line of text is no part of the scene.
        window.overlay.show_status = lambda text: None  # type: ignore[method-assign]
        window.overlay._status.SetInput("")
        window.plotter.render()
        return window

    yield open_window
    for window in made:
        window.close()


def pixels(window: Any) -> Any:
    """What is in the window now; nothing is drawn for it."""
    return np.asarray(window.plotter.screenshot(None, return_img=True))[..., :3].copy()


def bare() -> Any:
    """An empty window."""
    with EditWindow(scene().replace(objects=(), decals=scene().decals[:0]), off_screen=True, size=SIZE) as it:
        it.show()
        it.overlay._status.SetInput("")
        it.plotter.render()
        return pixels(it)


def slices(window: Any, most: Any = 500) -> Any:
    """Tick until nothing is waited for; what is said after each slice."""
    heard = []
    while window.subplot.warming_up:
        window.tick()
        heard.append(window.warmup.status)
        assert len(heard) < most
    return heard


def test_a_window_opens_empty_and_ends_with_the_picture_of_one_drawn_at_once(
    waiting: Any, opened: Any
) -> None:
    whole = opened(samples=2)
    whole.window.overlay._status.SetInput("")
    expected = whole.shot()
    window = waiting()
    assert window.subplot.warming_up
    np.testing.assert_array_equal(pixels(window), bare())
    heard = slices(window)
    assert all(news.startswith("preparing: ") for news in heard[:-1])
    assert heard[-1] == window.warmup.status == ""
    assert (pixels(window) != bare()).any()  # coarse, but there
    while window.frames.state is FrameState.COARSE:
        window.tick()
    np.testing.assert_array_equal(pixels(window), expected)


def test_each_piece_is_a_chance_to_listen(waiting: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("decals.window.frames.SLICE_SECONDS", 0.0)
    window = waiting()
    pieces = window.subplot.renderer.warmup(window.document, _options(window)).tasks
    heard = [news for news, _ in groupby(slices(window, 100_000))]  # a program may take several slices
    expected = [f"preparing: {news}" for _, news in with_status(pieces)]
    first = heard.index(expected[0])  # before that, what is made in a thread
    assert heard[first : first + len(expected)] == expected
    assert f"preparing: {DRAWING}" in heard


def _options(window: Any) -> Any:
    subplot = window.subplot
    return RenderOptions(mapping=subplot.mapping, contact=subplot.contact)


def test_other_programs_leave_the_picture_before_until_they_are_there(waiting: Any, opened: Any) -> None:
    window = waiting()
    slices(window)
    while window.frames.state is FrameState.COARSE:
        window.tick()
    before = pixels(window)
    number = int(window.document.decals.numbers[0])
    window.actions.state.selection = (number,)
    assert not window.document.decals.layered
    window.actions.perform("next_interaction", lambda: None)
    window.actions.state.selection = ()
    window.redraw(whole=True)
    assert window.document.decals.layered
    assert window.subplot.warming_up
    np.testing.assert_array_equal(pixels(window), before)
    while window.frames.state is FrameState.COARSE or window.subplot.warming_up:
        window.tick()
    assert window.subplot.renderer.targets_of(SPARE_SLOT) is None
    whole = opened(window.session, samples=2)
    whole.window.overlay._status.SetInput("")
    np.testing.assert_array_equal(pixels(window), whole.shot())


@pytest.mark.slow
def test_a_frame_at_rest_holds_no_objects_of_earlier_ones(waiting: Any) -> None:
    window = waiting()

    def rest() -> None:
        while window.frames.state is FrameState.COARSE or window.subplot.warming_up:
            window.tick()

    rest()
    window.session.do(AddObject(TreeObject("ball", Point((0, 3, 0), radius=1.0))))
    window.redraw(whole=True)
    rest()
    added = weakref.ref(window.document.objects[2])
    window.session.undo()
    window.session.forget_history()
    window.redraw(whole=True)
    rest()
    gc.collect()
    assert added() is None


def test_what_is_known_is_not_waited_for(waiting: Any) -> None:
    window = waiting()
    slices(window)
    user = Driver(window)
    user.drag((3, 3), (40, 20), (60, 30))
    assert not window.subplot.warming_up
    window.session.undo()
    window.redraw(whole=True)
    assert not window.subplot.warming_up


def test_a_whole_frame_may_be_asked_for_at_once(waiting: Any, opened: Any) -> None:
    whole = opened(samples=2)
    whole.window.overlay._status.SetInput("")
    window = waiting()
    window.tick()
    assert window.subplot.warming_up
    window._before_screenshot()
    assert not window.subplot.warming_up
    assert window.subplot.keep_previous_frame
    np.testing.assert_array_equal(pixels(window), whole.shot())


@pytest.mark.ordinary_cases("1", "4")
@pytest.mark.parametrize("ticks", [0, 1, 2, 4])
def test_a_window_closed_in_between_gives_everything_back(
    waiting: Any, monkeypatch: pytest.MonkeyPatch, ticks: Any
) -> None:
    monkeypatch.setattr("decals.window.frames.SLICE_SECONDS", 0.0)
    window = waiting()
    for _ in range(ticks):
        window.tick()
    assert window.subplot.warming_up
    context = window.subplot.renderer.context
    window.close()
    assert not context._programs._kept
    assert not any(context._spare_textures.values())
    window.tick()  # a timer that was on its way


def test_what_needs_no_graphics_is_made_in_a_thread_while_the_window_listens(
    waiting: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    go, where = threading.Event(), []

    def slow(*arguments: Any, **options: Any) -> Any:
        where.append(threading.current_thread())
        assert go.wait(60)
        return decal_library(*arguments, **options)

    monkeypatch.setattr("decals.rendering.renderer.decal_library", slow)
    monkeypatch.setattr("decals.window.frames.SLICE_SECONDS", 0.0)
    window = waiting()
    for _ in range(20):
        window.tick()
        assert window.subplot.warming_up
    assert where[0] is not threading.current_thread()
    go.set()
    slices(window, 100_000)
    assert (pixels(window) != bare()).any()


def test_programs_are_compiled_in_a_thread_while_the_window_listens(
    waiting: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    if system_library(GL) is None:
        pytest.skip("without this library of Linux nothing is compiled in a thread")
    go, linked = threading.Event(), []

    def make() -> Context:
        assert go.wait(60)
        return Context.standalone()

    def counted(*arguments: Any) -> Any:
        linked.append(arguments)
        return compile_program(*arguments)

    compiler = BackgroundCompiler(make)
    monkeypatch.setattr("decals.vtk.frame.shared_compiler", lambda: compiler)
    monkeypatch.setattr("decals.rendering.context.compile_program", counted)
    monkeypatch.setattr("decals.window.frames.SLICE_SECONDS", 0.0)
    window = waiting()
    for _ in range(20):
        window.tick()
        assert window.subplot.warming_up
    assert not linked
    go.set()
    slices(window, 100_000)
    assert linked
    assert (pixels(window) != bare()).any()


def test_what_goes_wrong_in_the_thread_is_raised_where_the_window_listens(
    waiting: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_arguments: Any, **_options: Any) -> None:
        raise TooMuchData("no room")

    monkeypatch.setattr("decals.rendering.renderer.decal_library", refuse)
    window = waiting()
    with pytest.raises(TooMuchData, match="no room"):
        slices(window)
    assert not window.subplot.warming_up
    window.tick()


def test_what_went_wrong_in_the_thread_is_tried_again_once_something_changed(
    waiting: Any, opened: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another scene may need the same programs, and no more of what there was too much of."""
    session, failures = EditSession(scene()), [TooMuchData("no room")]

    def refuse(*arguments: Any, **options: Any) -> Any:
        if failures:
            raise failures.pop()
        return decal_library(*arguments, **options)

    monkeypatch.setattr("decals.rendering.renderer.decal_library", refuse)
    window = waiting(session)
    with pytest.raises(TooMuchData, match="no room"):
        slices(window)
    session.do(ScaleDecals([3], 1.2))
    window.redraw(whole=True)
    slices(window)
    window.draw_whole_frame()
    monkeypatch.undo()
    whole = opened(session.document.scene, samples=2)
    whole.window.overlay.show_status("")
    whole.window.draw_whole_frame()
    np.testing.assert_array_equal(pixels(window), pixels(whole.window))


def test_a_shader_that_is_refused_is_said_once_and_clearly(
    waiting: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any, **_options: Any) -> None:
        raise CompileError("decal_pass.glsl:7: nonsense")

    monkeypatch.setattr("decals.rendering.renderer.decal_programs", refuse)
    window = waiting()
    with pytest.raises(CompileError, match=r"decal_pass\.glsl:7"):
        slices(window)
    assert not window.subplot.warming_up
    assert window.warmup.status == ""
    window.tick()
    window.plotter.render()
    assert not window.subplot.warming_up


def test_a_plotter_without_an_editor_shows_the_whole_at_once(waiting: Any) -> None:
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.decals.add_scene(scene(), camera=True)
    try:
        plotter.show(auto_close=False)
        assert not plotter.decals.subplot.warming_up
        first = plotter.screenshot(None, return_img=True)
        plotter.render()
        np.testing.assert_array_equal(plotter.screenshot(None, return_img=True), first)
        assert len(np.unique(np.asarray(first).reshape(-1, 3), axis=0)) > 50
    finally:
        plotter.close()
