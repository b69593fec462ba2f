"""The first frames of a window: what they take is made slice by slice, and what is seen then is the same."""

import threading

import numpy as np
import pytest

from decals.edit import EditSession, Scale
from decals.errors import TooMuchData
from decals.render import preparing
from decals.render.decal_data import library
from decals.render.drawing import PICTURE
from decals.render.pieces import told
from decals.window import EditWindow
from implicit_decals.shaders import CompileError
from tests.edit.scenes import scene
from tests.window.driver import Driver

SIZE = (180, 120)


class Ticking(EditWindow):
    """A window without a screen that comes as on one: the test is the timer."""

    ticking = True


@pytest.fixture
def waiting(opened, monkeypatch):
    """Open a window that is preparing; a look at the clock is a second, so that slices are short."""
    opened()  # skips where there is no OpenGL
    made = []

    def open_window(shown=None):
        window = Ticking(shown or scene(), off_screen=True, size=SIZE, samples=2)
        made.append(window)
        window.begin()
        window._end_screenshots()  # pyvista takes one while it shows the window
        window.plotter.show(auto_close=False, interactive=False)
        window.marks.say = lambda text: None  # the line of text is no part of the scene
        window.marks._status.SetInput("")
        window.plotter.render()
        return window

    yield open_window
    for window in made:
        window.close()


def pixels(window):
    """What is in the window now; nothing is drawn for it."""
    return np.asarray(window.plotter.screenshot(None, return_img=True))[..., :3].copy()


def bare():
    """An empty window."""
    with EditWindow(scene().replace(objects=(), decals=scene().decals[:0]), off_screen=True, size=SIZE) as it:
        it.show()
        it.marks._status.SetInput("")
        it.plotter.render()
        return pixels(it)


def slices(window, most=500):
    """Tick until nothing is waited for; what is said after each slice."""
    heard = []
    while window.stage.waiting:
        window.tick()
        heard.append(window.waiting.news)
        assert len(heard) < most
    return heard


def test_a_window_opens_empty_and_ends_with_the_picture_of_one_drawn_at_once(waiting, opened):
    whole = opened(samples=2)
    whole.window.marks._status.SetInput("")
    expected = whole.shot()
    window = waiting()
    assert window.stage.waiting
    np.testing.assert_array_equal(pixels(window), bare())
    heard = slices(window)
    assert all(news.startswith("preparing: ") for news in heard[:-1])
    assert heard[-1] == window.waiting.news == ""
    assert (pixels(window) != bare()).any()  # coarse, but there
    while window._moved:
        window.tick()
    np.testing.assert_array_equal(pixels(window), expected)


def test_each_piece_is_a_chance_to_listen(waiting, monkeypatch):
    monkeypatch.setattr("decals.window.waiting.SLICE", 0.0)
    window = waiting()
    pieces = window.stage.renderer.ahead(window.document, _modes(window)).pieces
    heard = slices(window, 100_000)
    expected = [f"preparing: {news}" for _, news in told(pieces)]
    first = heard.index(expected[0])  # before that, what is made in a thread
    assert heard[first : first + len(expected)] == expected
    assert f"preparing: {PICTURE}" in heard


def _modes(window):
    stage = window.stage
    return preparing.Modes(stage.mapping, stage.contact)


def test_other_programs_leave_the_picture_before_until_they_are_there(waiting, opened):
    window = waiting()
    slices(window)
    while window._moved:
        window.tick()
    before = pixels(window)
    number = int(window.document.decals.numbers[0])
    window.actions.selection = (number,)
    assert not window.document.decals.layered
    window.actions.perform("next_interaction", lambda: None)
    window.actions.selection = ()
    window.redraw(whole=True)
    assert window.document.decals.layered
    assert window.stage.waiting
    np.testing.assert_array_equal(pixels(window), before)
    while window._moved or window.stage.waiting:
        window.tick()
    whole = opened(window.session, samples=2)
    whole.window.marks._status.SetInput("")
    np.testing.assert_array_equal(pixels(window), whole.shot())


