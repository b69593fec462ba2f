"""Driven windows: what is done with mouse and keys is done to the scene, is seen, and can be undone."""

import random
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

from blobtree.nodes.paths import node_in_world
from decals import Camera, Contact, DecalImage, ImageMapping, Scene, load_scene
from decals.editing import RemoveObject, ScaleDecals
from decals.editing.brush_settings import Brush
from decals.editing.scatter_commands import decals_on
from decals.errors import InvalidEdit
from decals.window import EditWindow, press_key
from decals.window.host_plotter import pixels_of
from decals.window.overlay import OUTLINE_COLOR
from tests.decals.editing.scenes import tree_of
from tests.decals.window.driver import Driver


def test_a_drag_deforms_the_neighbours_and_undo_gives_back_the_first_picture(driver: Driver) -> None:
    first, state = driver.shot(), driver.state
    number, at = next(driver.visible())
    driver.click(at)
    owner, uv = driver.owners()
    marked = driver.shot()
    assert (marked != first).any()
    driver.drag(at, (at[0] + 4, at[1]), (at[0] + 12, at[1] + 3))
    after_owner, after_uv = driver.owners()
    neighbours = (owner == after_owner) & (owner >= 0) & (owner != number)
    moved = (np.abs(after_uv - uv).max(axis=2) > 1e-3) & neighbours
    assert moved.sum() > 10
    assert driver.session.labels == ("move",)
    driver.key("z", ctrl=True)
    driver.key("Escape")
    assert driver.state == state
    driver.window.actions.state.message = ""
    driver.window.update_overlay()
    np.testing.assert_array_equal(driver.shot(), first)


def test_neighbours_deform_while_the_pointer_is_down(driver: Driver) -> None:
    _, at = next(driver.visible())
    driver.click(at)
    seen = [driver.owners()[1]]
    driver.event("LeftButtonPressEvent", at)
    for step in (5, 10, 15):
        driver.event("MouseMoveEvent", (at[0] + step, at[1]))
        seen.append(driver.owners()[1])
    for before, after in pairwise(seen):
        assert (before != after).any()
    driver.event("LeftButtonReleaseEvent", (at[0] + 15, at[1]))


def test_the_camera_is_left_its_drags_and_wheel(driver: Driver) -> None:
    state, before = driver.state, driver.plotter.camera.position
    driver.drag((3, 3), (40, 20), (60, 30))
    turned = driver.plotter.camera.position
    assert turned != before
    _, at = next(driver.visible())
    driver.wheel(at)
    closer = driver.plotter.camera.position
    assert closer != turned
    driver.click(at)
    assert len(driver.window.actions.state.selection) == 1
    driver.drag(at, (at[0] + 10, at[1]))
    driver.wheel(at, ctrl=True)
    assert driver.plotter.camera.position == pytest.approx(closer)
    assert driver.session.labels == ("move",)
    driver.key("z", ctrl=True)
    driver.key("z", ctrl=True)
    assert driver.state == state


def test_a_click_places_on_either_object(driver: Driver) -> None:
    for number in (0, 1):
        shown, at = next((n, at) for n, at in driver.visible() if n in decals_on(driver.document, [number]))
        driver.window.actions.state.brush.brush = Brush.ADD
        driver.click(at)
        (placed,) = driver.window.actions.state.selection
        assert placed in decals_on(driver.document, [number])
        seen = driver.window.tools.at(*at)
        assert seen is not None
        assert seen.owner in (placed, shown)  # a smaller one stays on top
    assert len(driver.document.decals) == 62


def test_the_cpu_picks_what_the_window_shows(driver: Driver) -> None:
    owner, _ = driver.owners()
    height, width = owner.shape
    rng = np.random.default_rng(0)
    wrong = 0
    for _ in range(100):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        found = driver.window.tools.at(x, y)
        wrong += owner[height - 1 - y, x] != (-1 if found is None else found.owner)
    assert wrong <= 2  # silhouettes


def test_a_page_shows_everything_as_the_window_does(driver: Driver) -> None:
    driver.wheel((3, 3))
    closer = driver.plotter.camera.position
    driver.key("r", text="r")
    shown = driver.plotter.camera.position
    assert shown != pytest.approx(closer)
    driver.wheel((3, 3))
    before = driver.shot()
    assert press_key(driver.window, "r")
    assert driver.plotter.camera.position == pytest.approx(shown, rel=1e-5)
    assert (driver.shot() != before).any()
    assert driver.session.labels == ()


