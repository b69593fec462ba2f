"""The sandbox without a browser: its values follow the session, and its events edit the scene."""

import json
import re
import threading
import time
from collections.abc import Iterator
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import decals
from blobtree import Point, Segment, Torus, Twist, Union
from blobtree.nodes.paths import node_at
from blobtree.nodes.surgery import dominant_primitive
from decals import Camera, MeshObject, Scene, TreeObject
from decals.apps.sandbox.hover import outlines
from decals.apps.sandbox.outline import outline
from decals.apps.sandbox.sandbox import REST_SECONDS, Sandbox
from decals.apps.sandbox.words import FOLDER, TEXTS, words
from decals.editing import KEYS, Document, ReplaceScene, SetParameter, first_hit, nearest_points, tree_actions
from decals.editing.action_state import SLOW_STEP
from decals.editing.gizmo import on_plane
from decals.errors import InvalidEdit
from decals.window import EditWindow
from decals.window.host_plotter import pixels_of, ray_through
from tests.decals.editing.scenes import box, digest, tree_of

ROOT = Path(__file__).resolve().parents[3]
TREE = Point((0, 0, 0), radius=1.0) + Point((1.2, 0.4, 0), radius=0.6)
CAMERA = Camera((0, 0, 8))
POINTS = np.random.default_rng(1).uniform(-2, 2, (500, 3))


@cache
def covered() -> Scene:
    return decals.cover(TREE, count=20, images=["tile"])


@pytest.fixture
def window(vtk_display: None) -> Iterator[EditWindow]:
    with EditWindow(covered(), off_screen=True, size=(80, 60)) as window:
        window.show()
        yield window


def finish(window: EditWindow) -> None:
    """Wait until background work is done, however slow the machine is."""
    while window.background.busy:
        window.tick()
        time.sleep(0.005)


def test_of_waiting_slider_steps_only_the_newest_is_carried_out(window: EditWindow) -> None:
    sandbox, asked, radii = Sandbox(window), [], []
    sandbox.schedule = lambda: asked.append(True)
    sandbox.select("0/1")

    def changed(_: object) -> None:
        tree: Any = tree_of(window.document)
        radii.append(tree.children[1].radius)

    window.session.subscribe(changed)
    for radius in (0.65, 0.7, 0.75):
        sandbox.set_control("node", "radius", radius, False)
    assert (len(asked), radii) == (3, [])
    sandbox.take_step()
    sandbox.take_step()
    finish(window)
    assert radii == [0.75]
    sandbox.set_control("node", "radius", 0.8, False)
    sandbox.select("0/0")  # any other event comes after the step
    assert radii[-1] == 0.8
    sandbox.set_control("node", "radius", 0.85, False)
    sandbox.set_control("node", "radius", 0.9, True)
    tree: Any = tree_of(window.document)
    assert (tree.children[0].radius, tree.children[1].radius) == (0.9, 0.8)


def test_lessons_are_started_and_left(window: EditWindow) -> None:
    started: list[int] = []

    def start(number: int) -> None:
        started.append(number)
        window.session.do(ReplaceScene(window.document.scene.replace(objects=()), "lesson"))
        window.plotter.camera.position = (0.0, 0.0, 99.0)

    sandbox = Sandbox(window, start=True, lessons=["One", "Two"], start_lesson=start)
    before, camera = digest(window.document), window.plotter.camera.position
    assert sandbox.values()["start"]["lessons"] == ["One", "Two"]
    window.actions.files.path = "mine.json"
    wrong: list[Any] = [2, -1, True, None, "0", []]
    for number in wrong:
        sandbox.open_lesson(number)
        assert "lesson: expected a whole number from 0 to 1" in sandbox.status
    assert (started, sandbox.in_lesson, sandbox.values()["start"]["open"]) == ([], False, True)
    sandbox.open_lesson(1)
    assert (started, sandbox.in_lesson, sandbox.values()["start"]["open"]) == ([1], True, False)
    sandbox.open_lesson(0)
    assert sandbox.values()["title"] == "*untitled"  # the scene's file is not that of the lesson
    sandbox.close_lesson()
    assert not sandbox.in_lesson
    assert sandbox.values()["title"] == "mine.json"
    assert (digest(window.document), window.plotter.camera.position) == (before, camera)
    assert len(sandbox.values()["undone"]) == 2
    sandbox.open_lesson(0)
    sandbox.new_model()
    finish(window)
    assert not sandbox.in_lesson


