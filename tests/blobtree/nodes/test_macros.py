"""Macros: nodes that stand for a tree of other nodes in programs, and for themselves elsewhere."""

import pickle
from dataclasses import dataclass
from functools import reduce
from typing import ClassVar

import numpy as np
import pytest

from blobtree import Ellipsoid, Node, Point, Sum, Transform, from_json, polygonize, to_json
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes import surgery
from blobtree.nodes.paths import node_at, primitive_at, primitive_paths, resized, with_node
from blobtree.nodes.tree import Macro
from blobtree.tape.program import compile_program

EGG = Ellipsoid((0.5, 0.0, 0.0), (0.4, 0.8, 0.6), color=(1, 0, 0))
BALL = Point((-0.6, 0.0, 0.0), radius=0.5)


@dataclass(frozen=True, eq=False, repr=False)
class Pair(Macro):
    """`child` and a copy of it beside it."""

    made: ClassVar[list[int]] = []

    child: Node

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.child,)

    @Lazy
    def expanded(self) -> Node:
        self.made.append(1)
        return self.child + self.child.translate((0.1, 0.0, 0.0))


def test_a_macro_has_the_program_of_its_tree() -> None:
    plain = BALL + Point((0, 0, 0), radius=1.0).scale((0.4, 0.8, 0.6)).translate((0.5, 0, 0))
    points = np.random.default_rng(0).uniform(-2, 2, (500, 3))
    np.testing.assert_allclose((BALL + EGG)(points), plain(points), atol=1e-6)
    assert [type(step) for step in compile_program(BALL + EGG)] == [
        type(step) for step in compile_program(plain)
    ]
    copies, sums = Pair(BALL) - EGG, Sum((BALL, BALL.translate((0.1, 0, 0)))) - EGG
    np.testing.assert_array_equal(copies.tape.data, sums.tape.data)
    nested = Pair(Pair(BALL) | EGG).rotate((1, 2, 3), 40).offset(0.05)
    assert nested.tape.data.shape == (2 * (2 * 2 + 6) + 2 * 2 + 2, 4)


def test_equal_semi_axes_fold_into_a_ball() -> None:
    ball = Ellipsoid((1, 2, 3), (2, 2, 2))
    np.testing.assert_allclose(ball.tape.data, Point((1, 2, 3), radius=2.0).tape.data, rtol=1e-6)


def test_a_macro_expands_once_and_deep_chains_need_no_recursion() -> None:
    Pair.made.clear()
    tree: Node = Pair(BALL)
    _ = tree.tape, tree.support, (tree + EGG).tape
    assert len(Pair.made) == 1
    deep: Node = EGG
    for _ in range(3000):
        deep = Shell(deep)
    np.testing.assert_allclose((deep + BALL)([[0.5, 0, 0]]), (EGG + BALL)([[0.5, 0, 0]]))


@dataclass(frozen=True, eq=False, repr=False)
class Shell(Macro):
    """`child` itself."""

    child: Node

    @property
    def children(self) -> tuple[Node, ...]:
        return (self.child,)

    @property
    def expanded(self) -> Node:
        return self.child


def test_too_many_primitives_are_counted_in_expanded_trees() -> None:
    with pytest.raises(InvalidNode, match="primitives"):
        _ = reduce(lambda node, _: Pair(node), range(25), BALL + EGG).tape


def test_files_text_hash_and_copies_know_the_macro_alone() -> None:
    tree = BALL + EGG.rotate((0, 0, 1), 30)
    _ = tree.tape
    for copy in (from_json(to_json(tree)), pickle.loads(pickle.dumps(tree))):
        assert copy == tree
        assert hash(copy) == hash(tree)
        np.testing.assert_array_equal(copy.tape.data, tree.tape.data)
    assert eval(repr(tree), {kind.__name__: kind for kind in (Ellipsoid, Point, Sum, Transform)}) == tree
    assert "Ellipsoid(center=(0.5, 0.0, 0.0), semi_axes=(0.4, 0.8, 0.6)" in str(tree)


def test_paths_and_surgery_treat_an_ellipsoid_as_a_primitive() -> None:
    tree = BALL + EGG.rotate((0, 0, 1), 30)
    assert primitive_paths(tree) == [(0,), (1, 0)]
    assert primitive_at(tree, (1,)) is EGG
    surface = polygonize(tree, resolution=24).vertices
    right = surface[surface[:, 0].argmax()]
    assert surgery.dominant_primitive(tree, right) == (1, 0)
    larger = with_node(tree, (1, 0), resized(EGG, 2.0))
    assert node_at(larger, (1, 0)) == Ellipsoid((0.5, 0.0, 0.0), (0.8, 1.6, 1.2), color=(1, 0, 0))
    moved, path = surgery.duplicate_branch(tree, (1,), (0, 0, 2))
    assert path == (2,)
    assert moved([[0.43, 0.25, 2.0]])[0] == pytest.approx(1.0, abs=1e-3)


def test_colors_and_bounds_are_those_of_the_ball() -> None:
    np.testing.assert_allclose(EGG.colors([[0.5, 0, 0]])[0], np.array(EGG.color), atol=1e-6)
    lower, upper = EGG.bounds
    np.testing.assert_allclose(upper - lower, (0.8, 1.6, 1.2), rtol=0.01)
