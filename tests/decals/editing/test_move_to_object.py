"""Nodes that move into the tree of another object: fields, flags, names, decals, undo, refusals."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blobtree import ISO, Node, Point, Ricci, Segment, Union
from blobtree.errors import InvalidNode
from blobtree.nodes.paths import Path as TreePath
from blobtree.nodes.paths import moved, node_at, node_in_world, with_node
from blobtree.nodes.surgery import SOFTNESS, move_branch_into
from decals import Camera, DecalImage, Decals, MeshObject, Scene, TreeObject, load_scene, save_scene, scatter
from decals.editing import Actions, EditSession, MoveToObject, RemoveObject
from decals.errors import ImplicitDecalsError, InvalidEdit, InvalidInput
from tests.decals.editing.scenes import box, digest, tree_of
from tests.decals.editing.test_tree_commands import POINTS, quiet, trees
from tests.oracles.blobtree import value

BODY = Point((0, 0, 0), radius=1.0) + Segment((0.9, 0.5, 0), (1.4, 1.3, 0), radius=0.5)
HEAD = (Point((0, 0, 0), radius=0.6) | Point((0.4, 0, 0), radius=0.4)).rotate((0, 0, 1), 30)
HEADS = HEAD.translate((0, 1.0, 0)) + Point((0, -2.5, 0), radius=0.5)
BOX = box((-4, -1, -1), (-2, 1, 1))


def paths_of(tree: Node, path: TreePath = ()) -> list[TreePath]:
    below = [found for step, child in enumerate(tree.children) for found in paths_of(child, (*path, step))]
    return [path, *below]


def joined(tree: Node, a: Any, b: Any) -> Any:
    """What the root of a tree makes of its own field and that of a new operand, in float64."""
    if isinstance(tree, Union):
        return np.maximum(a, b)
    if isinstance(tree, Ricci):
        return (np.maximum(a, 0) ** SOFTNESS + np.maximum(b, 0) ** SOFTNESS) ** (1 / SOFTNESS)
    return a + b


@quiet
@given(source=trees, tree=trees, choice=st.integers(0, 99), place=st.integers(0, 99))
def test_a_moved_node_stays_in_the_world_and_joins_the_other_tree(
    source: Any, tree: Any, choice: int, place: int
) -> None:
    paths, targets = paths_of(source), paths_of(tree)
    path, target = paths[choice % len(paths)], targets[place % len(targets)]
    rest, after, found = move_branch_into(source, path, tree, target)
    branch = node_in_world(source, path)
    assert node_at(after, found) is node_at(source, path)
    np.testing.assert_allclose(
        value(node_in_world(after, found), POINTS), value(branch, POINTS), rtol=0, atol=1e-6
    )
    far = with_node(source, path, moved(node_at(source, path), (1000, 0, 0)))
    left = np.zeros(len(POINTS)) if rest is None else value(rest, POINTS)
    np.testing.assert_allclose(left, value(far, POINTS), rtol=0, atol=1e-6)
    _, at_root, _ = move_branch_into(source, path, tree, ())
    expected = joined(tree, value(tree, POINTS), value(branch, POINTS))
    np.testing.assert_allclose(value(at_root, POINTS), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("target", "found"),
    [((), (2,)), ((0,), (1,)), ((1,), (2,)), ((1, 0), (1, 0, 2)), ((1, 0, 0), (1, 0, 1))],
)
def test_a_node_becomes_the_last_operand_or_the_next_sibling(target: TreePath, found: TreePath) -> None:
    tree = BODY.children[0] + HEAD
    ball = Point((0, 0, 2), radius=0.3)
    rest, after, path = move_branch_into(ball + BODY, (0,), tree, target)
    assert rest == BODY
    assert path[: len(found)] == found
    assert node_at(after, path) is ball


@cache
def _decals() -> Decals:
    surfaces = TreeObject("heads", HEADS), MeshObject("box", *BOX), TreeObject("body", BODY)
    return scatter([item.surface for item in surfaces], count=150)


def scene(*, names: Any = None, **flags: Any) -> Scene:
    """A body, a tree of two parts of which one touches it, and a mesh apart; with decals on all."""
    objects = (
        TreeObject("heads", HEADS, names=names or {}, **flags),
        MeshObject("box", *BOX),
        TreeObject("body", BODY, names={(1,): "arm"}, hidden=((1,),)),
    )
    decals = _decals()
    images = (DecalImage.load("eye"),)
    return Scene(objects=objects, decals=decals, images=images, camera=Camera.framing(objects[0].bounds))


MOVES = [((0,), ()), ((0, 0, 0), (1,)), ((), (0,)), ((1,), (1,))]


@pytest.mark.parametrize(("path", "target"), MOVES)
def test_undo_and_files_are_exact(path: TreePath, target: TreePath, tmp_path: Path) -> None:
    session = EditSession(scene(names={(0, 0): "face"}, locked=((0, 0, 0, 1),)))
    first, files = digest(session.document), [tmp_path / name for name in ("0.json", "1.json", "2.json")]
    save_scene(session.document.scene, files[0])
    session.do(MoveToObject(0, path, 2, target, "move it"))
    last, objects = digest(session.document), session.document.objects
    save_scene(session.document.scene, files[1])
    for item, read in zip(objects, load_scene(files[1]).objects, strict=True):
        if isinstance(item, TreeObject):
            assert isinstance(read, TreeObject)
            assert (read.tree, read.names) == (item.tree, item.names)
            assert (read.hidden, read.locked) == (item.hidden, item.locked)
    assert session.undo() == "move it"
    save_scene(session.document.scene, files[2])
    assert (digest(session.document), files[2].read_bytes()) == (first, files[0].read_bytes())
    session.redo()
    assert digest(session.document) == last


@pytest.mark.parametrize(("path", "target"), MOVES)
def test_decals_stay_or_move_to_the_new_surface(path: TreePath, target: TreePath) -> None:
    session = EditSession(scene())
    before = session.document.decals.decals
    old = [tree_of(session.document, number)(before.positions) for number in (0, 2)]
    session.do(MoveToObject(0, path, 2, target))
    numbers, after = session.document.decals.numbers, session.document.decals.decals
    items = [item for item in session.document.objects if isinstance(item, TreeObject)]
    gaps = np.min([np.abs(item.tree(after.positions) - ISO) for item in items], axis=0)
    on_mesh = after.positions[:, 0] < -1.9
    assert on_mesh.sum() > 20
    assert gaps[~on_mesh].max() < 1e-3
    same = (before.positions[numbers] == after.positions).all(axis=1)
    assert same[on_mesh].all()
    new = [item.tree(before.positions[numbers]) for item in items]
    on_surface = np.abs(np.array(new) - ISO).min(axis=0) <= np.abs(np.array(old) - ISO).min(axis=0)[numbers]
    assert same[on_surface].all()
    assert 50 < same.sum() < len(same)
    gone = np.setdiff1d(np.arange(len(before)), numbers)
    assert all(item.tree(before.positions[gone]).max(initial=0) < ISO for item in items)


def test_names_and_flags_go_along() -> None:
    names = {(0,): "head", (0, 0, 0): "skull", (1,): "foot"}
    session = EditSession(scene(names=names, hidden=((0, 0, 0, 1), (1,)), locked=((0, 0, 0, 0),)))
    session.do(MoveToObject(0, (0,), 2, (0,)))
    heads, _, body = session.document.objects
    assert isinstance(heads, TreeObject)
    assert isinstance(body, TreeObject)
    assert (heads.names, heads.hidden, heads.locked) == ({(): "foot"}, ((),), ())
    assert body.names == {(1,): "head", (1, 0, 0): "skull", (2,): "arm"}
    assert (body.hidden, body.locked) == (((1, 0, 0, 1), (2,)), ((1, 0, 0, 0),))


def test_an_object_that_moves_whole_disappears_and_names_its_node() -> None:
    session = EditSession(scene(hidden=((),)))
    actions = Actions(session)
    actions.outline.change("object 0", "move", "object 2")
    assert [item.name for item in session.document.objects] == ["box", "body"]
    body = session.document.objects[1]
    assert isinstance(body, TreeObject)
    assert (body.names[(2,)], body.hidden) == ("heads", ((1,), (2,)))
    assert session.labels[0] == "move heads into body"
    assert actions.state.primitive == (1, (2,))
    actions.outline.change("1/2/1", "move", "1/0")
    assert session.labels[1:] == ("move in the tree",)


def test_a_node_that_moves_is_selected_and_named_by_the_label() -> None:
    session = EditSession(scene())
    actions = Actions(session)
    actions.outline.change("2/1", "move", "0/1")
    assert session.labels[0] == "move arm into heads"
    assert actions.state.primitive == (0, (2,))
    actions.outline.change("0/2", "move", "object 2")
    assert session.labels[1:] == ("move arm into body",)
    assert tree_of(session.document, 2) == BODY


@pytest.mark.parametrize("key", ["object 1", "0/0", "object 0"])
def test_meshes_do_not_join_trees(key: str) -> None:
    session = EditSession(scene())
    before = digest(session.document)
    with pytest.raises(InvalidEdit, match="a mesh"):
        Actions(session).outline.change(key, "move", "object 1" if key != "object 1" else "2/0")
    assert digest(session.document) == before


@pytest.mark.parametrize(
    ("command", "error", "message"),
    [
        (MoveToObject(0, (0,), 0, ()), InvalidEdit, "another object"),
        (MoveToObject(0, (0,), 9, ()), InvalidEdit, "object: expected"),
        (MoveToObject(-1, (0,), 2, ()), InvalidEdit, "object: expected"),
        (MoveToObject(0, (5,), 2, ()), InvalidNode, "path"),
        (MoveToObject(0, (0,), 2, (0, 0)), InvalidNode, "path"),
        (MoveToObject(0, None, 2, ()), InvalidInput, "path"),  # type: ignore[arg-type]
        (MoveToObject(0, (0,), 2, "x"), InvalidInput, "path"),  # type: ignore[arg-type]
        (MoveToObject(0, (0,), None, ()), InvalidEdit, "object"),  # type: ignore[arg-type]
    ],
)
def test_other_moves_are_refused(command: Any, error: Any, message: str) -> None:
    session = EditSession(scene())
    before = digest(session.document)
    with pytest.raises(error, match=message):
        session.do(command)
    assert digest(session.document) == before


def test_places_below_warps_are_refused() -> None:
    twisted = BODY.twist(20)
    for source, path, tree, target in ((twisted, (0, 0), BODY, ()), (BODY, (0,), twisted, (0,))):
        with pytest.raises(InvalidNode, match="lies below a Twist; move that as a whole"):
            move_branch_into(source, path, tree, target)
    assert move_branch_into(twisted, (), BODY, ())[2] == (2,)


def test_locked_objects_keep_their_nodes_and_take_none() -> None:
    for number in (0, 2):
        session = EditSession(scene())
        actions = Actions(session)
        actions.visibility.flag_node("locked", number, ())
        before = digest(session.document)
        with pytest.raises(InvalidEdit, match="is locked"):
            actions.outline.change("0/0", "move", "2/0")
        assert digest(session.document) == before
    session = EditSession(scene(locked=((0, 0, 0, 0),)))
    with pytest.raises(InvalidEdit, match="a Point of 'heads' is locked"):
        session.do(RemoveObject(0))


def test_an_object_that_decals_name_does_not_disappear() -> None:
    first = scene()
    decals = first.decals.replace(receivers=["heads"] * len(first.decals))
    whole = Scene(objects=first.objects, decals=decals, images=first.images, camera=first.camera)
    session = EditSession(whole)
    with pytest.raises(ImplicitDecalsError, match="got 'heads'"):
        session.do(MoveToObject(0, (), 2, ()))
