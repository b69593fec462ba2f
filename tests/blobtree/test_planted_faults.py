"""Faults planted in formulas and claims of kinds by a seed: the laws of `check_kind` find each of them."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree import Node
from blobtree.conformance.laws import LAWS, Case, NotChecked
from blobtree.conformance.plain_field import PlainField
from blobtree.conformance.samples import drawn_node
from blobtree.declare.claims import difference_like_choice, intersection_like_choice
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.tree import union_keeps
from blobtree.transpile.specialize import defined, warp_function
from tests.blobtree.transpile.warp_functions import python_function
from tests.conformance import exact_field

ROWS = {
    "operator": ("partials",),
    "skeleton": ("closest",),
    "field_kind": ("value_gradient",),
    "warp": ("forward", "pullback"),
}
"""The attributes of classes that hold their formulas, and the formulas in which faults are planted."""

BOUNDS = {"operator": "slope", "field_kind": "bounds", "warp": "lipschitz"}
"""The formulas that bound slopes."""

KINDS = {
    "operators": """
        sum union intersection difference ricci superelliptic_blend r_union r_intersection r_difference
        smooth_intersection smooth_difference clean_union controllable_blend
        """,
    "leaves": "point segment cone torus disc box rectangle triangle cylinder superquadric gyroid noise",
    "warps": "twist taper shear stretch limited_twist bend noise_warp",
}
GROUPS = {f"{name} {part}": tags.split()[part::4] for name, tags in KINDS.items() for part in range(4)}
FAULTS_OF_GROUP = 5
NOT_OF_A_FRESH_CLASS = ("file", "pickle", "refusals")
"""Laws that a class without a tag of its own cannot keep, and laws that no formula can break."""


def row_of(kind: Any) -> tuple[str, Any]:
    """Return the attribute that holds the formulas of a kind, and these."""
    return next((name, getattr(kind, name)) for name in ROWS if is_dataclass(getattr(kind, name, None)))


def with_row(kind: Any, label: str, **changed: Any) -> Any:
    """Return a fresh class like a kind, with other formulas or claims."""
    name, row = row_of(kind)
    body = {name: replace(row, digest=f"planted {label}", **changed), "__module__": __name__}
    return type(kind.__name__, (kind,), body)


def formula_in(kind: Any, part: str) -> wp.Function:
    """Return a formula of a leaf as its class has it, or that of a row."""
    name, row = row_of(kind)
    given = kind._formulas if name != "operator" else {}
    found: wp.Function = given[part].function if part in given else getattr(row, part)
    return found


def with_formula(kind: Any, label: str, part: str, function: wp.Function) -> Any:
    """Return a fresh class like a kind, with another formula."""
    if formula_in(kind, part) is getattr(row_of(kind)[1], part):
        return with_row(kind, label, **{part: function})
    declaration = kind._declaration(kind.file_tag)
    changed = replace(declaration.given[part], function=function)
    row = replace(declaration, given={**declaration.given, part: changed}).row()
    return with_row(kind, label, **{part: getattr(row, part)})


def source_of(function: wp.Function) -> ast.Module:
    """Return the syntax tree of a typed function."""
    return ast.parse(textwrap.dedent(inspect.getsource(python_function(function))))


def mutations(function: wp.Function) -> Iterator[tuple[str, ast.Module]]:
    """Yield a function with one change each: a sign, a constant × 1.01, or swapped operands."""
    tree = source_of(function)
    for place, node in enumerate(ast.walk(tree)):
        changed = deepcopy(tree)
        other: Any = list(ast.walk(changed))[place]
        match node:
            case ast.Constant(value=float(value)) if value != 0.0:
                other.value = value * 1.01
                yield f"{value} × 1.01", changed
            case ast.BinOp(op=ast.Add() | ast.Sub() as sign):
                other.op = ast.Sub() if isinstance(sign, ast.Add) else ast.Add()
                yield f"sign in {ast.unparse(node)}", changed
            case ast.BinOp(op=ast.Div()):
                other.left, other.right = other.right, other.left
                yield f"swapped in {ast.unparse(node)}", changed


def compiled(function: wp.Function, tree: ast.Module, label: str) -> wp.Function:
    """Return the function of a changed text."""
    definition: Any = tree.body[0]
    definition.decorator_list = []
    scope = dict(python_function(function).__globals__)
    name = f"{definition.name}_{label}"
    definition.name = name
    return warp_function(defined(name, ast.unparse(tree) + "\n", scope))


def scaled(function: wp.Function, label: str) -> wp.Function:
    """Return a bound at 0.7 of its value."""
    tree = source_of(function)
    for node in ast.walk(tree):
        if isinstance(node, ast.Return) and node.value is not None:
            node.value = ast.BinOp(ast.Constant(0.7), ast.Mult(), node.value)
    return compiled(function, ast.fix_missing_locations(tree), label)


def faults(tag: str) -> Iterator[tuple[str, Any]]:
    """Yield classes like a kind with one fault each, and what the fault is."""
    kind: Any = NODE_KINDS[tag]
    name, row = row_of(kind)
    for part in ROWS[name]:
        function = formula_in(kind, part)
        for number, (change, tree) in enumerate(mutations(function)):
            label = f"{part}_{number}"
            yield (
                f"{tag} {part}: {change}",
                with_formula(kind, label, part, compiled(function, tree, label)),
            )
    if name in BOUNDS:
        part = BOUNDS[name]
        less = scaled(formula_in(kind, part), "less")
        yield f"{tag} {part} × 0.7", with_formula(kind, part, part, less)
    if name == "operator":
        choices: tuple[Any, ...] = (union_keeps, intersection_like_choice, difference_like_choice)
        for choice in choices:
            yield f"{tag} pruned by {choice.key}", with_row(kind, choice.key, choice=choice)
        if not row.monotone:
            yield f"{tag} monotone", with_row(kind, "monotone", monotone=True)
    if tag == "torus":  # a solid round cone is convex: only its influence varies
        yield f"{tag} convex", with_row(kind, "convex", convex=True)


def results(node: Node) -> np.ndarray[Any, Any]:
    """Return values, gradients and bounds at points."""
    rng = np.random.default_rng(1)
    field = PlainField(node.tape)
    points = rng.uniform(-0.8, 0.8, (40, 3)).astype(np.float32)
    headings = np.eye(3)[rng.integers(0, 3, 40)]
    bounds = field.bounds(points, headings, np.full(40, 0.1))
    ranges = [field.pruned(point, 0.1)[0] for point in points[:20]]
    pruned = [field.pruned(point, 0.1)[1].values([point]) for point in points[:20]]
    parts = (field.values(points), field.gradients(points), bounds, ranges, pruned)
    return np.concatenate([np.ravel(part) for part in parts])


def changes_nothing(faulty: Any, kind: Any) -> bool:
    """Return True if a fault changes no result beyond rounding."""
    for number in range(2):
        try:
            seen, expected = (
                results(drawn_node(one, np.random.default_rng([4, number]))) for one in (faulty, kind)
            )
        except IndexError:  # it reads beyond its tape
            return False
        if not np.allclose(seen, expected, rtol=1e-5, atol=1e-6):
            return False
    return True


def broken_law(kind: Any, samples: int = 6) -> str | None:
    """Return the first law that a kind breaks, None for none."""
    for number in range(samples):
        node = drawn_node(kind, np.random.default_rng([5, number]))
        for place, (name, law) in enumerate(LAWS.items()):
            if name in NOT_OF_A_FRESH_CLASS:
                continue
            case = Case(node, exact_field, compiled=False, rng=np.random.default_rng([number, place]))
            try:
                if next(law(case), None) is not None:
                    return name
            except NotChecked:
                continue
            except Exception as error:  # a fault may break a formula
                return f"{name}: {type(error).__name__}"
    return None


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_planted_faults_are_found(group: str) -> None:
    rng = np.random.default_rng(list(group.encode()))
    planted: list[tuple[str, Any, Any]] = []
    candidates = [(label, faulty, NODE_KINDS[tag]) for tag in GROUPS[group] for label, faulty in faults(tag)]
    for place in rng.permutation(len(candidates)).tolist():
        label, faulty, kind = candidates[place]
        if not changes_nothing(faulty, kind):
            planted.append((label, faulty, kind))
        if len(planted) == FAULTS_OF_GROUP:
            break
    assert len(planted) == FAULTS_OF_GROUP
    assert [label for label, faulty, _ in planted if broken_law(faulty) is None] == []


@pytest.mark.slow
@pytest.mark.parametrize("tag", ["union", "segment", "gyroid", "taper"])
def test_a_fresh_class_without_a_fault_keeps_the_laws(tag: str) -> None:
    assert broken_law(with_row(NODE_KINDS[tag], "without a fault"), samples=2) is None
