"""Synthetic user: what each gesture does, without a window."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blobtree import Node, Point
from blobtree.nodes.paths import primitive_at
from blobtree.nodes.surgery import dominant_primitive
from decals import Interaction
from decals.editing import Actions, DeleteDecals, EditSession, PointerTools
from decals.editing.brush_settings import Brush
from decals.editing.decal_actions import SCALE_STEP
from decals.editing.queries import inside_polygon
from decals.editing.scatter_commands import decals_on
from tests.decals.editing.scenes import digest, scene, tree_of

SIZE = 400, 300


class UserInput:
    """Tools before the scene's camera, and places in its picture."""

    def __init__(self) -> None:
        self.session = EditSession(scene())
        self.document = self.session.document
        self.actions = Actions(self.session)
        self.rays = self.document.camera.rays(*SIZE)
        self.tools = PointerTools(
            self.actions,
            self.ray,
            pixels=lambda points: np.array([self.pixel(point) for point in points]).reshape(-1, 2),
        )
        self.first = digest(self.document)

    def ray(self, x: Any, y: Any) -> Any:
        inside = 0 <= x < SIZE[0] and 0 <= y < SIZE[1]
        return (self.rays.origin, self.rays.directions(x, y)) if inside else None

    def pixel(self, point: Any) -> Any:
        """Where a point is in the picture."""
        matrix = self.document.camera.clip_matrix(SIZE, self.document.objects[0].bounds)
        clip = matrix @ np.append(point, 1.0)
        return tuple((clip[:2] / clip[3] + 1) / 2 * SIZE)

    def visible(self) -> Any:
        """Numbers of decals that show at their own centre, nearest to the eye first."""
        decals = self.document.decals
        eye = np.array(self.document.camera.position)
        near = np.argsort(np.linalg.norm(decals.decals.positions - eye, axis=1))
        places = [(int(n), self.pixel(decals[int(n)].positions[0])) for n in decals.numbers[near]]
        return [(n, at) for n, at in places if (found := self.tools.at(*at)) and found.owner == n]

    @property
    def tree(self) -> Node:
        """Tree of the first object."""
        return tree_of(self.document)

    @property
    def held(self) -> tuple[int, tuple[int, ...]]:
        """Object and path of the held primitive."""
        held = self.actions.state.primitive
        assert held is not None
        return held

    def click(self, at: Any, **modifiers: Any) -> Any:
        used = self.tools.press(*at, **modifiers)
        return self.tools.release(*at, **modifiers) or used

    def drag(self, *places: Any) -> Any:
        used = [self.tools.press(*places[0])]
        used += [self.tools.move(*place) for place in places[1:]]
        return [*used, self.tools.release(*places[-1])]

    def key(self, name: str, at: Any = (1, 1), **modifiers: Any) -> Any:
        return self.tools.key(name, *at, **modifiers)

    def type(self, text: str) -> None:
        for letter in text:
            self.tools.key("unnamed", 1, 1, text=letter)


@pytest.fixture
def user() -> Any:
    return UserInput()


def test_clicks_select_and_leave_the_camera_its_events(user: UserInput) -> None:
    (first, at), (second, there) = user.visible()[:2]
    assert not user.click(at)
    assert list(user.actions.state.selection) == [first]
    user.click(there, shift=True)
    assert list(user.actions.state.selection) == [first, second]
    user.click(at, shift=True)
    assert list(user.actions.state.selection) == [second, first]
    user.click(there, ctrl=True)
    assert list(user.actions.state.selection) == [first]
    user.click((1, 1))
    assert list(user.actions.state.selection) == []
    assert user.key("a", ctrl=True)
    assert len(user.actions.state.selection) == 60
    user.key("Escape")
    assert list(user.actions.state.selection) == []
    assert digest(user.document) == user.first


def test_dragging_what_is_not_selected_is_the_cameras(user: UserInput) -> None:
    (_, at), *_ = user.visible()
    assert not any(user.drag(at, (at[0] + 40, at[1])))
    assert user.actions.state.selection == ()
    assert digest(user.document) == user.first


def test_a_selected_decal_follows_the_pointer_and_neighbours_are_left(user: UserInput) -> None:
    (number, at), *_ = user.visible()
    user.click(at)
    before = user.document.decals.decals
    goals = [(at[0] + step, at[1] + 5) for step in (2, 10, 20, 30)]
    assert all(user.drag(at, *goals))
    x, y = user.pixel(user.document.decals[number].positions[0])
    assert np.hypot(x - goals[-1][0], y - goals[-1][1]) < 3
    others = user.document.decals.numbers != number
    after = user.document.decals.decals
    np.testing.assert_array_equal(after.positions[others], before.positions[others])
    assert user.session.labels == ("move",)
    user.key("z", ctrl=True)
    assert digest(user.document) == user.first
    assert user.actions.state.message == "undid: move"