def test_marked_nodes_are_grouped_and_removed_together(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.select("0")
    sandbox.add("Torus")
    finish(window)
    field, at = tree_of(window.document)(POINTS), digest(window.document)
    sandbox.select("0/0")
    sandbox.change_row("0/0", "group")
    assert "select two or more operands" in sandbox.status
    sandbox.mark("0/2")
    assert sandbox.values()["marked"] == ["0/0", "0/2"]
    sandbox.change_row("0/2", "group")
    finish(window)
    assert shapes(window) == ["Sum", "Sum", "Point", "Torus", "Point"]
    assert sandbox.values()["selected"] == "0/0"
    np.testing.assert_allclose(tree_of(window.document)(POINTS), field, atol=1e-6)
    sandbox.select("0/0/0")
    for key in ("0/0/1", "0/1"):
        sandbox.mark(key)
    sandbox.change_row("0/0/1", "remove")
    finish(window)
    assert "last visible part" in sandbox.status
    sandbox.mark("0/1")
    sandbox.change_row("0/0/0", "remove")  # the group goes with its operands
    finish(window)
    assert shapes(window) == ["Point"]
    sandbox.go_to(1)
    assert digest(window.document) == at
    sandbox.mark("image 0")
    assert "row: expected" in sandbox.status
    sandbox.change_row("object 0", "duplicate")
    finish(window)
    sandbox.select("0/1")
    sandbox.mark("1/0/0")
    sandbox.change_row("0/1", "hide")
    assert [item.hidden for item in window.document.objects] == [((1,),), ((0, 0),)]
    for key in ("layer 0", "layer 1", "layer 1"):
        sandbox.mark(key)
    assert sandbox.values()["marked"] == ["layer 0"]
    sandbox.select("layer 0")
    assert sandbox.values()["marked"] == ["layer 0"]
    sandbox.select("")
    assert sandbox.values()["marked"] == []


def test_the_pointer_lights_up_rows_and_rows_light_up_the_view(window: EditWindow) -> None:
    sandbox, (width, height) = Sandbox(window), window.plotter.window_size
    message = sandbox.status
    seen: set[str] = set()
    for x in range(1000, 10000, 500):
        sandbox.hover(f"view {x}/5000")
        pick = window.tools.at(x * width / 10_000, height / 2)
        rows = sandbox.values()["hovered"]["rows"]
        if pick is None:
            assert rows == []
            continue
        leaf = dominant_primitive(tree_of(window.document), pick.position)
        assert rows == [f"0/{leaf[0]}", *(["layer 0"] if pick.owner >= 0 else [])]
        seen.add(rows[0])
    assert seen == {"0/0", "0/1"}
    matrix = window.document.camera.clip_matrix((width, height), window.document.objects[0].bounds)
    for key, bounds in (("0/1", TREE.children[1].bounds), ("object 0", TREE.bounds)):
        sandbox.hover(key)
        corners = np.array(list(product(*np.transpose(bounds))))
        clip = np.column_stack([corners, np.ones(8)]) @ np.transpose(matrix)
        expected = clip[:, :2] / clip[:, 3:] * (0.5, -0.5) + 0.5
        lines = np.reshape(sandbox.values()["hovered"]["lines"], (12, 2, 2))
        near = np.linalg.norm(lines.reshape(-1, 1, 2) - expected, axis=-1) < 0.002
        assert near.sum(axis=0).tolist() == [3] * 8  # each corner ends three edges
    sandbox.hover("layer 0")
    dots = sandbox.values()["hovered"]["dots"]
    assert 0 < len(dots) < len(window.document.decals)  # those on the far side have none
    sandbox.hover("image 0")
    assert sandbox.values()["hovered"]["dots"] == dots
    for key in ("", "q", "0/7", "object 5", "more 0", "view x", "layer 9"):
        sandbox.hover(key)
        assert sandbox.values()["hovered"] == {"rows": [], "lines": [], "dots": []}
    assert (sandbox.status, window.session.labels) == (message, ())


def test_arrows_lead_to_the_tops_of_images(vtk_display: None) -> None:
    halves = np.full((16, 16, 4), 255, np.uint8)
    halves[:8, :, 1:3], halves[8:, :, :2] = 0, 0  # red above, blue below
    ball = Point((0, 0, 0), radius=1.0)
    scene = decals.cover(ball, count=24, images=[decals.DecalImage("halves", halves)])
    with EditWindow(scene.replace(camera=CAMERA), off_screen=True, size=(360, 300)) as window:
        window.show()
        sandbox = Sandbox(window)
        sandbox.hover("image 0")
        picture = window.plotter.screenshot(None, return_img=True).astype(int)
        arrows = np.array(sandbox.values()["hovered"]["dots"]).reshape(-1, 2, 2)
        inside = np.abs(arrows[:, 0] - 0.5).max(axis=1) < 0.1  # those that face the camera
        assert inside.sum() >= 2
        for center, top in arrows[inside] * (360, 300):
            for (x, y), channel in ((top, 0), (2 * center - top, 2)):
                pixel = picture[int(y), int(x)]
                assert pixel[channel] > pixel[2 - channel] + 60


def test_a_page_says_what_the_scene_has_and_what_was_done_last(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.select("")
    assert sandbox.values()["panel"]["doc"] == "1 object, 20 decals, 1 image"
    sandbox.perform("select_all")
    sandbox.perform("larger")
    sandbox.perform("deselect")
    assert sandbox.values()["status"].endswith("last action: larger")
    sandbox.go_to(0)


def test_words_of_the_theory_are_explained_and_their_pages_have_these_sections(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.perform("select_all")
    values = sandbox.values()
    controls = [*values["scattering"], *values["drawing"], *values["decal"]["controls"]]
    assert {control["name"] for control in controls if control["word"]} == TEXTS.keys()
    for name, text in TEXTS.items():
        assert text.split("\n\n")[0].endswith(".")
        assert words()[name]["picture"].startswith("data:image/svg+xml")
        assert ElementTree.parse(FOLDER / f"{name}.svg").findall("*")
        section, page = re.findall("“(.*)” in (docs/.*[.]md)", text)[0]
        assert f"## {section}\n" in (ROOT / page).read_text(encoding="utf-8")


def shapes(window: EditWindow) -> list[str]:
    return [row["label"] for row in outline(window.document) if "/" in row["key"] or row["key"].isdigit()]


def test_values_of_a_page_are_plain_and_follow_the_session(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    values = sandbox.values()
    assert json.loads(json.dumps(values, default=list)) is not None
    assert [row["key"] for row in values["outline"]] == ["object 0", "0", "0/0", "0/1", "layer 0", "image 0"]
    assert (values["selected"], values["panel"]["controls"], values["done"]) == ("", [], [])
    assert [row["key"] for row in values["outline"] if row["picture"].startswith("data:image/png")] == [
        "image 0"
    ]
    sandbox.select("0/1")
    values = sandbox.values()
    assert (values["selected"], values["panel"]["kind"]) == ("0/1", "Point")
    sandbox.select("object 0")
    assert sandbox.values()["panel"]["kind"] == "Sum"
    sandbox.select("")
    assert sandbox.values()["selected"] == ""


def test_rows_are_hidden_locked_and_isolated(window: EditWindow) -> None:
    sandbox, before = Sandbox(window), digest(window.document)

    def flags() -> list[str]:
        rows = sandbox.values()["outline"]
        return [row["key"] for row in rows if row["hidden"] or row["locked"]]

    sandbox.change_row("0/1", "hide")
    sandbox.change_row("layer 0", "lock")
    assert flags() == ["0/1", "layer 0"]
    sandbox.select("layer 0")
    assert sandbox.values()["decal"]["count"] == 0  # locked
    sandbox.change_row("layer 0", "lock")
    sandbox.change_row("0/1", "hide")
    sandbox.select("layer 0")
    assert sandbox.values()["decal"]["count"] == 20
    sandbox.change_row("0/0", "isolate")
    assert flags() == ["0/1"]
    sandbox.change_row("0/0", "isolate")
    sandbox.change_row("layer 0", "isolate")  # shows everything: there is no other layer
    sandbox.change_row("layer 0", "hide")
    assert (flags(), len(window.document.decals)) == (["layer 0"], 0)
    sandbox.change_row("object 0", "lock")
    sandbox.change_row("object 0", "remove")
    finish(window)
    assert "'model 1' is locked" in sandbox.status
    sandbox.change_row("layer 7", "hide")
    assert "layer: expected one with decals" in sandbox.status
    sandbox.go_to(0)
    assert (flags(), digest(window.document)) == ([], before)


def test_handles_move_turn_and_scale_the_selected_node(window: EditWindow) -> None:
    sandbox, before = Sandbox(window), digest(window.document)
    assert sandbox.values()["gizmo"]["handles"] == []
    sandbox.select("0/1")
    places = {one["name"]: (one["x"], one["y"]) for one in sandbox.values()["gizmo"]["handles"]}
    assert len(places) == 8
    (x, y), end = places["move"], places["move x"]

    def drag(name: str, *ways: tuple[float, float], snap: bool = False) -> Any:
        sandbox.drag_handle(name, "begin", *places[name])
        for way in ways:
            sandbox.drag_handle(name, "move", *way, snap)
        sandbox.drag_handle(name, "end", *ways[-1], snap)
        finish(window)
        tree: Any = tree_of(window.document)
        return tree.children[1]

    far = (2 * end[0] - x, 2 * end[1] - y)
    center = drag("move x", (0.9, 0.1), far).center
    assert center[0] > 1.3
    np.testing.assert_array_equal(center[1:], (0.4, 0.0))
    assert window.session.labels == ("move x",)
    moved = sandbox.values()["gizmo"]["handles"][0]
    np.testing.assert_allclose((moved["x"], moved["y"]), end, atol=0.03)  # perspective
    sandbox.perform("undo")
    assert digest(window.document) == before
    snapped = drag("move x", far, snap=True).center[0] - 1.2
    np.testing.assert_allclose(snapped, round(snapped, 2), atol=1e-9)
    sandbox.perform("undo")
    wide = places["scale"]
    larger = drag("scale", (2 * wide[0] - x, 2 * wide[1] - y))
    assert larger.radius == pytest.approx(1.2, abs=0.03)
    sandbox.perform("undo")
    assert digest(window.document) == before
    assert window.session.undone_labels == ("scale",)
    for phase, by in (("begin", 0.0), ("move", 0.01), ("end", 0.01)):
        sandbox.drag_handle("move", phase, x + by, y)
    assert window.session.undone_labels == ("scale",)  # a click on a handle is one on the node behind it
    assert window.actions.state.primitive == (0, ())
    sandbox.select("0/1")
    sandbox.drag_handle({}, "begin", 0.5, 0.5)  # type: ignore[arg-type]
    sandbox.drag_handle("spin", "begin", 0.5, 0.5)
    assert "handle: expected one of the selected node, move" in sandbox.status
    sandbox.drag_handle("move", "throw", 0.5, 0.5)
    sandbox.drag_handle("move", "begin", None, "x")  # type: ignore[arg-type]
    sandbox.drag_handle("move", "move", 0.2, 0.2)  # no drag began
    sandbox.take_step()
    assert digest(window.document) == before


def test_a_slider_is_one_undo_entry_and_undo_restores_every_bit(window: EditWindow) -> None:
    sandbox, before = Sandbox(window), digest(window.document)
    sandbox.select("0/1")
    for radius in (0.65, 0.7, 0.75):
        sandbox.set_control("node", "radius", radius, False)
    sandbox.set_control("node", "radius", 0.8, True)
    finish(window)
    tree: Any = tree_of(window.document)
    assert tree.children[1].radius == 0.8
    positions = window.document.decals.decals.positions
    np.testing.assert_allclose(tree(positions), 0.5, atol=1e-4)  # decals follow the surface
    assert sandbox.values()["done"] == ["set radius"]
    sandbox.perform("undo")
    assert digest(window.document) == before
    for last in (False, True):  # the history ends a drag, and waits for the check of the surface
        sandbox.set_control("node", "radius", 0.8, last)
        sandbox.go_to(0)
        finish(window)
        assert digest(window.document) == before
        assert sandbox.values()["undone"] == ["set radius"]


def test_the_ends_of_a_slider_stay_while_it_moves(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.select("0/1")
    before = sandbox.values()["panel"]["controls"][2]
    sandbox.set_control("node", "radius", 1.4, False)
    after = sandbox.values()["panel"]["controls"][2]
    assert (after["value"], after["low"], after["high"]) == (1.4, before["low"], before["high"])


def test_after_two_slow_steps_a_slider_blocks_the_page_no_longer(
    window: EditWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    sandbox, compute, threads = Sandbox(window), SetParameter.compute, []

    def slow(command: SetParameter, document: Document) -> Any:
        threads.append(threading.current_thread() is threading.main_thread())
        began = time.thread_time()
        while time.thread_time() - began < 1.2 * SLOW_STEP:
            pass
        return compute(command, document)

    monkeypatch.setattr(SetParameter, "compute", slow)
    sandbox.select("0/1")
    for radius in (0.65, 0.7, 0.75, 0.8):
        sandbox.set_control("node", "radius", radius, False)
    sandbox.set_control("node", "radius", 0.85, True)
    finish(window)
    assert threads[:2] == [True, True]
    assert not any(threads[2:])
    tree: Any = tree_of(window.document)
    assert (tree.children[1].radius, window.session.labels) == (0.85, ("set radius",))


def test_a_slider_that_rests_ends_its_edit(window: EditWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    sandbox, now = Sandbox(window), time.monotonic()
    sandbox.select("0/1")
    sandbox.set_control("node", "radius", 0.7, False)
    sandbox.settle()
    assert window.session.stroke_open
    monkeypatch.setattr(time, "monotonic", lambda: now + 2.0 * REST_SECONDS + 60.0)
    sandbox.settle()
    monkeypatch.undo()
    finish(window)
    assert not window.session.stroke_open
    assert sandbox.values()["done"] == ["set radius"]


def test_parameters_of_all_sorts_are_set(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.select("0/1")
    sandbox.set_control("node", "color", "#ff0000")
    sandbox.set_control("node", "center", "0.5", index=[1])
    finish(window)
    ball: Any = tree_of(window.document).children[1]
    assert ball.color == (1.0, 0.0, 0.0)
    assert ball.center == (1.2, 0.5, 0.0)
    assert sandbox.values()["done"] == ["set color", "set center"]


def test_nodes_are_added_wrapped_and_combined_anew(window: EditWindow) -> None:
    sandbox, before = Sandbox(window), digest(window.document)
    sandbox.select("0/0")
    sandbox.add("Torus")
    finish(window)
    assert isinstance(tree_of(window.document).children[2], Torus)
    assert sandbox.values()["selected"] == "0/2"
    sandbox.wrap("Twist")
    finish(window)
    assert isinstance(tree_of(window.document).children[2], Twist)
    sandbox.unwrap()
    finish(window)
    sandbox.select("0")
    sandbox.combine("Union")
    finish(window)
    assert isinstance(tree_of(window.document), Union)
    assert shapes(window) == ["Union", "Point", "Point", "Torus"]
    assert sandbox.values()["done"] == [
        "add Torus",
        "put Torus under Twist",
        "remove Twist",
        "combine with Union",
    ]
    sandbox.go_to(1)
    assert sandbox.status == "history: after add Torus"
    assert shapes(window) == ["Sum", "Point", "Point", "Torus"]
    sandbox.go_to(0)
    assert sandbox.status == "history: at the start"
    assert digest(window.document) == before
    assert len(sandbox.values()["undone"]) == 4
    sandbox.go_to(4)
    assert shapes(window) == ["Union", "Point", "Point", "Torus"]


@pytest.mark.parametrize("many", [0, 5000])
def test_typed_values_follow_an_edit_that_selects_another_node(
    window: EditWindow, monkeypatch: pytest.MonkeyPatch, many: int
) -> None:
    monkeypatch.setattr(tree_actions, "MAX_DECALS_IN_DRAG", many)
    sandbox = Sandbox(window)
    sandbox.select("0/1")
    sandbox.wrap("Twist")
    sandbox.set_control("node", "radius", "0.7")
    sandbox.set_control("node", "center", "0.5", index=[1])
    assert (window.actions.state.refusal, window.background.waiting) == ("", 0 if many else 2)
    finish(window)
    twist: Any = tree_of(window.document).children[1]
    assert (type(twist), twist.child) == (Twist, Point((1.2, 0.5, 0), radius=0.7))
    assert sandbox.values()["selected"] == "0/1"
    assert window.session.labels[-2:] == (
        ("set center", "put Point under Twist") if many else ("set radius", "set center")
    )
    sandbox.perform("delete")
    sandbox.set_control("node", "degrees", "5")
    finish(window)
    assert shapes(window) == ["Point"]
    if not many:
        assert "removed or replaced" in sandbox.status


def test_a_new_node_without_a_selection_is_an_object(vtk_display: None) -> None:
    with EditWindow(Scene(objects=(), camera=CAMERA), off_screen=True, size=(80, 60)) as window:
        window.show()
        sandbox = Sandbox(window)
        for kind in ("Box", "Point"):
            sandbox.add(kind)
            finish(window)
            sandbox.select("")
        assert [item.name for item in window.document.objects] == ["box 1", "point 1"]


def test_a_node_is_replaced_by_one_of_another_kind(window: EditWindow) -> None:
    sandbox, before = Sandbox(window), digest(window.document)
    sandbox.select("0/1")
    kind = sandbox.values()["panel"]["controls"][0]
    assert (kind["name"], kind["value"]) == ("kind", "Point")
    assert {"Torus", "Box"} <= {*kind["choices"]}
    sandbox.set_control("node", "kind", "Torus")
    finish(window)
    sandbox.select("0")
    sandbox.set_control("node", "kind", "Union")
    finish(window)
    assert shapes(window) == ["Union", "Point", "Torus"]
    assert sandbox.values()["done"] == ["replace Point by Torus", "replace Sum by Union"]
    for wrong in ("Twist", "No", None, 3):
        sandbox.set_control("node", "kind", wrong)
        assert "kind: expected one of" in sandbox.status
    sandbox.go_to(0)
    assert digest(window.document) == before


def test_a_key_closes_no_page(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.change_row("object 0", "rename", "snail")
    for _ in range(2):
        sandbox.perform("close")
        assert "unsaved changes are kept" in sandbox.values()["status"]
        assert sandbox.values()["refused"]
    window.actions.files.finish()
    assert not window.actions.state.prompt.open


def test_a_value_that_is_refused_in_the_background_marks_its_field(
    window: EditWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once for each refusal: a page that sees two resets together sees none."""

    def refused(session: Any) -> str:
        session.do(SetParameter(0, (1,), "weight", 2.0))
        raise InvalidEdit("weight: expected more")

    sandbox = Sandbox(window)
    start = partial(window.background.edit, "set weight", refused)
    monkeypatch.setattr(sandbox._trees, "set_parameter", lambda *_, **__: start())
    sandbox.select("0/1")
    for count in (1, 2, 3):
        sandbox.set_control("node", "weight", "-5", index=[])
        finish(window)
        fields = sandbox.values()["fields"]
        assert (fields["refused"], fields["text"]) == ("node weight", "weight: expected more")
        assert fields["resets"]["node weight"] == count
        assert sandbox.values()["fields"] == fields
    assert window.session.labels == ()


def test_the_help_is_a_list_of_the_page(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    for show in (partial(sandbox.perform, "help"), partial(sandbox.show_help, True)):
        show()
        assert sandbox.values()["help"]
        assert not window.overlay.help_visible  # the page's text is larger
        sandbox.show_help(False)
        assert not sandbox.values()["help"]
    sandbox.perform("help")
    sandbox.perform("help")
    assert not sandbox.values()["help"]


def test_wrong_events_say_why_and_change_nothing(window: EditWindow) -> None:
    sandbox, before = Sandbox(window), digest(window.document)
    sandbox.set_control("node", "radius", 0.5)
    assert "no node is selected" in sandbox.status
    fields = sandbox.values()["fields"]
    assert (fields["refused"], fields["resets"]) == ("node radius", {"node radius": 1})  # it shows its value
    for key in ("0/7", "9", "x", "object x", None, 3, "image 7"):
        sandbox.select(key)  # type: ignore[arg-type]
        assert "expected" in sandbox.status
    sandbox.select("0/1")
    for name, raw in (("radius", -1), ("radius", "x"), ("nothing", 1), ("center", 3)):
        sandbox.set_control("node", name, raw)
        finish(window)
        assert sandbox.status
        sandbox.set_control("node", name, raw, index=[5])
        assert "expected" in sandbox.status
    for event, value in ((sandbox.add, "No"), (sandbox.wrap, "Sum"), (sandbox.combine, "Union")):
        event(value)
        finish(window)
        assert "expected" in sandbox.status or "select" in sandbox.status
    sandbox.unwrap()
    assert "one operand" in sandbox.status
    for entry in (-1, 99, "1", True):
        sandbox.go_to(entry)  # type: ignore[arg-type]
        assert "history" in sandbox.status
    sandbox.perform("no such action")
    assert "expected" in sandbox.status
    finish(window)
    assert digest(window.document) == before


def test_random_events_leave_a_scene_that_undo_restores(window: EditWindow) -> None:
    sandbox, before = Sandbox(window), digest(window.document)
    kinds = ["Point", "Torus", "Box", "Twist", "Offset", "Union", "Ricci", "Nothing"]
    actions = [b.action for b in KEYS.bindings if b.action not in ("close", "camera", "move", "add_image")]
    values: Any = st.one_of(st.floats(-3, 3), st.sampled_from(["", "x", None, [1, 2, 3], "#00ff00"]))
    names = ["radius", "center", "degrees", "color"]
    events: Any = st.one_of(
        st.tuples(st.just("select"), st.sampled_from(["", "0", "0/0", "0/1", "0/1/0", "object 0", "q"])),
        st.tuples(st.just("set_control"), st.just("node"), st.sampled_from(names), values),
        st.tuples(st.sampled_from(["add", "wrap", "combine"]), st.sampled_from(kinds)),
        st.tuples(st.just("perform"), st.sampled_from(actions)),
        st.tuples(st.just("go_to"), st.integers(-1, 4)),
        st.tuples(st.just("unwrap")),
    )

    @settings(max_examples=8, suppress_health_check=[HealthCheck.too_slow], derandomize=True)
    @given(st.lists(events, min_size=1, max_size=5))
    def run(chosen: list[Any]) -> None:
        for name, *arguments in chosen:
            getattr(sandbox, name)(*arguments)
            finish(window)
            if window.actions.state.prompt.open:
                window.actions.state.prompt.close()
            json.dumps(sandbox.values(), default=list)
        sandbox.go_to(0)
        finish(window)  # the check of a drag may run still
        assert digest(window.document) == before

    run()


def test_the_outline_lists_objects_nodes_and_images() -> None:
    objects = TreeObject("blob", Twist(TREE, 10.0)), MeshObject("crate", *box((-1, -4, -1), (1, -2, 1)))
    rows = outline(Document.from_scene(Scene(objects=objects, camera=CAMERA)))
    assert [(row["label"], row["kind"], row["depth"]) for row in rows] == [
        ("blob", "object", 0),
        ("Twist", "modifier", 1),
        ("Sum", "combination", 2),
        ("Point", "primitive", 3),
        ("Point", "primitive", 3),
        ("crate", "mesh", 0),
    ]
    assert [row["type"] for row in rows] == ["", "Twist", "Sum", "Point", "Point", ""]
    icons = ("cube-outline", "screw-lag", "plus-circle-outline", "circle", "circle", "vector-triangle")
    assert [row["icon"] for row in rows] == [f"mdi-{icon}" for icon in icons]
    many = TreeObject("many", Union(tuple(Point((3.0 * i, 0, 0), radius=1.0) for i in range(2500))))
    assert len(outline(Document.from_scene(Scene(objects=(many,), camera=CAMERA)))) == 2002


@pytest.mark.parametrize("toward", [(0.0, 0.0, 1.0), (1.0, 0.4, -0.3)])
def test_added_primitives_lie_where_the_view_looks(vtk_display: None, toward: tuple[float, ...]) -> None:
    body = TREE + Segment((0, 0, 0), (3, 0, 0), radius=0.4)
    scene = Scene(objects=(TreeObject("body", body),), camera=CAMERA)
    with EditWindow(scene, off_screen=True, size=(80, 60)) as window:
        window.show()
        sandbox, state = Sandbox(window), window.actions.state
        for kind in ("Point", "Box", "Torus", "Cylinder", "Polyline"):
            state.camera.look(toward, (0, 1, 0))
            before = tree_of(window.document)
            eye, target = (np.asarray(point, np.float64) for point in state.camera.eye_and_target())
            hit = first_hit(window.document.objects, eye, target - eye)
            seen = hit if len(hit.objects) else nearest_points(window.document.objects, target[None])
            size = float((before.bounds[1] - before.bounds[0]).max())
            sandbox.select("0/0")
            sandbox.add(kind)
            finish(window)
            assert state.primitive is not None
            low, high = node_at(tree_of(window.document), state.primitive[1]).bounds
            assert (high - low).max() == pytest.approx(0.1 * size, rel=0.02)
            assert (low - 0.01 * size <= seen.positions[0]).all()
            assert (seen.positions[0] <= high + 0.01 * size).all()


@pytest.mark.slow_cases("Box", "Cylinder", "Torus")
@pytest.mark.parametrize("kind", ["Point", "Box", "Torus", "Cylinder", "Polyline"])
def test_the_ghost_under_the_mouse_is_what_a_press_adds_there(window: EditWindow, kind: str) -> None:
    sandbox, state = Sandbox(window), window.actions.state
    size = float(np.ptp(tree_of(window.document).bounds, axis=0).max())
    places = np.random.default_rng(len(kind)).integers(0, 10_000, (3, 4)).tolist()
    for number, (x, y, *end) in enumerate(places):  # the first one is a click, the others are drags
        edge = "view {}/{}".format(*end) if number else ""
        pixel, end_pixel = np.array([(x, y), end]) / 10_000 * (80, 60)
        ray, end_ray = ray_through(window.subplot, *pixel), ray_through(window.subplot, *end_pixel)
        assert ray is not None
        assert end_ray is not None
        eye, target = window.camera.eye_and_target()
        sandbox.select("0/0")
        for _ in range(2):  # a thread loads the kernels of the first questions, which have no answer then
            pick = window.tools.at(*pixel)
            finish(window)
            sandbox.hover(f"kind {kind} view {x}/{y} {edge}".strip())
            ghost = sandbox.values()["hovered"]["lines"]
            finish(window)
            sandbox.hover("")
            sandbox.values()
        seen: Any = on_plane(target, np.subtract(eye, target), ray) if pick is None else pick.position
        there: Any = on_plane(seen, np.subtract(eye, target), end_ray)
        extent = 2 * np.linalg.norm(there - seen) if edge else 0.1 * size
        sandbox.add_at(kind, f"view {x}/{y}", edge)
        finish(window)
        assert state.primitive is not None
        node = node_at(tree_of(window.document), state.primitive[1])
        low, high = node.bounds
        assert (high - low).max() == pytest.approx(extent, rel=0.02)
        assert (low - 0.1 * extent <= seen).all()
        assert (seen <= high + 0.1 * extent).all()
        lines = (pixels_of(window.subplot, outlines(node).reshape(-1, 3)) + 0.5) / (80, 60) * (1, -1) + (0, 1)
        np.testing.assert_allclose(ghost, lines.reshape(-1, 4), atol=1e-3)
        sandbox.go_to(0)
        finish(window)


def test_all_copies_of_a_repeat_get_the_same_decals(window: EditWindow) -> None:
    sandbox = Sandbox(window)

    def offered() -> bool:
        return "same_on_copies" in [control["name"] for control in sandbox.values()["scattering"]]

    assert not offered()
    sandbox.set_control("scattering", "same_on_copies", True)
    assert "option: expected" in sandbox.status
    sandbox.select("0")
    sandbox.wrap("Repeat")
    finish(window)
    sandbox.set_control("node", "step", 5.0, index=[0])
    finish(window)
    repeat: Any = tree_of(window.document)
    assert offered()
    before = digest(window.document)
    sandbox.set_control("scattering", "count", 10 * repeat.count)
    sandbox.set_control("scattering", "same_on_copies", True)
    for number in (1, 2):  # each time with another seed, and as many
        sandbox.scatter()
        finish(window)
        assert window.session.labels[-number:] == ("scatter",) * number
        first, *others = np.split(window.document.decals.column("positions"), repeat.count)
        assert len(first) == 10
        for copy, positions in enumerate(others, 1):
            np.testing.assert_allclose(positions, first + copy * np.array(repeat.step), atol=1e-5)
    for _ in range(2):
        sandbox.perform("undo")
    finish(window)
    assert digest(window.document) == before
    sandbox.select("")
    sandbox.add("Torus")
    finish(window)
    sandbox.select("1")
    sandbox.scatter()
    finish(window)
    assert "expected one object whose root is a Repeat" in sandbox.status
    sandbox.set_control("scattering", "same_on_copies", False)
    sandbox.scatter()
    finish(window)
    assert window.session.labels[-1] == "scatter"


def test_the_queue_lists_work_and_each_entry_can_be_removed(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.set_control("scattering", "count", 60)
    sandbox.scatter()
    sandbox.add("Torus")
    sandbox.add("Box")
    queue = sandbox.values()["queue"]
    assert [(work["label"], work["running"]) for work in queue] == [
        ("scatter", True),
        ("add torus 1", False),
        ("add box 1", False),
    ]
    sandbox.drop_work(queue[1]["number"])
    sandbox.drop_work(queue[0]["number"])
    odd: list[Any] = [queue[0]["number"], None, "x"]
    for number in odd:
        sandbox.drop_work(number)
        assert "it has ended" in sandbox.status
    finish(window)
    assert window.session.labels == ("add box 1",)
    assert sandbox.values()["queue"] == []


def test_escape_deselects_rows_before_it_cancels_work(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.mark("layer 0")
    sandbox.select("image 0")
    sandbox.scatter()
    sandbox.perform("deselect")
    assert (sandbox.values()["selected"], sandbox.values()["marked"]) == ("", [])
    assert window.background.busy_editing
    sandbox.perform("deselect")
    assert not window.background.busy_editing
    finish(window)
    assert window.session.labels == ()


def test_a_refused_value_marks_its_field_and_says_the_range(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    for raw, reason in (
        (-5, "count: expected a whole number from 0 to"),
        ("12.5", "count: expected a whole number, got '12.5'"),
        ("abc", "count: expected a finite number"),
    ):
        sandbox.set_control("scattering", "count", raw)
        fields = sandbox.values()["fields"]
        assert (fields["refused"], fields["control"]) == ("scattering count",) * 2
        assert reason in fields["text"]
    assert fields["resets"] == {"scattering count": 3}
    sandbox.set_control("scattering", "count", "1.2e1")
    assert sandbox.values()["fields"]["refused"] == ""
    sandbox.set_control("scattering", "count", "abc")
    for name, raw in (("factor", -1), ("regularity", 2), ("seed", -1)):
        sandbox.set_control("scattering", name, raw)
        assert sandbox.values()["fields"]["refused"] == f"scattering {name}"
    sandbox.set_control("scattering", "seed", 7)
    fields = sandbox.values()["fields"]
    assert (fields["refused"], fields["text"]) == ("", "")
    sandbox.select("0/1")
    sandbox.set_control("node", "center", "x", index=[1])
    assert sandbox.values()["fields"]["refused"] == "node center 1"
    assert window.session.labels == ()


def test_a_field_shows_its_value_again_if_what_was_typed_is_undone(window: EditWindow) -> None:
    sandbox = Sandbox(window)
    sandbox.select("0/1")
    sandbox.values()
    sandbox.set_control("node", "radius", "0.7")
    sandbox.perform("undo")
    finish(window)
    assert sandbox.values()["fields"]["resets"] == {"node radius": 1}
