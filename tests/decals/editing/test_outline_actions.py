"""Parts of a scene by their keys, their changes, and steps through the history."""

from typing import Any

import numpy as np
import pytest

import decals
from blobtree import Mirror, Point, Segment
from decals import TreeObject
from decals.editing import Actions, EditSession, SetValues
from decals.editing.outline_actions import Part
from decals.editing.tree_actions import _surface_check
from decals.editing.visibility import RenumberLayers
from decals.errors import InvalidEdit, InvalidInput
from tests.decals.editing.scenes import digest, goes_back_and_forth, scene, tree_of


@pytest.mark.parametrize(
    ("key", "part"),
    [
        ("object 1", Part("object", 1)),
        ("layer -3", Part("layer", -3)),
        ("image 0", Part("image", 0)),
        ("0", Part("node", 0)),
        ("2/0/1", Part("node", 2, (0, 1))),
    ],
)
def test_a_key_names_a_part(key: str, part: Part) -> None:
    assert (Part.named(key), part.key) == (part, key)


@pytest.mark.parametrize(
    "key", ["", "x", "object", "object x", "object 0/1", "node 0", "0//1", None, 1.5, ()]
)
def test_other_texts_name_no_part(key: Any) -> None:
    with pytest.raises(InvalidEdit, match="row: expected that of an object, a node"):
        Part.named(key)


def test_a_node_is_that_of_its_row_or_the_root_of_an_object() -> None:
    assert (Part.node("object 1"), Part.node("0/1")) == (Part("node", 1), Part("node", 0, (1,)))
    with pytest.raises(InvalidEdit, match="row: expected that of an object or a node, got 'layer 0'"):
        Part.node("layer 0")


@pytest.mark.parametrize(("number", "place"), [(0, 2), (2, 0), (1, 0), (1, 1), (0, 1)])
def test_objects_and_layers_take_the_place_of_others(number: int, place: int) -> None:
    actions = Actions(EditSession(scene()))
    change, document = actions.outline.change, actions.state.session.document
    change("object 1", "duplicate")
    levels, numbers = (-3, 0, 7), document.decals.numbers
    actions.state.run(SetValues.each(numbers[:20], "layers", layers=levels[0]))
    actions.state.run(SetValues.each(numbers[20:30], "layers", layers=levels[2]))
    change("layer 7", "rename", "top")
    change("layer 7", "hide")
    change("layer -3", "lock")
    layers = np.zeros(len(numbers), np.int64)
    layers[:20], layers[20:30] = levels[0], levels[2]
    expected = [*levels]
    expected.insert(place, expected.pop(number))
    objects = [item.name for item in document.objects]
    objects.insert(place, objects.pop(number))
    change(f"object {number}", "reorder", f"object {place}")
    change(f"layer {levels[number]}", "reorder", f"layer {levels[place]}")
    assert [item.name for item in document.objects] == objects
    after = dict(zip(expected, levels, strict=True))
    shown = document.decals.take(document.decals.numbers).layers
    np.testing.assert_array_equal(
        shown, [after[layer] for layer in np.delete(layers, slice(20, 30)).tolist()]
    )
    assert set(document.hidden.decals.layers.tolist()) == {after[7]}
    assert (document.locked_layers, document.layer_names) == ((after[-3],), {after[7]: "top"})
    goes_back_and_forth(actions.state.session)