def test_actions_in_the_middle_of_a_drag_are_entries_between_its_parts(user: UserInput) -> None:
    (_, at), *_ = user.visible()
    user.click(at)
    user.tools.press(*at)
    step = iter(range(6, 60, 2))

    def move(times: Any = 3) -> None:
        for _ in range(times):
            assert user.tools.move(at[0] + next(step), at[1])

    move()
    user.tools.wheel(True, *at, ctrl=True)
    move()
    assert user.key("z", ctrl=True)  # the second part alone
    move()
    user.tools.release(*at)
    assert user.session.labels == ("move", "larger", "move")
    while user.session.undo():
        pass
    assert digest(user.document) == user.first


def test_what_is_deleted_in_the_middle_of_a_drag_is_not_held_any_more(user: UserInput) -> None:
    (_, at), *_ = user.visible()
    user.click(at)
    user.tools.press(*at)
    user.tools.move(at[0] + 8, at[1])
    user.key("Delete")
    assert not user.tools.dragging
    assert not user.tools.move(at[0] + 12, at[1])
    user.tools.release(at[0] + 12, at[1])
    assert user.actions.state.message == "delete"
    assert user.session.labels == ("move", "delete")


def test_a_drag_leads_from_one_object_to_another(user: UserInput) -> None:
    number, at = next((n, at) for n, at in user.visible() if n in decals_on(user.document, [0]))
    goal = next(at for n, at in user.visible() if n in decals_on(user.document, [1]))
    user.click(at)
    user.drag(at, ((at[0] + goal[0]) / 2, (at[1] + goal[1]) / 2), goal)
    assert number in decals_on(user.document, [1])
    decal = user.document.decals[number]
    positions, _ = user.document.objects[1].surface.project(decal.positions)
    np.testing.assert_allclose(decal.positions, positions, atol=1e-5)
    height = float(decal.normals[0] @ (decal.positions[0] - (-2.5, 0, 0)))
    assert height == pytest.approx(1.0, abs=1e-5)  # the normal of a face of the box that it lies on


def test_off_the_surfaces_a_dragged_decal_stays_at_the_last_place(user: UserInput) -> None:
    (_, at), *_ = user.visible()
    user.click(at)
    user.tools.press(*at)
    user.tools.move(at[0] + 10, at[1])
    before = digest(user.document)
    user.tools.move(1, 1)
    user.tools.move(-5000, 0)
    assert digest(user.document) == before


def test_escape_takes_a_drag_back(user: UserInput) -> None:
    (number, at), *_ = user.visible()
    user.click(at)
    user.tools.press(*at)
    assert user.tools.move(at[0] + 20, at[1])
    assert user.tools.dragging
    assert digest(user.document) != user.first
    user.key("Escape")
    assert digest(user.document) == user.first
    assert not user.tools.dragging
    user.tools.release(at[0] + 20, at[1])
    assert user.session.labels == ()
    assert number in user.document.decals.numbers


def test_clicks_at_one_place_select_the_decal_the_primitive_and_the_nodes_above(user: UserInput) -> None:
    (decal, at), (other, there) = user.visible()[:2]
    leaf = dominant_primitive(user.tree, user.tools.at(*at).position)  # type: ignore[union-attr]
    seen = []
    for _ in range(len(leaf) + 3):
        user.click(at)
        seen.append((user.actions.state.selection, user.actions.state.primitive))
    nodes = [((), (0, leaf[:count])) for count in range(len(leaf), -1, -1)]
    assert len(nodes) == 3  # a primitive in the sum in the difference
    assert seen == [((decal,), None), *nodes, ((decal,), None)]
    user.click(at)
    user.click(there)
    assert (user.actions.state.selection, user.actions.state.primitive) == ((other,), None)
    assert digest(user.document) == user.first


