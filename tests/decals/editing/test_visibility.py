"""Hidden and locked objects, nodes and layers: what is drawn, picked, edited, undone and saved."""

import pickle
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Difference, Node, Point, Union
from blobtree.errors import InvalidNode
from blobtree.nodes.surgery import without_branches
from decals import MeshObject, TreeObject
from decals.editing import (
    Actions,
    DeleteDecals,
    EditSession,
    FlagNodes,
    HideDecals,
    LockLayers,
    MovePrimitive,
    RemoveObject,
    RemovePrimitive,
    RenameLayer,
    RenameNode,
    RenameObject,
    ReplaceNode,
    SetValues,
    ShowDecals,
    pick,
)
from decals.editing.visibility import isolating
from decals.errors import InvalidEdit, InvalidScene
from decals.scenes.script import write_script
from tests.decals.editing.scenes import box, digest, goes_back_and_forth, scene, tree_of

CORNERS, FACES = box((0, 0, 0), (1, 1, 1))
A, B, C, D = (Point((x, 0.0, 0.0), radius=1.0) for x in (0.0, 1.2, 3.0, 5.0))
TOOL = Point((0, 0, 1), radius=0.3)
TREE = Difference(Union((A + B, C, D)), TOOL)


@pytest.mark.parametrize(
    ("paths", "expected"),
    [
        ([(1,)], Union((A + B, C, D))),
        ([(0, 0, 1), (0, 1), (0, 2)], Difference(A, TOOL)),
        ([(0, 0, 0), (0, 0, 1), (1,)], Union((C, D))),
        ([(0, 0), (0, 0, 1)], Difference(Union((C, D)), TOOL)),
        ([(0, 0, 0), (0, 2), (1,)], Union((B, C))),
    ],
)
def test_branches_are_left_out_together(paths: Any, expected: Node) -> None:
    assert without_branches(TREE, paths) == expected


@pytest.mark.parametrize("paths", [[()], [(0,)], [(0, 0), (0, 1), (0, 2)]])
def test_a_part_of_a_tree_is_left(paths: Any) -> None:
    with pytest.raises(InvalidNode, match="got all of it"):
        without_branches(TREE, paths)


def test_hidden_nodes_are_neither_drawn_nor_picked_and_come_back(vtk_display: None) -> None:
    shown, part = (decals.TreeObject("blobs", tree) for tree in (A + C, A))
    camera = decals.Camera.framing(shown.bounds)
    session = EditSession(decals.Scene(objects=[shown], camera=camera))
    session.do(FlagNodes(hidden={0: ((1,),)}))
    assert pick(session.document, (3, 0, 8), (0, 0, -1)) is None
    pixels = [
        one.render(size=(64, 48)).pixels
        for one in (session.document.scene, decals.Scene(objects=[part], camera=camera))
    ]
    np.testing.assert_array_equal(pixels[0], pixels[1])
    session.do(MovePrimitive(0, (0,), (0.1, 0, 0)))
    with pytest.raises(InvalidEdit, match="no part of 'blobs' would be left"):
        session.do(FlagNodes(hidden={0: ((0,), (1,))}))
    session.do(RemovePrimitive(0, (0,)))
    assert session.document.objects[0].hidden == ((),)  # all that is left was hidden


def test_hidden_objects_are_skipped(vtk_display: None) -> None:
    session = EditSession(scene())
    session.do(FlagNodes(hidden={0: ((),)}))
    assert [item.name for item in session.document.shown_objects] == ["box"]
    met = pick(session.document, (-2.5, 0, 9), (0, 0, -1))
    assert met is not None
    assert met.object == 1
    assert pick(session.document, (0, 0, 9), (0, 0, -1)) is None
    whole, alone = session.document.scene, scene().replace(objects=scene().objects[1:])
    np.testing.assert_array_equal(whole.render(size=(64, 48)).pixels, alone.render(size=(64, 48)).pixels)
    goes_back_and_forth(session)