def test_keys_of_pyvista_are_ours_where_the_table_says_so(driver: Driver) -> None:
    """`plus` widens lines in pyvista, `k` and `t` mean something to VTK; here they edit."""
    number, at = next(driver.visible())
    driver.click(at)
    radius = driver.document.decals[number].radii[0]
    driver.key("plus")
    driver.key("k")
    assert driver.document.decals[number].radii[0] > radius
    assert driver.document.decals[number].interactions[0] == 2
    assert driver.window.overlay._actor.prop.line_width == 3
    driver.key("h")
    assert driver.window.overlay.help_visible
    for _ in range(driver.window.actions.help_pages):
        driver.key("h")
    assert not driver.window.overlay.help_visible


def test_p_and_u_change_how_the_window_draws_and_picks(driver: Driver) -> None:
    subplot = driver.window.subplot
    assert (subplot.contact, subplot.mapping) == (Contact.ELASTIC, ImageMapping.CORRECTED)
    first = driver.shot()
    driver.key("u")
    assert subplot.mapping is ImageMapping.CHORD
    assert (driver.shot() != first).any()
    driver.key("P", shift=True)
    assert subplot.stiffness == 3.0
    for _ in range(3):
        driver.key("p")
    assert subplot.contact is Contact.RADIAL
    assert "contact mode: radial" in driver.window.overlay.status
    owner, _ = driver.owners()
    places = [(x, y) for x in range(60, 120, 6) for y in range(40, 80, 6) if owner[119 - y, x] >= 0]
    picks = [driver.window.tools.at(x, y) for x, y in places]
    owners = [owner[119 - y, x] for x, y in places]
    same = [pick is not None and pick.owner == own for pick, own in zip(picks, owners, strict=True)]
    assert np.mean(same) > 0.98
    kept = driver.document.scene.drawing
    assert (kept.contact, kept.mapping, kept.stiffness) == (Contact.RADIAL, ImageMapping.CHORD, 3.0)
    assert driver.session.labels[:2] == ("image mapping: chord", "stiffness of elastic contact: 3")
    for _ in driver.session.labels:
        driver.key("z", ctrl=True)
    assert (subplot.contact, subplot.mapping) == (Contact.ELASTIC, ImageMapping.CORRECTED)


def test_a_window_opens_with_the_given_modes(opened: Any) -> None:
    window = opened(contact="min", mapping=ImageMapping.CHORD).window
    assert (window.subplot.contact, window.subplot.mapping) == (Contact.MIN, ImageMapping.CHORD)
    assert window.document.drawing.contact is Contact.MIN


@pytest.mark.parametrize("key", ["n", "l"])
def test_the_first_object_of_an_empty_scene_is_made_by_key(opened: Any, key: str) -> None:
    images = (DecalImage.load("eye"),)
    driver = opened(Scene(objects=(), camera=Camera((1, 1, 5)), images=images))
    assert "n: add a ball" in driver.window.overlay.status
    empty = driver.shot()
    driver.press(key)
    assert len(driver.document.objects) == 1
    assert driver.window.actions.state.primitive == (0, ())
    middle = driver.shot()[50:70, 80:100]
    assert (middle != empty[50:70, 80:100]).any()
    driver.press("a", (104, 60))  # beside the handle
    assert len(driver.document.decals) == 1
    assert "n: add a ball" not in driver.window.overlay.status
    driver.press("z", ctrl=True)
    driver.press("z", ctrl=True)
    assert not driver.document.objects


def test_the_hint_for_help_stays(driver: Driver) -> None:
    driver.window.actions.state.show("a message")
    driver.window.update_overlay()
    assert driver.window.overlay.status == "h: help   a message"


def test_a_name_is_typed_in_the_window(opened: Any, tmp_path: Path) -> None:
    driver = opened(path=tmp_path / "scene.json")
    driver.key("S", ctrl=True, shift=True)
    assert f"save as: {tmp_path / 'scene.json'}" in driver.window.overlay.status
    for _ in "scene.json":
        driver.key("BackSpace")
    driver.type("Other-2.json")
    driver.press("Return")
    assert len(load_scene(tmp_path / "Other-2.json").decals) == len(driver.document.decals)
    assert driver.plotter.render_window.GetWindowName().startswith("Other-2.json")


def test_what_is_selected_is_outlined(driver: Driver) -> None:
    (number, at), (_, there) = islice(driver.visible(), 2)
    driver.click(at)
    decal = driver.document.decals[number]
    points = driver.window.overlay.lines.points
    assert np.linalg.norm(points - decal.positions[0], axis=1).max() < 1.1 * decal.radii[0]
    driver.click(there, shift=True)
    assert driver.window.overlay.lines.n_lines == 2
    driver.key("Escape")
    assert driver.window.overlay.lines.n_points == 0


