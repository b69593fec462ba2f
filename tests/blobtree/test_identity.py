"""One content hash for equal contents: of plain values, arrays and trees."""

import copy
import pickle
import zlib
from collections import OrderedDict
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st

from blobtree import (
    Node,
    Point,
    Segment,
    content_hash,
    from_json,
    identity,
    numeric_parameters,
    numeric_values,
    to_json,
    with_numeric_values,
)
from blobtree.custom import define_skeleton
from blobtree.errors import InvalidInput, InvalidNode, UnusableFile
from blobtree.nodes.samples import Samples
from tests.blobtree.custom_kinds import EVERYTHING
from tests.blobtree.trees import random_trees, trees
from tests.programs import output_of

BALL = Point((0, 0, 0), radius=1.0)

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=4),
    max_leaves=12,
)


class Side(Enum):
    LEFT = 1
    RIGHT = 2


@dataclass
class Run:
    count: int
    label: str = field(default="", compare=False)


def same(first: Any, second: Any) -> bool:
    """Return True if two plain values are equal, and truth values are no numbers."""
    if isinstance(first, bool) is not isinstance(second, bool):
        return False
    if isinstance(first, list):
        paired = isinstance(second, list) and len(first) == len(second)
        return paired and all(map(same, first, second))
    if isinstance(first, dict):
        keyed = isinstance(second, dict) and first.keys() == second.keys()
        return keyed and all(same(first[key], second[key]) for key in first)
    return bool(first == second)


@given(PLAIN, PLAIN)
@settings(max_examples=300)
def test_plain_values_have_equal_hashes_if_they_are_equal(first: Any, second: Any) -> None:
    assert content_hash(first) == content_hash(copy.deepcopy(first))
    assert (content_hash(first) == content_hash(second)) == same(first, second)


DIFFERENT: list[Any] = [
    None, False, True, 0, 1, -1, 1.5, 2**70, "", "0", b"", b"0", [], [[]], [0], [0, 0], [[0], 0], {},
    {"a": 0},
    {"a": 1}, {"b": 0}, [["a", 0]], {0}, {0, 1}, "ab", ["a", "b"], ["ab", ""], Side.LEFT, Side.RIGHT,
    Run(1), Run(2), {"count": 1}, np.zeros(2), np.zeros(3), np.zeros((2, 1)), np.zeros(2, np.float32),
    np.zeros(2, np.int32), np.array(["a", "b"]), np.array(["ab", ""]), np.array([["a", "b"]]),
    float("inf"), float("-inf"), float("nan"), BALL, [BALL], content_hash(BALL), "\ud800",
]  # fmt: skip


def test_different_values_have_different_hashes() -> None:
    hashes = [content_hash(value) for value in DIFFERENT]
    assert len(set(hashes)) == len(hashes)


@pytest.mark.parametrize(
    "values",
    [
        (1, 1.0, np.float32(1), np.int8(1), np.uint64(1), np.float16(1)),
        (0.0, -0.0, 0, np.float32(-0.0)),
        (0.1, np.float64(0.1)),
        (float("nan"), np.float32("nan"), -float("nan")),
        ([1, 2], (1, 2), range(1, 3)),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}, OrderedDict(b=2, a=1)),
        ({3, 1, 2}, frozenset([1, 2, 3])),
        (True, np.True_),
        (b"ab", bytearray(b"ab"), memoryview(b"ab")),
        (np.arange(6.0).reshape(2, 3), np.asfortranarray(np.arange(6.0).reshape(2, 3))),
        (np.arange(3), np.arange(3).astype(">i8"), np.arange(6)[::2] // 2),
        (np.zeros(2), -np.zeros(2)),
        (
            np.array(["a", "bc"]),
            np.array(["a", "bc"], object),
            np.array(["a", "bc"], np.dtypes.StringDType()),
        ),
        (Run(3, "first"), Run(3, "second")),
    ],
    ids=lambda values: repr(values[0])[:20],
)
def test_equal_values_of_other_types_have_one_hash(values: tuple[Any, ...]) -> None:
    assert len({content_hash(value) for value in values}) == 1


def test_a_path_stands_for_the_bytes_of_its_file(tmp_path: Path) -> None:
    for name in ("first.bin", "second.bin"):
        (tmp_path / name).write_bytes(b"same")
    assert (
        content_hash(tmp_path / "first.bin") == content_hash(tmp_path / "second.bin") == content_hash(b"same")
    )
    with pytest.raises(UnusableFile, match="third"):
        content_hash(tmp_path / "third.bin")


def nested() -> list[Any]:
    rows: list[Any] = []
    rows.append(rows)
    return rows


@pytest.mark.parametrize(
    "value",
    [lambda: 0, object(), np.zeros(2, complex), 1j, Node, nested()],
    ids=lambda value: type(value).__name__,
)
def test_values_without_contents_are_refused(value: Any) -> None:
    with pytest.raises(InvalidInput, match="expected"):
        content_hash([value])


def test_nesting_has_a_limit_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Programs may raise Python's limit of recursion; each level would then cost more than the one before."""
    monkeypatch.setattr(identity, "MAX_NESTING", 50)
    deep: list[Any] = [1]
    for _ in range(48):
        deep = [deep]
    assert len(content_hash(deep)) == 40
    for value in ([[deep]], {"a": {"b": deep}}, np.array([[[deep]], None], object)):
        with pytest.raises(InvalidInput, match="nested too deeply"):
            content_hash(value)


