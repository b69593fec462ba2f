"""Expressions: values and intervals of all operations beside NumPy, trees of parts, meshes, and refusals."""

from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Expression, Node, from_json, polygonize, to_json
from blobtree.errors import InvalidNode
from blobtree.nodes import clauses, expressions
from blobtree.tape.model import gradients_at
from blobtree.tape.program import postorder
from blobtree.transpile.python import plain_python, vector
from tests.blobtree.expressions import letters, program
from tests.blobtree.tape.evaluations import bounds_along
from tests.conformance import broken_laws
from tests.oracles import blobtree as oracle
from tests.oracles.expressions import VALUES, values

Floats = NDArray[np.float64]
BOX: Any = ((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))
FORMULAS: Any = expressions
ROW, RANGE, ALONG = (
    plain_python(formula.func)
    for formula in (FORMULAS.clause_row, FORMULAS.clause_range, FORMULAS.clause_along)
)
CONSTANT_SECOND = ("mod", "compare", "pow", "nth-root")
JUMPS = ("floor", "ceil", "round", "mod", "compare")


def parts_of(node: Node) -> list[Node]:
    """The distinct parts of an expression."""
    nodes: Any = postorder(cast(Any, node), below=lambda item: item.program_children)
    return [item for item in nodes if not item.program_children]


def operands_of(operation: str, rng: np.random.Generator) -> list[Floats]:
    """Ranges (2, 2) of both operands that the operation is defined on."""
    center, radius = rng.uniform(-2.0, 2.0, 2), 10.0 ** rng.uniform(-3.0, 0.0, 2)
    if operation == "pow":
        center[0], radius[1] = abs(center[0]), 0.0
    if operation in ("nth-root", "mod", "compare"):
        center[1], radius[1] = rng.integers(1, 5), 0.0
    return list(np.column_stack([center - radius, center + radius]))


@pytest.mark.parametrize("operation", VALUES)
def test_values_and_ranges_of_operations(operation: str) -> None:
    rng = np.random.default_rng(5)
    code = clauses.CODES[operation]
    with np.errstate(all="ignore"):
        for _ in range(100):
            a, b = operands_of(operation, rng)
            if operation == "pow" and rng.random() < 0.5:
                b = b + 0.25 - b % 0.25
            count = clauses.ARITIES[operation]
            x, y = (rng.uniform(low, high, 40) for low, high in (a, b))
            exact = VALUES[operation](*(x, y)[:count])
            found = np.array([ROW(code, *pair) for pair in zip(x, y, strict=True)])
            sane = np.isfinite(exact) & (np.abs(exact) < 1e6)
            if operation == "pow":
                sane &= x > 0.0
            np.testing.assert_allclose(found[sane, 0], exact[sane], rtol=1e-6, atol=1e-6)
            slopes = 1.0, (0.5 if count == 2 and operation not in CONSTANT_SECOND else 0.0)
            low, high, slope = RANGE(code, vector(*a, slopes[0]), vector(*b, slopes[1]))
            assert low <= exact[sane].min(initial=np.inf) + 1e-6 * (1.0 + abs(low))
            assert high >= exact[sane].max(initial=-np.inf) - 1e-6 * (1.0 + abs(high))
            steepest = np.abs(found[:, 1:]) @ slopes
            assert (steepest[sane] <= slope * (1.0 + 1e-6)).all()
            if operation in JUMPS:
                order = np.argsort(x)
                steps = np.abs(np.diff(exact[order])) / np.diff(x[order])
                assert (steps <= slope * (1.0 + 1e-6)).all()


def any_program(rng: np.random.Generator, count: int) -> list[str]:
    """The lines of a program of clauses of all kinds, whose numbers may be huge."""
    lines = ["x var-x", "y var-y", "k mul x x", "l exp k"]
    for i in range(count):
        operation = str(rng.choice(tuple(VALUES)))
        read = rng.choice([line.split()[0] for line in lines], clauses.ARITIES[operation])
        lines.append(" ".join((f"_{i}", operation, *read)))
    return lines


def inner_operands(operation: str, rng: np.random.Generator) -> Floats:
    """Values (2, 33) of both operands on the way from 0 to 1; those that must be constant are."""
    start, rate = rng.uniform(-2.0, 2.0, 2), rng.normal(size=2) * 10.0 ** rng.uniform(-3.0, 0.5, 2)
    start = np.where(rng.random(2) < 0.2, 0.0, start)
    if operation in CONSTANT_SECOND:
        start[1], rate[1] = rng.integers(1, 5), 0.0
    return np.asarray(start[:, None] + rate[:, None] * np.linspace(0.0, 1.0, 33))


@pytest.mark.parametrize("operation", VALUES)
def test_rates_along_lines_hold_of_operations(operation: str) -> None:
    rng, code = np.random.default_rng(6), clauses.CODES[operation]
    for _ in range(200):
        operands = inner_operands(operation, rng)
        rates = 32.0 * np.diff(operands, axis=1)
        ranges = np.stack([operands.min(axis=1), operands.max(axis=1), rates.min(axis=1), rates.max(axis=1)])
        low, high, least, greatest = ALONG(code, *(vector(*numbers) for numbers in ranges.T))
        found = np.array([ROW(code, *pair)[0] for pair in operands.T])
        if np.abs(found).max() >= 1e6:
            continue
        changes = 32.0 * np.diff(found)
        slack = 1e-6 * (1.0 + np.abs(found).max())
        assert low <= found.min() + slack
        assert high >= found.max() - slack
        assert least <= changes.min() + 64.0 * slack
        assert greatest >= changes.max() - 64.0 * slack


