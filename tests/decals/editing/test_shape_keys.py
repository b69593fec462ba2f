"""Keys for shapes: primitives and objects more and less, under the cursor or held, and all of it undone."""

from typing import Any

import numpy as np
import pytest

from blobtree import ISO, Point, Segment
from blobtree.nodes.paths import node_in_world, primitive_at, primitive_paths
from blobtree.nodes.surgery import Join, join_of
from decals.editing import Actions, RemoveObject
from decals.editing.scatter_commands import decals_on
from tests.blobtree.custom_kinds import Bar
from tests.decals.editing.scenes import CARVED, digest, tree_of
from tests.decals.editing.test_pointer_tools import UserInput
from tests.decals.editing.test_primitive_commands import session_of

OFF = (1, 1)
"""A place in the picture where there is nothing."""


@pytest.fixture
def user() -> Any:
    return UserInput()


def top(user: Any) -> Any:
    """Where the tree's highest place toward the eye is seen."""
    return user.pixel(user.document.objects[0].surface.project([[0, 0, 2]])[0][0])


def undo_all(user: Any) -> None:
    while user.session.labels:
        user.key("z", ctrl=True)
    assert digest(user.document) == user.first


@pytest.mark.parametrize(("key", "kind"), [("n", Point), ("l", Segment)])
def test_what_grows_under_the_cursor_is_blended_and_held(user: Any, key: Any, kind: Any) -> None:
    at = top(user)
    place = user.tools.at(*at).position
    user.actions.state.selection = (3,)
    assert user.tools.key(key, *at)
    number, path = user.actions.state.primitive
    assert number == 0
    assert user.actions.state.selection == ()
    made = primitive_at(user.tree, path)
    assert isinstance(made, kind)
    assert join_of(user.tree, path) is Join.BLEND
    assert len(primitive_paths(user.tree)) == len(primitive_paths(CARVED)) + 1
    start = made.center if kind is Point else made.start
    np.testing.assert_allclose(start, place, atol=1e-6)
    assert user.actions.trees.handle_position[2] > place[2] + 0.3  # on top of what is new
    decals = user.document.decals.decals[np.isin(user.document.decals.numbers, decals_on(user.document, [0]))]
    assert np.abs(user.tree(decals.positions) - ISO).max() < 1e-4
    user.key("z", ctrl=True)
    assert user.actions.state.primitive is None
    assert digest(user.document) == user.first


def test_the_ways_to_join_go_round_and_the_primitive_stays_held(user: UserInput) -> None:
    user.tools.key("n", *top(user))
    before = user.tree
    points = np.random.default_rng(0).uniform(-2, 2, (500, 3)).astype(np.float32)
    seen = []
    for _ in range(5):
        ball = primitive_at(user.tree, user.held[1])
        user.key("j")
        assert primitive_at(user.tree, user.held[1]) == ball
        seen.append(user.actions.state.message)
    words = ("soft union", "union", "intersection", "difference", "blend")
    assert seen == [f"join by {word}" for word in words]
    np.testing.assert_allclose(user.tree(points), before(points), atol=5e-6)
    assert len(user.session.labels) == 6
    undo_all(user)


def test_a_way_to_join_that_leaves_nothing_is_passed_over() -> None:
    session = session_of(Point((0, 0, 0), radius=1.0) | Point((5, 0, 0), radius=0.5), 20)
    actions = Actions(session)
    actions.state.primitive = (0, (1,))
    actions.perform("next_join", lambda: None)
    assert actions.state.message == "join by difference"  # what both have in common is nothing


def test_a_hole_is_held_by_its_tool(user: UserInput) -> None:
    tool = (1,)
    assert primitive_at(CARVED, tool) == Point((0, -0.9, 0.6), radius=0.5)
    user.actions.perform("next_join", lambda: user.tools.at(*user.pixel((0, -0.55, 0.85))))
    assert user.actions.state.message == "join by blend"
    assert primitive_at(user.tree, user.held[1]) == primitive_at(CARVED, tool)


