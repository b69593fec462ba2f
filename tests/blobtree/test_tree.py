"""Nodes: immutable values that combine with operators, refuse nonsense, and may be deep and many."""

import ast
import inspect
import time
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

import blobtree
from blobtree import (
    BlobTreeError,
    Difference,
    Intersection,
    InvalidNode,
    Node,
    Point,
    Ricci,
    Segment,
    Sum,
    Transform,
    Union,
)
from blobtree.formulas.skeletons import POINT
from blobtree.tapes.program import Run, compile_program
from tests.blobtree.trees import random_trees, trees

A = Point((0, 0, 0), radius=1.0)
B = Point((1, 0, 0), radius=0.5, color=(1, 0, 0))
C = Segment((0, 0, 0), (0, 2, 0), radius=0.25)


# -- combining ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("combined", "kind"), [(A + B + C, Sum), (A | B | C, Union), (A & B & C, Intersection)]
)
def test_operators_flatten(combined: Node, kind: type[Node]) -> None:
    assert type(combined) is kind
    assert combined.children == (A, B, C)


def test_operators_flatten_from_the_right_too_but_not_one_kind_into_another() -> None:
    assert (A + (B + C)).children == (A, B, C)
    assert ((A | B) + C).children == (Union((A, B)), C)
    assert (Ricci((A, B), exponent=2.0) + C).children == (Ricci((A, B), exponent=2.0), C)
    assert Difference(Difference(A, B), C) == A - B - C


def test_operands_may_come_from_any_iterable() -> None:
    assert Sum(iter([A, B])) == Sum([A, B]) == Sum((A, B))  # type: ignore[arg-type]


@given(trees())
@settings(max_examples=60, deadline=None)
def test_nodes_are_values(tree: Node) -> None:
    names: dict[str, Any] = {name: getattr(blobtree, name) for name in blobtree.__all__}
    again = eval(repr(tree), names)
    assert again == tree
    assert hash(again) == hash(tree)
    assert again is not tree
    assert len({tree, again}) == 1


def test_different_nodes_differ() -> None:
    assert Point((0, 0, 0), radius=1.0) == A
    assert Point((0, 0, 0), radius=1.1) != A
    assert A + B != A | B
    assert Sum((A, B)) != Sum((B, A))
    assert Ricci((A, B), exponent=2.0) != Ricci((A, B), exponent=3.0)


@pytest.mark.parametrize("node", [A, C, A + B, A - B, Ricci((A, B), exponent=2.0), A.translate((1, 2, 3))])
def test_nodes_do_not_change(node: Node) -> None:
    for name in (*node.__dataclass_fields__, "anything"):  # type: ignore[attr-defined]
        with pytest.raises((FrozenInstanceError, TypeError)):
            setattr(node, name, 1.0)


def test_numbers_are_kept_as_plain_floats() -> None:
    node = Point(np.array([1, 2, 3], np.float32), radius=np.float32(2), color=[0, 1, 0])  # type: ignore[arg-type]
    assert node == Point((1.0, 2.0, 3.0), radius=2.0, color=(0.0, 1.0, 0.0))
    assert "np." not in repr(node)


# -- placing --------------------------------------------------------------------------------------------


def surface_point(node: Node, points: list[tuple[float, float, float]]) -> None:
    np.testing.assert_allclose(node(points), 0.5, atol=1e-5)


def test_transforms_move_the_surface() -> None:
    surface_point(A.translate((5, 0, 0)), [(6, 0, 0), (5, 1, 0)])
    surface_point(A.scale(3.0), [(3, 0, 0), (0, 0, -3)])
    surface_point(A.scale((1, 2, -3)), [(1, 0, 0), (0, 2, 0), (0, 0, 3)])
    surface_point(B.rotate((0, 0, 1), 90.0), [(0, 1.5, 0), (0, 0.5, 0)])
    surface_point(B.rotate((0, 0, -7), 90.0), [(0, -1.5, 0)])
    surface_point(B.translate((1, 0, 0)).rotate((0, 0, 1), 180.0), [(-2.5, 0, 0)])
    surface_point(A.transform(np.diag([2.0, 1.0, 1.0, 1.0])), [(2, 0, 0), (0, 1, 0)])


def test_a_turn_leaves_its_axis_alone_and_a_full_one_everything() -> None:
    turned = A.translate((1, 1, 1)).rotate((1, 1, 1), 77.0)
    surface_point(turned, [(1 + 3**-0.5,) * 3])
    matrix = np.array(A.rotate((1, 2, 3), 360.0).matrix)
    np.testing.assert_allclose(matrix, np.eye(4)[:3], atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(np.array(A.rotate((1, 2, 3), 50).matrix)[:, :3]), 1.0)


