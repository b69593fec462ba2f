"""View, decal panel and outline changes of the sandbox, without a browser."""

import io
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import decals
from blobtree import Point, Transform
from blobtree.nodes.paths import node_at
from blobtree.nodes.surgery import move_branch
from decals import Contact, ImageMapping, MeshObject
from decals.apps.sandbox.decal_panel import drawing_controls
from decals.apps.sandbox.sandbox import Sandbox
from decals.editing import AddImage, MovePrimitive, RenameObject, ReplaceImage, SetDrawing, SetValues
from decals.rendering import Background, Environment
from decals.scenes.camera import PRESETS
from decals.scenes.meshes import as_polydata
from decals.window import EditWindow
from decals.window.host_plotter import TURN_DEGREES, pixels_of
from decals.window.view_modes import MODES, OVERLAYS, PREFIX, example_data
from tests.apps.sandbox.test_sandbox import TREE, finish
from tests.decals.editing.scenes import box, digest, tree_of


@pytest.fixture(scope="module")
def shared(vtk_display: None) -> Iterator[EditWindow]:
    vertices, faces = box((-3, -1, -1), (-2, 1, 1))
    objects: list[Any] = [decals.TreeObject("blob", TREE), MeshObject("crate", vertices, faces)]
    scene = decals.cover(TREE, count=40, images=["tile"]).replace(objects=objects)
    with EditWindow(scene, off_screen=True, size=(120, 90)) as window:
        window.show()
        yield window


@pytest.fixture
def sandbox(shared: EditWindow) -> Iterator[Sandbox]:
    sandbox = Sandbox(shared)
    yield sandbox
    for name, value in (("mode", "traced"), ("overlay", "none"), ("slice", "none")):
        sandbox.set_control("display", name, value)
    settle(sandbox, shared)
    sandbox.go_to(0)
    shared.actions.state.selection, shared.actions.state.primitive = (), None


def settle(sandbox: Sandbox, window: EditWindow) -> None:
    """Wait until the view shows what it should: one call installs what was made, the next begins new work."""
    finish(window)
    idle, end = 0, time.monotonic() + 60.0
    while idle < 3:
        sandbox.settle()
        idle = 0 if sandbox.values()["display"]["busy"] else idle + 1
        assert time.monotonic() < end
        time.sleep(0.002)


def picture(window: EditWindow) -> np.ndarray:
    pixels: np.ndarray = np.asarray(window.plotter.screenshot(None, return_img=True)).astype(int)
    return pixels


def test_every_mode_and_overlay_changes_the_picture_and_all_go_back(
    sandbox: Sandbox, shared: EditWindow
) -> None:
    pictures = [picture(shared)]
    choices: list[tuple[str, Any]] = [("mode", mode) for mode in MODES[1:]] + [("mode", MODES[0])]
    choices += [("overlay", overlay) for overlay in OVERLAYS[1:] if overlay != "folds"]
    choices += [("overlay", "none"), ("slice", "z"), ("slice_position", -0.3)]
    choices += [("slice_normal", (1.0, 0.0, 2.0)), ("slice", "none")]
    for name, value in choices:
        sandbox.set_control("display", name, value)
        settle(sandbox, shared)
        drawn = picture(shared)
        if value in ("traced", "none", ""):
            np.testing.assert_array_equal(drawn, pictures[0])
        else:
            least = 0.1 if value == "polygonized" else 0.3  # the mesh looks much like the surface
            assert all(np.abs(drawn - other).mean() > least for other in pictures), (name, value)
            pictures.append(drawn)
    assert sandbox.display._meshes == []  # the view of the scene itself needs none
    sandbox.set_control("display", "overlay", "folds")
    sandbox.settle()
    assert "preparing the view" in sandbox.status
    settle(sandbox, shared)
    assert "triangles folded" in sandbox.status


def test_dragged_primitives_snap(sandbox: Sandbox, shared: EditWindow) -> None:
    sandbox.select("0/1")
    sandbox.set_control("display", "snap", 0.25)
    trees = shared.actions.trees
    before = np.array(trees.selected_node.center)  # type: ignore[attr-defined]
    trees.begin_drag()
    trees.drag((0.3, -0.1, 0.4))
    trees.end_drag()
    finish(shared)
    after = np.array(trees.selected_node.center)  # type: ignore[attr-defined]
    np.testing.assert_allclose(after - before, (0.25, 0.0, 0.5), atol=1e-6)
    wrong: list[Any] = [-1.0, float("nan"), "far", None]
    for value in wrong:
        sandbox.set_control("display", "snap", value)
        assert "snap: expected" in sandbox.status
    sandbox.set_control("display", "snap", 0.0)
    controls = {control["name"]: control["value"] for control in sandbox.values()["display"]["controls"]}
    assert controls["snap"] == 0.0


