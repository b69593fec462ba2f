"""Nodes as values: equal, hashed, written, pickled and copied alike, where recursion would fail too."""

import copy
import inspect
import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings

import blobtree
from blobtree import Difference, Node, Point, Ricci, Segment, Sum, Union, from_json, to_json
from blobtree.tape.program import postorder
from tests.blobtree.trees import random_trees, trees

NAMES: dict[str, Any] = {name: getattr(blobtree, name) for name in blobtree.__all__}
DEPTH = 4_000
"""Several times what Python or C could recurse into; `tests.blobtree.meshing.test_scale` goes deeper."""

A = Point((0, 0, 0), radius=1.0)
B = Segment((0, 0, 0), (1, 0, 0), radius=0.5)


def differences(last: float) -> Node:
    tree: Node = A.scale(last)
    for i in range(DEPTH):
        tree = tree - Point((2.0 + 0.001 * i, 0, 0), radius=0.5)
    return tree


def translations(last: float) -> Node:
    tree: Node = A.scale(last)
    for _ in range(DEPTH):
        tree = tree.translate((0.001, 0, 0))
    return tree


def mixed(last: float) -> Node:
    """Every way of holding other nodes, leaning left and right in turn."""
    tree: Node = A.offset(last)
    for i in range(DEPTH // 8 + 1):
        tree = Union((Ricci((B, Sum((tree.scale(1.001),))), exponent=2.0 + i / DEPTH), A))
        tree = Difference(B, B & tree.twist(1.0).offset(0.1))
    return tree


DEEP = pytest.mark.parametrize("make", [differences, translations, mixed])


@pytest.mark.slow_cases("differences", "translations")
@DEEP
def test_a_deep_tree_compares_and_hashes(make: Callable[[float], Node]) -> None:
    tree, same, other = make(0.4375), make(0.4375), make(0.8125)
    assert tree == same
    assert tree != other
    assert hash(tree) == hash(same)
    assert tree == same  # again, now that both know their hashes
    assert tree != other
    assert {tree: "found"}[same] == "found"
    assert other not in {tree}


@DEEP
def test_a_deep_tree_is_written(make: Callable[[float], Node]) -> None:
    tree = make(0.4375)
    text = repr(tree)
    assert text.count("(") == text.count(")") > DEPTH
    assert repr(make(0.8125)) == text.replace("0.4375", "0.8125")
    lines = str(tree).splitlines()
    assert max(map(len, lines)) < 300
    expected = 2 if make is differences else 1
    assert sum(line.split()[0] == f"[{DEPTH}]" for line in lines) == expected


@pytest.mark.slow_cases("differences", "translations")
@DEEP
def test_a_deep_tree_is_pickled_and_copied(make: Callable[[float], Node]) -> None:
    tree = make(0.4375)
    hash(tree)
    for protocol in (2, pickle.HIGHEST_PROTOCOL):
        again = pickle.loads(pickle.dumps(tree, protocol))
        assert again is not tree
        assert again == tree
    assert copy.copy(tree) is tree
    assert copy.deepcopy([tree])[0] is tree
    assert from_json(to_json(tree)) == tree


def test_a_pickle_is_read_by_a_process_whose_strings_hash_otherwise() -> None:
    tree = A - B
    hash(tree)
    program = (
        "import pickle, sys; from blobtree import Point, Segment;"
        "tree = pickle.load(sys.stdin.buffer);"
        "same = Point((0, 0, 0), radius=1.0) - Segment((0, 0, 0), (1, 0, 0), radius=0.5);"
        "assert tree == same and hash(tree) == hash(same)"
    )
    subprocess.run([sys.executable, "-c", program], input=pickle.dumps(tree), check=True)


@given(trees())
@settings(max_examples=100)
def test_text_pickle_and_file_give_the_tree_back(tree: Node) -> None:
    for again in (eval(repr(tree), NAMES), pickle.loads(pickle.dumps(tree)), from_json(to_json(tree))):
        assert again is not tree
        assert again == tree
        assert hash(again) == hash(tree)
        assert repr(again) == repr(tree)
        assert to_json(again) == to_json(tree)


@given(trees(), trees())
@settings(max_examples=60)
def test_trees_are_equal_where_their_texts_are(first: Node, second: Node) -> None:
    assert (first == second) == (repr(first) == repr(second))


def test_one_changed_number_anywhere_makes_another_tree() -> None:
    (tree,) = random_trees(seed=11, count=1, depth=5)
    text = repr(tree)
    radii = [i for i in range(len(text)) if text.startswith("radius=", i)]
    assert len(radii) > 5
    for i in radii:
        other = eval(text[: i + 7] + "1e-3 + " + text[i + 7 :], NAMES)
        assert other != tree
        assert hash(other) != hash(tree)


def test_a_shared_subtree_is_compared_hashed_and_pickled_once() -> None:
    def doubled(levels: int) -> Node:
        tree: Node = A
        for _ in range(levels):
            tree = Union((tree.translate((1, 0, 0)), tree))
        return tree

    started = time.process_time()
    tree, same = doubled(200), doubled(200)
    assert tree == same
    assert hash(tree) == hash(same)
    again = pickle.loads(pickle.dumps(tree))
    assert again == tree
    assert len(postorder(again)) == len(postorder(tree)) == 401
    assert time.process_time() - started < 5.0


def test_a_larger_tree_takes_the_hashes_of_its_parts() -> None:
    tree = differences(0.4375)
    hash(tree)
    started = time.process_time()
    for i in range(100):
        hash(tree - Point((float(i), 0, 0), radius=1.0))
    assert time.process_time() - started < 1.0


def test_a_node_equals_nothing_but_nodes() -> None:
    assert A != "Point"
    assert A != 1
    assert (A == None) is False  # noqa: E711
    assert A.__eq__(1) is NotImplemented


def test_every_kind_of_node_leaves_being_a_value_to_node() -> None:
    kinds = [kind for kind in NAMES.values() if inspect.isclass(kind) and issubclass(kind, Node)]
    assert len(kinds) >= 11
    for kind in kinds:
        for name in ("__eq__", "__hash__", "__repr__", "__str__", "__reduce__"):
            assert getattr(kind, name) is getattr(Node, name), f"{kind.__name__}: use eq=False, repr=False"