@pytest.mark.parametrize("seed", range(3))
def test_a_click_on_bare_surface_selects_the_primitive_there(user: UserInput, seed: int) -> None:
    user.session.do(DeleteDecals(user.document.decals.numbers))
    rng, selected = np.random.default_rng(seed), set()
    for _ in range(20):
        at = tuple(rng.uniform((120, 60), (280, 240)).tolist())
        pick = user.tools.at(*at)
        user.click(at)
        expected = None
        if pick is not None and pick.object == 0:
            expected = 0, dominant_primitive(user.tree, pick.position)
        assert user.actions.state.primitive == expected
        selected.add(expected)
    assert len(selected) > 1
    user.click((1, 1))
    assert user.actions.state.primitive is None


def test_shift_adds_nodes_and_ctrl_toggles_them(user: UserInput) -> None:
    state: Any = user.actions.state
    places = {}
    user.session.do(DeleteDecals(user.document.decals.numbers))
    for x, y in np.random.default_rng(0).uniform((120, 60), (280, 240), (40, 2)).tolist():
        pick = user.tools.at(x, y)
        if pick is not None and pick.object == 0:
            places[0, dominant_primitive(user.tree, pick.position)] = x, y
    first, second = (0, (1,)), (0, (0, 1))  # the ball that cuts, and the limb
    at, there = places[first], places[second]
    user.click(at, shift=True)
    user.click(there, shift=True)
    assert state.nodes == (first, second)
    user.click(at, shift=True)
    assert (state.nodes, state.primitive) == ((second, first), first)
    user.click((1, 1), shift=True)  # beside the model
    assert state.nodes == (second, first)
    user.click(there, ctrl=True)
    assert state.nodes == (first,)
    user.click(at, ctrl=True)
    assert state.nodes == ()
    user.click(at)
    user.click(there, ctrl=True)
    assert state.nodes == (first, second)
    user.key("Delete")
    assert isinstance(user.tree, Point)
    assert (state.nodes, user.session.labels[-1]) == ((), "remove a primitive")
    user.session.undo()
    user.session.undo()
    assert digest(user.document) == user.first


def test_decals_and_nodes_are_not_selected_together(user: UserInput) -> None:
    state: Any = user.actions.state
    (decal, at), (other, there) = user.visible()[:2]
    user.click(at)
    user.click(there, shift=True)
    assert (state.selection, state.nodes) == ((decal, other), ())
    user.click(at)
    user.click(at)
    assert len(state.nodes) == 1
    node = state.primitive
    user.click(there, ctrl=True)  # a decal is there, but nodes are selected
    assert state.selection == ()
    assert state.nodes in ((), (node, state.primitive))


def test_a_click_on_a_mesh_selects_its_decals_alone(user: UserInput) -> None:
    on_mesh = set(decals_on(user.document, [1]))
    decal, at = next((n, at) for n, at in user.visible() if n in on_mesh)
    for _ in range(3):
        user.click(at)
        assert (user.actions.state.selection, user.actions.state.primitive) == ((decal,), None)


def test_the_add_tool_adds_a_decal_like_the_selected_one(user: UserInput) -> None:
    (_, at), (_, there) = user.visible()[:2]
    user.key("s", shift=True)
    assert user.actions.state.brush.brush is Brush.ADD
    assert not user.click(at)
    assert user.actions.state.selection == (60,)
    x, y = user.pixel(user.document.decals[60].positions[0])
    assert np.hypot(x - at[0], y - at[1]) < 0.5
    user.key("i")
    user.key("plus")
    assert user.tools.key("a", *there)
    model, new = user.document.decals[60], user.document.decals[61]
    assert (new.images, new.radii) == (model.images, model.radii)
    user.click((1, 1))
    assert user.actions.state.message == "no surface under the cursor; point at one"
    user.drag(there, (there[0] + 40, there[1]))
    assert len(user.document.decals) == 62
    user.key("Escape")
    user.click(there)
    assert len(user.document.decals) == 62


@pytest.mark.parametrize(
    ("change", "reason"), [("lock", "is locked; unlock it"), ("hide", "is hidden; show it")]
)
def test_the_add_tool_adds_no_decal_to_a_locked_or_hidden_layer(
    user: UserInput, change: str, reason: str
) -> None:
    (_, at), *_ = user.visible()
    user.key("s", shift=True)
    user.actions.outline.change("layer 0", change)
    count = len(user.document.decals)
    assert not user.click(at)
    assert user.actions.state.message.startswith(f"layer 0 {reason}")
    assert len(user.document.decals) == count
    user.actions.outline.change("layer 0", change)
    user.click(at)
    assert user.actions.state.selection == (60,)


