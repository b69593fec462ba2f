"""Windows come and go: nothing stays behind, and other contexts live on."""

import ctypes
import gc
import sys
import warnings
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from decals.errors import InvalidScene
from decals.rendering import Renderer, RenderOptions
from tests.decals.shapes import Picture, View
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import both, shot
from tests.programs import output_of

STATUS = Path("/proc/self/statm")
PAGE = 4096


def show_and_close(plotter: Factory, *, ours: bool = True) -> np.ndarray:
    pl = plotter()
    actor = pl.add_mesh(pv.Sphere())
    if ours:
        pl.decals.add_scene(both(), camera=True)
        pl.decals.apply(actor)
    seen = shot(pl)
    pl.close()
    return seen


def make(**options: Any) -> Plotter:
    return Plotter(off_screen=True, window_size=[160, 120], **options)


def test_closing_lets_go_of_everything(plotter: Factory) -> None:
    show_and_close(plotter)
    pl = make()
    pl.decals.apply(pl.add_mesh(pv.Sphere()))
    pl.decals.add_scene(both(), camera=True)
    shot(pl)
    things = [weakref.ref(item) for item in (pl, pl.decals, pl.decals.subplot, pl.decals.subplot.renderer)]
    pl.close()
    del pl
    gc.collect()
    assert [thing() for thing in things] == [None] * len(things)


def test_reopening_shows_the_same(plotter: Factory) -> None:
    first = show_and_close(plotter)
    for _ in range(3):
        np.testing.assert_array_equal(show_and_close(plotter), first)


class Allocated(ctypes.Structure):
    """What `mallinfo2` of the GNU C library returns."""

    _fields_ = [
        (name, ctypes.c_size_t) for name in ("a", "b", "c", "d", "mapped", "e", "f", "used", "g", "h")
    ]


def held() -> np.ndarray:
    """Bytes resident, bytes allocated by the C library, and blocks of Python objects."""
    gc.collect()
    library = ctypes.CDLL(None)
    library.mallinfo2.restype = Allocated
    allocated = library.mallinfo2()
    resident = int(STATUS.read_text().split()[1]) * PAGE
    return np.array([resident, allocated.used + allocated.mapped, sys.getallocatedblocks()])


def grown(*, ours: bool) -> np.ndarray:
    """What `held` grows by with each window: the third least of six chunks of five windows.

    Allocators and drivers take memory in steps, which are in some chunks, and give some back in others. What
    each window keeps is in every chunk.
    """
    marks = []
    for _ in range(7):  # the first chunk warms up
        for _ in range(5):
            show_and_close(make, ours=ours)
        marks.append(held())
    grown_by: np.ndarray = np.sort(np.diff(marks, axis=0), axis=0)[2] / 5
    return grown_by


GROWN = "from tests.decals.vtk.test_lifetime import grown; print(*grown(ours=True), *grown(ours=False))"


@pytest.mark.slow
def test_memory_stays_flat(plotter: Factory) -> None:
    """In a process of its own: windows keep little more than VTK itself leaves behind.

    Mesa 22.3 keeps one to two kilobytes of pages of each program ever compiled, without any window or VTK
    too, and a window has ten.
    """
    plotter()
    if not (STATUS.exists() and hasattr(ctypes.CDLL(None), "mallinfo2")):
        pytest.skip("this system does not say what the process holds")
    values = np.array(output_of(GROWN).split()[-6:], float)
    (pages, allocated, blocks), vtks = values[:3], values[3:]
    assert pages < vtks[0] + 60_000
    assert allocated < vtks[1] + 10_000
    assert blocks < vtks[2] + 100


def test_a_renderer_of_its_own_outlives_windows(plotter: Factory) -> None:
    """VTK ends the EGL display that all share with its last window, unless it is held."""
    with Renderer() as own:
        first = own.render(both(), RenderOptions(size=(64, 48)))
        show_and_close(plotter)
        np.testing.assert_array_equal(own.render(both(), RenderOptions(size=(64, 48))), first)
        show_and_close(plotter, ours=False)
        np.testing.assert_array_equal(own.render(both(), RenderOptions(size=(64, 48))), first)


def test_a_failing_scene_says_so_once_and_recovers(pl: Plotter, capfd: pytest.CaptureFixture[str]) -> None:
    first = shot(pl)
    bad = Picture(np.zeros((4, 4), np.uint8))
    pl.decals.scene = View(both().objects, both().camera, both().decals, (bad,))
    shot(pl)
    shot(pl)
    assert capfd.readouterr().err.count("InvalidImage: image 0: expected") == 1
    pl.decals.scene = both()
    np.testing.assert_array_equal(shot(pl), first)


@pytest.mark.parametrize("scale", [0.0, -1.0, 1.5, float("nan")])
def test_impossible_scales_are_refused(plotter: Factory, scale: float) -> None:
    subplot = plotter().decals.subplot
    with pytest.raises(InvalidScene, match="draw_scale: expected"):
        subplot.draw_scale = scale
    assert subplot.draw_scale == 1.0


def test_clearing_a_plotter_and_filling_it_again(pl: Plotter) -> None:
    first = shot(pl)
    pl.decals.clear()
    assert (shot(pl) == shot(pl)[0, 0]).all()
    pl.decals.add_scene(both(), camera=True)
    np.testing.assert_array_equal(shot(pl), first)


def test_a_plotter_without_decals_has_nothing_of_ours(plotter: Factory) -> None:
    pl = plotter()
    pl.add_mesh(pv.Sphere())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shot(pl)
    assert "decals" not in pl.__dict__
    assert "decals" not in pl.renderer.actors


def test_no_frame_leaves_an_error_of_opengl(pl: Plotter) -> None:
    pl.decals.apply(pl.add_mesh(pv.Sphere(), show_edges=True))
    for width in (160, 170, 150):
        pl.window_size = width, 120
        shot(pl)
        pl.decals.subplot.at(80, 60)
        pl.render_window.MakeCurrent()
        assert pl.decals.subplot.renderer.context.gl.error == "GL_NO_ERROR"


def test_a_window_that_is_given_another_context_shows_the_same(pl: Plotter) -> None:
    """Qt makes one anew when a widget is docked elsewhere; here the window is ended and drawn again."""
    pl.decals.apply(pl.add_mesh(pv.Sphere(center=(0, 0, 1), radius=0.4)))
    first = shot(pl)
    for _ in range(2):
        old = pl.decals.subplot.renderer.context
        pl.render_window.Finalize()
        np.testing.assert_array_equal(shot(pl), first)
        assert old.stale
        assert pl.decals.subplot.renderer.context is not old
        assert (
            pl.decals.subplot.renderer.context.gl is old.gl
        )  # moderngl would keep another's memory for good
        np.testing.assert_array_equal(shot(pl), first)


def test_what_could_not_be_drawn_is_tried_again_once_it_is_asked_for_otherwise(
    plotter: Factory, capfd: pytest.CaptureFixture[str]
) -> None:
    pl = plotter(window_size=(1200, 40))
    pl.decals.add_scene(both(), camera=True)
    first = shot(pl)
    context = pl.decals.subplot.renderer.context
    context.max_texture_size = min(context.max_texture_size, 16384)  # some cards take more
    pl.decals.subplot.samples = 16
    shot(pl)
    pl.camera.azimuth = 1.0
    shot(pl)
    assert capfd.readouterr().err.count("InvalidScene: expected at most") == 1
    pl.camera.azimuth = 0.0
    pl.decals.subplot.samples = 2
    np.testing.assert_array_equal(shot(pl), first)