def test_what_is_known_is_not_waited_for(waiting):
    window = waiting()
    slices(window)
    hands = Driver(window)
    hands.drag((3, 3), (40, 20), (60, 30))
    assert not window.stage.waiting
    window.session.undo()
    window.redraw(whole=True)
    assert not window.stage.waiting


def test_a_whole_frame_may_be_asked_for_at_once(waiting, opened):
    whole = opened(samples=2)
    whole.window.marks._status.SetInput("")
    window = waiting()
    window.tick()
    assert window.stage.waiting
    window.make_whole()
    assert not window.stage.waiting
    assert window.stage.patient
    np.testing.assert_array_equal(pixels(window), whole.shot())


@pytest.mark.parametrize("ticks", [0, 1, 2, 4])
def test_a_window_closed_in_between_gives_everything_back(waiting, monkeypatch, ticks):
    monkeypatch.setattr("decals.window.waiting.SLICE", 0.0)
    window = waiting()
    for _ in range(ticks):
        window.tick()
    assert window.stage.waiting
    context = window.stage.renderer.context
    window.close()
    assert not context._programs
    assert not context._compute_programs
    assert not any(context._stock.values())
    window.tick()  # a timer that was on its way


def test_what_needs_no_graphics_is_made_in_a_thread_while_the_window_listens(waiting, monkeypatch):
    go, where = threading.Event(), []

    def slow(*arguments, **options):
        where.append(threading.current_thread())
        assert go.wait(60)
        return library(*arguments, **options)

    monkeypatch.setattr(preparing, "library", slow)
    monkeypatch.setattr("decals.window.waiting.SLICE", 0.0)
    window = waiting()
    for _ in range(20):
        window.tick()
        assert window.stage.waiting
    assert where[0] is not threading.current_thread()
    go.set()
    slices(window, 100_000)
    assert (pixels(window) != bare()).any()


def test_what_goes_wrong_in_the_thread_is_raised_where_the_window_listens(waiting, monkeypatch):
    def refuse(*_arguments, **_options):
        raise TooMuchData("no room")

    monkeypatch.setattr(preparing, "library", refuse)
    window = waiting()
    with pytest.raises(TooMuchData, match="no room"):
        slices(window)
    assert not window.stage.waiting
    window.tick()


def test_what_went_wrong_in_the_thread_is_tried_again_once_something_changed(waiting, opened, monkeypatch):
    """Another scene may need the same programs, and no more of what there was too much of."""
    session, failures = EditSession(scene()), [TooMuchData("no room")]

    def refuse(*arguments, **options):
        if failures:
            raise failures.pop()
        return library(*arguments, **options)

    monkeypatch.setattr(preparing, "library", refuse)
    window = waiting(session)
    with pytest.raises(TooMuchData, match="no room"):
        slices(window)
    session.do(Scale([3], 1.2))
    window.redraw(whole=True)
    slices(window)
    window.rest()
    monkeypatch.undo()
    whole = opened(session.document.scene, samples=2)
    whole.window.marks.say("")
    whole.window.rest()
    np.testing.assert_array_equal(pixels(window), pixels(whole.window))


def test_a_shader_that_is_refused_is_said_once_and_clearly(waiting, monkeypatch):
    def refuse(*_):
        raise CompileError("paint.glsl:7: nonsense")

    monkeypatch.setattr(preparing, "painting_program", refuse)
    window = waiting()
    with pytest.raises(CompileError, match=r"paint\.glsl:7"):
        slices(window)
    assert not window.stage.waiting
    assert window.waiting.news == ""
    window.tick()
    window.plotter.render()
    assert not window.stage.waiting


def test_a_plotter_that_nobody_edits_in_shows_the_whole_at_once(waiting):
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.decals.add_scene(scene())
    try:
        plotter.show(auto_close=False)
        assert not plotter.decals.stage.waiting
        first = plotter.screenshot(None, return_img=True)
        plotter.render()
        np.testing.assert_array_equal(plotter.screenshot(None, return_img=True), first)
        assert len(np.unique(first.reshape(-1, 3), axis=0)) > 50
    finally:
        plotter.close()
