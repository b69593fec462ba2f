"""Operands of trees that remove: their tapes have the values of the operands' own trees."""

import numpy as np
import pytest

from blobtree import Box, Expression, Node, Point, Segment, Shell, SmoothDifference
from blobtree.tape.model import values_at
from blobtree.tape.operands import MOST_WALLED_PARTS, has_walls, leaves_of, operands_of

BALL = Point((0, 0, 0), radius=1.0)
ROD = Segment((-1, 0, 0), (1, 0.2, 0), radius=0.4)
BOX = Box((0.2, 0, 0), (1, 0.8, 0.6), radius=0.1)
NEAR = Point((0.4, 0, 0), radius=0.9)

TREES: dict[str, tuple[Node, list[Node]]] = {
    "difference": (BALL - ROD, [BALL, ROD]),
    "tools in one run": (BALL - ROD - ROD.translate((0, 0.5, 0)), [BALL, ROD | ROD.translate((0, 0.5, 0))]),
    "blends": ((BALL + ROD) - (BOX | NEAR), [BALL + ROD, BOX | NEAR]),
    "intersection": (BALL & NEAR & BOX, [BALL, NEAR, BOX]),
    "nested": (BALL - (BOX - ROD), [BALL, BOX, ROD]),
    "beside": ((BALL - ROD) | BOX, [BALL, ROD, BOX]),
    "shell": (Shell(BALL, 0.1), [BALL, BALL.offset(-0.1)]),
    "warped": ((BALL - ROD).twist(30.0), [BALL.twist(30.0), ROD.twist(30.0)]),
    "stretched": (
        (BALL - BOX).scale((1, 2, 0.5)),
        [BALL.scale((1, 2, 0.5)), BOX.scale((1, 2, 0.5))],
    ),
    "smooth": (SmoothDifference(BALL, ROD, 0.1), [BALL, ROD]),
}


@pytest.mark.parametrize("name", TREES)
def test_operands_have_the_values_of_their_trees(name: str) -> None:
    tree, expected = TREES[name]
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (200, 3))
    found = [values_at(operand.tape, points) for operand in operands_of(tree._program, tree.tape)]
    assert has_walls(tree._program)
    assert len(found) == len(expected)
    for node in expected:
        assert min(float(np.abs(values - node(points)).max()) for values in found) < 1e-6


def test_a_tree_that_only_adds_has_no_operands() -> None:
    tree = (BALL + ROD) | BOX.twist(20.0)
    assert not has_walls(tree._program)
    assert operands_of(tree._program, tree.tape) == []


@pytest.mark.parametrize(("count", "walls"), [(MOST_WALLED_PARTS, True), (MOST_WALLED_PARTS + 1, False)])
def test_an_expression_of_many_parts_has_no_operands(count: int, walls: bool) -> None:
    lines = ["x var-x", "y var-y", "m0 add x y"]
    for i in range(1, count):
        lines += [f"c{i} const {1.0 + i}", f"s{i} mul y c{i}", f"a{i} add x s{i}", f"m{i} max m{i - 1} a{i}"]
    tree = Expression(lines, (0, 0, 0), (1, 1, 1))
    assert has_walls(tree._program) is walls
    assert (operands_of(tree._program, tree.tape) != []) is walls


@pytest.mark.parametrize(
    ("tree", "tools"),
    [
        (BALL - ROD - BOX, ["Box", "Segment"]),
        (BALL & (ROD + BOX), []),
        ((BALL + ROD) - (BOX | NEAR), ["Box"]),
        (BALL - (BOX - ROD), ["Box"]),
    ],
)
def test_tools_are_what_is_removed_and_stays_removed(tree: Node, tools: list[str]) -> None:
    operands = operands_of(tree._program, tree.tape)
    assert sorted(type(operand.leaf).__name__ for operand in operands if operand.tool) == tools


@pytest.mark.parametrize(
    ("tree", "meeting"),
    [
        (BALL - ROD, []),
        (BALL & ROD, ["Point", "Segment"]),
        ((BALL & ROD) - BOX, ["Point", "Segment"]),
        ((BALL - BOX) & (ROD + NEAR), ["Box", "Point", "Segment"]),
    ],
)
def test_operands_of_intersections_meet(tree: Node, meeting: list[str]) -> None:
    operands = operands_of(tree._program, tree.tape)
    assert sorted(type(operand.leaf).__name__ for operand in operands if operand.meets) == meeting


def test_leaves_have_their_own_values() -> None:
    tree = ((BALL + ROD).twist(30.0) - BOX.scale((1, 2, 0.5))) | (NEAR & ROD.translate((0, 1, 0)))
    parts = [BALL.twist(30.0), ROD.twist(30.0), BOX.scale((1, 2, 0.5)), NEAR, ROD.translate((0, 1, 0))]
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (200, 3))
    found = [values_at(tape, points) for tape in leaves_of(tree._program, tree.tape)]
    assert len(found) == len(parts)
    for part in parts:
        assert min(float(np.abs(values - part(points)).max()) for values in found) < 1e-6