def test_paths_follow_the_structure_and_isolating_hides_the_others() -> None:
    session = EditSession(
        decals.Scene(
            objects=[TreeObject("t", TREE), MeshObject("box", *box((7, 0, 0), (8, 1, 1)))],
            camera=decals.Camera((0, 0, 9)),
        )
    )
    session.do(FlagNodes(hidden={0: ((0, 2),)}, locked={0: ((0, 0, 1),)}))
    session.do(RemovePrimitive(0, (0, 0, 0)))
    item = session.document.objects[0]
    assert (item.hidden, item.locked) == (((0, 2),), ((0, 0),))
    session.do(RemovePrimitive(0, (0, 1)))
    assert (session.document.objects[0].hidden, tree_of(session.document)) == (
        ((0, 1),),
        Difference(Union((B, D)), TOOL),
    )
    session.do(isolating(session.document, 0, (0, 0)))
    assert [item.hidden for item in session.document.objects] == [((0, 1), (1,)), ((),)]
    (shown,) = session.document.shown_objects
    assert isinstance(shown, TreeObject)
    assert shown.tree == B


def test_locked_parts_refuse_edits_and_the_rest_takes_them() -> None:
    session = EditSession(scene())
    session.do(FlagNodes(locked={0: ((0, 0),), 1: ((),)}))
    wrong: list[Any] = [
        MovePrimitive(0, (0, 0), (0.1, 0, 0)),
        RemovePrimitive(0, (0, 0)),
        RemoveObject(0),
        RemoveObject(1),
        RenameObject(1, "crate"),
    ]
    before = digest(session.document)
    for command in wrong:
        with pytest.raises(InvalidEdit, match="is locked; unlock it in the outline"):
            session.do(command)
    assert digest(session.document) == before
    session.do(MovePrimitive(0, (0, 1), (0.02, 0, 0)))
    session.do(RenameObject(0, "body"))
    session.do(FlagNodes(locked={0: (), 1: ()}))
    session.do(RemoveObject(1))
    goes_back_and_forth(session)


def test_locked_layers_keep_their_decals_and_are_not_selected() -> None:
    session = EditSession(scene())
    actions = Actions(session)
    session.do(SetValues.each(range(20), layers=2))
    session.do(LockLayers([2]))
    with pytest.raises(InvalidEdit, match="layer 2 is locked"):
        session.do(DeleteDecals([19, 20]))
    actions.perform("select_all", lambda: None)
    assert actions.state.selection == tuple(range(20, 60))
    positions = session.document.decals.take(range(20)).positions
    session.do(MovePrimitive(0, (0,), (0.3, 0, 0)))  # locked decals follow the surface
    assert (session.document.decals.take(range(20)).positions != positions).any()
    actions.visibility.flag_layer("locked", 2)
    session.do(DeleteDecals([19, 20]))
    goes_back_and_forth(session)


def test_hidden_layers_come_back_bit_for_bit_and_are_saved(tmp_path: Path) -> None:
    session = EditSession(scene())
    actions = Actions(session)
    session.do(SetValues.each(range(20), layers=2))
    state = digest(session.document)
    actions.visibility.flag_layer("hidden", 2)
    assert session.document.decals.numbers.tolist() == list(range(20, 60))
    session.do(LockLayers([0]))
    session.do(FlagNodes(hidden={0: ((1,),)}, locked={1: ((),)}))
    session.save(tmp_path / "scene.json")
    loaded = decals.load_scene(tmp_path / "scene.json")
    assert (len(loaded.decals), len(loaded.hidden_decals), loaded.locked_layers) == (40, 20, (0,))
    assert [item.hidden for item in loaded.objects] == [((1,),), ()]
    assert [item.locked for item in loaded.objects] == [(), ((),)]
    again = EditSession(loaded)
    again.do(ShowDecals([0]))  # none of that layer is hidden
    assert again.labels == ()
    again.do(ShowDecals([2]))
    assert len(again.document.decals) == 60
    assert len(again.document.hidden.numbers) == 0
    session.undo()
    session.undo()
    actions.visibility.flag_layer("hidden", 2)
    assert digest(session.document) == state
    goes_back_and_forth(session)