def test_turning_the_wheel_is_one_entry_for_each_selection(user: UserInput) -> None:
    (first, at), (_, there) = user.visible()[:2]
    assert not user.tools.wheel(True, *at)
    user.click(at)
    radius = user.document.decals[first].radii[0]
    for _ in range(5):
        assert user.tools.wheel(True, *at, ctrl=True)
    assert user.document.decals[first].radii[0] == pytest.approx(radius * SCALE_STEP**5, rel=1e-5)
    user.tools.wheel(False, *at, shift=True)
    user.click(there)
    user.tools.wheel(False, *at, shift=True)
    user.tools.wheel(False, *at, shift=True)
    for expected in ("turn", "turn", "larger"):
        user.key("z", ctrl=True)
        assert expected in user.actions.state.message
    assert digest(user.document) == user.first
    user.key("Z", ctrl=True, shift=True)
    assert user.document.decals[first].radii[0] == pytest.approx(radius * SCALE_STEP**5, rel=1e-5)


@pytest.mark.parametrize(
    ("keys", "column", "expected"),
    [
        (["i"], "images", lambda v: (v + 2) % 3 - 1),
        (["i", "i", "i"], "images", lambda v: v),
        (["i", "I"], "images", lambda v: v),
        (["Prior", "Prior"], "layers", lambda v: v + 2),
        (["Next"], "layers", lambda v: v - 1),
        (["k"], "interactions", lambda v: (v + 1) % 3),
        (["o"], "opacities", lambda v: v * np.float32(0.8)),
        (["O"], "opacities", lambda v: v),
        (["minus"], "radii", lambda v: v / np.float32(SCALE_STEP)),
    ],
)
def test_keys_change_what_is_selected(user: Any, keys: Any, column: Any, expected: Any) -> None:
    user.actions.state.selection = (3, 5)
    before = getattr(user.document.decals.take([3, 5]), column)
    for key in keys:
        assert user.key(key, shift=key.isupper())
    after = getattr(user.document.decals.take([3, 5]), column)
    np.testing.assert_allclose(after, expected(before), rtol=1e-6)
    user.actions.state.end_stroke()
    for _ in user.session.labels:
        user.key("z", ctrl=True)
    assert digest(user.document) == user.first


def test_layers_and_interactions_are_said_by_name(user: UserInput) -> None:
    user.actions.state.selection = (3,)
    for key, said in (("Prior", "layer 1"), ("Next", "layer 0"), ("Next", "layer -1")):
        user.key(key)
        assert user.actions.state.message == said
    names = []
    for _ in range(3):
        user.key("k")
        names.append(user.actions.state.message)
        assert names[-1].endswith(Interaction(user.document.decals[3].interactions[0]).name.lower())
    assert sorted(names) == ["interaction: independent", "interaction: overlap", "interaction: push"]


def test_tints_go_round(user: UserInput) -> None:
    user.actions.state.selection = (3,)
    seen = []
    for _ in range(5):
        user.key("t")
        seen.append(tuple(user.document.decals[3].tints[0].tolist()))
    assert len(set(seen)) == 5
    assert seen[-1] == (1, 1, 1)


def test_duplicates_are_selected_and_deleted_ones_forgotten(user: UserInput) -> None:
    user.actions.state.selection = (3, 5)
    user.key("d")
    assert list(user.actions.state.selection) == [60, 61]
    user.key("Delete")
    assert list(user.actions.state.selection) == []
    user.actions.state.selection = (3, 5)
    user.key("BackSpace")
    assert list(user.actions.state.selection) == []
    assert not {3, 5} & set(user.document.decals.numbers.tolist())
    user.key("d")
    assert "no decal is selected" in user.actions.state.message


def test_scattering_and_relaxing_where_the_cursor_is(user: UserInput) -> None:
    number, at = next((n, at) for n, at in user.visible() if n in decals_on(user.document, [0]))
    count = len(decals_on(user.document, [0]))
    user.tools.key("g", *at)
    assert len(decals_on(user.document, [0])) == count
    assert number not in user.document.decals.numbers
    user.tools.key("x", *at)
    assert user.actions.state.message == "relax"
    user.key("x")
    assert user.actions.state.message == "no surface under the cursor; point at one"


def test_m_on_another_primitive_selects_that_one(user: UserInput) -> None:
    surface = user.document.objects[0].surface
    places = [user.pixel(surface.project([target])[0][0]) for target in ([0, 0, 2], [1.3, 1.2, 2])]
    first, second = places
    user.tools.key("m", *first)
    one = user.actions.state.primitive
    user.tools.key("m", *second)
    other = user.actions.state.primitive
    assert None not in (one, other)
    assert one != other
    assert "drag its handle" in user.actions.state.message
    user.tools.key("m", *second)
    assert user.actions.state.primitive is None
    user.tools.key("m", *second)
    assert user.actions.state.primitive == other
    user.tools.key("m", 0, 0)
    assert user.actions.state.primitive is None
    assert user.actions.state.message == "primitive deselected"


