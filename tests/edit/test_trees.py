"""Primitives of trees: paths, moves through transforms, and decals that follow."""

import numpy as np
import pytest
import warp as wp

from blobtree import ISO, Cone, InvalidNode, Point, Ricci, Segment, define_skeleton
from decals.coat.seeding import seed
from decals.edit import (
    EditSession,
    MovePrimitive,
    PaintPrimitive,
    ResizePrimitive,
    primitive_near,
    primitive_paths,
)
from decals.edit.actions import Actions
from decals.edit.following import Start, following
from decals.edit.trees import alone, moved, primitive_at, with_node
from decals.errors import InvalidEdit, InvalidMesh
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage, Scene, TreeObject
from tests.edit.scenes import digest

A, B = Point((0, 0, 0), radius=1.0), Segment((1, 0, 0), (2, 0, 0), radius=0.5)
C = Cone((0, 0, 2), (0, 0, 3), radius=0.4, end_radius=0.2)
NESTED = (A + B.translate((0.5, 0, 0)).scale(2)) - (C.rotate((0, 0, 1), 90) | A)


def session_of(tree, count=80):
    item = TreeObject("tree", tree)
    return EditSession(
        Scene(
            objects=(item,),
            decals=seed([item.surface], count=count),
            images=(DecalImage.load("scale"),),
            camera=Camera.framing(item.bounds),
        )
    )


def test_paths_name_every_primitive_and_exchange_it():
    paths = primitive_paths(NESTED)
    assert [primitive_at(NESTED, path) for path in paths] == [A, B, C, A]
    for path in paths:
        assert with_node(NESTED, path, primitive_at(NESTED, path)) == NESTED
        other = with_node(NESTED, path, Point((9, 9, 9), radius=1))
        assert primitive_at(other, path) == Point((9, 9, 9), radius=1)
        assert sum(primitive_at(other, at) != primitive_at(NESTED, at) for at in paths) == 1
    for path in ((7,), (0, 0, 0), (1,)):
        with pytest.raises(InvalidEdit):
            primitive_at(NESTED, path)


def test_a_primitive_alone_lies_where_it_lies_in_the_tree():
    tree = A.translate((3, 0, 0)) + B
    points = np.random.default_rng(0).normal(0, 3, (200, 3)).astype(np.float32)
    np.testing.assert_array_equal(alone(tree, (0, 0))(points), A.translate((3, 0, 0))(points))
    assert primitive_near(tree, (3, 0, 1)) == (0, 0)
    assert primitive_near(tree, (1.5, 0, 0.5)) == (1,)


def test_moving_keeps_what_a_primitive_is():
    assert moved(B, (0, 1, 0)) == Segment((1, 1, 0), (2, 1, 0), radius=0.5)
    assert moved(C, (1, 0, 0)).end_radius == 0.2
    black = Point((0, 0, 0), radius=1, color=(0, 0, 0))
    assert moved(black, (1, 2, 3)) == Point((1, 2, 3), radius=1, color=(0, 0, 0))
    turned = B.rotate((0, 0, 1), 30)
    assert moved(moved(turned, (1, 0, 0)), (0, 2, 0)) == turned.child.transform(
        np.array(turned.matrix) + np.outer([1, 2, 0], [0, 0, 0, 1])
    )


@wp.func
def rod(q: wp.vec3, half: wp.float32) -> wp.vec3:
    return wp.vec3(wp.clamp(q[0], -half, half), 0.0, 0.0)


def test_skeletons_of_ones_own_move_again_and_again_by_the_same_path():
    own = define_skeleton(rod, convex=True)
    session = session_of(A + own(0.5, radius=0.4).translate((0.8, 0, 0)) + own(1.0, radius=0.3))
    first = digest(session.document)
    for path in ((1,), (2,)):
        before = alone(session.document.objects[0].tree, path)
        for _ in range(3):
            session.do(MovePrimitive(0, path, (0.0, 0.1, 0.2)))
        session.do(ResizePrimitive(0, path, 1.1))
        session.do(ResizePrimitive(0, path, 1 / 1.1))
        session.do(PaintPrimitive(0, path, (1, 0, 0)))
        after = alone(session.document.objects[0].tree, path)
        points = np.random.default_rng(0).uniform(*before.bounds, (300, 3)).astype(np.float32)
        there = np.add(points, (0, 0.3, 0.6))
        np.testing.assert_allclose(after(there), before(points), atol=1e-4)
        assert after.colors(there).max() == 1
        decals, item = session.document.decals.decals, session.document.objects[0]
        assert np.abs(item.tree(decals.positions) - ISO).max() < 1e-4
    while session.undo():
        pass
    assert digest(session.document) == first