def test_clicks_at_one_place_lead_to_the_root_and_boxes_show_it(driver: Driver) -> None:
    decal, at = next((n, at) for n, at in driver.visible() if n in decals_on(driver.document, [0]))
    state, overlay, tree = driver.window.actions.state, driver.window.overlay, tree_of(driver.document)
    first, seen = driver.state, []
    for _ in range(5):
        driver.click(at)  # from the third time on, it meets the handle
        seen.append(state.primitive and state.primitive[1])
        if state.primitive is None:
            assert state.selection == (decal,)
            continue
        low, high = node_in_world(tree, state.primitive[1]).bounds
        points = overlay.lines.points
        np.testing.assert_allclose((points.min(axis=0), points.max(axis=0)), (low, high))
        lengths = [np.linalg.norm(a - b) for a, b in points.reshape(-1, 2, 3)]
        np.testing.assert_allclose(sorted(lengths), np.repeat(sorted(high - low), 4), rtol=1e-5)
    assert seen[1] is not None
    assert seen == [None, seen[1], seen[1][:1], (), None]
    driver.click((1, 1))
    assert overlay.lines.n_points == 0
    assert driver.state == first


@pytest.mark.parametrize("parallel", [False, True])
def test_outlines_stay_whole_and_in_place_on_coarse_frames(driver: Driver, parallel: bool) -> None:
    window, subplot = driver.window, driver.window.subplot
    window.camera.parallel = parallel
    driver.click(next(driver.visible())[1])
    before = pixels_of(subplot, window.overlay.lines.points)

    def outlined() -> int:
        target = driver.plotter.render_window
        picture = vtkWindowToImageFilter(input=target, read_front_buffer=False, should_rerender=False)
        picture.Update()
        pixels = pv.convert_array(picture.GetOutput().GetPointData().GetScalars()).astype(int)
        return int((np.abs(pixels - 255 * np.array(OUTLINE_COLOR)).max(axis=1) < 60).sum())

    window.redraw(whole=True)
    whole = outlined()
    assert whole > 20
    subplot.draw_scale = 0.125
    driver.plotter.render()
    assert outlined() > 0.8 * whole
    actor = driver.plotter.actors["decals-selection"]
    moved = pv.PolyData(window.overlay.lines.points).transform(actor.user_matrix, inplace=False).points
    np.testing.assert_allclose(pixels_of(subplot, moved), before, atol=0.1)
    subplot.draw_scale = 1.0
    window.camera.parallel = False


def test_outlines_wait_until_a_drag_has_ended(driver: Driver) -> None:
    _, at = next(driver.visible())
    driver.click(at)
    assert driver.window.overlay.lines.n_lines == 1
    driver.event("LeftButtonPressEvent", at)
    driver.event("MouseMoveEvent", (at[0] + 9, at[1]))
    assert driver.window.overlay.lines.n_points == 0
    driver.event("LeftButtonReleaseEvent", (at[0] + 9, at[1]))
    assert driver.window.overlay.lines.n_lines == 1