def test_primitives_under_the_cursor(user: UserInput) -> None:
    at = user.pixel(user.document.objects[0].surface.project([[0, 0, 2]])[0][0])
    tree = user.tree
    user.tools.key("m", *at)
    number, path = user.held
    assert number == 0
    assert user.actions.trees.handle_position == pytest.approx(
        [0, 0, 1], abs=0.03
    )  # on the surface, under the cursor
    assert "drag its handle" in user.actions.state.message
    user.actions.trees.begin_drag()
    for step in (0.1, 0.2, 0.3):
        user.actions.trees.drag((0, step, 0))
    user.actions.state.end_stroke()
    moved = primitive_at(user.tree, path)
    assert isinstance(moved, Point)
    assert moved.center == pytest.approx((0, 0.3, 0))
    assert user.actions.trees.handle_position == pytest.approx([0, 0.3, 1], abs=0.03)
    assert user.session.labels == ("move a primitive",)
    user.tools.key("bracketright", *at)
    user.tools.key("bracketright", *at)
    user.tools.key("c", *at)
    assert len(user.session.labels) == 3
    for _ in range(3):
        user.key("z", ctrl=True)
    assert user.document.objects[0].tree is tree
    assert digest(user.document) == user.first


def test_a_scene_without_a_file_asks_for_its_name(user: UserInput, tmp_path: Path) -> None:
    user.key("s", ctrl=True)
    assert "save as: untitled.json" in user.actions.state.prompt.text
    user.key("Delete")
    user.type(str(tmp_path / "scene.json"))
    user.key("Return")
    assert user.actions.files.path == tmp_path / "scene.json"
    assert "saved to" in user.actions.state.message
    assert (tmp_path / "scene.json").exists()
    assert not user.session.modified


def test_what_means_nothing_here_is_left_to_others(user: UserInput) -> None:
    for name in ("F5", "F6", "r"):
        assert not user.key(name)
    assert not user.tools.move(5, 5)
    assert not user.tools.release(5, 5)
    assert user.key("h")
    assert user.actions.help_visible


@pytest.mark.parametrize("brush", [Brush.BOX, Brush.LASSO])
def test_boxes_and_lassos_select_what_is_seen_in_them(brush: Brush) -> None:
    user = UserInput()
    user.actions.state.brush.brush = brush
    width, height = SIZE
    corners = [(0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1)]
    assert user.tools.press(*corners[0])
    for corner in corners[2:3] if brush is Brush.BOX else corners[1:]:
        assert user.tools.move(*corner)
    assert len(user.tools.selection_line) == 4
    assert user.tools.release(*corners[-1])
    selected = user.actions.state.selection
    for number, at in user.visible():
        met, center = user.tools.at(*at), user.document.decals[number].positions[0]
        if met is not None and np.linalg.norm(met.position - center) < 0.01:  # its very centre is seen
            assert number in selected
    assert 0 < len(selected) < len(user.document.decals)
    for number in selected:  # its centre is the first point along its ray
        met = user.tools.at(*user.pixel(user.document.decals[number].positions[0]))
        if met is None:  # at the silhouette, the ray may just miss
            continue
        gap = np.linalg.norm(met.position - user.document.decals[number].positions[0])
        assert gap < user.document.decals[number].radii[0]
    number, (x, y) = user.visible()[0]
    user.tools.press(x - 3, y - 3)
    user.tools.move(x + 3, y + 3)
    user.tools.move(x - 3, y + 3)
    user.tools.release(x - 3, y + 3)
    assert user.actions.state.selection in ((number,), ())
    assert digest(user.document) == user.first
    user.actions.state.brush.brush = Brush.SELECT


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=3, max_size=8))
@settings(max_examples=40)
def test_points_in_polygons_by_crossings(corners: list[tuple[int, int]]) -> None:
    points = np.random.default_rng(len(corners)).uniform(-1, 10, (20, 2))
    inside = inside_polygon(points, corners)
    for (x, y), found in zip(points, inside, strict=True):
        crossings = 0
        for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1], strict=True):
            if (y0 > y) != (y1 > y):
                crossings += x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
        assert found == (crossings % 2 == 1)