def test_a_branch_moves_as_a_whole():
    tree = (A + B).rotate((0, 0, 1), 20) | Point((0, 0, 5), radius=1)
    session = session_of(tree)
    before = session.document.decals.decals
    session.do(MovePrimitive(0, (0,), (0.5, 0, 0)))
    after = session.document.decals.decals
    low = before.positions[:, 2] < 2
    np.testing.assert_allclose(after.positions[low], before.positions[low] + (0.5, 0, 0), atol=1e-4)
    np.testing.assert_array_equal(after.positions[~low], before.positions[~low])


@pytest.mark.parametrize("path", [(0,), (1, 0, 0)])
def test_a_move_is_one_in_the_world_whatever_lies_above(path):
    tree = A + B.rotate((0, 1, 1), 40).translate((3, 1, 0))
    offset = np.array([0.2, -0.1, 0.3])
    session = session_of(tree)
    before = alone(tree, path)
    session.do(MovePrimitive(0, path, offset))
    after = alone(session.document.objects[0].tree, path)
    points = np.random.default_rng(0).uniform(*before.bounds, (300, 3)).astype(np.float32)
    np.testing.assert_allclose(after(points + offset), before(points), atol=1e-5)


def test_decals_on_a_primitive_go_along_and_the_others_stay():
    tree = A | Point((5, 0, 0), radius=1.0)
    session = session_of(tree)
    before = session.document.decals.decals
    session.do(MovePrimitive(0, (1,), (0.3, 0.4, 0)))
    after = session.document.decals.decals
    right = before.positions[:, 0] > 2
    np.testing.assert_array_equal(after.positions[~right], before.positions[~right])
    np.testing.assert_allclose(after.positions[right], before.positions[right] + (0.3, 0.4, 0), atol=1e-4)
    np.testing.assert_allclose(after.tangents, before.tangents, atol=1e-3)


@pytest.mark.parametrize("tree", [A + B, Ricci([A, B], exponent=3), A - Point((0, 0, 1.2), radius=0.6)])
@pytest.mark.parametrize(
    "command",
    [
        MovePrimitive(0, (1,), (0.1, 0.15, -0.1)),
        ResizePrimitive(0, (1,), 1.2),
        ResizePrimitive(0, (0,), 0.8),
    ],
)
def test_decals_stay_on_the_surface_and_come_back(tree, command):
    session = session_of(tree)
    first = digest(session.document)
    change = session.do(command)
    assert len(change.after.numbers)
    decals, item = session.document.decals.decals, session.document.objects[0]
    assert np.abs(item.tree(decals.positions) - ISO).max() < 1e-4
    normals = item.surface.normal(decals.positions)
    cosines = np.einsum("ni,ni->n", normals, decals.normals)
    assert (cosines < 0.999).sum() <= 2  # on a crease, rounding decides whose normal it is
    session.undo()
    assert digest(session.document) == first


def test_following_is_whole_on_a_primitive_alone_and_shared_in_a_blend():
    tree = A + Point((1.2, 0, 0), radius=1.0)
    low, high = tree.bounds
    points = seed([TreeObject("t", tree).surface], count=100).positions
    first, second = following(tree, (0,), points), following(tree, (1,), points)
    np.testing.assert_allclose(first + second, 1.0, atol=0.02)
    mirror = points * (-1, 1, 1) + (1.2, 0, 0)
    np.testing.assert_allclose(following(tree, (1,), mirror), first, atol=0.02)
    far = np.abs(points[:, 0] - low[0]) > (high - low)[0] * 0.7
    assert first[far].max() < 0.15


def test_decals_in_a_hole_follow_the_tool():
    tree = A - Point((0, 0, 1.1), radius=0.5)
    points = TreeObject("t", tree).surface.project([[0, 0, 0.6]])[0]
    np.testing.assert_allclose(following(tree, (1,), points), 1.0, atol=0.02)
    np.testing.assert_allclose(following(tree, (0,), points), 0.0, atol=0.02)


@pytest.mark.parametrize("way", [(0.02, 0.03, -0.02), (0.4, 0.3, -0.2)])
def test_a_quick_move_is_the_same_move_without_a_surface(way):
    quick, whole = session_of(A + B), session_of(A + B)
    quick.do(MovePrimitive(0, (1,), way, quick=True))
    whole.do(MovePrimitive(0, (1,), way))
    assert "surface" not in vars(quick.document.objects[0])
    decals, tree = quick.document.decals.decals, quick.document.objects[0].tree
    assert decals.packed().tobytes() == whole.document.decals.decals.packed().tobytes()
    assert tree == whole.document.objects[0].tree
    assert np.abs(tree(decals.positions) - ISO).max() < 1e-4


