"""What actors in the window hide, and what they do not."""

from itertools import islice

import pyvista as pv

from decals.window.looking import ray_through


def test_what_an_actor_hides_is_neither_picked_nor_gone_to(driver):
    (number, at), (other, there) = islice(driver.visible(), 2)
    ray = ray_through(driver.window.stage, *there)
    ball = pv.Sphere(radius=0.12, center=ray[0] + 0.5 * (driver.document.decals[other].positions[0] - ray[0]))
    driver.plotter.add_mesh(ball, reset_camera=False, name="ball")
    driver.shot()
    driver.click(there)
    assert driver.window.actions.selection == ()
    driver.key("a", there)
    assert driver.window.actions.message == "point at a surface"
    driver.click(at)
    assert driver.window.actions.selection == (number,)
    before = driver.state
    driver.event("LeftButtonPressEvent", at)
    driver.event("MouseMoveEvent", there)
    assert driver.state == before
    driver.event("LeftButtonReleaseEvent", there)
    driver.plotter.remove_actor("ball")
    driver.shot()
    driver.click(there)
    assert driver.window.actions.selection == (other,)


def test_what_surrounds_a_selected_decal_hides_nothing(driver):
    _, at = next(driver.visible())
    driver.click(at)
    driver.shot()
    seen = [driver.pixel(point) for point in driver.window.marks.lines.points]
    assert all(driver.window.tools.at(*place) is not None for place in seen)
