"""Keys for shapes: primitives and objects more and less, under the cursor or held, and all of it undone."""

import numpy as np
import pytest
import warp as wp

from blobtree import ISO, Point, Segment, define_skeleton
from decals.edit import Join, RemoveObject, primitive_paths
from decals.edit.actions import Actions
from decals.edit.population import lying_on
from decals.edit.shapes import join_of
from decals.edit.trees import alone, primitive_at
from tests.edit.scenes import CARVED, digest
from tests.edit.test_tools import Hands
from tests.edit.test_trees import session_of

OFF = (1, 1)
"""A place in the picture where there is nothing."""


@pytest.fixture
def hands():
    return Hands()


def top(hands):
    """Where the tree's highest place toward the eye is seen."""
    return hands.pixel(hands.document.objects[0].surface.project([[0, 0, 2]])[0][0])


def tree_of(hands, number=0):
    return hands.document.objects[number].tree


def undo_all(hands):
    while hands.session.labels:
        hands.key("z", ctrl=True)
    assert digest(hands.document) == hands.first


@pytest.mark.parametrize(("key", "kind"), [("n", Point), ("l", Segment)])
def test_what_grows_under_the_cursor_is_blended_and_held(hands, key, kind):
    at = top(hands)
    place = hands.tools.at(*at).position
    hands.actions.selection = (3,)
    assert hands.tools.key(key, *at)
    number, path = hands.actions.grip
    assert number == 0
    assert hands.actions.selection == ()
    made = primitive_at(tree_of(hands), path)
    assert isinstance(made, kind)
    assert join_of(tree_of(hands), path) is Join.BLEND
    assert len(primitive_paths(tree_of(hands))) == len(primitive_paths(CARVED)) + 1
    start = made.center if kind is Point else made.start
    np.testing.assert_allclose(start, place, atol=1e-6)
    assert hands.actions.grip_center[2] > place[2] + 0.3  # on top of what is new
    decals = hands.document.decals.decals[
        np.isin(hands.document.decals.numbers, lying_on(hands.document, [0]))
    ]
    assert np.abs(tree_of(hands)(decals.positions) - ISO).max() < 1e-4
    hands.key("z", ctrl=True)
    assert hands.actions.grip is None
    assert digest(hands.document) == hands.first


def test_the_ways_to_join_go_round_and_the_primitive_stays_held(hands):
    hands.tools.key("n", *top(hands))
    before = tree_of(hands)
    points = np.random.default_rng(0).uniform(-2, 2, (500, 3)).astype(np.float32)
    seen = []
    for _ in range(5):
        ball = primitive_at(tree_of(hands), hands.actions.grip[1])
        hands.key("j")
        assert primitive_at(tree_of(hands), hands.actions.grip[1]) == ball
        seen.append(hands.actions.message)
    words = ("soft union", "union", "intersection", "difference", "blend")
    assert seen == [f"joined by {word}" for word in words]
    np.testing.assert_allclose(tree_of(hands)(points), before(points), atol=5e-6)
    assert len(hands.session.labels) == 6
    undo_all(hands)


def test_a_way_to_join_that_leaves_nothing_is_passed_over():
    session = session_of(Point((0, 0, 0), radius=1.0) | Point((5, 0, 0), radius=0.5), 20)
    actions = Actions(session)
    actions.grip = (0, (1,))
    actions.perform("next_join", lambda: None)
    assert actions.message == "joined by difference"  # what both have in common is nothing


def test_a_hole_is_held_by_its_tool(hands):
    tool = (1,)
    assert primitive_at(CARVED, tool) == Point((0, -0.9, 0.6), radius=0.5)
    hands.actions.perform("next_join", lambda: hands.tools.at(*hands.pixel((0, -0.55, 0.85))))
    assert hands.actions.message == "joined by blend"
    assert primitive_at(tree_of(hands), hands.actions.grip[1]) == primitive_at(CARVED, tool)


