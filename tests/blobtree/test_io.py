"""BlobTree files: they come back as they went, are written whole or not at all, and say what is wrong."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blobtree import Node, Point, Union, from_json, load, save, to_json
from blobtree.errors import InvalidFile
from blobtree.io import RECORD_OF_KIND
from blobtree.nodes.kinds import NODE_KINDS
from tests.blobtree.custom_kinds import Ring, Soft
from tests.blobtree.trees import KINDS, random_trees

BALL = {"type": "point", "center": [0, 0, 0], "radius": 1, "color": [1, 1, 1]}


def document(*nodes: Any, **changes: Any) -> str:
    return json.dumps({"format": "blobtree", "version": 1, "nodes": nodes} | changes)


def test_a_file_comes_back_equal(tmp_path: Path) -> None:
    for tree in random_trees(seed=4, count=10):
        save(tree, tmp_path / "träe.json")
        assert load(str(tmp_path / "träe.json")) == tree


def test_the_documented_form_is_read() -> None:
    read = from_json(document(BALL, {**BALL, "center": [1, 0, 0]}, {"type": "sum", "operands": [0, 1]}))
    white = (1, 1, 1)
    assert read == Point((0, 0, 0), radius=1, color=white) + Point((1, 0, 0), radius=1, color=white)


def test_a_shared_subtree_is_written_once_and_read_back_shared() -> None:
    tree: Node = Point((0, 0, 0), radius=1.0)
    for _ in range(30):
        tree = Union((tree, tree))
    text = to_json(tree)
    assert len(json.loads(text)["nodes"]) == 31
    read = from_json(text)
    assert read.children[0] is read.children[1]
    assert to_json(read) == text


def test_a_spine_of_ten_thousand_is_no_recursion() -> None:
    tree: Node = Point((0, 0, 0), radius=1.0)
    for i in range(10_000):
        tree = tree - Point((0, 0, float(i)), radius=1.0)
    assert to_json(from_json(to_json(tree))) == to_json(tree)


def test_custom_nodes_are_read_under_their_old_and_new_tags() -> None:
    ring = Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2)
    tree = Soft((ring, Point((1, 0, 0), radius=0.4)), 1.0)
    text = to_json(tree).decode()
    assert text.count('"custom_skeleton"') == text.count('"custom_operator"') == 1
    old = text.replace("custom_skeleton", "own skeleton").replace("custom_operator", "own operator")
    assert from_json(old) == from_json(text) == tree


def test_every_built_in_kind_of_node_has_a_record() -> None:
    assert {kind.file_tag for kind in KINDS} <= set(NODE_KINDS)
    assert set(RECORD_OF_KIND) == set(NODE_KINDS.values())
    for kind, record in RECORD_OF_KIND.items():
        names = {field.name for field in dataclasses.fields(kind)}
        assert set(record.__struct_fields__) == names


BROKEN: dict[str, tuple[str, str]] = {
    "a cycle": (
        document({"type": "sum", "operands": [1]}, {"type": "sum", "operands": [0]}),
        r"nodes\[0\] \(sum\): operand 1 does not stand before this node, which is node 0",
    ),
    "itself": (
        document(BALL, {"type": "union", "operands": [0, 1]}),
        r"nodes\[1\] \(union\): operand 1 does not",
    ),
    "a negative place": (
        document(BALL, {"type": "transform", "child": -1, "matrix": [[1, 0, 0, 0]] * 3}),
        r"nodes\[1\] \(transform\): operand -1 does not stand before",
    ),
    "beyond the end": (
        document(BALL, {"type": "difference", "solid": 0, "tool": 9}),
        r"nodes\[1\] \(difference\): operand 9",
    ),
    "radius 0": (
        document(BALL, {**BALL, "radius": 0}),
        r"nodes\[1\] \(point\): radius: expected a number above 0",
    ),
    "radius −1": (
        document({**BALL, "radius": -1}),
        r"nodes\[0\] \(point\): radius: expected a number above 0",
    ),
    "a huge radius": (
        document({**BALL, "radius": 1e300}),
        r"nodes\[0\] \(point\): radius: expected a finite number",
    ),
    "a colour": (
        document({**BALL, "color": [2, 0, 0]}),
        r"nodes\[0\] \(point\): color: expected red, green, blue",
    ),
    "an exponent": (
        document(BALL, {"type": "ricci", "operands": [0], "exponent": 0.5}),
        r"nodes\[1\] \(ricci\): exponent",
    ),
    "a flat map": (
        document(BALL, {"type": "transform", "child": 0, "matrix": [[0, 0, 0, 0]] * 3}),
        r"nodes\[1\] \(transform\): matrix: expected an invertible map",
    ),
    "a ragged map": (
        document(BALL, {"type": "transform", "child": 0, "matrix": [[1, 0], [1]]}),
        r"nodes\[1\] \(transform\): matrix: expected a finite 3×4",
    ),
    "no operands": (
        document({"type": "sum", "operands": []}),
        r"nodes\[0\] \(sum\): operands: expected at least one",
    ),
    "no nodes": (document(), "nodes: expected at least one node, got none"),
    "a wrong version": (
        document(BALL, version=2),
        r"not a BlobTree of version 1: version: unknown value 2$",
    ),
    "a wrong format": (
        document(BALL, format="scene"),
        r"not a BlobTree of version 1: format: unknown value 'scene'$",
    ),
    "an unknown field": (
        document({**BALL, "colour": 1}),
        r"0\]: there is no field 'colour'; remove it$",
    ),
    "an unknown field outside": (document(BALL, author="x"), "1: there is no field 'author'; remove it$"),
    "an unknown type": (
        document(BALL, {**BALL, "type": "teapot"}),
        r"nodes\[1\].type: unknown value 'teapot'$",
    ),
    "no type": (document({"radius": 1}), r"nodes\[0\]: the field 'type' is missing$"),
    "a missing field": (
        document({"type": "point", "center": [0, 0, 0]}),
        r"nodes\[0\]: the field 'radius' is missing$",
    ),
    "two coordinates": (
        document({**BALL, "center": [0, 0]}),
        r"nodes\[0\].center: expected a list of 3 values$",
    ),
    "a word for a number": (
        document({**BALL, "radius": "1"}),
        r"nodes\[0\].radius: expected a number, got a text$",
    ),
    "NaN": (
        document({**BALL, "radius": float("nan")}),
        "valid JSON: invalid character at line 1, column ",
    ),
    "a place that is no integer": (
        document(BALL, {"type": "sum", "operands": [0.5]}),
        r"nodes\[1\].operands\[0\]: expected a whole number, got a number$",
    ),
    "truncated": (document(BALL)[:-20], "not a BlobTree of version 1: the file ends too early$"),
    "empty": ("", "not a BlobTree of version 1: the file is empty$"),
    "no JSON": ("solid cube", "it is not valid JSON: invalid character at line 1, column 1$"),
    "a list": ("[]", "not a BlobTree of version 1: expected an object in braces, got a list$"),
    "null": ("null", "not a BlobTree of version 1: expected an object in braces, got null$"),
    "deep nesting": ('{"nodes": ' + "[" * 100_000, "not a BlobTree"),
    "more after the end": (document(BALL) + "{}", "JSON: trailing characters at line 1, column "),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_a_broken_file_says_what_is_wrong_and_where(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match=message):
        from_json(text)
    path = tmp_path / "broken.json"
    path.write_text(text)
    with pytest.raises(InvalidFile, match=r"broken\.json: .*" + message):
        load(path)


@pytest.mark.parametrize(
    "content", [b"\xff\xfe\x00", b"\x00" * 64, b'{"format": "\xff"}', b"ply\nformat ascii"]
)
def test_bytes_that_are_no_text(content: bytes) -> None:
    with pytest.raises(InvalidFile, match="not a BlobTree"):
        from_json(content)


@given(st.binary(max_size=200) | st.text(max_size=200))
@settings(max_examples=200)
def test_rubbish_is_an_invalid_file_and_nothing_else(rubbish: bytes | str) -> None:
    with pytest.raises(InvalidFile):
        from_json(rubbish)


@given(st.data())
@settings(max_examples=150)
def test_a_damaged_file_is_a_tree_or_an_invalid_file(data: st.DataObject) -> None:
    text = bytearray(document(BALL, {**BALL, "radius": 2}, {"type": "sum", "operands": [0, 1]}), "ascii")
    for _ in range(data.draw(st.integers(1, 3))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
    try:
        read = from_json(bytes(text))
    except InvalidFile:
        return
    assert isinstance(read, Node)


def test_a_missing_file_and_a_folder_are_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "none.json")
    with pytest.raises(OSError, match=r".+"):
        load(tmp_path)
    with pytest.raises(FileNotFoundError):
        save(Point((0, 0, 0), radius=1.0), tmp_path / "none" / "tree.json")
