"""Tree → program: registers, runs, and the order of operands."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings

from blobtree import Intersection, Node, Point, Ricci, Segment, Sum, Union
from blobtree.errors import InvalidNode
from blobtree.tape.program import Pop, Push, Run, compile_program, postorder, registers_needed
from tests.blobtree.trees import trees


def leaf(i: int = 0) -> Node:
    return Point((0.1 * i, 0, 0), radius=1.0) if i % 2 else Segment((0, 0, 0), (1, 0, 0.1 * i), radius=0.5)


def balanced(depth: int, *operators: Callable[[Node, Node], Node]) -> Node:
    """2^depth leaves of two kinds, the operators taking turns from the leaves up."""
    level = [leaf(i) for i in range(2**depth)]
    for height in range(depth):
        combine = operators[height % len(operators)]
        level = [combine(a, b) for a, b in zip(level[::2], level[1::2], strict=True)]
    return level[0]


def leaves(node: Node) -> int:
    return sum(not below.children for below in postorder(node))


def add(a: Node, b: Node) -> Node:
    return Sum((a, b))


def unite(a: Node, b: Node) -> Node:
    return Union((a, b))


@pytest.mark.parametrize("depth", range(1, 11))
def test_a_balanced_tree_needs_no_more_registers_than_levels(depth: int) -> None:
    for tree in (
        balanced(depth, add, unite),
        balanced(depth, lambda a, b: a - b),
        balanced(depth, unite, add),
    ):
        needed = registers_needed(compile_program(tree))
        assert needed <= depth
        assert (needed > 0) == (depth > 1)


@given(trees(max_leaves=20))
@settings(max_examples=100)
def test_registers_stay_below_the_logarithm_of_the_leaves(tree: Node) -> None:
    assert registers_needed(compile_program(tree)) <= math.log2(max(leaves(tree), 1)) + 1e-9


@given(trees(max_leaves=20))
@settings(max_examples=100)
def test_each_register_is_written_before_it_is_read_and_read_once(tree: Node) -> None:
    full: set[int] = set()
    primitives = 0
    for step in compile_program(tree):
        match step:
            case Push(register):
                assert register not in full
                full.add(register)
            case Pop(register):
                full.remove(register)
            case Run():
                assert step.primitives
                primitives += len(step.primitives)
    assert not full
    assert primitives >= leaves(tree)  # a shared subtree is emitted wherever it is used


@pytest.mark.parametrize("lean", ["left", "right"])
@pytest.mark.parametrize("kind", ["difference", "mixed"])
def test_a_left_spine_needs_no_register_and_a_right_spine_one(lean: str, kind: str) -> None:
    tree = leaf()
    for i in range(200):
        pair = (tree, leaf(i)) if lean == "left" else (leaf(i), tree)
        tree = pair[0] - pair[1] if kind == "difference" or i % 2 else Union(pair)
    needed = registers_needed(compile_program(tree))
    assert needed == (0 if lean == "left" else 1)


def test_the_heavier_operand_of_a_difference_goes_first() -> None:
    light, heavy = balanced(2, add, unite), balanced(6, add, unite)
    needed = registers_needed(compile_program(heavy))
    for tree in (light - heavy, heavy - light):
        assert registers_needed(compile_program(tree)) == needed
    (last,) = [step for step in compile_program(light - heavy)[-1:] if isinstance(step, Pop)]
    assert last.swapped


def test_points_of_one_sum_are_one_run() -> None:
    points = [Point((float(i), 0, 0), radius=1.0) for i in range(50)]
    (run,) = compile_program(Sum(tuple(points)))
    assert isinstance(run, Run)
    assert [placed.primitive for placed in run.primitives] == points
    assert run.operator is Sum.operator


def test_a_run_holds_one_skeleton_one_operator_and_one_kind_of_map() -> None:
    ball, bone = Point((0, 0, 0), radius=1.0), Segment((0, 0, 0), (1, 0, 0), radius=1.0)
    mixed = compile_program(Sum((ball, ball, bone, bone, ball)))
    assert [len(step.primitives) for step in mixed if isinstance(step, Run)] == [3, 2]
    stretched = compile_program(Sum((ball, ball.scale((1, 2, 1)), ball.scale((1, 3, 1)), ball.scale(2.0))))
    assert [(len(s.primitives), s.stretched) for s in stretched if isinstance(s, Run)] == [
        (2, False), (2, True),
    ]  # fmt: skip
    # a fold that may start from the empty field does; an intersection has to start from its first operand
    united, common = (compile_program(node) for node in (Union((ball, ball)), ball & ball))
    assert [s.operator for s in united if isinstance(s, Run)] == [Union.operator]
    assert [s.operator for s in common if isinstance(s, Run)] == [Sum.operator, Intersection.operator]
    different = Ricci((ball, Ricci((ball, ball), exponent=2.0)), exponent=3.0)
    assert [s.parameters for s in compile_program(different) if isinstance(s, Run)] == [(2.0,), (3.0,)]


def test_nested_combinations_of_one_kind_are_one_run() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    inner = Sum((ball, Sum((ball,)).translate((1, 0, 0))))
    (run,) = compile_program(Sum((ball, inner.translate((1, 0, 0)))))
    assert isinstance(run, Run)
    assert [placed.placement.matrix[0, 3] for placed in run.primitives] == [0.0, 1.0, 2.0]


def test_a_ricci_blend_of_exponent_1_is_a_sum() -> None:
    ball = Point((0, 0, 0), radius=1.0)
    (run,) = compile_program(Sum((Ricci((ball, ball), exponent=1.0), ball)))
    assert isinstance(run, Run)
    assert (run.operator, len(run.primitives)) == (Sum.operator, 3)


def test_transforms_multiply_from_the_outside_in() -> None:
    tree = Point((1, 0, 0), radius=1.0).rotate((0, 0, 1), 90.0).scale((2, 1, 1)).translate((0, 0, 5))
    (run,) = compile_program(tree)
    assert isinstance(run, Run)
    (placed,) = run.primitives
    np.testing.assert_allclose(placed.placement.matrix @ [1, 0, 0, 1], [0, 1, 5, 1], atol=1e-15)
    np.testing.assert_allclose(placed.placement.matrix @ [0, 1, 0, 1], [-2, 0, 5, 1], atol=1e-15)


def test_a_tree_that_needs_too_many_registers_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("blobtree.tape.tape.REGISTERS", 3)
    assert balanced(4, add, unite).tape.registers == 3
    with pytest.raises(InvalidNode, match="tree: needs 4 registers, at most 3 exist; group its operands"):
        _ = balanced(5, add, unite).tape


def test_exponentially_shared_subtrees_are_refused() -> None:
    tree: Node = Point((0, 0, 0), radius=1.0)
    for _ in range(60):
        tree = Union((tree, tree.translate((1, 0, 0))))
    with pytest.raises(InvalidNode, match="exceed"):
        compile_program(tree)