def test_held_primitives_are_duplicated_and_deleted_decals_first(hands):
    hands.tools.key("n", *top(hands))
    count = len(primitive_paths(tree_of(hands)))
    first = alone(tree_of(hands), hands.actions.grip[1])
    hands.key("d")
    copy = primitive_at(tree_of(hands), hands.actions.grip[1])
    assert copy.radius == first.radius
    assert np.linalg.norm(np.subtract(copy.center, first.center)) == pytest.approx(first.radius, rel=1e-5)
    assert abs(copy.center[2] - first.center[2]) < 0.5 * first.radius  # to the side, as seen
    hands.actions.selection = (3,)
    hands.key("Delete")
    assert 3 not in hands.document.decals.numbers
    assert len(primitive_paths(tree_of(hands))) == count + 1
    hands.key("Delete")
    assert len(primitive_paths(tree_of(hands))) == count
    assert hands.actions.message == "remove a primitive"
    assert hands.actions.grip is None
    hands.key("Delete")
    assert "select a decal first" in hands.actions.message
    undo_all(hands)


def test_the_last_primitive_says_how_the_object_goes(hands):
    hands.tools.key("N", *top(hands), shift=True)
    assert hands.actions.grip == (2, ())
    before = digest(hands.document)
    hands.key("Delete")
    assert "remove the object instead" in hands.actions.message
    hands.key("j")
    assert "alone in its shape" in hands.actions.message
    assert digest(hands.document) == before


def test_objects_come_and_go_under_the_cursor(hands):
    at = top(hands)
    place = hands.tools.at(*at)
    hands.tools.key("N", *at, shift=True)
    ball = hands.document.objects[2]
    assert ball.name == "ball 1"
    assert hands.tools.at(*at).object == 2
    np.testing.assert_allclose(
        ball.tree.center, place.position + ball.tree.radius * place.normal, atol=1e-6
    )  # it lies on what was under the cursor
    hands.tools.key("N", *at, shift=True)
    assert [item.name for item in hands.document.objects[2:]] == ["ball 1", "ball 2"]
    hands.tools.key("Delete", *at, shift=True)
    assert hands.actions.message == "remove an object"
    assert hands.actions.grip is None
    assert hands.document.objects[2] is ball
    undo_all(hands)


def test_all_objects_may_go_and_the_next_lies_where_the_camera_looks(hands):
    for _ in range(2):
        (_, at), *_ = hands.visible()
        hands.tools.key("Delete", *at, shift=True)
    assert hands.document.objects == ()
    assert len(hands.document.decals) == 0
    hands.tools.key("N", *OFF, shift=True)
    (ball,) = hands.document.objects
    assert ball.tree.center == pytest.approx(hands.document.camera.target)
    undo_all(hands)


def test_what_points_nowhere_or_at_a_mesh_says_so(hands):
    box = next(at for number, at in hands.visible() if number in lying_on(hands.document, [1]))
    for key in ("n", "l", "j"):
        hands.key(key, OFF)
        assert hands.actions.message == "point at a surface"
        hands.tools.key(key, *box)
        assert hands.actions.message == "'box' is a mesh and has no primitives; point at a BlobTree"
    hands.tools.key("Delete", *OFF, shift=True)
    assert hands.actions.message == "point at a surface"
    assert hands.session.labels == ()


@pytest.mark.parametrize(("gone", "held"), [(1, (0, (0, 0))), (0, None)])
def test_objects_that_go_take_the_handle_along_only_if_numbers_move(hands, gone, held):
    hands.actions.grip = (0, (0, 0))
    hands.session.do(RemoveObject(gone))
    assert hands.actions.grip == held


@wp.func
def bar(q: wp.vec3, half: wp.float32) -> wp.vec3:
    return wp.vec3(wp.clamp(q[0], -half, half), 0.0, 0.0)


def test_skeletons_of_ones_own_stay_held_while_they_are_dragged():
    own = define_skeleton(bar, convex=True)
    session = session_of(Point((0, 0, 0), radius=1.0) + own(0.5, radius=0.4).translate((0.8, 0, 0)), 20)
    first = digest(session.document)
    actions = Actions(session)
    for path in ((1, 0), (0,)):
        actions.grip = (0, path)
        before = alone(session.document.objects[0].tree, path).bounds[0]
        actions.begin_grip()
        for step in (0.1, 0.2, 0.3):
            actions.move_grip((0, 0, step))
        actions.end_grip()
        assert actions.grip == (0, path)
        after = alone(session.document.objects[0].tree, path).bounds[0]
        np.testing.assert_allclose(after - before, (0, 0, 0.3), atol=1e-5)
    while session.undo():
        pass
    assert digest(session.document) == first