@pytest.mark.parametrize(
    "tree", [A + B, Ricci([A, B.scale(1.2)], exponent=3), A - Point((0, 0, 1.2), radius=0.6)]
)
@pytest.mark.parametrize("path", [(0,), (1,)])
def test_beyond_its_reach_a_node_carries_nothing_along(tree, path):
    """What is asked of decals near the node alone is what all would have been given, bit for bit."""
    item, other = TreeObject("tree", tree), TreeObject("other", Point((1.5, 0.2, 0.4), radius=0.9))
    positions = seed([item.surface, other.surface], count=300).positions
    start = Start(((item, other), 0, path), tree, positions)
    np.testing.assert_array_equal(start.weights, following(tree, path, positions.astype(np.float64)))
    assert 0 < (start.weights > 0).sum() < len(positions)


def test_a_drag_in_steps_ends_as_one_move_does():
    other = TreeObject("other", Point((2.6, 0, 0), radius=0.5))
    tree = TreeObject("tree", A + B)
    decals = seed([tree.surface, other.surface], count=120)
    scene = Scene(
        objects=(tree, other),
        decals=decals,
        images=(DecalImage.load("scale"),),
        camera=Camera.framing(tree.bounds),
    )
    steps, at_once = EditSession(scene), EditSession(scene)
    for path, way in (((1,), np.array([0.2, 0.1, -0.1])), ((0,), np.array([0.0, -0.3, 0.1]))):
        actions = Actions(steps)
        actions.grip = 0, path
        actions.begin_grip()
        for share in (0.2, 1.4, 0.7, 1.0):
            actions.move_grip(share * way)
        actions.end_grip()
        at_once.do(MovePrimitive(0, path, way, quick=True))
        one, same = steps.document, at_once.document
        assert one.decals.decals.packed().tobytes() == same.decals.decals.packed().tobytes()
        assert one.objects[0].tree == same.objects[0].tree
    assert len(steps.labels) == len(at_once.labels) == 2


def test_a_path_may_be_a_list():
    one, other = session_of(A + B, 12), session_of(A + B, 12)
    one.do(MovePrimitive(0, [1], (0, 0, 0.1)))
    other.do(MovePrimitive(0, (1,), (0, 0, 0.1)))
    assert one.document.objects[0].tree == other.document.objects[0].tree
    moved = one.document.decals.decals.positions
    np.testing.assert_array_equal(moved, other.document.decals.decals.positions)


def test_a_primitive_that_leaves_nothing_to_see_goes_back():
    """A tool that swallows the whole; step by step nobody asks for the surface, letting go does."""
    session = session_of(A - Point((1.2, 0, 0), radius=1.3), 12)
    actions = Actions(session)
    actions.grip = (0, (1,))
    state = digest(session.document)
    actions.begin_grip()
    actions.move_grip((-1.2, 0, 0))
    actions.end_grip()
    assert digest(session.document) == state
    assert session.labels == ()
    assert "surface" in actions.message


def test_painting_leaves_the_decals():
    session = session_of(A + B)
    change = session.do(PaintPrimitive(0, (1,), (1, 0, 0)))
    assert not len(change.after.numbers)
    assert primitive_at(session.document.objects[0].tree, (1,)).color == (1, 0, 0)


@pytest.mark.parametrize(
    ("command", "error", "message"),
    [
        (MovePrimitive(1, (0,), (0, 0, 1)), InvalidEdit, "0 to 0, got 1"),
        (MovePrimitive(0, (5,), (0, 0, 1)), InvalidEdit, "path"),
        (MovePrimitive(0, (0,), (0, 0, np.nan)), InvalidEdit, "offset"),
        (ResizePrimitive(0, (0,), 0.0), InvalidEdit, "above 0"),
        (PaintPrimitive(0, (0,), (2, 0, 0)), InvalidNode, "color"),
        (ResizePrimitive(0, (0,), 0.001), InvalidMesh, "surface"),
    ],
)
def test_what_cannot_be_is_refused(command, error, message):
    session = session_of(A)
    session.document.put(*_under_a_sum(session.document))
    before = digest(session.document)
    with pytest.raises(error, match=message):
        session.do(command)
    assert digest(session.document) == before


def _under_a_sum(document):
    change = document.with_parts(objects=(TreeObject("tree", A - Point((0, 0, 0), radius=0.5)),))
    return change.after, change.parts_after


def test_below_a_twist_nothing_moves_alone():
    session = session_of((A + B).twist(30))
    with pytest.raises(InvalidEdit, match="below a Twist"):
        session.do(MovePrimitive(0, (0, 0), (0, 0, 1)))