# -- trees ----------------------------------------------------------------------------------------------


@wp.func
def stick(q: wp.vec3, half: wp.float32) -> wp.vec3:
    return wp.vec3(wp.clamp(q[0], -half, half), 0.0, 0.0)


@wp.func
def short_stick(q: wp.vec3, half: wp.float32) -> wp.vec3:
    return wp.vec3(wp.clamp(q[0], 0.0, half), 0.0, 0.0)


@given(trees(), trees())
@settings(max_examples=100)
def test_trees_have_equal_hashes_if_they_are_equal(first: Node, second: Node) -> None:
    for again in (from_json(to_json(first)), pickle.loads(pickle.dumps(first))):
        assert again == first
        assert again.content_hash == first.content_hash
    assert (first.content_hash == second.content_hash) == (first == second)


def test_trees_of_custom_kinds_keep_their_hash() -> None:
    for tree in (EVERYTHING, *EVERYTHING.children):
        again = pickle.loads(pickle.dumps(tree))
        assert again == tree
        assert again.content_hash == tree.content_hash


def test_a_kind_is_its_functions() -> None:
    def made(kind: type[Node]) -> str:
        return kind(0.5, radius=0.2).content_hash  # type: ignore[call-arg]  # of a custom kind

    hashes = {made(define_skeleton(function, name="identity")) for function in (stick, short_stick, stick)}
    assert len(hashes) == 2


@given(trees(), st.randoms(use_true_random=False))
@settings(max_examples=100)
def test_another_number_of_a_tree_gives_another_hash(tree: Node, random: Any) -> None:
    chosen = [random.choice(numeric_parameters(tree))]
    value = numeric_values(tree, chosen)
    try:
        changed = with_numeric_values(tree, chosen, np.nextafter(value, np.inf))
    except InvalidNode:  # an end of a range
        changed = with_numeric_values(tree, chosen, np.nextafter(value, -np.inf))
    assert changed != tree
    assert changed.content_hash != tree.content_hash


def test_what_texts_leave_out_does_not_count() -> None:
    assert replace(BALL, weight=1.0).content_hash == BALL.content_hash
    assert replace(BALL, weight=2.0).content_hash != BALL.content_hash
    assert replace(BALL, falloff="gaussian").content_hash != BALL.content_hash
    assert replace(BALL, attributes={"bone": "arm"}).content_hash != BALL.content_hash


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (BALL + BALL.translate((1, 0, 0)), BALL | BALL.translate((1, 0, 0))),
        (BALL - BALL.translate((1, 0, 0)), BALL.translate((1, 0, 0)) - BALL),
        (BALL & (BALL & BALL.scale(2)), BALL & BALL.scale(2)),
        (BALL, Segment((0, 0, 0), (0, 0, 0.5), radius=1.0)),
    ],
)
def test_other_structures_have_other_hashes(first: Node, second: Node) -> None:
    assert first.content_hash != second.content_hash


def test_a_deep_tree_is_hashed_without_recursion() -> None:
    tree: Node = BALL
    for _ in range(4_000):
        tree = tree - BALL
    assert len(tree.content_hash) == 40


def test_samples_are_compared_by_their_numbers() -> None:
    numbers = np.random.default_rng(0).standard_normal((3, 4, 5)).astype(np.float32)
    first = Samples.of(numbers)
    second = Samples(first.shape, zlib.compress(first.array.tobytes(), 9))
    assert first.data != second.data
    assert first == second
    assert hash(first) == hash(second)
    assert first.content_hash == second.content_hash
    assert first != Samples.of(numbers + 1)
    assert pickle.loads(pickle.dumps(first)) == first


SCRIPT = """
import pickle, sys
from blobtree import content_hash
from tests.blobtree.trees import random_trees
print(*(tree.content_hash for tree in random_trees(5, 40)), content_hash({"b": {3, "x", 1.5}, "a": "é"}))
"""


@pytest.mark.parametrize(("seed", "processor"), [("0", "Haswell"), ("1", "Prescott")])
def test_hashes_are_those_of_any_process(seed: str, processor: str) -> None:
    own = [tree.content_hash for tree in random_trees(5, 40)]
    environment = {"PYTHONHASHSEED": seed, "OPENBLAS_CORETYPE": processor}
    printed = output_of(SCRIPT, env={**environment, "PATH": "", "HOME": str(Path.home())}).split()
    assert printed == [*own, content_hash({"a": "é", "b": {1.5, "x", 3}})]


def test_hashes_are_those_of_any_machine() -> None:
    assert (
        content_hash({"count": 1000, "names": ["é", None, True]})
        == "d26df674b7d5ad532dc63da1277c7f302058b76b"
    )
    assert (
        content_hash(np.arange(6, dtype=np.float32).reshape(2, 3))
        == "94058508a44832a02114ff7b50f2e369470c0ae5"
    )
    assert (
        content_hash(BALL - Segment((0, 0, 0), (1, 0, 0), radius=0.25))
        == "3935a7e052728c4965e2f90ed429c1de2d077ad8"
    )