def test_shown_decals_return_to_a_surface_that_moved() -> None:
    session = EditSession(decals.cover(A + B, count=20, images=["eye"]))
    session.do(HideDecals(range(20)))
    session.do(MovePrimitive(0, (1,), (0.6, 0, 0)))
    session.do(ShowDecals())
    positions = session.document.decals.decals.positions
    np.testing.assert_allclose(tree_of(session.document)(positions), 0.5, atol=0.02)


def test_keys_hide_isolate_lock_and_show(tmp_path: Path) -> None:
    session = EditSession(scene())
    actions, document = Actions(session), session.document

    def on_tree() -> Any:
        return pick(document, (0, 0, 9), (0, 0, -1))

    actions.perform("hide", on_tree)
    assert [item.hidden for item in document.objects] == [((),), ()]
    actions.perform("show_all", on_tree)
    assert [item.hidden for item in document.objects] == [(), ()]
    actions.perform("isolate", on_tree)
    assert [item.hidden for item in document.objects] == [(), ((),)]
    actions.perform("isolate", on_tree)
    assert [item.hidden for item in document.objects] == [(), ()]
    actions.perform("lock", on_tree)
    assert document.objects[0].locked == ((),)
    actions.perform("select_primitive", on_tree)
    actions.perform("thicker", on_tree)
    assert "is locked" in actions.state.message
    actions.perform("lock", lambda: None)
    assert len(document.objects[0].locked) == 2  # the selected primitive, too
    actions.state.selection = (0, 1)
    actions.perform("hide", lambda: None)
    assert (actions.state.selection, len(document.decals)) == ((), 58)
    goes_back_and_forth(session)


def test_an_isolated_layer_is_shown_alone_and_then_all() -> None:
    scene = decals.cover(A, count=9, images=["eye"])
    layers = np.arange(9) % 3
    session = EditSession(scene.replace(decals=scene.decals.replace(layers=layers)))
    actions, document, before = Actions(session), session.document, digest(session.document)
    actions.visibility.flag_layer("hidden", 1)
    actions.visibility.isolate_layer(1)
    assert document.decals.numbers.tolist() == [1, 4, 7]
    actions.visibility.isolate_layer(2)
    assert document.decals.numbers.tolist() == [2, 5, 8]
    actions.visibility.isolate_layer(2)
    assert document.decals.numbers.tolist() == [*range(9)]
    assert session.labels == ("hide decals", "isolate a layer", "isolate a layer", "show all")
    actions.go_to(0)
    assert digest(document) == before


def test_flags_that_change_nothing_leave_no_entry() -> None:
    session = EditSession(decals.cover(A + B, count=3, images=["eye"]))
    actions = Actions(session)
    session.do(FlagNodes({0: ()}, {0: ()}))
    actions.perform("show_all", lambda: None)
    actions.visibility.isolate_node(0, ())  # there is nothing else to hide
    assert session.next_undo is None
    actions.visibility.flag_layer("locked", 0)
    actions.visibility.flag_layer("locked", 0)
    assert session.labels == ("lock", "unlock")


def test_decals_on_hidden_parts_are_not_selected() -> None:
    first, second = TreeObject("one", A + B), TreeObject("other", D)
    session = EditSession(decals.cover([first, second], count=60, images=["eye"]))
    actions, document = Actions(session), session.document
    positions = document.decals.decals.positions
    on_first, left = positions[:, 0] < 3.0, positions[:, 0] < -0.5
    everything, on_one = (tuple(np.flatnonzero(rows).tolist()) for rows in (on_first | True, on_first))
    actions.state.selection = everything
    actions.visibility.isolate_node(0, ())
    assert actions.state.selection == on_one
    actions.perform("select_all", lambda: None)
    assert actions.state.selection == on_one
    actions.visibility.isolate_node(0, (0,))  # a part of a blend
    kept = np.isin(np.arange(60), actions.state.selection)
    assert kept[left].all()
    assert not kept[positions[:, 0] > 1.6].any()
    actions.perform("undo", lambda: None)
    actions.perform("undo", lambda: None)
    actions.perform("select_all", lambda: None)
    assert actions.state.selection == everything
    for number in (0, 1):
        actions.visibility.flag_node("hidden", number, ())
    assert actions.state.selection == ()