@pytest.mark.parametrize("degree", [-3.0, -2.0, -1.0, 0.5, 3.0, (2.0, 4.0)])
def test_ranges_of_roots_of_any_degree(degree: Any) -> None:
    rng, code = np.random.default_rng(8), clauses.CODES["nth-root"]
    n = np.array([degree, degree]).reshape(-1)[[0, -1]]
    for _ in range(50):
        center, radius = rng.uniform(-2.0, 2.0), 10.0 ** rng.uniform(-2.0, 0.0)
        low, high, slope = RANGE(
            code, vector(center - radius, center + radius, 1.0), vector(*n, float(n[0] < n[1]))
        )
        pairs = np.column_stack(
            [rng.uniform(center - radius, center + radius, 40), rng.uniform(n[0], n[1], 40)]
        )
        rows = np.array([ROW(code, *pair)[:2] for pair in pairs])
        assert low <= rows[:, 0].min() + 1e-6
        assert rows[:, 0].max() <= high + 1e-6
        assert np.abs(rows[:, 1]).max() <= slope * (1.0 + 1e-6)


def test_large_whole_powers_have_the_sign_of_their_parity() -> None:
    lines = ["x var-x", "n const 65", "p pow x n", "one const 1", "s add p one"]
    node = Expression(lines, (0, 0, 0), (4, 4, 4))
    assert (node([[-1.01, 0, 0], [-0.9, 0, 0]]) > 0.5).tolist() == [True, False]


@pytest.mark.parametrize("factor", [1e15, -1e15])
def test_products_beyond_floats_have_the_right_sign(factor: float) -> None:
    shape = ["x var-x", "y var-y", "m min x y", f"a const {factor}", "b const 1e15"]
    node = Expression([*shape, "p mul m a", "q mul p b", "r mul q b"], *BOX)
    inside = node(np.array([[0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])) > 0.5
    assert inside.tolist() == [factor < 0.0, factor > 0.0]


@pytest.mark.parametrize(
    "operation", ["sqrt -4", "ln -4", "asin -4", "acos 4", "pow -4 0.5", "nth-root -4 2"]
)
def test_constants_are_folded_as_they_are_computed(operation: str) -> None:
    name, *constants = operation.split()
    lines = [f"c{i} const {value}" for i, value in enumerate(constants)]
    folded = clauses.parsed([*lines, " ".join(["r", name, *(f"c{i}" for i in range(len(constants)))])])
    assert folded[-1].value == pytest.approx(ROW(clauses.CODES[name], *map(float, [*constants, "0"][:2]))[0])


@pytest.mark.parametrize("seed", range(6))
def test_fields_and_gradients_are_those_of_the_oracle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    node = Expression(program(rng, 12), *BOX, width=0.7)
    points = rng.uniform(-1.2, 1.2, (300, 3)).astype(np.float32).astype(np.float64)
    field = oracle.evaluate(node, points)
    np.testing.assert_allclose(node(points), field.value, atol=2e-5)
    smooth = field.margin > 1e-2
    exact = oracle.gradient(node, points[smooth])
    tolerance = 1e-3 * (1.0 + np.abs(exact).max(initial=0.0))
    np.testing.assert_allclose(node.gradient(points[smooth]), exact, atol=tolerance)


@pytest.mark.parametrize("seed", range(3))
def test_values_alone_are_those_beside_gradients(seed: int) -> None:
    rng = np.random.default_rng(seed)
    node = Expression(any_program(rng, 20), *BOX, width=0.7)
    points = rng.uniform(-1.2, 1.2, (500, 3))
    np.testing.assert_array_equal(node(points), gradients_at(node.tape, points)[:, 0])


@pytest.mark.parametrize("seed", range(8))
def test_rays_are_no_steeper_than_their_bounds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    node = Expression(program(rng, 12), *BOX, weight=(1.0, -0.7)[seed % 2])
    assert not broken_laws(node, rng, "interval", "pruning", "Lipschitz bound")


def test_rays_along_a_wall_do_not_change() -> None:
    node = Expression(["x var-x", "y var-y", "r hypot x y", "s square r", "h const 0.3", "d sub s h"], *BOX)
    starts = np.array([(0.5, 0.3, -0.9), (0.1, -0.6, 0.9)])
    value, rise, fall = bounds_along(node.tape, starts, [(0, 0, 1), (0, 0, -1)], 0.8).T
    assert (value > 0.0).all()
    assert (value < 1.0).all()
    assert rise.tolist() == fall.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("seed", range(4))
def test_boxes_bound_the_field(seed: int) -> None:
    rng = np.random.default_rng(seed)
    node = Expression(program(rng, 12), *BOX)
    for _ in range(20):
        center, half = rng.uniform(-1.0, 1.0, 3), 10.0 ** rng.uniform(-2.0, -0.3)
        low, high = node.interval(center - half, center + half)
        field = node(rng.uniform(center - half, center + half, (200, 3)))
        assert low <= field.min() + 1e-6
        assert high >= field.max() - 1e-6


def test_min_and_max_are_a_tree_of_parts() -> None:
    text = letters(np.random.default_rng(1), 40)
    node = Expression("\n".join(["# a comment", "", *text]), (0, 0, 0), (2, 2, 0.2))
    assert len(parts_of(node)) > 100
    assert not any("min" in line for line in node.clauses[:3])
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (2000, 3)) * (1.0, 1.0, 0.1)
    value, _ = values(text, points)
    assert ((node(points) > 0.5) == (value < 0.0))[np.abs(value) > 1e-6].all()


