"""Handles of nodes: where they lie, and what a drag of one does; the oracle is plain NumPy."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import decals
from blobtree import Point, Polyline, Segment, Transform, Twist
from blobtree.nodes.paths import mapped, node_at, node_in_world
from decals import TreeObject
from decals.editing import (
    Actions,
    DragSurface,
    EditSession,
    MirrorPrimitive,
    PointerTools,
    RemoveObject,
    TransformPrimitive,
)
from decals.editing.brush_settings import Brush
from decals.editing.gizmo import (
    HandleDrag,
    along_line,
    angle_about,
    control_points,
    handles_of,
    moved_point,
    on_plane,
    scale_about,
    snap_distance,
    turn_about,
)
from decals.errors import InvalidEdit
from tests.decals.editing.scenes import digest, tree_of

LIMB = Segment((1, 0, 0), (2, 1, 0), radius=0.3)
TREE = Point((0, 0, 0), radius=1.0) + LIMB
POINTS = np.random.default_rng(3).uniform(-3, 3, (200, 3)).astype(np.float32)
numbers = st.floats(-5.0, 5.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
directions = vectors.filter(lambda v: bool(np.linalg.norm(v) > 0.1))


@given(vectors, directions, vectors, directions)
@settings(max_examples=60)
def test_a_line_comes_closest_to_a_ray_there(origin: Any, axis: Any, start: Any, toward: Any) -> None:
    found = along_line(origin, axis, (start, toward))
    line, ray = axis / np.linalg.norm(axis), toward / np.linalg.norm(toward)
    if found is None:
        assert np.linalg.norm(np.cross(line, ray)) < 2e-3
        return
    matrix = np.stack([line, -ray], axis=1)
    (expected, _), *_ = np.linalg.lstsq(matrix, start - origin, rcond=None)
    np.testing.assert_allclose(found, expected, atol=1e-5 * max(1.0, abs(expected)))


@given(vectors, directions, vectors, directions)
@settings(max_examples=60)
def test_a_ray_meets_a_plane_there(point: Any, normal: Any, start: Any, toward: Any) -> None:
    met = on_plane(point, normal, (start, toward))
    unit = normal / np.linalg.norm(normal)
    if met is None:
        assert abs(toward @ unit) < 2e-3 * np.linalg.norm(toward)
        return
    scale = 1.0 + float(np.abs(met).max())
    assert abs((met - point) @ unit) < 1e-6 * scale
    assert np.linalg.norm(np.cross(met - start, toward)) < 1e-6 * scale * np.linalg.norm(toward)


@given(vectors, st.integers(0, 2), st.floats(-170.0, 170.0))
@settings(max_examples=30)
def test_turns_and_angles_agree(center: Any, axis: int, degrees: float) -> None:
    matrix = turn_about(center, axis, degrees)
    np.testing.assert_allclose(matrix[:3, :3] @ center + matrix[:3, 3], center, atol=1e-9)
    arm = np.roll((0.0, 1.0, 0.3), axis)
    turned = matrix[:3, :3] @ arm
    np.testing.assert_allclose(angle_about(np.eye(3)[axis], arm, turned), degrees, atol=1e-9)


def test_snaps_are_round_and_fit_into_the_gizmo() -> None:
    assert [snap_distance(length) for length in (4.0, 0.9, 24.0, 1e-3)] == pytest.approx(
        [1.0, 0.2, 5.0, 2e-4]
    )


def test_handles_stand_at_ends_and_control_points_also_below_maps() -> None:
    placed = TREE.scale(2.0).translate((1, 0, 0))
    names = [handle.name for handle in handles_of(placed, (0, 0, 1), 1.0)]
    assert names[-2:] == ["start 0", "end 0"]
    assert len(names) == 10
    start, end = control_points(placed, (0, 0, 1))
    np.testing.assert_allclose([start.position, end.position], [(3, 0, 0), (5, 2, 0)])
    assert moved_point(placed, (0, 0, 1), "end 0", (5, 4, 0)) == ((0, 0, 1), "end", (2.0, 2.0, 0.0))
    curve = Polyline(((0, 0, 0), (1, 1, 0), (2, 0, 0)), radius=0.2)
    assert [handle.name for handle in control_points(curve, ())] == ["points 0", "points 1", "points 2"]
    _, name, value = moved_point(curve, (), "points 1", (1, 3, 0))
    assert (name, value) == ("points", ((0, 0, 0), (1, 3, 0), (2, 0, 0)))
    twisted = Twist(Segment((1, 0, 0), (1, 0, 1), radius=0.2), degrees=90.0)
    ends = control_points(twisted, (0,))
    np.testing.assert_allclose([end.position for end in ends], [(1, 0, 0), (0, 1, 1)], atol=1e-8)
    _, name, value = moved_point(twisted, (0,), "end 0", (0, 2, 1))
    assert name == "end"
    np.testing.assert_allclose(value, (2, 0, 1), atol=1e-8)


@pytest.mark.parametrize(("length", "count"), [(1.0, 8), (math.nan, 9)])
def test_a_point_alone_has_its_gizmo_only_and_a_view_without_scale_warns_of_nothing(
    length: float, count: int
) -> None:
    assert len(handles_of(TREE, (0,), length)) == count


@pytest.mark.parametrize("name", ["move", "move z", "turn y", "scale", "end 0"])
def test_a_drag_follows_the_pointer_is_one_entry_and_is_undone(name: str) -> None:
    session = EditSession(decals.cover(TREE, count=12, images=["eye"]))
    actions, state = Actions(session), digest(session.document)
    actions.trees.select_node(0, (1,))
    place = next(handle.position for handle in actions.trees.handles(0.5) if handle.name == name)
    eye = np.array((1.0, 2.0, 9.0))
    target = place + np.array((0.2, 0.1, 0.3))
    actions.trees.begin_handle_drag(name, (eye, place - eye), 0.5)
    for share in (0.5, 1.0):
        actions.trees.drag_handle((eye, place + share * (target - place) - eye))
    actions.trees.end_drag()
    assert session.labels == ("move end 0" if name == "end 0" else name,)
    after = next(handle.position for handle in actions.trees.handles(0.5) if handle.name == name)
    if name in ("move", "end 0"):  # lies on the pointer's ray
        assert np.linalg.norm(np.cross(after - eye, target - eye)) < 1e-5
    elif name == "move z":
        np.testing.assert_allclose(after[:2], place[:2], atol=1e-6)
    positions = session.document.decals.decals.positions
    np.testing.assert_allclose(tree_of(session.document)(positions), 0.5, atol=0.02)
    session.undo()
    assert digest(session.document) == state
    actions.trees.drag_handle((eye, target - eye))  # the drag has ended
    actions.trees.begin_handle_drag(name, (eye, place - eye), 0.5)
    actions.trees.select_node(0, (0,))
    actions.trees.drag_handle((eye, target - eye))  # another node, a point without ends, is selected now
    assert digest(session.document) == state


@pytest.mark.parametrize("matrix", [turn_about(np.ones(3), 2, 40.0), scale_about(np.zeros(3), 1.5)])
def test_a_transformed_node_is_the_mapped_field(matrix: Any) -> None:
    tree = TREE.rotate((0, 1, 0), 30.0)
    session = EditSession(decals.Scene(objects=[TreeObject("t", tree)], camera=decals.Camera((0, 0, 9))))
    session.do(TransformPrimitive(0, (0, 1), matrix))
    inverse = np.linalg.inv(matrix)
    before = node_in_world(tree, (0, 1))
    after = node_in_world(tree_of(session.document), (0, 1))
    np.testing.assert_allclose(after(POINTS), before(POINTS @ inverse[:3, :3].T + inverse[:3, 3]), atol=2e-5)


def test_similar_maps_keep_the_kind_and_mirrors_join_like_copies() -> None:
    turned: Any = mapped(LIMB, turn_about(np.zeros(3), 2, 90.0))
    np.testing.assert_allclose((turned.start, turned.end), [(0, 1, 0), (-1, 2, 0)], atol=1e-12)
    larger: Any = mapped(replace(LIMB, width=0.3), scale_about(np.zeros(3), 2.0))
    assert (larger.start, larger.radius, larger.width) == ((2.0, 0.0, 0.0), 2.0 * LIMB.radius, 0.6)
    assert isinstance(mapped(LIMB, np.diag([1.0, 1.0, 2.0, 1.0])), Transform)
    session = EditSession(decals.cover(TREE, count=5, images=["eye"]))
    session.do(MirrorPrimitive(0, (1,)))
    image: Any = node_at(tree_of(session.document), (2,))
    assert (type(image), image.start, image.end) == (Segment, (-1.0, 0.0, 0.0), (-2.0, 1.0, 0.0))
    mirrored = POINTS * np.array((-1, 1, 1), np.float32)
    np.testing.assert_allclose(
        tree_of(session.document)(POINTS), tree_of(session.document)(mirrored), atol=1e-6
    )
    actions = Actions(session)
    actions.trees.select_node(0, (1,))
    actions.perform("mirror", lambda: None)
    assert session.labels[-1] == "mirror a primitive"


def test_a_drag_of_a_parallel_ray_does_nothing() -> None:
    handles = handles_of(TREE, (1,), 1.0)
    ray = (np.array((0.0, 0.0, 9.0)), np.array((0.0, 0.0, -1.0)))
    assert HandleDrag(handles, "move z", ray, 1.0).offset(ray, 0.0) is None
    level = (np.array((9.0, 0.0, 0.0)), np.array((-1.0, 0.0, 0.0)))
    assert HandleDrag(handles, "turn z", level, 1.0).matrix(level, snap=False) is None


@pytest.mark.parametrize(
    ("tree", "path", "start", "end"),
    [
        (TREE, (1,), (2.25, 1.2, 0), (2.4, 1.5, 0.2)),
        (TREE, (), (-1, 0, 0), (-1.6, 0.2, 0)),
        (TREE.twist(30.0), (0, 0), (0, 0, 1), (0.1, 0.1, 0.6)),
        (
            Point((0, 0, 0), radius=1.0) - Segment((0, 0, 1), (1, 0, 1), radius=0.3),
            (1,),
            (0, 0, 0.7),
            (0, 0, 0.5),
        ),
    ],
)
def test_a_dragged_point_of_the_surface_ends_where_it_is_dragged(
    tree: Any, path: Any, start: Any, end: Any
) -> None:
    session = EditSession(decals.cover(tree, count=12, images=["eye"]))
    before = digest(session.document)
    place = session.document.objects[0].surface.project([start])[0][0]
    session.do(DragSurface(0, path, place, end))
    changed: Any = tree_of(session.document)
    np.testing.assert_allclose(changed([end]), 0.5, atol=1e-4)
    positions = session.document.decals.decals.positions
    np.testing.assert_allclose(changed(positions), 0.5, atol=1e-4)
    others = [node_at(changed, (i,)) == node_at(tree, (i,)) for i in range(2)] if len(path) == 1 else []
    assert others[:1] == [True] * len(others[:1])
    session.undo()
    assert digest(session.document) == before


def test_the_least_change_moves_and_grows_a_ball_alike_and_nothing_else_is_dragged() -> None:
    ball: Any = Point((0, 0, 0), radius=1.0)
    session = EditSession(decals.cover(ball, count=3, images=["eye"]))
    session.do(DragSurface(0, (), (0, 1, 0), (0, 1.5, 0)))
    after: Any = tree_of(session.document)
    np.testing.assert_allclose((*after.center, after.radius), (0, 0.25, 0, 1.25), atol=0.01)
    with pytest.raises(InvalidEdit, match="start"):
        session.do(DragSurface(0, (), (0, 1), (0, 2, 0)))


def test_the_pull_brush_drags_the_surface_under_the_pointer_as_one_entry() -> None:
    scene = decals.cover(TREE, count=12, images=["eye"])
    rays = scene.camera.rays(100, 100)
    session = EditSession(scene)
    actions, state = Actions(session), digest(session.document)
    tools = PointerTools(actions, lambda x, y: (rays.origin, rays.directions(x, y)))
    actions.state.brush.brush = Brush.PULL
    assert not tools.press(0, 0)
    tools.release(0, 0)
    start = next((x, y) for x in range(99, 0, -1) for y in range(0, 100, 3) if tools.at(x, y))
    for way in (4, 9):
        tools.press(*start)
        for x in (4, way):
            tools.move(start[0] + x, start[1])
        assert tools.dragging
        tools.release(start[0] + way, start[1])
    assert set(session.labels) == {"drag the surface"}
    assert tools.at(start[0] + 6, start[1]) is not None
    tools.actions.trees.drag_surface((0, 0, 1), (0, 0, 2))  # the drag has ended
    while session.labels:
        session.undo()
    assert digest(session.document) == state


def test_a_drag_of_an_object_that_was_removed_since_the_press_is_refused() -> None:
    scene = decals.cover(TREE, count=12, images=["eye"])
    rays = scene.camera.rays(100, 100)
    session = EditSession(scene)
    actions = Actions(session)
    tools = PointerTools(actions, lambda x, y: (rays.origin, rays.directions(x, y)))
    actions.state.brush.brush = Brush.PULL
    start = next((x, y) for x in range(99, 0, -1) for y in range(0, 100, 3) if tools.at(x, y))
    tools.press(*start)
    session.do(RemoveObject(0))
    for x in (4, 8):
        tools.move(start[0] + x, start[1])
    assert "object" in actions.state.refusal
    tools.release(start[0] + 8, start[1])
    assert session.labels == ("remove an object",)


def test_the_surface_is_dragged_in_the_background_of_a_window() -> None:
    session = EditSession(decals.cover(TREE, count=12, images=["eye"]))
    actions = Actions(session, threaded=True)
    actions.trees.select_node(0, (0,))
    actions.state.begin_stroke("drag the surface")
    actions.trees.drag_surface((-1, 0, 0), (-1.2, 0, 0))
    assert actions.state.background.following
    actions.state.background.close()