@pytest.mark.slow_cases("5000")
@pytest.mark.parametrize("max_decals", [5_000, 5])
def test_a_primitive_is_moved_by_its_handle_and_decals_follow(
    driver: Any, max_decals: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("decals.editing.tree_actions.MAX_DECALS_IN_DRAG", max_decals)
    monkeypatch.setattr("decals.editing.session.MAX_REPLAYED_DECALS", max_decals)
    point = driver.document.objects[0].surface.project([[1.3, 1.2, 2]])[0][0]
    bare = driver.shot()
    driver.key("m", driver.pixel(point))
    first, state = driver.shot(), driver.state
    ball = (first != bare).any(axis=-1) & (first[..., 2] > first[..., 0] + 30)
    assert ball[119 - driver.pixel(point)[1], driver.pixel(point)[0]], "the handle is seen"
    number, path = driver.window.actions.state.primitive
    widget = driver.window.handle.widget
    center = driver.window.actions.trees.handle_position
    assert widget.GetCenter() == pytest.approx(center.tolist())
    before, first_tree = driver.document.decals.decals.positions, driver.document.objects[number].tree
    widget.InvokeEvent("StartInteractionEvent")
    for step in (0.1, 0.2, 0.4):
        widget.SetCenter(*np.add(center, (step, 0, 0)).tolist())
        widget.InvokeEvent("InteractionEvent")
    widget.InvokeEvent("EndInteractionEvent")
    driver.finish()
    moved = np.linalg.norm(driver.document.decals.decals.positions - before, axis=1)
    assert moved.max() > 0.2
    assert (moved == 0).any()
    low, high = node_in_world(driver.document.objects[number].tree, path).support
    moved_by = low + high - sum(node_in_world(first_tree, path).support)
    assert moved_by / 2 == pytest.approx([0.4, 0, 0], abs=1e-5)
    assert driver.session.labels == ("move a primitive",)
    assert (driver.shot() != first).any()
    driver.key("z", ctrl=True)
    assert driver.state == state
    driver.key("m", driver.pixel(point))
    assert driver.window.handle.widget is None
    assert number == 0
    assert path


def test_saving_keeps_the_windows_camera(opened: Any, tmp_path: Path) -> None:
    driver = opened(path=tmp_path / "scene.json")
    driver.drag((3, 3), (40, 20))
    driver.key("s", ctrl=True)
    driver.finish()
    assert not driver.session.modified
    assert "saved to" in driver.window.overlay.status
    saved = load_scene(tmp_path / "scene.json")
    assert saved.camera.position == pytest.approx(driver.plotter.camera.position)
    assert saved.decals.packed().tobytes() == driver.document.decals.decals.packed().tobytes()


def test_a_session_goes_on_in_another_window(opened: Any) -> None:
    first = opened()
    _, at = next(first.visible())
    first.click(at)
    first.key("Delete")
    first.window.close()
    assert first.session._listeners == []
    second = opened(first.session)
    assert len(second.document.decals) == 59
    second.key("z", ctrl=True)
    assert len(second.document.decals) == 60


def test_a_closed_window_says_so_and_its_session_goes_on(opened: Any) -> None:
    driver = opened()
    driver.window.close()
    with pytest.raises(InvalidEdit, match="was closed"):
        driver.window.show()
    driver.window.redraw(whole=True)
    driver.session.do(ScaleDecals(driver.document.decals.numbers[:1], 1.5))
    assert driver.session.undo() is not None


def test_an_empty_scene_can_be_opened_and_nothing_breaks(opened: Any) -> None:
    driver = opened(Scene(objects=(), camera=Camera((0, 0, 5))))
    for key in "adikoxgmtc":
        driver.key(key, (90, 60))
    driver.click((90, 60), ctrl=True)
    driver.drag((20, 20), (40, 40))
    driver.key("z", ctrl=True)
    assert driver.session.labels == ()


def test_two_windows_at_once(opened: Any) -> None:
    one, two = opened(), opened()
    _, at = next(one.visible())
    one.click(at)
    one.key("Delete")
    assert (len(one.document.decals), len(two.document.decals)) == (59, 60)
    assert (one.shot() != two.shot()).any()
    assert isinstance(one.window, EditWindow)


def test_an_object_that_is_removed_is_not_held_any_more(driver: Driver) -> None:
    point = driver.document.objects[0].surface.project([[1.3, 1.2, 2]])[0][0]
    driver.key("m", driver.pixel(point))
    assert driver.window.handle.widget is not None
    driver.session.do(RemoveObject(0))
    driver.window.redraw(whole=True)
    assert driver.window.actions.state.primitive is None
    assert driver.window.handle.widget is None
    driver.key("z", ctrl=True)
    driver.key("m", driver.pixel(point))
    assert driver.window.handle.widget is not None


@pytest.mark.parametrize("nearer", [1e200, 1e-200])
def test_a_camera_out_of_reach_goes_back(driver: Driver, nearer: float) -> None:
    before, camera = driver.shot(), driver.renderer.camera
    position = camera.position
    driver.window.begin_motion()
    camera.Dolly(nearer)
    assert camera.position != position
    driver.window.redraw(whole=True)
    assert camera.position == position
    np.testing.assert_array_equal(driver.shot(), before)


def test_every_move_of_the_camera_leaves_a_view(driver: Driver) -> None:
    rng, camera = random.Random(3), driver.window.camera
    for _ in range(1000):
        match rng.randrange(10):
            case 0:
                camera.parallel = not camera.parallel
            case 1:
                camera.look(rng.choice(((1, 0, 0), (0, 1, 0), (0, 0, 1))), (0.3, 0.5, 0.7))
            case _:
                move = rng.choice((0.0, 0.1, 1.0)), rng.choice((0.0, -0.2)), rng.choice((0.25, 0.5, 1.0, 3.0))
                camera.move_and_zoom(*move)
        camera.keep_usable()
        driver.window.subplot.viewpoint()
