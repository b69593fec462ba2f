"""Every row of the table of operators: value, partials, slope bound and algebra, in float64."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree.declare.claims import OperatorRow
from blobtree.formulas.operators import DIFFERENCE, INTERSECTION, OPERATORS, RICCI, SUM, UNION
from tests.blobtree.transpile.warp_functions import call

Floats = NDArray[np.float64]

EXPONENTS = (1.0, 1.5, 2.0, 7.0, 100.0)


def norm(a: Any, b: Any, n: float) -> Any:
    """(aⁿ + bⁿ)^(1/n), the larger operand taken out so that float64 can hold a hundredth power."""
    larger = np.maximum(np.maximum(a, b), 1e-300)
    return larger * ((a / larger) ** n + (b / larger) ** n) ** (1.0 / n)


def difference(a: Any, b: Any, _n: float) -> Any:
    top = np.maximum(a, 1.0)
    return np.where(b <= 0.0, a, np.maximum(np.minimum(a, top - b * (2.0 * top - 1.0)), 0.0))


VALUES: dict[OperatorRow, Callable[[Any, Any, float], Any]] = {
    SUM: lambda a, b, n: a + b,
    RICCI: norm,
    UNION: lambda a, b, n: np.maximum(a, b),
    INTERSECTION: lambda a, b, n: np.minimum(a, b),
    DIFFERENCE: difference,
}
ROWS = [(operator, n) for operator in OPERATORS for n in (EXPONENTS if operator is RICCI else (0.0,))]
EVERY_ROW = pytest.mark.parametrize(("operator", "n"), ROWS, ids=[f"{o.name}-{n:g}" for o, n in ROWS])


def pairs(count: int = 4000) -> tuple[Floats, Floats]:
    """Operands from 0 to 4, of one size and of very different ones; zeros among them."""
    rng = np.random.default_rng(0)
    a, b = 4.0 * rng.uniform(0.0, 1.0, (2, count)) ** 2
    tiny = 10.0 ** rng.uniform(-12.0, 0.0, count // 4)
    a[: count // 4] = tiny
    b[count // 8 : 3 * count // 8] = tiny
    special = np.array([(x, y) for x in (0.0, 0.25, 0.5, 1.0, 2.0) for y in (0.0, 0.25, 0.5, 1.0, 2.0)])
    a, b = (
        np.concatenate(both).astype(np.float32).astype(np.float64)
        for both in ((a, special[:, 0]), (b, special[:, 1]))
    )
    return a, b


def partials(operator: OperatorRow, a: Floats, b: Floats, n: float) -> NDArray[np.float32]:
    return call(operator.partials, a=a, b=b, exponent=n)


def test_the_table_is_complete() -> None:
    assert set(VALUES) == set(OPERATORS)
    assert len({operator.name for operator in OPERATORS}) == len(OPERATORS)


@EVERY_ROW
def test_values(operator: OperatorRow, n: float) -> None:
    a, b = pairs()
    np.testing.assert_allclose(
        partials(operator, a, b, n)[:, 0], VALUES[operator](a, b, n), rtol=2e-6, atol=2e-6
    )


@EVERY_ROW
def test_partials_are_differences(operator: OperatorRow, n: float) -> None:
    """Away from kinks, where one-sided differences of float64 agree with each other."""
    a, b = pairs()
    smooth = np.minimum(a, b) > 1e-3
    a, b = a[smooth], b[smooth]
    value, step = VALUES[operator], 1e-6
    seen = partials(operator, a, b, n)
    for column, (da, db) in ((1, (step, 0.0)), (2, (0.0, step))):
        ahead = (value(a + da, b + db, n) - value(a, b, n)) / step
        behind = (value(a, b, n) - value(a - da, b - db, n)) / step
        agree = np.abs(ahead - behind) < 1e-2
        assert agree.mean() > 0.98
        central = 0.5 * (ahead + behind)
        np.testing.assert_allclose(seen[agree, column], central[agree], atol=1e-4 * max(1.0, n / 10.0))


@EVERY_ROW
def test_nothing_added_changes_nothing(operator: OperatorRow, n: float) -> None:
    a, _ = pairs()
    zero = np.zeros_like(a)
    seen = partials(operator, a, zero, n)
    expected = zero if operator is INTERSECTION else a
    np.testing.assert_allclose(seen[:, 0], expected, rtol=2e-7)
    present = a > 0.0
    np.testing.assert_array_equal(
        seen[present, 1], np.full(present.sum(), float(operator is not INTERSECTION))
    )
    if operator in (UNION, INTERSECTION, DIFFERENCE, SUM):
        np.testing.assert_array_equal(seen[:, 0], expected.astype(np.float32))


@EVERY_ROW
def test_a_fold_may_start_from_nothing_where_the_table_says_so(operator: OperatorRow, n: float) -> None:
    _, b = pairs()
    seen = partials(operator, np.zeros_like(b), b, n)[:, 0]
    assert operator.starts_from_zero == bool(np.allclose(seen, b, rtol=2e-7, atol=0.0))


@EVERY_ROW
def test_operands_change_places_where_the_table_says_so(operator: OperatorRow, n: float) -> None:
    a, b = pairs()
    there, back = partials(operator, a, b, n), partials(operator, b, a, n)
    assert operator.commutes == bool(np.allclose(there[:, 0], back[:, 0], rtol=1e-6))
    if operator.commutes:
        value = VALUES[operator]
        np.testing.assert_allclose(value(value(a, b, n), 0.5, n), value(a, value(b, 0.5, n), n), rtol=1e-12)


@EVERY_ROW
def test_the_field_never_falls_below_zero(operator: OperatorRow, n: float) -> None:
    a, b = pairs()
    seen = partials(operator, a, b, n)
    assert (seen[:, 0] >= 0.0).all()
    assert np.isfinite(seen).all()


@EVERY_ROW
def test_no_slope_exceeds_its_bound(operator: OperatorRow, n: float) -> None:
    """|∂F/∂a ∇a + ∂F/∂b ∇b| for any gradients of bounded length, at any operands below their bounds."""
    rng = np.random.default_rng(1)
    a, b = pairs()
    count = len(a)
    slopes = rng.uniform(0.0, 3.0, (2, count))
    slopes[0, ::7] = slopes[1, ::11] = 0.0
    gradients = rng.normal(size=(2, count, 3))
    gradients[1, ::3] = gradients[0, ::3]  # parallel, the worst case of a sum
    gradients[1, 1::3] = -gradients[0, 1::3]
    gradients *= (slopes / np.linalg.norm(gradients, axis=2))[..., None]
    room = rng.choice([1.0, 1.0, 1.5], (2, count))
    bound = call(
        operator.slope, slope_a=slopes[0], slope_b=slopes[1], max_a=a * room[0], max_b=b * room[1], exponent=n
    )
    seen = partials(operator, a, b, n).astype(np.float64)
    length = np.linalg.norm(seen[:, 1:2] * gradients[0] + seen[:, 2:] * gradients[1], axis=1)
    assert (length <= bound * (1.0 + 2e-5) + 1e-6).all()
    assert (length > 0.9 * bound).mean() > 0.02, "the bound is so loose that this shows nothing"


@pytest.mark.parametrize("a", [0.5, 1.0, 1.0001, 1.7, 3.9])
def test_a_tool_that_barely_reaches_a_place_barely_changes_it(a: float) -> None:
    """The plain complement 1 − b would cut a sum that exceeds 1 down to 1 at once."""
    b = np.array([0.0, 1e-30, 1e-7, 1e-4, 1e-3])
    cut = partials(DIFFERENCE, np.full(5, a), b, 0.0)[:, 0]
    assert (np.abs(cut - a) <= 8.0 * b + 3e-7 * a).all()


def test_the_cut_of_a_difference_lies_where_the_tool_is_half() -> None:
    """F ≥ ½ inside the solid exactly where the tool is below ½, and F falls as the tool grows."""
    a = np.repeat([0.6, 1.0, 1.5, 4.0], 201)
    b = np.tile(np.linspace(0.0, 1.0, 201), 4)
    cut = partials(DIFFERENCE, a, b, 0.0)[:, 0]
    sure = np.abs(b - 0.5) > 1e-4
    np.testing.assert_array_equal((cut >= 0.5)[sure], (b < 0.5)[sure])
    assert (np.diff(cut.reshape(4, 201), axis=1) <= 1e-6).all()
    np.testing.assert_allclose(cut[b == 0.5], 0.5, atol=1e-6)


def test_ricci_runs_from_the_sum_to_the_union() -> None:
    a, b = pairs()
    np.testing.assert_allclose(partials(RICCI, a, b, 1.0)[:, 0], a + b, rtol=1e-6)
    gap = partials(RICCI, a, b, 100.0)[:, 0] - np.maximum(a, b)
    assert (gap >= -1e-6).all()
    assert (gap <= np.maximum(a, b) * (2.0**0.01 - 1.0) + 1e-6).all()