def test_the_frame_budget_holds_for_the_polygonized_scene(sandbox: Sandbox, shared: EditWindow) -> None:
    subplot = shared.subplot
    sandbox.set_control("display", "mode", "polygonized")
    settle(sandbox, shared)
    drawn = subplot.drawn_objects
    assert drawn is not None
    assert [type(item).__name__ for item in drawn] == ["MeshedTree", "MeshObject"]
    picture(shared)
    shared.frames.budget.record(2.0, 100.0)  # frames take long
    shared.begin_motion()
    subplot.vtk_renderer.camera.Azimuth(1.0)
    shared.plotter.render()
    assert subplot.draw_scale < 1.0
    assert subplot.drawn_fraction == 1.0
    sandbox.set_control("drawing", "mapping", "walked")
    settle(sandbox, shared)
    picture(shared)
    assert subplot.shown_mapping is ImageMapping.WALKED
    sandbox.set_control("display", "mode", "traced")
    settle(sandbox, shared)
    assert subplot.drawn_objects is None


def test_near_and_far_planes_follow_a_growing_model(sandbox: Sandbox, shared: EditWindow) -> None:
    camera = shared.subplot.vtk_renderer.camera
    shared.subplot.vtk_renderer.reset_camera_clipping_range()  # other tests may have moved the planes
    near, far = camera.clipping_range
    sandbox.select("0/1")
    sandbox.set_control("node", "center", -60.0, index=[2])
    finish(shared)
    shared.plotter.render()
    assert camera.clipping_range[1] > far
    assert camera.clipping_range[0] <= near


def test_overlays_follow_edits(sandbox: Sandbox, shared: EditWindow) -> None:
    sandbox.set_control("display", "overlay", "seeds")
    settle(sandbox, shared)
    assert "40 seeds" in sandbox.status
    shared.actions.state.selection = (3,)
    sandbox.perform("delete")
    settle(sandbox, shared)
    assert "39 seeds" in sandbox.status


