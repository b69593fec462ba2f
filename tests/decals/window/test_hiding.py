"""What actors in the window hide, and what they do not."""

from itertools import islice

import numpy as np
import pyvista as pv

from decals.window.host_plotter import ray_through
from tests.decals.window.driver import Driver


def test_what_an_actor_hides_is_neither_picked_nor_gone_to(driver: Driver) -> None:
    (number, at), (other, there) = islice(driver.visible(), 2)
    ray = ray_through(driver.window.subplot, *there)
    assert ray is not None
    origin = np.asarray(ray[0])
    center = origin + 0.5 * (driver.document.decals[other].positions[0] - origin)
    ball = pv.Sphere(radius=0.12, center=center)
    driver.plotter.add_mesh(ball, reset_camera=False, name="ball")
    driver.shot()
    driver.click(there)
    assert list(driver.window.actions.state.selection) == []
    driver.key("a", there)
    assert driver.window.actions.state.message == "no surface under the cursor; point at one"
    driver.click(at)
    assert list(driver.window.actions.state.selection) == [number]
    before = driver.state
    driver.event("LeftButtonPressEvent", at)
    driver.event("MouseMoveEvent", there)
    assert driver.state == before
    driver.event("LeftButtonReleaseEvent", there)
    driver.plotter.remove_actor("ball")
    driver.shot()
    driver.click(there)
    assert list(driver.window.actions.state.selection) == [other]


def test_what_surrounds_a_selected_decal_hides_nothing(driver: Driver) -> None:
    _, at = next(driver.visible())
    driver.click(at)
    driver.shot()
    seen = [driver.pixel(point) for point in driver.window.overlay.lines.points]
    assert all(driver.window.tools.at(*place) is not None for place in seen)
