"""Synthetic hands: what each gesture does, without a window."""

import numpy as np
import pytest

from decals.edit import EditSession
from decals.edit.actions import LARGER, Actions
from decals.edit.population import lying_on
from decals.edit.tools import Tools
from decals.edit.trees import primitive_at
from decals.model import Interaction
from tests.edit.scenes import digest, scene

SIZE = 400, 300


class Hands:
    """Tools before the scene's camera, and places in its picture."""

    def __init__(self):
        self.session = EditSession(scene())
        self.document = self.session.document
        self.actions = Actions(self.session)
        self.rays = self.document.camera.rays(*SIZE)
        self.tools = Tools(self.actions, self.ray)
        self.first = digest(self.document)

    def ray(self, x, y):
        inside = 0 <= x < SIZE[0] and 0 <= y < SIZE[1]
        return (self.rays.origin, self.rays.directions(x, y)) if inside else None

    def pixel(self, point):
        """Where a point is in the picture."""
        matrix = self.document.camera.clip_matrix(SIZE, self.document.objects[0].bounds)
        clip = matrix @ np.append(point, 1.0)
        return tuple((clip[:2] / clip[3] + 1) / 2 * SIZE)

    def visible(self):
        """Numbers of decals that show at their own centre, nearest to the eye first."""
        decals = self.document.decals
        eye = np.array(self.document.camera.position)
        near = np.argsort(np.linalg.norm(decals.decals.positions - eye, axis=1))
        places = [(int(n), self.pixel(decals[int(n)].positions[0])) for n in decals.numbers[near]]
        return [(n, at) for n, at in places if (found := self.tools.at(*at)) and found.owner == n]

    def click(self, at, **modifiers):
        used = self.tools.press(*at, **modifiers)
        return self.tools.release(*at, **modifiers) or used

    def drag(self, *places):
        used = [self.tools.press(*places[0])]
        used += [self.tools.move(*place) for place in places[1:]]
        return [*used, self.tools.release(*places[-1])]

    def key(self, name, at=(1, 1), **modifiers):
        return self.tools.key(name, *at, **modifiers)


@pytest.fixture
def hands():
    return Hands()


def test_clicks_select_and_leave_the_camera_its_events(hands):
    (first, at), (second, there) = hands.visible()[:2]
    assert not hands.click(at)
    assert hands.actions.selection == (first,)
    hands.click(there, shift=True)
    assert hands.actions.selection == (first, second)
    hands.click(at, shift=True)
    assert hands.actions.selection == (second,)
    hands.click((1, 1))
    assert hands.actions.selection == ()
    assert hands.key("a", ctrl=True)
    assert len(hands.actions.selection) == 60
    hands.key("Escape")
    assert hands.actions.selection == ()
    assert digest(hands.document) == hands.first


def test_dragging_what_is_not_selected_is_the_cameras(hands):
    (_, at), *_ = hands.visible()
    assert not any(hands.drag(at, (at[0] + 40, at[1])))
    assert hands.actions.selection == ()
    assert digest(hands.document) == hands.first


def test_a_selected_decal_follows_the_pointer_and_neighbours_are_left(hands):
    (number, at), *_ = hands.visible()
    hands.click(at)
    before = hands.document.decals.decals
    goals = [(at[0] + step, at[1] + 5) for step in (2, 10, 20, 30)]
    assert all(hands.drag(at, *goals))
    x, y = hands.pixel(hands.document.decals[number].positions[0])
    assert np.hypot(x - goals[-1][0], y - goals[-1][1]) < 3
    others = hands.document.decals.numbers != number
    after = hands.document.decals.decals
    np.testing.assert_array_equal(after.positions[others], before.positions[others])
    assert hands.session.labels == ("move",)
    hands.key("z", ctrl=True)
    assert digest(hands.document) == hands.first
    assert hands.actions.message == "undid: move"


def test_actions_in_the_middle_of_a_drag_are_entries_between_its_parts(hands):
    (_, at), *_ = hands.visible()
    hands.click(at)
    hands.tools.press(*at)
    step = iter(range(6, 60, 2))

    def move(times=3):
        for _ in range(times):
            assert hands.tools.move(at[0] + next(step), at[1])

    move()
    hands.tools.wheel(True, *at, ctrl=True)
    move()
    assert hands.key("z", ctrl=True)  # the second part alone
    move()
    hands.tools.release(*at)
    assert hands.session.labels == ("move", "larger", "move")
    while hands.session.undo():
        pass
    assert digest(hands.document) == hands.first