# -- refusing -------------------------------------------------------------------------------------------

BAD_VECTORS = [
    None,
    1.0,
    "abc",
    (1, 2),
    (1, 2, 3, 4),
    (0, 0, np.nan),
    (0, np.inf, 0),
    (0, 0, 1e19),
    [[1, 2, 3]],
]
BAD_POSITIVES = [0, 0.0, -1.0, np.nan, np.inf, 1e19, None, "wide", [1.0]]
BAD_COLORS = [None, (0, 0), (0, 0, 1.01), (-0.01, 0, 0), (0, 0, np.nan), "red"]


@pytest.mark.parametrize("bad", BAD_VECTORS, ids=repr)
def test_places_are_three_finite_numbers(bad: Any) -> None:
    attempts: dict[str, Callable[[], Node]] = {
        "center": lambda: Point(bad, radius=1.0),
        "start": lambda: Segment(bad, (0, 0, 0), radius=1.0),
        "end": lambda: Segment((0, 0, 0), bad, radius=1.0),
        "offset": lambda: A.translate(bad),
        "axis": lambda: A.rotate(bad, 30.0),
    }
    for name, attempt in attempts.items():
        with pytest.raises(InvalidNode, match=rf"^{name}: expected three finite numbers \(x, y, z\), got "):
            attempt()


@pytest.mark.parametrize("bad", BAD_POSITIVES, ids=repr)
def test_radii_are_above_zero(bad: Any) -> None:
    for attempt in (lambda: Point((0, 0, 0), radius=bad), lambda: Segment((0, 0, 0), (1, 0, 0), radius=bad)):
        with pytest.raises(InvalidNode, match=r"^radius: expected a .*number.*, got "):
            attempt()


@pytest.mark.parametrize("bad", BAD_COLORS, ids=repr)
def test_colours_are_red_green_and_blue(bad: Any) -> None:
    with pytest.raises(InvalidNode, match=r"^color: expected "):
        Point((0, 0, 0), radius=1.0, color=bad)
    with pytest.raises(InvalidNode, match=r"^color: expected "):
        Segment((0, 0, 0), (1, 0, 0), radius=1.0, color=bad)


@pytest.mark.parametrize("bad", [0.99, 0.0, -2.0, 101.0, np.nan, np.inf, None, "two"], ids=repr)
def test_exponents_run_from_1_to_100(bad: Any) -> None:
    with pytest.raises(InvalidNode, match=r"^exponent: expected "):
        Ricci((A, B), exponent=bad)


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros((3, 4)),
        np.diag([1.0, 1.0, 0.0, 1.0]),
        np.diag([1.0, 1.0, 1e-7, 1.0]),
        np.full((3, 4), np.nan),
        np.diag([np.inf, 1.0, 1.0, 1.0]),
        np.eye(3),
        np.eye(5),
        np.diag([1.0, 1.0, 1.0, 2.0]),
        np.eye(4) + np.eye(4, k=-3),
        "matrix",
        None,
        [[1, 2], [3]],
    ],
    ids=range(12),
)
def test_maps_are_affine_and_invertible(bad: Any) -> None:
    with pytest.raises(InvalidNode, match=r"^matrix: expected "):
        A.transform(bad)
    with pytest.raises(InvalidNode, match=r"^matrix: expected "):
        Transform(A, bad)


@pytest.mark.parametrize(
    "bad", [0.0, (1, 0, 1), np.nan, np.inf, (1, 2), "big", None, (1, 1, np.nan)], ids=repr
)
def test_scales_are_finite_and_not_zero(bad: Any) -> None:
    with pytest.raises(InvalidNode, match=r"^factor: expected "):
        A.scale(bad)


def test_a_turn_has_an_axis_and_an_angle() -> None:
    with pytest.raises(InvalidNode, match="axis: expected a direction, got the zero vector"):
        A.rotate((0, 0, 0), 10.0)
    for bad in (np.nan, np.inf, None, "a bit"):
        with pytest.raises(InvalidNode, match="degrees: expected a finite number"):
            A.rotate((0, 0, 1), bad)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [Sum, Union, Intersection, lambda nodes: Ricci(nodes, exponent=2.0)])
def test_combinations_hold_nodes_at_least_one(kind: Callable[[Any], Node]) -> None:
    with pytest.raises(InvalidNode, match="operands: expected at least one node, got none"):
        kind(())
    with pytest.raises(InvalidNode, match="operands: expected BlobTree nodes, got 1"):
        kind((A, 1))
    with pytest.raises(InvalidNode, match="operands: expected "):
        kind(A)
    with pytest.raises(InvalidNode, match="operands: expected "):
        kind(None)
    assert kind((A,))([(0, 0, 0)]) == A([(0, 0, 0)])


