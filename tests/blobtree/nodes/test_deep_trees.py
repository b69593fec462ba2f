"""Trees may be deep, wide, and share their parts."""

import time
from collections.abc import Callable
from functools import reduce
from operator import add

import numpy as np
import pytest

from blobtree import Node, Point, Ricci, Sum, Union
from blobtree.tape.program import Run, compile_program

A = Point((0, 0, 0), radius=1.0)
PLACES = [(0.0, 0.0, 0.0), (0.3, 0.2, 0.1), (50.0, 0.0, 0.0)]


def test_a_spine_of_ten_thousand_differences() -> None:
    tree: Node = A
    for i in range(10_000):
        tree = tree - Point((2.0 + 0.001 * i, 0, 0), radius=0.5)
    assert tree.tape.registers == 0
    np.testing.assert_allclose(tree(PLACES), A(PLACES) * [1, 1, 0], atol=1e-6)
    assert (tree.support[0] < tree.support[1]).all()


def test_a_spine_of_ten_thousand_translations() -> None:
    tree: Node = A
    for _ in range(10_000):
        tree = tree.translate((0.001, 0, 0))
    np.testing.assert_allclose(tree.support[0] + tree.support[1], [20.0, 0.0, 0.0], atol=1e-4)
    np.testing.assert_allclose(tree([(10.0, 0, 0), (11.0, 0, 0)]), [1.0, 0.5], atol=1e-5)


def test_spines_of_every_kind_that_lean_to_the_right() -> None:
    tree: Node = A
    for i in range(1_000):
        leaf = Point((0.0, 0.01 * i, 3.0), radius=0.1)
        tree = Ricci((leaf, leaf & (leaf | (leaf - tree))), exponent=2.0)
    assert tree.tape.registers <= 2
    assert np.isfinite(tree(PLACES)).all()


def test_a_balanced_tree_of_mixed_operators() -> None:
    level: list[Node] = [Point((0.01 * i, 0, 0), radius=0.5) for i in range(2**12)]
    kinds: list[Callable[[Node, Node], Node]] = [
        lambda a, b: a | b, lambda a, b: a + b, lambda a, b: a - b, lambda a, b: Ricci((a, b), exponent=3.0),
    ]  # fmt: skip
    depth = 0
    while len(level) > 1:
        level = [kinds[depth % 4](a, b) for a, b in zip(level[::2], level[1::2], strict=True)]
        depth += 1
    assert level[0].tape.registers <= 12
    assert np.isfinite(level[0](PLACES)).all()


def test_a_subtree_that_is_used_twice_at_every_level() -> None:
    tree: Node = A
    for _ in range(12):
        tree = Union((tree, tree.translate((0.5, 0, 0))))
    assert sum(isinstance(step, Run) and len(step.primitives) for step in compile_program(tree)) == 2**12
    np.testing.assert_allclose(tree([(3.0, 0, 0), (6.0, 1.0, 0), (-1.0, 0, 0)]), [1.0, 0.5, 0.5], atol=1e-5)


@pytest.mark.slow
def test_a_hundred_thousand_points_take_seconds() -> None:
    rng = np.random.default_rng(0)
    started = time.process_time()
    tree = Sum(tuple(Point(tuple(p), radius=0.01) for p in rng.uniform(0, 1, (100_000, 3)).tolist()))
    values = tree(rng.uniform(0, 1, (100, 3)))
    assert len(tree.tape.data) == 1 + 100_000 * (Point.skeleton.parameters + 1)
    assert time.process_time() - started < 30.0
    assert values.max() > 0.0
    assert (tree.support[0] >= -0.03).all()


def test_hundreds_of_operands_added_one_by_one_are_one_sum() -> None:
    points: list[Node] = [Point((float(i), 0, 0), radius=0.6) for i in range(300)]
    total = reduce(add, points)
    assert total.children == tuple(points)