def test_what_is_deleted_in_the_middle_of_a_drag_is_not_held_any_more(hands):
    (_, at), *_ = hands.visible()
    hands.click(at)
    hands.tools.press(*at)
    hands.tools.move(at[0] + 8, at[1])
    hands.key("Delete")
    assert not hands.tools.dragging
    assert not hands.tools.move(at[0] + 12, at[1])
    hands.tools.release(at[0] + 12, at[1])
    assert hands.actions.message == "delete"
    assert hands.session.labels == ("move", "delete")


def test_a_drag_leads_from_one_object_to_another(hands):
    number, at = next((n, at) for n, at in hands.visible() if n in lying_on(hands.document, [0]))
    goal = next(at for n, at in hands.visible() if n in lying_on(hands.document, [1]))
    hands.click(at)
    hands.drag(at, ((at[0] + goal[0]) / 2, (at[1] + goal[1]) / 2), goal)
    assert number in lying_on(hands.document, [1])
    decal = hands.document.decals[number]
    positions, _ = hands.document.objects[1].surface.project(decal.positions)
    np.testing.assert_allclose(decal.positions, positions, atol=1e-5)
    height = float(decal.normals[0] @ (decal.positions[0] - (-2.5, 0, 0)))
    assert height == pytest.approx(1.0, abs=1e-5)  # the normal of a face of the box that it lies on


def test_off_the_surfaces_a_dragged_decal_stays_at_the_last_place(hands):
    (_, at), *_ = hands.visible()
    hands.click(at)
    hands.tools.press(*at)
    hands.tools.move(at[0] + 10, at[1])
    before = digest(hands.document)
    hands.tools.move(1, 1)
    hands.tools.move(-5000, 0)
    assert digest(hands.document) == before


def test_escape_takes_a_drag_back(hands):
    (number, at), *_ = hands.visible()
    hands.click(at)
    hands.tools.press(*at)
    assert hands.tools.move(at[0] + 20, at[1])
    assert hands.tools.dragging
    assert digest(hands.document) != hands.first
    hands.key("Escape")
    assert digest(hands.document) == hands.first
    assert not hands.tools.dragging
    hands.tools.release(at[0] + 20, at[1])
    assert hands.session.labels == ()
    assert number in hands.document.decals.numbers


def test_ctrl_click_places_a_decal_like_the_selected_one(hands):
    (_, at), (_, there) = hands.visible()[:2]
    assert hands.click(at, ctrl=True)
    assert hands.actions.selection == (60,)
    x, y = hands.pixel(hands.document.decals[60].positions[0])
    assert np.hypot(x - at[0], y - at[1]) < 0.5
    hands.key("i")
    hands.key("plus")
    assert hands.tools.key("a", *there)
    model, new = hands.document.decals[60], hands.document.decals[61]
    assert (new.images, new.radii) == (model.images, model.radii)
    hands.click((1, 1), ctrl=True)
    assert hands.actions.message == "point at a surface"
    assert len(hands.document.decals) == 62


def test_turning_the_wheel_is_one_entry_for_each_selection(hands):
    (first, at), (_, there) = hands.visible()[:2]
    assert not hands.tools.wheel(True, *at)
    hands.click(at)
    radius = hands.document.decals[first].radii[0]
    for _ in range(5):
        assert hands.tools.wheel(True, *at, ctrl=True)
    assert hands.document.decals[first].radii[0] == pytest.approx(radius * LARGER**5, rel=1e-5)
    hands.tools.wheel(False, *at, shift=True)
    hands.click(there)
    hands.tools.wheel(False, *at, shift=True)
    hands.tools.wheel(False, *at, shift=True)
    for expected in ("turn", "turn", "larger"):
        hands.key("z", ctrl=True)
        assert expected in hands.actions.message
    assert digest(hands.document) == hands.first
    hands.key("Z", ctrl=True, shift=True)
    assert hands.document.decals[first].radii[0] == pytest.approx(radius * LARGER**5, rel=1e-5)


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
        (["minus"], "radii", lambda v: v / np.float32(LARGER)),
    ],
)
def test_keys_change_what_is_selected(hands, keys, column, expected):
    hands.actions.selection = (3, 5)
    before = getattr(hands.document.decals.take([3, 5]), column)
    for key in keys:
        assert hands.key(key, shift=key.isupper())
    after = getattr(hands.document.decals.take([3, 5]), column)
    np.testing.assert_allclose(after, expected(before), rtol=1e-6)
    hands.actions.settle()
    for _ in hands.session.labels:
        hands.key("z", ctrl=True)
    assert digest(hands.document) == hands.first


