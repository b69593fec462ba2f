"""Every blend of the library: value, partials, ranges, choices and slope bounds, against float64."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import GradientBlend
from blobtree.declare.claims import KEEP_LEFT, KEEP_NONE, KEEP_RIGHT, OperatorRow, Support
from blobtree.formulas.operators import DEEPEST
from blobtree.nodes import blends
from tests.blobtree.formulas.test_operators import pairs
from tests.blobtree.transpile.warp_functions import call, python_function
from tests.oracles import blends as oracle

Floats = NDArray[np.float64]

SETTINGS: dict[str, list[dict[str, float]]] = {
    "superelliptic_blend": [
        {"width": width, "exponent": exponent} for width in (0.05, 0.3, 0.5) for exponent in (1.0, 2.0, 30.0)
    ],
    "smooth_intersection": [{"width": width} for width in (1e-3, 0.1, 0.5)],
    "smooth_difference": [{"width": width} for width in (1e-3, 0.1, 0.5)],
    "controllable_blend": [
        {"left_angle": left, "right_angle": right}
        for left, right in ((0, 0), (0, 30), (20, 5), (44, 44), (10, 43))
    ],
}
DECLARED = [kind.operator for kind in vars(blends).values() if "tag" in getattr(kind, "__dict__", ())]
BLENDS = [*(row for row in DECLARED if not row.gradients), DEEPEST]
ROWS = [(row, setting) for row in BLENDS for setting in SETTINGS.get(row.name, [{}])]
EVERY_ROW = pytest.mark.parametrize(("row", "setting"), ROWS, ids=[f"{r.name}-{s}" for r, s in ROWS])
FALLING = ("smooth_difference", "r_difference")


def run(row: OperatorRow, part: str, setting: dict[str, float], **arguments: Any) -> NDArray[Any]:
    """Call a function of a row with its parameters, on a tape if there are several."""
    function = getattr(row, part)
    numbers = list(setting.values())
    if row.name == "controllable_blend":
        numbers = np.tan(np.radians(numbers)).tolist()
    declared = python_function(function).__annotations__
    several = {"parameter": 0.0, "tape": [numbers + [0.0] * (4 - len(numbers))]}
    extra: dict[str, Any] = (
        several if len(numbers) > 1 else dict.fromkeys(("parameter", "width", "exponent"), numbers or 0.0)
    )
    return call(function, **arguments, **{name: value for name, value in extra.items() if name in declared})


def partials(row: OperatorRow, setting: dict[str, float], a: Floats, b: Floats) -> Floats:
    return run(row, "partials", setting, a=a, b=b).astype(np.float64)


def test_the_table_is_complete() -> None:
    assert set(oracle.VALUES) == {row.name for row in (*BLENDS, GradientBlend.operator)}


def operands(row: OperatorRow) -> tuple[Floats, Floats]:
    """Pairs of fields; those of a signed row are not positive."""
    a, b = pairs()
    return (-a, -b) if row.signed else (a, b)


@EVERY_ROW
def test_values(row: OperatorRow, setting: dict[str, float]) -> None:
    a, b = operands(row)
    expected = oracle.VALUES[row.name](a, b, **setting)
    np.testing.assert_allclose(partials(row, setting, a, b)[:, 0], expected, rtol=1e-5, atol=2e-6)


@EVERY_ROW
def test_partials_are_differences(row: OperatorRow, setting: dict[str, float]) -> None:
    """Away from kinks, where one-sided differences of float64 agree with each other."""
    a, b = operands(row)
    present = np.minimum(np.abs(a), np.abs(b)) > 1e-3
    a, b = a[present], b[present]
    by_a, by_b, change = oracle.partials(row.name, a, b, **setting)
    smooth = change < 1e-3
    assert smooth.mean() > 0.95
    seen = partials(row, setting, a, b)
    for column, expected in ((1, by_a), (2, by_b)):
        np.testing.assert_allclose(seen[smooth, column], expected[smooth], rtol=2e-3, atol=2e-3)


@EVERY_ROW
def test_an_absent_operand(row: OperatorRow, setting: dict[str, float]) -> None:
    a, _ = operands(row)
    zero = np.zeros_like(a)
    right, left = partials(row, setting, a, zero)[:, 0], partials(row, setting, zero, a)[:, 0]
    np.testing.assert_array_equal(right, zero if row.support is Support.COMMON else a)
    np.testing.assert_array_equal(left, a if row.support is Support.EITHER else zero)
    assert row.starts_from_zero == (row.support is Support.EITHER)


@EVERY_ROW
def test_results_are_finite_and_of_one_sign(row: OperatorRow, setting: dict[str, float]) -> None:
    tiny = np.array([0.0, 1e-38, 1e-30, 1e-19, 1e-12, 1e-7, 0.25, 0.5, 1.0, 3.0])
    a, b = (both.ravel() for both in np.meshgrid(tiny, tiny))
    sign = -1.0 if row.signed else 1.0
    seen = partials(row, setting, sign * a, sign * b)
    assert np.isfinite(seen).all()
    assert (sign * seen[:, 0] >= 0.0).all()


@EVERY_ROW
def test_order_matters_where_the_table_says_so(row: OperatorRow, setting: dict[str, float]) -> None:
    if not row.commutes:
        return
    a, b = operands(row)
    value = oracle.VALUES[row.name]
    np.testing.assert_allclose(value(a, b, **setting), value(b, a, **setting), rtol=1e-12)
    third = np.full_like(a, 0.6)
    nested = value(value(a, b, **setting), third, **setting), value(a, value(b, third, **setting), **setting)
    np.testing.assert_allclose(*nested, rtol=1e-9)


@EVERY_ROW
def test_ranges_contain_samples_and_choices_are_exact(row: OperatorRow, setting: dict[str, float]) -> None:
    rng = np.random.default_rng(2)
    ends = np.sort(2.0 * rng.uniform(0.0, 1.0, (2, 1500, 2)) ** 2, axis=2)
    ends[:, ::3] = np.sort(ends[:, ::3, :1] + [0.0, 0.05], axis=2)
    ends[0, ::7, 0] = ends[1, ::5, 0] = 0.0
    ends[0, ::35] = ends[1, ::25] = 0.0
    if row.signed:
        ends = np.sort(-ends, axis=2)
    ends = ends.astype(np.float32).astype(np.float64)
    bounds = run(row, "range", setting, a=ends[0], b=ends[1]).astype(np.float64)
    choice = run(row, "choice", setting, a=ends[0], b=ends[1])
    shares = rng.uniform(0.0, 1.0, (2, 40, 1500)).round(1)
    for one, other in zip(*shares, strict=True):
        a, b = (
            low + share * (high - low)
            for share, (low, high) in zip((one, other), ends.transpose(0, 2, 1), strict=True)
        )
        seen = partials(row, setting, a, b)
        assert (seen[:, 0] >= bounds[:, 0] - 1e-6).all()
        assert (seen[:, 0] <= bounds[:, 1] + 1e-6).all()
        for keep, expected in (
            (KEEP_LEFT, np.stack([a, np.ones_like(a), np.zeros_like(a)], axis=1)),
            (KEEP_RIGHT, np.stack([b, np.zeros_like(a), np.ones_like(a)], axis=1)),
        ):
            kept = (choice == keep) & ((a != 0.0) | (b != 0.0))
            np.testing.assert_allclose(seen[kept, 0], expected[kept, 0], rtol=1e-6, atol=1e-7)
            np.testing.assert_allclose(seen[kept, 1:], expected[kept, 1:], atol=1e-5)
        np.testing.assert_array_equal(seen[choice == KEEP_NONE, 0], 0.0)


@EVERY_ROW
def test_no_slope_exceeds_its_bound(row: OperatorRow, setting: dict[str, float]) -> None:
    """|∂F/∂a ∇a + ∂F/∂b ∇b| for gradients of bounded length; for monotone rows also slopes below 0."""
    rng = np.random.default_rng(1)
    a, b = operands(row)
    count = len(a)
    slopes = rng.uniform(0.0, 3.0, (2, count))
    if row.monotone:
        slopes[:, ::2] -= 1.5
    slopes[0, ::7] = slopes[1, ::11] = 0.0
    room = rng.choice([1.0, 1.0, 1.5], (2, count))
    bound = run(
        row, "slope", setting, slope_a=slopes[0], slope_b=slopes[1], max_a=a * room[0], max_b=b * room[1]
    )
    seen = partials(row, setting, a, b)
    weights = seen[:, 1:] if row.monotone else np.abs(seen[:, 1:])
    steepest = weights[:, 0] * slopes[0] + weights[:, 1] * slopes[1]
    assert (steepest <= bound * (1.0 + 1e-4 * np.sign(bound)) + 1e-5).all()
    assert (steepest > 0.5 * bound).mean() > 0.01, "the bound is so loose that this shows nothing"


@EVERY_ROW
def test_monotone_rows_never_fall(row: OperatorRow, setting: dict[str, float]) -> None:
    a, b = operands(row)
    seen = partials(row, setting, a, b)
    if row.monotone:
        assert (seen[:, 1:] >= -1e-6).all()
    else:
        assert row.name in FALLING
        assert (seen[:, 2] <= 1e-6).all()


@pytest.mark.parametrize("name", ["r_union", "clean_union"])
def test_a_clean_union_has_the_surface_of_the_union_and_is_smooth_off_its_crease(name: str) -> None:
    row = next(row for row in BLENDS if row.name == name)
    a, b = (both.ravel() for both in np.meshgrid(*[np.linspace(0.0, 1.0, 201)] * 2))
    inside = partials(row, {}, a, b)[:, 0] >= 0.5
    sure = np.abs(np.maximum(a, b) - 0.5) > 1e-4
    np.testing.assert_array_equal(inside[sure], (np.maximum(a, b) >= 0.5)[sure])
    equal = np.linspace(0.02, 1.0, 99)
    equal = equal[np.abs(equal - 0.5) > 0.02]
    below, above = partials(row, {}, equal, equal - 1e-5), partials(row, {}, equal, equal + 1e-5)
    np.testing.assert_allclose(below[:, 1:], above[:, 1:], atol=0.02)


def test_a_blend_of_width_one_half_is_that_of_ricci() -> None:
    a, b = pairs()
    row = next(row for row in BLENDS if row.name == "superelliptic_blend")
    seen = partials(row, {"width": 0.5, "exponent": 3.0}, a, b)[:, 0]
    np.testing.assert_allclose(seen, (a**3 + b**3) ** (1 / 3), rtol=1e-5, atol=1e-6)