def test_the_view_is_made_again_only_if_what_it_shows_has_changed(
    sandbox: Sandbox, shared: EditWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[str] = []

    def counted(objects: Any, **options: Any) -> Any:
        made.append(objects[0].name)
        return as_polydata(objects, **options)

    monkeypatch.setattr("decals.apps.sandbox.display.as_polydata", counted)
    sandbox.set_control("display", "mode", "wireframe")
    settle(sandbox, shared)
    assert made == ["blob", "crate"]
    shared.session.do(SetValues.each([1, 2], layers=3, radii=0.1))
    sandbox.settle()
    assert not sandbox.values()["display"]["busy"]  # no decal is in this view
    shared.session.do(RenameObject(1, "chest"))
    settle(sandbox, shared)
    assert made == ["blob", "crate"]
    shared.session.do(MovePrimitive(0, (0,), (0.1, 0, 0)))
    settle(sandbox, shared)
    assert made == ["blob", "crate", "blob"]
    sandbox.set_control("display", "overlay", "owners")
    settle(sandbox, shared)
    shared.session.do(SetValues.each([1, 2], radii=0.2))
    sandbox.settle()
    assert sandbox.values()["display"]["busy"]
    settle(sandbox, shared)
    assert made == ["blob", "crate", "blob"]


def test_an_overlay_with_a_scale_is_added_without_a_frame(
    sandbox: Sandbox, shared: EditWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = []
    monkeypatch.setattr(shared.plotter, "render", lambda: frames.append(True))
    sandbox.set_control("display", "overlay", "stretch")
    display, end = sandbox.display, time.monotonic() + 60.0
    frames.clear()
    while not shared.plotter.scalar_bars:
        display.update()
        assert time.monotonic() < end
        time.sleep(0.002)
    assert not frames


def test_each_kind_of_actor_is_drawn_once_before_input_comes(shared: EditWindow) -> None:
    drawn: list[int] = []

    def shown(*_: object) -> int:
        return sum(name.startswith(PREFIX) for name in shared.plotter.actors)

    tag = shared.plotter.render_window.AddObserver("StartEvent", lambda *_: drawn.append(shown()))
    Sandbox(shared)
    shared.plotter.render_window.RemoveObserver(tag)
    assert drawn[0] == len(example_data()) > 5
    assert not shown()
    assert not shared.plotter.scalar_bars


def test_cameras(sandbox: Sandbox, shared: EditWindow) -> None:
    camera = shared.subplot.vtk_renderer.camera
    sandbox.move_camera("keep")
    kept = camera.position
    for name in PRESETS:
        sandbox.move_camera("look", name)
        toward = np.array(camera.position) - camera.focal_point
        preset = np.array(PRESETS[name])
        np.testing.assert_allclose(toward / np.linalg.norm(toward), preset / np.linalg.norm(preset))
    sandbox.set_control("display", "orthographic", True)
    assert camera.parallel_projection
    sandbox.move_camera("go", 0)
    assert camera.position == kept
    assert not camera.parallel_projection
    distances = []
    for choose in ("", "0/1"):
        sandbox.select(choose)
        sandbox.move_camera("frame")
        distances.append(camera.distance)
    assert distances[1] < distances[0]
    wrong: list[Any] = [
        ("look", "up"),
        ("look", "top bottom"),
        ("look", None),
        ("go", 9),
        ("go", True),
        ("fly", None),
        (None, None),
    ]
    for name, value in wrong:
        sandbox.move_camera(name, value)
        assert "expected" in sandbox.status
    sandbox.set_control("display", "slice", "tilted")
    wrong = [("mode", "x"), ("overlay", None), ("slice_position", "x"), ("slice_position", float("inf"))]
    wrong += [("slice", "w"), ("slice_normal", (0, 0, 0)), ("slice_normal", 3), ("up", "w"), (3, 3)]
    for name, value in wrong:
        sandbox.set_control("display", name, value)
        assert "expected" in sandbox.status
    for index in (["x"], [3], 0):
        sandbox.set_control("display", "slice_normal", 1.0, True, index)
        assert "expected" in sandbox.status
    sandbox.set_control("display", "slice", "none")
    for pinch in ((0.0, 0.0, 0.0, "spin"), (None, 0.0, 1.0, "move"), (0.0, float("nan"), 1.0, "move")):
        sandbox.pinch(*pinch)
        assert "expected" in sandbox.status


def test_the_model_keeps_its_size_when_the_projection_changes(sandbox: Sandbox, shared: EditWindow) -> None:
    camera = shared.subplot.vtk_renderer.camera
    point = np.array(camera.focal_point) + 0.3 * np.array(camera.up)
    places = []
    for action in ("view_three-quarter", "orthographic", "orthographic"):
        sandbox.perform(action)
        places.append(pixels_of(shared.subplot, point))
    np.testing.assert_allclose(places[1], places[0], atol=0.5)
    np.testing.assert_allclose(places[2], places[0], atol=1e-3)


def test_fingers_move_and_zoom_what_lies_at_the_target(sandbox: Sandbox, shared: EditWindow) -> None:
    camera, (_, height) = shared.subplot.vtk_renderer.camera, shared.plotter.window_size
    for parallel in (False, True):
        sandbox.perform("frame")
        sandbox.set_control("display", "orthographic", parallel)
        point = np.array(camera.focal_point)
        sides = np.stack([point, point + 0.2 * np.array(camera.up)])
        before = pixels_of(shared.subplot, sides)
        sandbox.pinch(0.0, 0.0, 1.0, "begin")
        sandbox.pinch(0.1, -0.2, 1.0, "move", 3)
        moved = pixels_of(shared.subplot, sides)
        np.testing.assert_allclose(moved[0] - before[0], (0.1 * height, -0.2 * height), atol=1e-3)
        sandbox.pinch(0.0, 0.0, 2.0, "move")
        sandbox.pinch(0.0, 0.0, 1.0, "end")
        camera.focal_point, camera.position = (
            tuple(np.array(one) + point - np.array(camera.focal_point))
            for one in (camera.focal_point, camera.position)
        )
        zoomed = pixels_of(shared.subplot, sides)
        np.testing.assert_allclose(zoomed[0], before[0], atol=1e-3)
        np.testing.assert_allclose(zoomed[1] - zoomed[0], 2.0 * (before[1] - before[0]), rtol=0.15)


def test_two_fingers_turn_the_view_around_its_target(sandbox: Sandbox, shared: EditWindow) -> None:
    camera = shared.subplot.vtk_renderer.camera
    sandbox.perform("view_front")
    target, eye, up = (np.array(one) for one in (camera.focal_point, camera.position, camera.up))
    side = np.cross(up, eye - target)
    for moved, across in (((0.1, 0.0), side), ((0.0, 0.1), up * camera.distance)):
        sandbox.perform("view_front")
        sandbox.pinch(*moved, 1.0, "move")
        angle = np.radians(TURN_DEGREES * 0.1)
        expected = target + np.cos(angle) * (eye - target) - np.sin(angle) * across
        np.testing.assert_allclose(camera.position, expected, atol=1e-6)
        np.testing.assert_allclose(camera.focal_point, target, atol=1e-9)
        assert abs(np.dot(camera.up, camera.direction)) < 1e-6


@pytest.mark.slow_cases("0.25-False", "4.0-True")
@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("factor", [0.25, 4.0])
def test_any_number_of_pinches_leaves_a_view(
    sandbox: Sandbox, shared: EditWindow, parallel: bool, factor: float
) -> None:
    sandbox.perform("frame")
    sandbox.set_control("display", "orthographic", parallel)
    for _ in range(60):
        sandbox.pinch(0.3, -0.2, factor, "move")
        assert "expected" not in sandbox.status
        shared.subplot.viewpoint()
    sandbox.go_to(0)
    sandbox.perform("frame")
    sandbox.pinch(0.0, 0.0, 1.0, "end")


def test_a_page_lists_the_newest_entries_and_jumps_to_each(
    sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("decals.apps.sandbox.sandbox.MAX_HISTORY", 2)
    for name in ("first", "second", "third"):
        sandbox.change_row("object 0", "rename", name)
    values = sandbox.values()
    assert (values["earlier"], len(values["done"]), values["forgotten"]) == (1, 2, 0)
    sandbox.go_to(values["earlier"] + 1)  # the page's first entry
    assert sandbox.values()["outline"][0]["label"] == "second"
    sandbox.go_to(0)


def test_two_fingers_take_back_what_the_first_did(sandbox: Sandbox, shared: EditWindow) -> None:
    before, camera = digest(shared.document), shared.subplot.vtk_renderer.camera
    sandbox.perform("frame")
    sandbox.set_control("brush", "brush", "erase")
    middle = [side // 2 for side in shared.plotter.window_size]
    shared.tools.press(*middle)
    assert digest(shared.document) != before
    sandbox.pinch(0.0, 0.0, 1.0, "begin")
    assert digest(shared.document) == before
    assert sandbox.values()["done"] == []
    sandbox.set_control("brush", "brush", "select")
    position = camera.position
    shared.tools.press(*middle)
    sandbox.pinch(0.0, 0.0, 1.0, "begin")
    assert not shared.tools.release(*middle)
    assert shared.actions.state.selection == ()
    assert camera.position == position


def test_the_slice_is_moved_and_tilted_in_the_view(sandbox: Sandbox, shared: EditWindow) -> None:
    sandbox.perform("frame")
    sandbox.perform("view_three-quarter")
    sandbox.set_control("display", "slice", "x")
    controls = {control["name"]: control for control in sandbox.values()["display"]["controls"]}
    low, high = (controls["slice_position"][end] for end in ("low", "high"))
    assert abs(controls["slice_position"]["value"] - (low + high) / 2) < 1e-6
    places = {one["name"]: (one["x"], one["y"]) for one in sandbox.values()["gizmo"]["handles"]}
    (line,) = sandbox.values()["gizmo"]["lines"]
    assert line == [*places["slice"], *places["tilt slice"]]
    for name in ("slice", "tilt slice"):
        before = sandbox.display.options.slice
        sandbox.drag_handle(name, "begin", *places[name])
        sandbox.drag_handle(name, "move", places[name][0] + 0.05, places[name][1] + 0.1)
        sandbox.drag_handle(name, "end", places[name][0] + 0.05, places[name][1] + 0.1)
        after = sandbox.display.options.slice
        assert before is not None
        assert after is not None
        assert (before.normal == after.normal) == (name == "slice")
        assert (before.point == after.point) == (name == "tilt slice")
    assert sandbox.values()["done"] == []
    controls = {control["name"]: control for control in sandbox.values()["display"]["controls"]}
    assert controls["slice"]["value"] == "tilted"
    sandbox.set_control("display", "slice_normal", "0", True, [1])
    sandbox.set_control("display", "slice_normal", 0.0, True, [2])
    controls = {control["name"]: control for control in sandbox.values()["display"]["controls"]}
    assert controls["slice"]["value"] == "x"
    sandbox.set_control("display", "slice", "none")
    assert sandbox.values()["gizmo"]["handles"] == []
    sandbox.drag_handle("slice", "begin", 0.5, 0.5)
    assert "expected" in sandbox.status


def test_values_of_decals_are_set_as_one_entry_each(sandbox: Sandbox, shared: EditWindow) -> None:
    before = digest(shared.document)
    shared.actions.state.selection = (3, 5)
    values: dict[str, Any] = {
        "radius": 0.3,
        "opacity": 0.5,
        "layer": 2,
        "interaction": "overlap",
        "spill": True,
        "receivers": "crate",
        "fade_angle": 90.0,
        "fade_depth": 0.5,
        "single_sheet": True,
        "tint": "#ff0000",
        "image": "tint alone",
    }
    controls = {control["name"]: control for control in sandbox.values()["decal"]["controls"]}
    assert set(controls) == set(values)
    for name, value in values.items():
        sandbox.set_control("decals", name, value, False)
        sandbox.set_control("decals", name, value, True)
        finish(shared)
    rows = shared.document.decals.take(np.array([3, 5]))
    assert rows.radii.tolist() == [np.float32(0.3)] * 2
    assert rows.images.tolist() == [-1, -1]
    assert rows.spill.all()
    assert rows.receivers.tolist() == ["crate"] * 2
    controls = {control["name"]: control["value"] for control in sandbox.values()["decal"]["controls"]}
    assert {name: controls[name] for name in ("layer", "interaction", "tint", "image")} == {
        "layer": 2,
        "interaction": "overlap",
        "tint": "#ff0000",
        "image": "tint alone",
    }
    assert len(sandbox.values()["done"]) == len(values)
    wrong: list[Any] = [
        ("radius", -1),
        ("radius", "x"),
        ("image", "no"),
        ("tint", 3),
        ("receivers", "no"),
        ("fade_angle", 200),
        ("no", 1),
        (None, 1),
    ]
    for name, value in wrong:
        sandbox.set_control("decals", name, value)
        assert "expected" in sandbox.status or "radii" in sandbox.status
    sandbox.go_to(0)
    assert digest(shared.document) == before


def test_brush_and_drawing_are_set(sandbox: Sandbox, shared: EditWindow) -> None:
    sandbox.set_control("brush", "brush", "scatter")
    sandbox.set_control("brush", "radius", "0.7")
    sandbox.set_control("brush", "density", 0.5)
    values = sandbox.values()["brush"]
    assert values["brush"] == "scatter"
    assert {control["name"]: control["value"] for control in values["controls"]}["radius"] == 0.7
    camera = shared.subplot.vtk_renderer.camera
    ends = pixels_of(shared.subplot, [camera.focal_point, np.array(camera.focal_point) + camera.up])
    length = np.linalg.norm(ends[1] - ends[0]) / shared.plotter.window_size[1]
    assert sandbox.values()["gizmo"]["brush"] == pytest.approx(0.7 * length, rel=0.1)
    wrong_brush: list[tuple[str, Any]] = [("brush", "smear"), ("radius", 0), ("density", 2), ("color", 1)]
    wrong_brush += [("radius", None), ("images", "moss"), ("images", [[]]), ("images", None)]
    for name, value in wrong_brush:
        sandbox.set_control("brush", name, value)
        assert "expected" in sandbox.status
    sandbox.set_control("brush", "brush", "select")
    before = shared.document.drawing
    sandbox.set_control("drawing", "contact", "radial")
    for stiffness in (4, "3.5", 3):
        sandbox.set_control("drawing", "stiffness", stiffness, False)
    sandbox.set_control("drawing", "stiffness", 3)
    sandbox.set_control("drawing", "background.top", "#ff0000")
    sandbox.settle()
    drawing = shared.document.scene.drawing
    assert (shared.subplot.contact, shared.subplot.stiffness) == (Contact.RADIAL, 3.0)
    assert drawing.background == Background((1, 0, 0), before.background.bottom)
    assert shared.plotter.renderer.GetBackground2() == (1.0, 0.0, 0.0)
    assert sandbox.values()["done"] == ["set contact", "set stiffness", "set background.top"]
    wrong: list[Any] = [("contact", "x"), ("stiffness", 0), ("stiffness", "x"), ("color", 1), (None, 1)]
    for name, value in [*wrong, ("filtered", 3), ("samples", ""), ("background.top", None)]:
        sandbox.set_control("drawing", name, value)
        assert "expected" in sandbox.status
    sandbox.go_to(0)
    assert shared.document.drawing == before
    sandbox.set_control("drawing", "environment.strength", 2)
    assert "expected one of" in sandbox.status
    dark = Environment(np.zeros((2, 4, 3)), rotation=5)
    shown = drawing_controls(replace(before, environment=dark))
    new = {control["name"]: control["value"] for control in shown[len(drawing_controls(before)) :]}
    assert new == {"environment.rotation": 5, "environment.strength": 1, "environment.visible": False}
    shared.session.do(SetDrawing(replace(before, environment=dark)))
    sandbox.set_control("drawing", "environment.strength", "0.5")
    assert shared.document.drawing.environment == replace(dark, strength=0.5)


def test_scattering_takes_the_options_of_its_panel(sandbox: Sandbox, shared: EditWindow) -> None:
    first = {control["name"]: control["value"] for control in sandbox.values()["scattering"]}
    assert first["count"] == len(shared.document.decals) > 0
    values = {"count": "30", "regularity": 0.2, "sizing": "touching", "jitter.size": 0.3, "direction": "none"}
    for name, value in values.items():
        sandbox.set_control("scattering", name, value)
        assert sandbox.status == f"set {name}"
    shown = {control["name"]: control["value"] for control in sandbox.values()["scattering"]}
    assert shown["sizing"] == "touching"
    for wrong in (("count", "x"), ("images", 3), ("sizing", "x"), (None, 1)):
        sandbox.set_control("scattering", *wrong)
        assert "expected" in sandbox.status
    sandbox.scatter()
    finish(shared)
    recipe = shared.document.recipe
    assert recipe is not None
    assert (len(shared.document.decals), recipe.parameters["jitter"]["size"]) == (30, 0.3)
    expected = decals.scatter(
        [item.surface for item in shared.document.objects],
        count=30,
        images=1,
        regularity=0.2,
        sizing="touching",
        jitter=decals.scattering.Jitter(size=0.3),
    )
    np.testing.assert_array_equal(shared.document.scene.decals.positions, expected.positions)
    np.testing.assert_array_equal(shared.document.scene.decals.radii, expected.radii)
    seed = next(control for control in sandbox.values()["scattering"] if control["name"] == "seed")
    assert seed["value"] == 1  # the next one


def test_a_zone_has_images_and_a_density_of_its_own(sandbox: Sandbox, shared: EditWindow) -> None:
    before = shared.document.decals
    numbers, positions = before.numbers, before.decals.positions.copy()
    for name in ("scale", "eye"):
        shared.session.do(AddImage(decals.DecalImage.load(name)))
    sandbox.set_control("scattering", "count", 60)
    sandbox.set_control("scattering", "images", ["scale", "eye"])
    sandbox.set_control("scattering", "images", ["eye"])
    sandbox.set_control("scattering", "zone_density", 0)
    assert "expected a number above 0" in sandbox.status
    sandbox.set_control("scattering", "zone_density", "4")
    sandbox.scatter_zone()
    assert "no zone is selected" in sandbox.status
    sandbox.select("0/1")
    sandbox.scatter_zone()
    finish(shared)
    document, chosen = shared.document, sandbox._state.selection
    kept = np.isin(numbers, document.decals.numbers)
    assert 0 < kept.sum() < len(kept)
    np.testing.assert_array_equal(document.decals.take(numbers[kept]).positions, positions[kept])
    new = document.decals.take(np.array(chosen))
    assert sandbox.values()["decal"]["count"] == len(new) > 8
    assert set(new.images.tolist()) == {2}
    sandbox.change_row("image 0", "remove")  # the numbers of the others change, the choice does not
    sandbox.scatter()
    finish(shared)
    assert (len(document.decals), set(document.decals.decals.images.tolist())) == (60, {1})
    assert sandbox.values()["done"][-3:] == ["scatter on Point", "remove an image", "scatter"]
    sandbox.go_to(0)
    np.testing.assert_array_equal(shared.document.decals.decals.positions, positions)


def test_images_become_materials_and_are_dropped_on_rows(sandbox: Sandbox, shared: EditWindow) -> None:
    before = digest(shared.document)
    sandbox.set_control("image", "roughness", 0.5)
    assert "no image is selected" in sandbox.status
    sandbox.select("image 0")
    for roughness in (0.7, 0.5, 0.2):
        sandbox.set_control("image", "roughness", roughness, False)
    sandbox.set_control("image", "roughness", 0.2)
    material = shared.document.images[0]
    assert isinstance(material, decals.DecalMaterial)
    assert material.roughness.max() == 51
    assert sandbox.values()["selected"] == "image 0"
    shown = sandbox.values()["image"]
    assert shown["picture"].startswith("data:image/png")
    assert [control["value"] for control in shown["controls"]] == pytest.approx([0.2, 0, 1, 0])
    assert sandbox.values()["done"] == ["set roughness"]
    for name, value in (("roughness", 2), ("relief", 0.2), ("height", 1), ("metallic", "")):
        sandbox.set_control("image", name, value)
        assert "expected" in sandbox.status
    shared.session.do(ReplaceImage(0, decals.DecalMaterial("m", material.pixels, roughness=material.pixels)))
    assert sandbox.values()["image"]["controls"][0]["value"] is None  # a map
    file = io.BytesIO()
    Image.new("RGBA", (8, 8), "red").save(file, "PNG")
    given = [{"name": "red.png", "content": file.getvalue()}]
    sandbox.upload(given, "layer 0")
    assert set(shared.document.decals.decals.images.tolist()) == {1}
    sandbox.upload(given, "image 0")
    assert [image.pixels.shape for image in shared.document.images] == [(8, 8, 4)] * 2
    assert sandbox.values()["done"][-2:] == ["add an image", "replace an image"]
    sandbox.upload(given, "image 9")
    assert "expected" in sandbox.status
    sandbox.go_to(0)
    assert digest(shared.document) == before


def test_the_scatter_brush_adds_the_chosen_images(sandbox: Sandbox, shared: EditWindow) -> None:
    before, brush = digest(shared.document), shared.actions.state.brush
    for name in ("scale", "eye"):
        shared.session.do(AddImage(decals.DecalImage.load(name)))
    sandbox.set_control("brush", "brush", "scatter")

    def chosen() -> list[str]:
        controls = {control["name"]: control for control in sandbox.values()["brush"]["controls"]}
        assert controls["images"]["choices"][-2:] == ("scale", "eye")
        value: list[str] = controls["images"]["value"]
        return value

    every = chosen()
    assert every[-2:] == ["scale", "eye"]
    sandbox.set_control("brush", "images", ["eye"])
    assert chosen() == ["eye"]
    assert list(brush.images) == [len(every) - 1]
    for images in (every, []):
        sandbox.set_control("brush", "images", images)
        assert (chosen(), list(brush.images)) == (every, [])
    sandbox.set_control("brush", "images", ["scale"])
    sandbox.change_row("image 0", "remove")
    assert not brush.images
    sandbox.set_control("brush", "brush", "select")
    sandbox.go_to(0)
    assert digest(shared.document) == before


def test_an_image_that_is_dropped_on_the_view_becomes_a_decal_there(
    sandbox: Sandbox, shared: EditWindow
) -> None:
    before, count = digest(shared.document), len(shared.document.images)
    sandbox.move_camera("frame")
    (width, height), tools = shared.plotter.window_size, shared.tools
    column, row = next(
        (column, row)
        for row in range(2000, 9000, 500)
        for column in range(1000, 9000, 500)
        if tools.at(column * width / 10_000, row * height / 10_000) is not None
    )
    pick = tools.at(column * width / 10_000, row * height / 10_000)
    assert pick is not None
    file = io.BytesIO()
    Image.new("RGBA", (8, 8), "red").save(file, "PNG")
    given, place = [{"name": "red.png", "content": file.getvalue()}], f"view {column}/{row}"
    sandbox.upload(given, place)
    (number,) = shared.actions.state.selection
    decal = shared.document.decals[number]
    assert decal.images.tolist() == [count]
    np.testing.assert_allclose(decal.positions[0], pick.position)
    assert sandbox.values()["done"] == ["add an image"]
    assert sandbox.status == "added image red and a decal"
    sandbox.place_image("image 0", place)
    assert shared.document.decals[shared.actions.state.selection[0]].images.tolist() == [0]
    added = len(shared.document.decals)
    sandbox.upload(given, "view 0/10000")  # beside the model: the image alone is added
    assert (len(shared.document.images), len(shared.document.decals)) == (count + 2, added)
    assert "choose it" in sandbox.status
    sandbox.place_image("image 0", "view 0/10000")
    assert "no surface" in sandbox.status
    for wrong in ("view 1", "view 1/2/3", "view a/b", "view -5/1", "", None):
        sandbox.place_image("image 0", wrong)  # type: ignore[arg-type]
        assert "no surface" in sandbox.status, wrong
    for key, reason in (("image 9", "expected"), ("layer 0", "an image alone"), ("0", "an image alone")):
        sandbox.place_image(key, place)
        assert reason in sandbox.status, key
    sandbox.go_to(0)
    assert digest(shared.document) == before


def test_a_click_reports_what_it_meets(sandbox: Sandbox, shared: EditWindow) -> None:
    sandbox.move_camera("frame")
    x, y = next(
        (x, y)
        for y in range(20, 70, 4)
        for x in range(60, 110, 4)
        if (p := shared.tools.at(x, y)) and not p.object
    )
    shared.tools.press(x, y)
    shared.tools.release(x, y)
    facts = sandbox.values()["pick"]
    assert facts["object"] == "blob"
    assert facts["primitive"].startswith("Point")
    assert abs(float(facts["field"]) - 0.5) < 1e-3
    assert len(facts["position"].split(", ")) == 3


def test_rows_are_renamed_duplicated_moved_and_removed(sandbox: Sandbox, shared: EditWindow) -> None:
    before = digest(shared.document)
    sandbox.change_row("object 0", "rename", "snail")
    sandbox.change_row("object 0", "duplicate")
    finish(shared)
    assert [item.name for item in shared.document.objects] == ["snail", "crate", "snail 2"]
    sandbox.change_row("0/0", "move", "0/1")
    finish(shared)
    first: Any = tree_of(shared.document)
    assert [ball.radius for ball in first.children] == [0.6, 1.0]
    assert sandbox.values()["selected"] == "0/1"
    sandbox.change_row("0/1", "duplicate")
    finish(shared)
    assert len(tree_of(shared.document).children) == 3
    sandbox.change_row("0/2", "remove")
    finish(shared)
    sandbox.change_row("object 2", "remove")
    finish(shared)
    sandbox.change_row("0/1", "rename", "head")
    sandbox.change_row("layer 0", "rename", "scales")
    labels = {row["key"]: row["label"] for row in sandbox.values()["outline"]}
    assert (labels["0/1"], labels["layer 0"], labels["0/0"]) == ("head", "scales", "Point")
    shared.session.do(AddImage("eye"))
    sandbox.change_row("image 1", "move", "layer 0")
    assert set(shared.document.decals.decals.images.tolist()) == {1}
    sandbox.change_row("image 0", "remove")
    assert [image.source for image in shared.document.images] == ["eye"]
    sandbox.change_row("layer 0", "remove")
    assert len(shared.document.decals) == 0
    changes: list[Any] = [
        ("object 0", "rename", "crate"),
        ("object 0", "rename", ""),
        ("object 0", "rename", None),
        ("0/0", "rename", None),
        ("image 0", "rename", "x"),
        ("image 7", "remove", None),
        ("image 0", "move", "0/0"),
        ("layer 0", "move", "0"),
        ("layer 0/1", "hide", None),
        ("layer 0", "rename", 3),
        ("0/0", "move", "1"),
        ("0/0", "move", "0/0"),
        ("0/0", "move", None),
        ("0", "remove", None),
        ("object 7", "remove", None),
        ("x", "remove", None),
        (None, "duplicate", None),
        ("object 0", "explode", None),
    ]
    for key, change, value in changes:
        sandbox.change_row(key, change, value)
        finish(shared)
        assert sandbox.status, (key, change)
    assert len(shared.document.objects) == 2
    sandbox.go_to(0)
    assert digest(shared.document) == before


def test_a_moved_branch_stays_where_it_is() -> None:
    group = (Point((0, 0, 0), radius=0.5) + Point((1, 0, 0), radius=0.3)).translate((0, 2, 0))
    tree = group + Point((0, -1, 0), radius=0.4) + TREE.twist(10.0)
    points = np.random.default_rng(2).uniform(-2, 3, (500, 3)).astype(np.float32)
    for path, target in (((1,), (0, 0)), ((0, 0, 1), ()), ((0, 0, 1), (1,)), ((0,), (1,)), ((1,), (0,))):
        moved, found = move_branch(tree, path, target)
        np.testing.assert_allclose(moved(points), tree(points), atol=2e-6)
        assert type(node_at(moved, found)) in (type(node_at(tree, path)), Transform)
