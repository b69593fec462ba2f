"""Commands for primitives: moves through maps, and decals that follow."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from blobtree import ISO, Box, Cone, EndlessRepeat, Mirror, Point, Ricci, Segment
from blobtree.errors import InvalidNode
from blobtree.nodes.paths import node_in_world, primitive_at
from blobtree.nodes.places import Place
from decals import Camera, DecalImage, Scene, TreeObject, scatter
from decals.editing import (
    Actions,
    EditSession,
    MovePrimitive,
    PaintPrimitive,
    ReplaceNode,
    ResizePrimitive,
    SetParameter,
    TransformPrimitive,
)
from decals.editing.followers import DragAnchor, following_weights
from decals.errors import InvalidEdit, InvalidMesh
from tests.blobtree.custom_kinds import Bar
from tests.decals.editing.scenes import digest, tree_of

A, B = Point((0, 0, 0), radius=1.0), Segment((1, 0, 0), (2, 0, 0), radius=0.5)
STILL = np.eye(3)[None]
C = Cone((0, 0, 2), (0, 0, 3), radius=0.4, end_radius=0.2)
NESTED = (A + B.translate((0.5, 0, 0)).scale(2)) - (C.rotate((0, 0, 1), 90) | A)


def session_of(tree: Any, count: int = 80) -> Any:
    return EditSession(scene_of(tree, count))


@cache
def scene_of(tree: Any, count: int) -> Scene:
    item = TreeObject("tree", tree)
    return Scene(
        objects=(item,),
        decals=scatter([item.surface], count=count),
        images=(DecalImage.load("scale"),),
        camera=Camera.framing(item.bounds),
    )


@pytest.mark.slow
def test_skeletons_of_ones_own_move_again_and_again_by_the_same_path() -> None:
    session = session_of(A + Bar(0.5, radius=0.4).translate((0.8, 0, 0)) + Bar(1.0, radius=0.3))
    first = digest(session.document)
    for path in ((1,), (2,)):
        before = node_in_world(session.document.objects[0].tree, path)
        for _ in range(3):
            session.do(MovePrimitive(0, path, (0.0, 0.1, 0.2)))
        session.do(ResizePrimitive(0, path, 1.1))
        session.do(ResizePrimitive(0, path, 1 / 1.1))
        session.do(PaintPrimitive(0, path, (1, 0, 0)))
        after = node_in_world(session.document.objects[0].tree, path)
        points = np.random.default_rng(0).uniform(*before.support, (300, 3)).astype(np.float32)
        there = np.add(points, (0, 0.3, 0.6))
        np.testing.assert_allclose(after(there), before(points), atol=1e-4)
        assert after.colors(there).max() == 1
        decals, item = session.document.decals.decals, session.document.objects[0]
        assert np.abs(item.tree(decals.positions) - ISO).max() < 1e-4
    while session.undo():
        pass
    assert digest(session.document) == first


def test_a_branch_moves_as_a_whole() -> None:
    tree = (A + B).rotate((0, 0, 1), 20) | Point((0, 0, 5), radius=1)
    session = session_of(tree)
    before = session.document.decals.decals
    session.do(MovePrimitive(0, (0,), (0.5, 0, 0)))
    after = session.document.decals.decals
    low = before.positions[:, 2] < 2
    np.testing.assert_allclose(after.positions[low], before.positions[low] + (0.5, 0, 0), atol=1e-4)
    np.testing.assert_array_equal(after.positions[~low], before.positions[~low])


@pytest.mark.parametrize("path", [(0,), (1, 0, 0)])
def test_a_move_is_one_in_the_world_whatever_lies_above(path: Any) -> None:
    tree = A + B.rotate((0, 1, 1), 40).translate((3, 1, 0))
    offset = np.array([0.2, -0.1, 0.3])
    session = session_of(tree)
    before = node_in_world(tree, path)
    session.do(MovePrimitive(0, path, offset))
    after = node_in_world(session.document.objects[0].tree, path)
    points = np.random.default_rng(0).uniform(*before.support, (300, 3)).astype(np.float32)
    np.testing.assert_allclose(after(points + offset), before(points), atol=1e-5)


@pytest.mark.parametrize(
    "command",
    [
        MovePrimitive(0, (0, 0), (0.05, 0.05, 0)),
        MovePrimitive(0, (0,), (0.2, 0.05, 0)),
        TransformPrimitive(0, (0,), np.diag([1.0, 1.1, 0.9, 1.0])),
        ResizePrimitive(0, (0, 0), 1.1),
    ],
)
def test_a_primitive_of_an_endless_repeat_is_edited(command: Any) -> None:
    endless = EndlessRepeat(Point((0, 0, 0), radius=0.4), (1, 0, 0))
    session = session_of(endless & Box((0, 0, 0), (2.5, 2, 2), radius=0))
    first = digest(session.document)
    session.do(command)
    decals, item = session.document.decals.decals, session.document.objects[0]
    assert np.abs(item.tree(decals.positions) - ISO).max() < 1e-4
    session.undo()
    assert digest(session.document) == first


def test_decals_on_a_primitive_go_along_and_the_others_stay() -> None:
    tree = A | Point((5, 0, 0), radius=1.0)
    session = session_of(tree)
    before = session.document.decals.decals
    session.do(MovePrimitive(0, (1,), (0.3, 0.4, 0)))
    after = session.document.decals.decals
    right = before.positions[:, 0] > 2
    np.testing.assert_array_equal(after.positions[~right], before.positions[~right])
    np.testing.assert_allclose(after.positions[right], before.positions[right] + (0.3, 0.4, 0), atol=1e-4)
    np.testing.assert_allclose(after.tangents, before.tangents, atol=1e-3)


@pytest.mark.parametrize("tree", [A + B, Ricci((A, B), exponent=3), A - Point((0, 0, 1.2), radius=0.6)])
@pytest.mark.parametrize(
    "command",
    [
        MovePrimitive(0, (1,), (0.1, 0.15, -0.1)),
        ResizePrimitive(0, (1,), 1.2),
        ResizePrimitive(0, (0,), 0.8),
    ],
)
def test_decals_stay_on_the_surface_and_come_back(tree: Any, command: Any) -> None:
    session = session_of(tree)
    first = digest(session.document)
    change = session.do(command)
    assert len(change.after.numbers)
    decals, item = session.document.decals.decals, session.document.objects[0]
    assert np.abs(item.tree(decals.positions) - ISO).max() < 1e-4
    rows = change.after.numbers  # the others keep the mean normals of images that bend over the old crease
    normals = item.surface.normal(decals.positions[rows])
    cosines = np.einsum("ni,ni->n", normals, decals.normals[rows])
    assert (cosines < 0.999).sum() <= 2  # on a crease, rounding decides whose normal it is
    session.undo()
    assert digest(session.document) == first


def test_following_is_whole_on_a_primitive_alone_and_shared_in_a_blend() -> None:
    tree = A + Point((1.2, 0, 0), radius=1.0)
    low, high = tree.support
    points = scatter([TreeObject("t", tree).surface], count=100).positions.astype(np.float64)
    first, second = (following_weights(tree, (step,), points, STILL)[0] for step in (0, 1))
    np.testing.assert_allclose(first + second, 1.0, atol=0.02)
    mirror = points * (-1, 1, 1) + (1.2, 0, 0)
    np.testing.assert_allclose(following_weights(tree, (1,), mirror, STILL)[0], first, atol=0.02)
    far = np.abs(points[:, 0] - low[0]) > (high - low)[0] * 0.7
    assert first[far].max() < 0.15


def test_decals_in_a_hole_follow_the_tool() -> None:
    tree = A - Point((0, 0, 1.1), radius=0.5)
    points = TreeObject("t", tree).surface.project([[0, 0, 0.6]])[0].astype(np.float64)
    np.testing.assert_allclose(following_weights(tree, (1,), points, STILL)[0], 1.0, atol=0.02)
    np.testing.assert_allclose(following_weights(tree, (0,), points, STILL)[0], 0.0, atol=0.02)


@pytest.mark.parametrize("way", [(0.02, 0.03, -0.02), (0.4, 0.3, -0.2)])
def test_a_quick_move_is_the_same_move_without_a_surface(way: Any) -> None:
    quick, whole = session_of(A + B), session_of(A + B)
    quick.do(MovePrimitive(0, (1,), way, quick=True))
    whole.do(MovePrimitive(0, (1,), way))
    assert "surface" not in vars(quick.document.objects[0])
    decals, tree = quick.document.decals.decals, quick.document.objects[0].tree
    assert decals.packed().tobytes() == whole.document.decals.decals.packed().tobytes()
    assert tree == whole.document.objects[0].tree
    assert np.abs(tree(decals.positions) - ISO).max() < 1e-4


@pytest.mark.ordinary_cases("path0-tree0")
@pytest.mark.parametrize(
    "tree", [A + B, Ricci((A, B.scale(1.2)), exponent=3), A - Point((0, 0, 1.2), radius=0.6)]
)
@pytest.mark.parametrize("path", [(0,), (1,)])
def test_beyond_its_reach_a_node_carries_nothing_along(tree: Any, path: Any) -> None:
    """What is asked of decals near the node alone is what all would have been given, bit for bit."""
    item, other = TreeObject("tree", tree), TreeObject("other", Point((1.5, 0.2, 0.4), radius=0.9))
    positions = scatter([item.surface, other.surface], count=300).positions
    start = DragAnchor(((item, other), 0, path), tree, positions)
    whole = following_weights(tree, path, positions.astype(np.float64), STILL)
    np.testing.assert_array_equal(start.weights, whole)
    assert 0 < (start.weights > 0).sum() < len(positions)


def test_a_drag_in_steps_ends_as_one_move_does() -> None:
    other = TreeObject("other", Point((2.6, 0, 0), radius=0.5))
    tree = TreeObject("tree", A + B)
    decals = scatter([tree.surface, other.surface], count=120)
    scene = Scene(
        objects=(tree, other),
        decals=decals,
        images=(DecalImage.load("scale"),),
        camera=Camera.framing(tree.bounds),
    )
    steps, at_once = EditSession(scene), EditSession(scene)
    for path, way in (((1,), np.array([0.2, 0.1, -0.1])), ((0,), np.array([0.0, -0.3, 0.1]))):
        actions = Actions(steps)
        actions.state.primitive = 0, path
        actions.trees.begin_drag()
        for share in (0.2, 1.4, 0.7, 1.0):
            actions.trees.drag(share * way)
        actions.trees.end_drag()
        at_once.do(MovePrimitive(0, path, way, quick=True))
        one, same = steps.document, at_once.document
        assert one.decals.decals.packed().tobytes() == same.decals.decals.packed().tobytes()
        assert tree_of(one) == tree_of(same)
    assert len(steps.labels) == len(at_once.labels) == 2


def test_a_path_may_be_a_list() -> None:
    one, other = session_of(A + B, 12), session_of(A + B, 12)
    one.do(MovePrimitive(0, [1], (0, 0, 0.1)))  # type: ignore[arg-type]
    other.do(MovePrimitive(0, (1,), (0, 0, 0.1)))
    assert one.document.objects[0].tree == other.document.objects[0].tree
    moved = one.document.decals.decals.positions
    np.testing.assert_array_equal(moved, other.document.decals.decals.positions)


def test_a_primitive_that_leaves_nothing_to_see_goes_back() -> None:
    """A tool that removes everything: the steps of a drag pass, its end is refused."""
    session = session_of(A - Point((1.2, 0, 0), radius=1.3), 12)
    actions = Actions(session)
    actions.state.primitive = (0, (1,))
    state = digest(session.document)
    actions.trees.begin_drag()
    actions.trees.drag((-1.2, 0, 0))
    actions.trees.end_drag()
    assert digest(session.document) == state
    assert session.labels == ()
    assert "surface" in actions.state.message


def test_painting_leaves_the_decals() -> None:
    session = session_of(A + B)
    change = session.do(PaintPrimitive(0, (1,), (1, 0, 0)))
    assert not len(change.after.numbers)
    assert primitive_at(session.document.objects[0].tree, (1,)).color == (1, 0, 0)


@pytest.mark.parametrize(
    ("command", "error", "message"),
    [
        (MovePrimitive(1, (0,), (0, 0, 1)), InvalidEdit, "0 to 0, got 1"),
        (MovePrimitive(0, (5,), (0, 0, 1)), InvalidNode, "path"),
        (MovePrimitive(0, (0,), (0, 0, np.nan)), InvalidEdit, "offset"),
        (ResizePrimitive(0, (0,), 0.0), InvalidEdit, "above 0"),
        (PaintPrimitive(0, (0,), (2, 0, 0)), InvalidNode, "color"),
        (ResizePrimitive(0, (0,), 0.001), InvalidMesh, "surface"),
    ],
)
def test_what_cannot_be_is_refused(command: Any, error: Any, message: Any) -> None:
    session = session_of(A)
    session.document.apply(*_under_a_sum(session.document))
    before = digest(session.document)
    with pytest.raises(error, match=message):
        session.do(command)
    assert digest(session.document) == before


def _under_a_sum(document: Any) -> Any:
    change = document.compute_parts(objects=(TreeObject("tree", A - Point((0, 0, 0), radius=0.5)),))
    return change.after, change.parts_after


def test_below_a_twist_a_node_moves_as_the_world_shows_it_and_decals_follow() -> None:
    ball = Point((0, 0, 1.5), radius=0.6)
    session = session_of((B + ball.translate((1.5, 0, 0))).twist(60))
    first, path, offset = digest(session.document), (0, 1), np.array((0.2, 0.5, 0.3))
    middle, before = Place(tree_of(session.document), path).middle, session.document.decals.decals.positions
    np.testing.assert_allclose(middle, (0.0, 1.5, 1.5), atol=1e-6)
    session.do(MovePrimitive(0, path, offset))
    tree, after = tree_of(session.document), session.document.decals.decals.positions
    np.testing.assert_allclose(Place(tree, path).middle, middle + offset, atol=1e-6)
    np.testing.assert_allclose(tree((middle + offset)[None]), 1.0, atol=1e-5)
    far = before[:, 2] > 1.9  # on the ball alone
    np.testing.assert_allclose((after - before)[far].mean(axis=0), offset, atol=0.1)
    assert np.abs(tree(after) - ISO).max() < 1e-4
    session.undo()
    assert digest(session.document) == first


def test_decals_follow_the_mirror_image_of_a_node_too() -> None:
    limb = Segment((0.8, 0.3, 0), (2, 0.3, 0), radius=0.3)
    session = session_of(Mirror(A + limb, axis="x").rotate((0, 0, 1), 90))
    before, path = session.document.decals.decals.positions, (0, 0, 1)
    session.do(MovePrimitive(0, path, (0, 0.4, 0.2)))
    moved, tree = session.document.decals.decals.positions - before, tree_of(session.document)
    for side in (1, -1):  # y of the limb's free end
        end = side * before[:, 1] > 1.9
        np.testing.assert_allclose(moved[end], [(0, side * 0.4, 0.2)] * int(end.sum()), atol=0.01)
        assert end.sum() > 1
    assert np.abs(tree(session.document.decals.decals.positions) - ISO).max() < 1e-4
    turn = np.diag([1.0, 1.0, -1.0, 1.0])[:, [0, 2, 1, 3]]
    before = session.document.decals.decals.positions
    session.do(TransformPrimitive(0, path, turn))
    moved = session.document.decals.decals.positions - before
    for side in (1, -1):
        end = side * before[:, 1] > 2.3
        turned = np.diag([1, side, 1, 1]) @ turn @ np.diag([1, side, 1, 1])
        misses = np.linalg.norm((moved - before @ (turned - np.eye(4))[:3, :3].T)[end], axis=1)
        assert misses.min() < 0.02


def test_a_parameter_of_any_node_is_set_and_decals_stay_on_the_surface() -> None:
    session = session_of((A + B).twist(10.0))
    before = digest(session.document)
    session.do(SetParameter(0, (), "degrees", 25.0))
    session.do(SetParameter(0, (0, 1), "end", (2.2, 0.3, 0)))
    tree: Any = tree_of(session.document)
    assert (tree.degrees, tree.child.operands[1].end) == (25.0, (2.2, 0.3, 0.0))
    np.testing.assert_allclose(tree(session.document.decals.decals.positions), ISO, atol=1e-4)
    assert session.labels == ("set degrees", "set end")
    for _ in range(2):
        session.undo()
    assert digest(session.document) == before


def test_a_color_is_set_without_a_look_at_the_decals() -> None:
    session = session_of(A + B)
    edit = session.do(SetParameter(0, (1,), "color", "red"))
    tree: Any = tree_of(session.document)
    assert tree.operands[1].color == (1.0, 0.0, 0.0)
    assert len(edit.after.numbers) == 0


def test_a_node_is_replaced_by_any_other() -> None:
    session = session_of(A + B)
    session.do(ReplaceNode(0, (1,), C))
    assert tree_of(session.document) == A + C
    with pytest.raises(InvalidEdit, match="expected one of start, end"):
        session.do(SetParameter(0, (1,), "size", 1.0))