def test_layers_and_interactions_are_said_by_name(hands):
    hands.actions.selection = (3,)
    for key, said in (("Prior", "layer 1"), ("Next", "layer 0"), ("Next", "layer -1")):
        hands.key(key)
        assert hands.actions.message == said
    names = []
    for _ in range(3):
        hands.key("k")
        names.append(hands.actions.message)
        assert names[-1].endswith(Interaction(hands.document.decals[3].interactions[0]).name.lower())
    assert sorted(names) == ["interaction: contact", "interaction: independent", "interaction: overlap"]


def test_tints_go_round(hands):
    hands.actions.selection = (3,)
    seen = []
    for _ in range(5):
        hands.key("t")
        seen.append(tuple(hands.document.decals[3].tints[0].tolist()))
    assert len(set(seen)) == 5
    assert seen[-1] == (1, 1, 1)


def test_duplicates_are_selected_and_deleted_ones_forgotten(hands):
    hands.actions.selection = (3, 5)
    hands.key("d")
    assert hands.actions.selection == (60, 61)
    hands.key("Delete")
    assert hands.actions.selection == ()
    hands.actions.selection = (3, 5)
    hands.key("BackSpace")
    assert hands.actions.selection == ()
    assert not {3, 5} & set(hands.document.decals.numbers.tolist())
    hands.key("d")
    assert "select a decal first" in hands.actions.message


def test_scattering_and_relaxing_where_the_cursor_is(hands):
    number, at = next((n, at) for n, at in hands.visible() if n in lying_on(hands.document, [0]))
    count = len(lying_on(hands.document, [0]))
    hands.tools.key("g", *at)
    assert len(lying_on(hands.document, [0])) == count
    assert number not in hands.document.decals.numbers
    hands.tools.key("x", *at)
    assert hands.actions.message == "relax"
    hands.key("x")
    assert hands.actions.message == "point at a surface"


def test_primitives_under_the_cursor(hands):
    at = hands.pixel(hands.document.objects[0].surface.project([[0, 0, 2]])[0][0])
    tree = hands.document.objects[0].tree
    hands.tools.key("m", *at)
    number, path = hands.actions.grip
    assert number == 0
    assert hands.actions.grip_center == pytest.approx([0, 0, 1], abs=0.03)  # on the surface, under the cursor
    assert "drag the blue ball" in hands.actions.message
    hands.actions.begin_grip()
    for step in (0.1, 0.2, 0.3):
        hands.actions.move_grip((0, step, 0))
    hands.actions.settle()
    moved = primitive_at(hands.document.objects[0].tree, path)
    assert moved.center == pytest.approx((0, 0.3, 0))
    assert hands.actions.grip_center == pytest.approx([0, 0.3, 1], abs=0.03)
    assert hands.session.labels == ("move a primitive",)
    hands.tools.key("bracketright", *at)
    hands.tools.key("bracketright", *at)
    hands.tools.key("c", *at)
    assert len(hands.session.labels) == 3
    for _ in range(3):
        hands.key("z", ctrl=True)
    assert hands.document.objects[0].tree is tree
    assert digest(hands.document) == hands.first


def test_saving_says_where(hands, tmp_path):
    hands.key("s", ctrl=True)
    assert "nowhere to save" in hands.actions.message
    hands.actions.path = tmp_path / "scene.json"
    hands.key("s", ctrl=True)
    assert hands.actions.path.exists()
    assert not hands.session.modified


def test_what_means_nothing_here_is_left_to_others(hands):
    for name in ("w", "F5", "q", "r"):
        assert not hands.key(name)
    assert not hands.tools.move(5, 5)
    assert not hands.tools.release(5, 5)
    assert hands.key("h")
    assert hands.actions.help