def test_a_mirror_takes_what_is_moved_onto_it() -> None:
    tree = Mirror(Point((1, 0, 0), radius=0.5)) + Point((0, 0, 0), radius=1.0)
    horn = Point((1, 1, 0), radius=0.4)
    models = [TreeObject("body", tree + horn), TreeObject("far", Point((2, 3, 0), radius=0.4))]
    actions = Actions(EditSession(decals.cover(models, count=8, images=["eye"])))
    session, document = actions.state.session, actions.state.session.document
    before = digest(document)
    for key, place, count in (("0/2", (1, 1, 0), 1), ("object 1", (2, 3, 0), 0)):
        actions.outline.change(key, "move", "0/0")
        ends = np.array([place, (-place[0], *place[1:])], np.float32)
        values = tree_of(document)(ends)
        np.testing.assert_allclose(values[0], values[1], rtol=1e-5)
        assert values.min() > 0.9
        assert len(document.objects) == count + 1
    with pytest.raises(InvalidInput, match="outside the branch"):
        actions.outline.change("0/0", "move", "0/0")
    while session.labels:
        session.undo()
    assert digest(document) == before


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("layer 0", "layer 5"),
        ("layer 5", "layer 0"),
        ("layer 0", "object 0"),
        ("object 0", "object 9"),
        ("object 0", "0"),
    ],
)
def test_what_takes_no_place_is_refused(key: str, value: str) -> None:
    actions = Actions(EditSession(scene()))
    actions.outline.change("layer 3", "rename", "empty")
    before = digest(actions.state.session.document)
    with pytest.raises((InvalidEdit, InvalidInput)):
        actions.outline.change(key, "reorder", value)
    with pytest.raises(InvalidEdit, match="expected one that"):
        actions.outline.change("image 0", "reorder", "image 1")
    with pytest.raises(InvalidEdit, match="a number for each alone"):
        RenumberLayers({0: 3, 3: 3}).compute(actions.state.session.document)
    assert digest(actions.state.session.document) == before


def test_changes_are_undone_exactly() -> None:
    actions = Actions(EditSession(scene()))
    change, document = actions.outline.change, actions.state.session.document
    change("0/0", "rename", "body")
    change("layer 0", "rename", "scales")
    change("object 1", "duplicate")
    change("image 1", "move", "layer 0")
    change("0/1", "hide")
    change("0/0", "lock")
    assert [item.name for item in document.objects] == ["blob", "box", "box 2"]
    blob = document.objects[0]
    assert isinstance(blob, TreeObject)
    assert (blob.names, blob.hidden, blob.locked) == ({(0,): "body"}, ((1,),), ((0,),))
    assert set(document.decals.decals.images.tolist()) == {1}
    goes_back_and_forth(actions.state.session)


def test_marked_nodes_of_several_objects_change_together() -> None:
    actions = Actions(EditSession(scene()))
    change, session = actions.outline.change, actions.state.session
    change("object 0", "duplicate")
    marked = ["0/0/1", "2/0/1", "2/0/0/0"]

    def flags(name: str) -> list[Any]:
        return [getattr(item, name) for item in session.document.objects]

    change("2/0/1", "hide")
    change("0/0/1", "hide", None, marked)
    assert flags("hidden") == [((0, 1),), (), ((0, 0, 0), (0, 1))]
    change("2/0/1", "hide", None, marked)
    assert flags("hidden") == [(), (), ()]
    change("2/0/1", "lock", None, marked)
    assert flags("locked") == [((0, 1),), (), ((0, 0, 0), (0, 1))]
    assert session.labels[1:] == ("hide", "hide", "show", "lock")
    before = digest(session.document)
    for other, message in (("remove", "is locked"), ("group", "operands of one combination")):
        with pytest.raises(InvalidEdit, match=message):
            change("2/0/1", other, None, marked)
    assert digest(session.document) == before
    change("2/0/1", "lock", None, marked)
    with pytest.raises(InvalidEdit, match="operands of one combination"):
        change("2/0/0/1", "group", None, ["0/0/0", "2/0/0/1"])
    change("0/0/1", "remove", None, marked)
    first, second = (tree_of(session.document, number) for number in (0, 2))
    assert (type(first.children[0]), type(second.children[0])) == (Point, Segment)
    assert session.labels[5:] == ("unlock", "remove a primitive")
    goes_back_and_forth(session)