def test_held_primitives_are_duplicated_and_deleted_decals_first(user: UserInput) -> None:
    user.tools.key("n", *top(user))
    count = len(primitive_paths(user.tree))
    first = node_in_world(user.tree, user.held[1])
    user.key("d")
    copy = primitive_at(user.tree, user.held[1])
    assert isinstance(copy, Point)
    assert isinstance(first, Point)
    assert copy.radius == first.radius
    assert np.linalg.norm(np.subtract(copy.center, first.center)) == pytest.approx(first.radius, rel=1e-5)
    assert abs(copy.center[2] - first.center[2]) < 0.5 * first.radius  # to the side, as seen
    user.actions.state.selection = (3,)
    user.key("Delete")
    assert 3 not in user.document.decals.numbers
    assert len(primitive_paths(user.tree)) == count + 1
    user.key("Delete")
    assert len(primitive_paths(user.tree)) == count
    assert user.actions.state.message == "remove a primitive"
    assert user.actions.state.primitive is None
    user.key("Delete")
    assert "no decal is selected" in user.actions.state.message
    undo_all(user)


def test_the_last_primitive_says_how_the_object_goes(user: UserInput) -> None:
    user.tools.key("N", *top(user), shift=True)
    assert user.actions.state.primitive == (2, ())
    before = digest(user.document)
    user.key("Delete")
    assert "remove the object instead" in user.actions.state.message
    user.key("j")
    assert "alone in its tree" in user.actions.state.message
    assert digest(user.document) == before


def test_objects_come_and_go_under_the_cursor(user: UserInput) -> None:
    at = top(user)
    place = user.tools.at(*at)
    user.tools.key("N", *at, shift=True)
    ball, seen = user.document.objects[2], user.tools.at(*at)
    assert ball.name == "ball 1"
    assert place is not None
    assert seen is not None
    assert seen.object == 2
    point = tree_of(user.document, 2)
    assert isinstance(point, Point)
    expected = place.position + point.radius * place.normal
    np.testing.assert_allclose(point.center, expected.tolist(), atol=1e-6)  # on what was under the cursor
    user.tools.key("N", *at, shift=True)
    assert [item.name for item in user.document.objects[2:]] == ["ball 1", "ball 2"]
    user.tools.key("Delete", *at, shift=True)
    assert user.actions.state.message == "remove an object"
    assert user.actions.state.primitive is None
    assert user.document.objects[2] is ball
    undo_all(user)


def test_all_objects_may_go_and_the_next_lies_where_the_camera_looks(user: UserInput) -> None:
    for _ in range(2):
        (_, at), *_ = user.visible()
        user.tools.key("Delete", *at, shift=True)
    assert list(user.document.objects) == []
    assert len(user.document.decals) == 0
    user.tools.key("N", *OFF, shift=True)
    assert len(user.document.objects) == 1
    ball = user.tree
    assert isinstance(ball, Point)
    assert ball.center == pytest.approx(user.document.camera.target)
    undo_all(user)


def test_what_points_nowhere_or_at_a_mesh_says_so(user: UserInput) -> None:
    box = next(at for number, at in user.visible() if number in decals_on(user.document, [1]))
    for key in ("n", "l", "j"):
        user.key(key, OFF)
        assert user.actions.state.message == "no surface under the cursor; point at one"
        user.tools.key(key, *box)
        assert user.actions.state.message == "'box' is a mesh and has no primitives; point at a BlobTree"
    user.tools.key("Delete", *OFF, shift=True)
    assert user.actions.state.message == "no surface under the cursor; point at one"
    assert user.session.labels == ()


@pytest.mark.parametrize(("gone", "held"), [(1, (0, (0, 0))), (0, None)])
def test_objects_that_go_take_the_handle_along_only_if_numbers_move(user: Any, gone: Any, held: Any) -> None:
    user.actions.state.primitive = (0, (0, 0))
    user.session.do(RemoveObject(gone))
    assert user.actions.state.primitive == held


@pytest.mark.slow
def test_skeletons_of_ones_own_stay_held_while_they_are_dragged() -> None:
    session = session_of(Point((0, 0, 0), radius=1.0) + Bar(0.5, radius=0.4).translate((0.8, 0, 0)), 20)
    first = digest(session.document)
    actions = Actions(session)
    for path in ((1, 0), (0,)):
        actions.state.primitive = (0, path)
        before = node_in_world(session.document.objects[0].tree, path).support[0]
        actions.trees.begin_drag()
        for step in (0.1, 0.2, 0.3):
            actions.trees.drag((0, 0, step))
        actions.trees.end_drag()
        assert actions.state.primitive == (0, path)
        after = node_in_world(session.document.objects[0].tree, path).support[0]
        np.testing.assert_allclose(after - before, (0, 0, 0.3), atol=1e-5)
    while session.undo():
        pass
    assert digest(session.document) == first
