"""Keys for shapes in the window: what grows is seen and held, and undo gives the first picture back."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blobtree import Point
from decals.editing.scatter_commands import decals_on
from tests.decals.editing.scenes import tree_of
from tests.decals.window.driver import Driver


def fresh(driver: Any) -> Any:
    """The whole frame, with nothing said and nothing held."""
    driver.window.actions.state.message, driver.window.actions.state.primitive = "", None
    driver.window.update_overlay()
    return driver.shot()


def place(driver: Any) -> Any:
    """Where a decal of the tree shows."""
    on_tree = decals_on(driver.document, [0])
    return next(at for number, at in driver.visible() if number in on_tree)


@pytest.mark.slow
def test_primitives_grow_join_and_go_and_undo_gives_the_first_picture(driver: Driver) -> None:
    first, state, at = fresh(driver), driver.state, place(driver)
    pictures = [first]
    for key, spot in (("n", at), ("j", (1, 1)), ("d", (1, 1)), ("l", at), ("Delete", (1, 1))):
        driver.press(key, spot)
        assert (driver.window.handle.widget is None) == (key == "Delete")
        pictures.append(fresh_but_held(driver))
    assert all((one != other).any() for one, other in pairwise(pictures))
    assert len(driver.session.labels) == 5
    for _ in range(5):
        driver.press("z", ctrl=True)
    assert driver.state == state
    np.testing.assert_array_equal(fresh(driver), first)


def fresh_but_held(driver: Any) -> Any:
    driver.window.actions.state.message = ""
    driver.window.update_overlay()
    return driver.shot()


def test_the_handle_of_what_is_new_drags_it(driver: Driver) -> None:
    driver.press("n", place(driver))
    grip = driver.window.handle
    before = driver.window.actions.trees.handle_position
    grip.begin()
    grip.widget.SetCenter(*np.add(before, (0.3, 0, 0)).tolist())
    grip.move()
    grip.end()
    driver.finish()
    assert driver.session.labels == ("add Point", "move a primitive")
    np.testing.assert_allclose(driver.window.actions.trees.handle_position - before, (0.3, 0, 0), atol=0.1)


def test_a_window_without_objects_gets_one_where_it_looks(driver: Driver) -> None:
    first, state = fresh(driver), driver.state
    while driver.document.objects:
        _, at = next(driver.visible())
        driver.press("Delete", at, shift=True)
    assert len(driver.document.decals) == 0
    empty = fresh(driver)
    driver.plotter.camera.focal_point = (0.25, 0, 0)
    driver.plotter.enable_parallel_projection()
    driver.press("N", shift=True)
    ball = tree_of(driver.document)
    assert isinstance(ball, Point)
    np.testing.assert_allclose(ball.center, (0.25, 0.0, 0.0), atol=1e-6)
    assert driver.window.handle.widget is not None
    driver.plotter.disable_parallel_projection()
    driver.plotter.camera.focal_point = driver.document.camera.target
    assert (fresh(driver) != empty).any()
    while driver.session.labels:
        driver.press("z", ctrl=True)
    assert driver.state == state
    np.testing.assert_array_equal(fresh(driver), first)


def test_scenes_without_objects_are_saved_and_opened(opened: Any, tmp_path: Path) -> None:
    from decals import load_scene

    driver = opened(path=tmp_path / "scene.json")
    while driver.document.objects:
        driver.press("Delete", next(driver.visible())[1], shift=True)
    driver.press("s", ctrl=True)
    again = opened(load_scene(tmp_path / "scene.json"))
    assert again.document.objects == ()
    again.press("N", shift=True)
    assert len(again.document.objects) == 1