def test_meshes_lie_on_the_surface() -> None:
    text = letters(np.random.default_rng(3), 25)
    mesh = polygonize(Expression(text, (0, 0, 0), (2, 2, 0.3)), resolution=96)
    value, _ = values(text, mesh.vertices.astype(np.float64))
    inside = np.abs(mesh.vertices[:, 2]) < 0.149
    assert np.abs(value[inside]).max() < 1e-4


def test_factors_and_offsets_are_moved_into_parts() -> None:
    shape = ["x var-x", "y var-y", "h const 0.5", "a sub x h", "b sub y h", "m min a b"]
    flipped = [*shape, "n neg m", "k const 2", "s mul n k", "t add s h"]
    node = Expression(flipped, *BOX)
    assert len(parts_of(node)) == 2
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (500, 3))
    np.testing.assert_allclose(node(points), oracle.value(node, points), atol=1e-5)


def test_shared_clauses_do_not_multiply() -> None:
    lines = ["x var-x", "y var-y", "a0 sin x", "b0 cos y"]
    for i in range(60):
        lines += [f"a{i + 1} min a{i} b{i}", f"b{i + 1} max a{i} b{i}"]
    node = Expression(lines, *BOX)
    assert len(parts_of(node)) == 1
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (100, 3))
    np.testing.assert_allclose(node(points), oracle.value(node, points), atol=1e-5)


def test_negative_weights_carve_in_a_sum() -> None:
    rng = np.random.default_rng(6)
    text, points = letters(rng, 6, size=0.6), rng.uniform(-1.0, 1.0, (500, 3))
    whole, carved = (Expression(text, *BOX, weight=weight)(points) for weight in (1.0, -0.5))
    np.testing.assert_allclose(carved, -0.5 * whole, atol=1e-6)


def test_files_hold_the_text() -> None:
    node = Expression(program(np.random.default_rng(7), 8), *BOX, width=0.3)
    assert from_json(to_json(node)) == node


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected 1 to 200,000 clauses"),
        ("# nothing", "expected 1 to 200,000 clauses"),
        ("x", r"clauses\[0\]: expected one of var-x, .*; got ''"),
        ("x var-w", r"clauses\[0\]: expected one of var-x, .*; got 'var-w'"),
        ("x var-x\ny rand x", r"clauses\[1\]: expected one of .*; got 'rand'"),
        ("x var-x\ny add x", "expected 2 operands of add, got 1"),
        ("x var-x 1", "expected 0 operands of var-x, got 1"),
        ("x neg x", "expected names of earlier clauses, got 'x'"),
        ("x neg y\ny neg x", "expected names of earlier clauses, got 'y'"),
        ("c const nan", "expected a number up to 1e.15, got 'nan'"),
        ("c const 1e400", "expected a number up to 1e.15, got '1e400'"),
        ("c const one", "expected a number up to 1e.15, got 'one'"),
        ("x var-x\nx neg x", "expected a name of its own, got 'x' again"),
        ("x var-x\nb const 1e15\nm min b x\nn mul m b", "mul of .* is no number here"),
        ("c const 0\nr recip c", "recip of 0 is no number here"),
        ([1, 2], "expected texts that are not empty"),
    ],
)
def test_impossible_texts_are_refused(text: Any, message: str) -> None:
    with pytest.raises(InvalidNode, match=message):
        Expression(text, *BOX)


def test_parts_with_too_many_values_are_refused() -> None:
    lines = ["x var-x", *(f"a{i} sin {'x' if i == 0 else f'a{i - 1}'}" for i in range(40)), "s0 mul a0 a39"]
    lines += [f"s{i + 1} mul s{i} a{i + 1}" for i in range(38)]
    with pytest.raises(InvalidNode, match="need at most 29 values at once"):
        Expression(lines, *BOX)


@pytest.mark.parametrize("seed", range(3))
def test_huge_numbers_give_finite_fields(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(10):
        lines = any_program(rng, 12)
        node = Expression(lines, *BOX)
        points = rng.uniform(-1.5, 1.5, (50, 3))
        assert np.isfinite(node(points)).all()
        assert np.isfinite(node.gradient(points)).all()
        assert np.isfinite(node.interval((-1, -1, -1), (1, 1, 1))).all()