def test_marked_layers_change_together() -> None:
    actions = Actions(EditSession(scene()))
    change, session = actions.outline.change, actions.state.session
    document = session.document
    numbers = document.decals.numbers
    session.do(SetValues.each(numbers[:20], "raise", layers=1))
    session.do(SetValues.each(numbers[20:30], "raise", layers=2))
    marked = ["layer 1", "layer 2"]
    np.testing.assert_array_equal(document.decals_of_layer(1, 2), numbers[:30])
    change("layer 2", "hide")
    change("layer 1", "hide", None, marked)
    assert set(document.hidden.decals.layers.tolist()) == {1, 2}
    change("layer 2", "hide", None, marked)
    assert not len(document.hidden.numbers)
    change("layer 0", "lock")
    change("layer 2", "lock", None, marked)
    assert sorted(document.locked_layers) == [0, 1, 2]
    change("layer 1", "lock", None, marked)
    assert document.locked_layers == (0,)
    change("layer 0", "lock", None, marked)
    change("layer 1", "remove", None, [*marked, "0/1"])
    np.testing.assert_array_equal(document.decals.numbers, numbers[30:])
    assert len(session.labels) == 10
    goes_back_and_forth(session)


@pytest.mark.parametrize("number", [0, 1])
def test_an_object_is_duplicated_beside_itself(number: int) -> None:
    actions = Actions(EditSession(scene()))
    document = actions.state.session.document
    actions.visibility.flag_node("locked", number, ())
    first = document.objects[number]
    actions.outline.change(f"object {number}", "duplicate")
    copy = document.objects[2]
    assert (copy.name, copy.locked, type(copy)) == (f"{first.name} 2", ((),), type(first))
    (low, high), (low_2, high_2) = first.bounds, copy.bounds
    offset = low_2 - low
    distance = np.linalg.norm(offset)
    assert np.abs(offset / distance) @ (high - low) == pytest.approx(distance, rel=1e-2)  # just apart
    eye, target = (np.asarray(point) for point in actions.state.camera.eye_and_target())
    assert abs(offset @ (eye - target)) < 1e-2 * distance  # as seen
    np.testing.assert_allclose(high_2 - low_2, high - low, rtol=1e-2)
    assert actions.state.session.labels[-1] == f"duplicate {first.name}"
    assert actions.state.primitive == ((2, ()) if number == 0 else None)
    goes_back_and_forth(actions.state.session)


@pytest.mark.parametrize(
    "change", ["hide", "lock", "isolate", "rename", "remove", "duplicate", "group", "move"]
)
@pytest.mark.parametrize("key", ["7/0", "object 7", "image 7"])
def test_parts_that_are_missing_are_refused(key: str, change: str) -> None:
    actions = Actions(EditSession(scene()))
    before = digest(actions.state.session.document)
    with pytest.raises(InvalidInput):
        actions.outline.change(key, change, "0/0", ["0/0", key] if key[0].isdigit() else ())
    assert digest(actions.state.session.document) == before


def test_history_is_entered_anywhere() -> None:
    actions = Actions(EditSession(scene()))
    session, states = actions.state.session, [digest(actions.state.session.document)]
    for name in ("one", "two", "three"):
        actions.outline.change("object 0", "rename", name)
        states.append(digest(session.document))
    for count in (1, 3, 0, 2):
        actions.go_to(count)
        assert (len(session.labels), digest(session.document)) == (count, states[count])
    wrong: list[Any] = [4, -1, "1", True]
    for count in wrong:
        with pytest.raises(InvalidEdit, match="history: expected a whole number from 0 to 3"):
            actions.go_to(count)


def test_a_step_ends_a_drag() -> None:
    actions = Actions(EditSession(scene()))
    actions.trees.select_node(0, (0,))
    before, steps = tree_of(actions.state.session.document), list[bool]()
    actions.trees.begin_drag()
    actions.trees.drag((0.1, 0, 0))
    actions.when_idle("step", lambda: steps.append(True))
    assert (steps, actions.state.session.stroke_open) == ([True], False)
    actions.go_to(0)
    assert tree_of(actions.state.session.document) == before


def test_a_check_of_an_object_that_is_gone_says_so() -> None:
    assert _surface_check(9)(EditSession(scene())).startswith("object: expected a whole number from 0 to")
