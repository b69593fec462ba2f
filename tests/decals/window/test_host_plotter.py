"""Editing in a host plotter: as in a window of its own; the plotter is restored afterwards."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from blobtree import Point
from decals import Scene, TreeObject, cover, load_scene
from decals.editing.scatter_commands import decals_on
from decals.errors import InvalidScene
from decals.window import EditWindow
from tests.decals.editing.scenes import scene
from tests.decals.vtk.conftest import Factory, plotter
from tests.decals.vtk.scenes import shot
from tests.decals.window.conftest import opened
from tests.decals.window.driver import Driver

__all__ = ["opened", "plotter"]

FAR = 2e6
"""Distance from the origin at which float32 no longer tells the points of a ball of radius 1 apart."""


def far_ball() -> Scene:
    return cover(Point((FAR, 0, 0), radius=1.0), count=20, images=["eye"])


def take_hold(driver: Driver) -> None:
    """Of a primitive of the tree."""
    on_tree = decals_on(driver.document, [0])
    driver.key("m", next(at for number, at in driver.visible() if number in on_tree))
    assert driver.window.handle.widget is not None


@pytest.mark.slow
def test_hands_in_a_subplot_that_is_no_longer_the_active_one(plotter: Factory) -> None:
    pl = plotter(shape=(1, 2), window_size=(320, 120))
    ball = pl.add_mesh(pv.Sphere())
    pl.subplot(0, 1)
    empty = shot(pl)
    window = EditWindow(scene(), plotter=pl)
    window.show()
    pl.subplot(0, 0)
    renderer = pl.renderers[1]
    renderer.ResetCamera()
    driver = Driver(window, renderer)
    first, state = driver.shot(), driver.state
    np.testing.assert_array_equal(first[:, :155], empty[:, :155])
    _, at = next(driver.visible())
    driver.click(at)
    driver.drag(at, (at[0] + 4, at[1]), (at[0] + 12, at[1] + 3))
    assert driver.session.labels == ("move",)
    assert (driver.shot() != first).any()
    driver.key("z", ctrl=True)
    assert driver.state == state
    window.close()
    assert list(pl.renderers[0].actors.values()) == [ball]
    assert not pl.renderers[1].actors
    np.testing.assert_array_equal(shot(pl), empty)
    assert driver.session._listeners == []


def test_a_subplot_that_showed_a_scene_shows_the_edited_one(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_scene(scene(), camera=True)
    pl.decals.subplot.samples = 1
    first = shot(pl)
    with EditWindow(scene(), plotter=pl) as window:
        window.show()
        window.subplot.draw_scale = 0.5  # as while something moves
    np.testing.assert_array_equal(pl.decals.scene.decals.packed(), scene().decals.packed())
    np.testing.assert_array_equal(shot(pl), first)
    window = EditWindow(pl.decals.scene, plotter=pl)
    window.show()
    driver = Driver(window)
    _, at = next(driver.visible())
    driver.click(at)
    driver.key("Delete")
    window.close()
    assert pl.decals.subplot.wait_for_gpu is False
    edited = pl.decals.scene
    assert len(edited.decals) == len(scene().decals) - 1
    after = shot(pl)
    assert (after != first).any()
    fresh = plotter()
    fresh.decals.add_scene(edited, camera=True)
    fresh.decals.subplot.samples = 1
    np.testing.assert_array_equal(after, shot(fresh))
    pl.decals.add(edited.decals[:1])


def test_a_tick_after_the_end_leaves_the_plotter_alone(plotter: Factory) -> None:
    """Scripts tick by themselves, and a timer's last event may be on its way."""
    pl = plotter()
    pl.decals.add_scene(scene(), camera=True)
    pl.decals.subplot.samples = 1
    window = EditWindow(scene(), plotter=pl, samples=3)
    window.show()
    window.begin_motion()
    window.frames._changed_at = 1.0
    window.close()
    renders: list[int] = []
    tag = pl.render_window.AddObserver("StartEvent", lambda *_: renders.append(1))
    for _ in range(3):
        window.tick()
    window._before_screenshot()  # as before a screenshot that is wrapped twice
    pl.render_window.RemoveObserver(tag)
    assert pl.decals.subplot.samples == 1
    assert pl.decals.subplot.draw_scale == 1.0
    assert not renders