def test_a_difference_and_a_transform_hold_nodes() -> None:
    for attempt in (lambda: Difference(A, 1), lambda: Difference("a", A), lambda: Transform(3, np.eye(4))):  # type: ignore[arg-type]
        with pytest.raises(InvalidNode, match="operands: expected BlobTree nodes, got "):
            attempt()


@pytest.mark.parametrize("other", [1, 1.0, "a", None, (0, 0, 0), np.float64(1.0)], ids=repr)
def test_python_says_what_does_not_combine_with_a_node(other: Any) -> None:
    attempts: tuple[Callable[[], Any], ...] = (
        lambda: A + other, lambda: A | other, lambda: A & other, lambda: A - other,
        lambda: other + A, lambda: other | A, lambda: other & A, lambda: other - A,
    )  # fmt: skip
    for attempt in attempts:
        with pytest.raises(TypeError):
            attempt()


def test_every_refusal_is_a_blobtree_error_and_a_value_error() -> None:
    assert issubclass(InvalidNode, BlobTreeError)
    assert issubclass(BlobTreeError, ValueError)


# -- depth and number -----------------------------------------------------------------------------------

PLACES = [(0.0, 0.0, 0.0), (0.3, 0.2, 0.1), (50.0, 0.0, 0.0)]


def test_a_spine_of_ten_thousand_differences() -> None:
    tree: Node = A
    for i in range(10_000):
        tree = tree - Point((2.0 + 0.001 * i, 0, 0), radius=0.5)
    assert tree.tape.registers == 0
    np.testing.assert_allclose(tree(PLACES), A(PLACES) * [1, 1, 0], atol=1e-6)
    assert (tree.bounds[0] < tree.bounds[1]).all()


def test_a_spine_of_ten_thousand_translations() -> None:
    tree: Node = A
    for _ in range(10_000):
        tree = tree.translate((0.001, 0, 0))
    np.testing.assert_allclose(tree.bounds[0] + tree.bounds[1], [20.0, 0.0, 0.0], atol=1e-4)
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


def test_a_hundred_thousand_points_take_seconds() -> None:
    rng = np.random.default_rng(0)
    started = time.process_time()
    tree = Sum(tuple(Point(tuple(p), radius=0.01) for p in rng.uniform(0, 1, (100_000, 3)).tolist()))
    values = tree(rng.uniform(0, 1, (100, 3)))
    assert len(tree.tape.data) == 1 + 100_000 * (POINT.parameters + 1)
    assert time.process_time() - started < 30.0
    assert values.max() > 0.0
    assert (tree.bounds[0] >= -0.03).all()


def test_hundreds_of_operands_added_one_by_one_are_one_sum() -> None:
    points: list[Node] = [Point((float(i), 0, 0), radius=0.6) for i in range(300)]
    total = reduce(add, points)
    assert total.children == tuple(points)


# -- asking ---------------------------------------------------------------------------------------------


def test_tape_and_bounds_are_made_once() -> None:
    (tree,) = random_trees(seed=3, count=1)
    assert tree.tape is tree.tape
    assert tree.bounds is tree.bounds
    assert tree.tape.on() is tree.tape.on()


# -- the public door ------------------------------------------------------------------------------------


def test_the_door_is_sorted_complete_and_documented() -> None:
    names = blobtree.__all__
    assert names == sorted(names, key=lambda name: (not name.isupper(), not name[0].isupper(), name))
    assert len(set(names)) == len(names)
    public = {
        name
        for name, value in vars(blobtree).items()
        if not name.startswith("_") and not inspect.ismodule(value)
    }
    assert public | {"polygonize"} == set(names)
    for name in names:
        value = getattr(blobtree, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert value.__doc__, name
            assert value.__module__.startswith("blobtree.")


def test_every_public_member_and_module_of_the_package_is_documented() -> None:
    for path in sorted(Path(blobtree.__file__).parent.glob("*.py")):
        module = ast.parse(path.read_text(encoding="utf-8"))
        assert ast.get_docstring(module), path.name
        for node in ast.walk(module):
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                inside = any(
                    isinstance(outer, ast.FunctionDef) and node in ast.walk(outer) and outer is not node
                    for outer in ast.walk(module)
                )
                private = any(
                    isinstance(outer, ast.ClassDef) and outer.name.startswith("_") and node in ast.walk(outer)
                    for outer in ast.walk(module)
                )
                assert inside or private or ast.get_docstring(node), f"{path.name}: {node.name}"