@pytest.mark.parametrize("wrong", [((5,),), ((0, -1),), (0,), "x", ((0.5,),), 3, (("a",),)])
def test_wrong_paths_are_refused(wrong: Any) -> None:
    with pytest.raises(InvalidScene, match="expected paths of its nodes"):
        TreeObject("t", TREE, hidden=wrong)
    with pytest.raises(InvalidScene, match="expected paths of its nodes"):
        MeshObject("box", CORNERS, FACES, locked=wrong)


def test_names_stay_with_their_nodes_and_layers_and_are_saved(tmp_path: Path) -> None:
    session = EditSession(scene())
    surface = session.document.objects[0].surface
    for command in (RenameNode(0, (0,), "left"), RenameNode(0, (1,), "right"), RenameNode(0, (), "body")):
        session.do(command)
    session.do(RenameLayer(3, "rust"))
    session.do(RenameLayer(0, "scales"))
    session.do(RenameObject(0, "snail"))
    assert session.document.objects[0].surface is surface
    session.do(RenameNode(0, (1,), "right"))  # it has that name
    given = "left", "right", "body", "rust", "scales", "snail"
    assert session.labels == tuple(f"rename to '{name}'" for name in given)
    session.do(FlagNodes(hidden={0: ((1,),)}))
    tree = tree_of(session.document)
    session.do(ReplaceNode(0, (), Union(tree.children)))  # of the same operands
    session.do(MovePrimitive(0, (0, 0), (0.1, 0, 0)))
    session.save(tmp_path / "scene.json")
    write_script(session.document.scene, tmp_path / "scene.py")
    loaded = decals.load_scene(tmp_path / "scene.json")
    for rebuilt in (loaded, runpy.run_path(str(tmp_path / "scene.py"))["scene"], session.document.scene):
        assert rebuilt.layer_names == {0: "scales", 3: "rust"}
        item = rebuilt.objects[0]
        assert isinstance(item, TreeObject)
        assert item.names == {(): "body", (0,): "left", (1,): "right"}
        assert item.hidden == ((1,),)
    assert pickle.loads(pickle.dumps(loaded)).layer_names == loaded.layer_names
    session.do(FlagNodes(hidden={0: ()}))
    session.do(RenameLayer(3, ""))
    session.do(RenameNode(0, (), ""))
    session.do(RemovePrimitive(0, (0,)))
    item = session.document.objects[0]
    assert isinstance(item, TreeObject)
    assert (item.names, session.document.layer_names) == ({(): "right"}, {0: "scales"})
    goes_back_and_forth(session)
    wrong: list[Any] = [
        RenameNode(0, (7,), "x"),
        RenameNode(0, (7,), ""),
        RenameNode(0, np.array([]), "x"),  # type: ignore[arg-type]
        RenameNode(0, (), np.array([])),  # type: ignore[arg-type]
        RenameNode(1, (), "x"),
        RenameNode(0, (), 3),  # type: ignore[arg-type]
        RenameNode(0, (), "\ud800"),
        RenameLayer(0, " "),
        RenameLayer("x", "x"),  # type: ignore[arg-type]
    ]
    for one in wrong:
        with pytest.raises((InvalidEdit, InvalidScene, InvalidNode), match="expected"):
            session.do(one)
    for names in ((), "ab", {(5,): "x"}, {0: "x"}, {(): ""}):
        with pytest.raises(InvalidScene, match="expected"):
            TreeObject("t", TREE, names=names or [(0,)])  # type: ignore[arg-type]
    with pytest.raises(InvalidScene, match=r"got \[\(5,\)\]"):
        TreeObject("t", TREE, names={(5,): "x"})