def test_what_somebody_shows_meanwhile_stays(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_scene(scene(), camera=True)
    with EditWindow(scene(), plotter=pl) as window:
        window.show()
        pl.decals.scene = other = scene(20)
    assert pl.decals.scene is other
    with EditWindow(scene(), plotter=pl) as window:
        window.show()
        pl.clear()
    assert pl.decals.subplot.scene is None


def test_a_window_in_the_subplot_of_another_gives_it_back(plotter: Factory) -> None:
    pl = plotter()
    outer = EditWindow(scene(), plotter=pl)
    outer.show()
    with EditWindow(scene(20), plotter=pl) as inner:
        inner.show()
        assert outer.subplot.scene is inner.document
    assert outer.subplot.scene is outer.document
    outer.close()
    assert outer.subplot.scene is None


def test_each_of_two_subplots_has_hands_of_its_own(plotter: Factory) -> None:
    pl = plotter(shape=(1, 2), window_size=(320, 120))
    drivers = []
    for column in (0, 1):
        pl.subplot(0, column)
        window = EditWindow(scene(), plotter=pl)
        window.show()
        drivers.append(Driver(window, pl.renderers[column]))
    for driver, other in (drivers, drivers[::-1]):
        number, at = next(driver.visible())
        before = other.state
        driver.click(at)
        driver.wheel(at, ctrl=True)
        driver.key("Delete", at)
        assert list(driver.session.labels) == ["larger", "delete"]
        assert number not in driver.document.decals.numbers
        assert other.state == before
        driver.key("z", at, ctrl=True)
        assert list(driver.session.labels) == ["larger"]


def test_hands_stay_where_the_plotter_gets_another_style(plotter: Factory) -> None:
    pl = plotter()
    window = EditWindow(scene(), plotter=pl)
    window.show()
    driver = Driver(window)
    pl.enable_terrain_style()
    number, at = next(driver.visible())
    driver.click(at)
    assert window.actions.state.selection == (number,)


def test_screenshots_show_whole_frames(plotter: Factory) -> None:
    pl = plotter()
    window = EditWindow(scene(), plotter=pl)
    window.show()
    whole = pl.screenshot(return_img=True)
    window.subplot.draw_scale, window.subplot.samples = 0.25, 1  # as while something moves
    np.testing.assert_array_equal(pl.screenshot(return_img=True), whole)
    window.close()
    assert "screenshot" not in vars(pl)


def test_the_handle_is_ours_alone(plotter: Factory) -> None:
    pl = plotter(shape=(1, 2), window_size=(320, 120))
    theirs = pl.add_sphere_widget(lambda _center: None, center=(0, 0, 0), radius=0.2)
    pl.subplot(0, 1)
    window = EditWindow(scene(), plotter=pl)
    window.show()
    pl.subplot(0, 0)
    driver = Driver(window, pl.renderers[1])
    take_hold(driver)
    assert window.handle.widget.GetCurrentRenderer() is pl.renderers[1]
    window.close()
    assert window.handle.widget is None
    assert theirs.GetEnabled()


def test_a_window_that_goes_with_the_handle_in_it(plotter: Factory) -> None:
    pl = plotter()
    window = EditWindow(scene(), plotter=pl)
    window.show()
    driver = Driver(window)
    take_hold(driver)
    pl.close()
    window.close()
    assert window.handle.widget is None


def test_a_camera_that_stands_somewhere_stays_there(plotter: Factory) -> None:
    pl = plotter()
    with EditWindow(scene(), plotter=pl):
        assert pl.camera.position == pytest.approx(scene().camera.position)
    pl.camera_position = [(0, -9, 1), (0, 0, 0), (0, 0, 1)]
    with EditWindow(scene(), plotter=pl):
        assert pl.camera.position == (0, -9, 1)


def test_a_plotter_that_was_closed_first(plotter: Factory) -> None:
    pl = plotter()
    window = EditWindow(scene(), plotter=pl)
    window.show()
    pl.close()
    window.close()
    with pytest.raises(InvalidScene, match="this one was closed"):
        EditWindow(scene(), plotter=pl)


def test_what_is_no_plotter_is_refused() -> None:
    with pytest.raises(InvalidScene, match="a pyvista plotter to edit in, got str"):
        EditWindow(scene(), plotter="window")  # type: ignore[arg-type]


def test_a_far_scene_is_edited_and_saved_like_one_at_the_origin(opened: Any, tmp_path: Path) -> None:
    path, scene = tmp_path / "far.json", far_ball()
    ball = TreeObject("ball", Point((0, 0, 0), radius=1.0))
    same = Scene(objects=[ball], camera=scene.camera, decals=scene.decals, images=scene.images)
    near, far = opened(same), opened(scene, path=path)
    for driver in (near, far):
        driver.press("a", ctrl=True)  # outlines and handles are in the pictures too
    np.testing.assert_array_equal(far.shot(), near.shot())
    far.press("s", ctrl=True)
    saved = load_scene(path)
    assert saved.origin == (FAR, 0.0, 0.0)
    np.testing.assert_allclose(saved.camera.position, scene.camera.position, atol=1e-6)


def test_a_plotter_shows_a_far_scene_from_the_same_side_afterwards(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_scene(far_ball(), camera=True)
    pl.decals.subplot.samples = 1
    first, position = shot(pl), pl.camera.position
    with EditWindow(pl.decals.scene, plotter=pl) as window:
        window.show()
        assert np.abs(pl.camera.position).max() < 100.0
    np.testing.assert_allclose(pl.camera.position, position, atol=1e-6)
    np.testing.assert_array_equal(shot(pl), first)
