"""Operators at extreme operands and parameters, against float64: one law a test, for every row.

`blobtree.check_kind` tries nodes, whose operands are rarely tiny, equal, above 2, or of very different sizes.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Difference, Ricci
from blobtree.declare.claims import KEEP_LEFT, KEEP_NONE, KEEP_RIGHT, OperatorRow, Support
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.pieces import _Deepest
from blobtree.nodes.rounds import _ArcDifference, _ArcIntersection, _ArcUnion
from tests.blobtree.transpile.warp_functions import call, python_function
from tests.oracles import blends as oracle
from tests.oracles.blobtree import Field, pressed_field, rated

Floats = NDArray[np.float64]
Setting = dict[str, float]

DEEPEST, DIFFERENCE, RICCI = _Deepest.operator, Difference.operator, Ricci.operator

CONTACTS: list[Setting] = [
    {"ratio": ratio, "width": width, "height": height}
    for ratio, width, height in (
        (1.0, 0.3, 0.05),
        (4.0, 0.5, 0.125),
        (0.2, 0.1, 0.025),
        (1.0, 0.4, 0.0),
        (100.0, 0.2, 0.01),
        (0.01, 0.5, 0.1),
    )
]
CUTS: list[Setting] = [
    {"left": left, "right": right} for left, right in ((2.0, 1.4), (1.1, 1.7), (1.01, 1.02))
]
SETTINGS: dict[str, list[Setting]] = {
    "ricci": [{"exponent": exponent} for exponent in (1.0, 1.5, 2.0, 7.0, 100.0)],
    "superelliptic_blend": [
        {"width": width, "exponent": exponent} for width in (0.05, 0.3, 0.5) for exponent in (1.0, 2.0, 30.0)
    ],
    "smooth_intersection": [{"width": width} for width in (1e-3, 0.1, 0.5)],
    "smooth_difference": [{"width": width} for width in (1e-3, 0.1, 0.5)],
    "controllable_blend": [
        {"left_angle": left, "right_angle": right}
        for left, right in ((0, 0), (0, 30), (20, 5), (44, 44), (10, 43))
    ],
    "arc_union": [{"left": 0.0, "right": 0.6}, {"left": 0.9, "right": 0.3}, {"left": 0.99, "right": 0.98}],
    "arc_intersection": CUTS,
    "arc_difference": CUTS,
    "press": CONTACTS,
    "bulge": CONTACTS,
    "rated_union": [{"ratio": ratio} for ratio in (0.01, 0.5, 1.0, 3.0, 100.0)],
}


def norm(a: Any, b: Any, exponent: float) -> Any:
    """(aⁿ + bⁿ)^(1/n), the larger operand taken out so that float64 can hold a hundredth power."""
    larger = np.maximum(np.maximum(a, b), 1e-300)
    return larger * ((a / larger) ** exponent + (b / larger) ** exponent) ** (1.0 / exponent)


def difference(a: Any, b: Any) -> Any:
    top = np.maximum(a, 1.0)
    return np.where(b <= 0.0, a, np.maximum(np.minimum(a, top - b * (2.0 * top - 1.0)), 0.0))


def pressed(a: Floats, b: Floats, ratio: float, width: float, height: float) -> Floats:
    empty = np.zeros((len(a), 3)), np.full(len(a), np.inf)
    return pressed_field(Field(a, *empty), Field(b, *empty), ratio, width, height).value


def bulged(a: Floats, b: Floats, ratio: float, width: float, height: float) -> Floats:
    return np.where(rated(b, ratio) >= 0.5, a, pressed(a, b, ratio, width, height))


VALUES: dict[str, Callable[..., Floats]] = {
    **oracle.VALUES,
    "sum": lambda a, b: a + b,
    "ricci": norm,
    "union": lambda a, b: np.maximum(a, b),
    "intersection": lambda a, b: np.minimum(a, b),
    "difference": difference,
    "press": pressed,
    "bulge": bulged,
    "rated_union": lambda a, b, ratio: np.maximum(a, rated(b, ratio)),
}
DECLARED = [
    row for kind in NODE_KINDS.values() if isinstance(row := getattr(kind, "operator", None), OperatorRow)
]
ARCS = [kind.operator for kind in (_ArcUnion, _ArcIntersection, _ArcDifference)]
ROWS = {row.name: row for row in (*DECLARED, DEEPEST, *ARCS)}
CASES = [
    (row, setting) for row in ROWS.values() if not row.gradients for setting in SETTINGS.get(row.name, [{}])
]
EVERY_ROW = pytest.mark.parametrize(("row", "setting"), CASES, ids=[f"{r.name}-{s}" for r, s in CASES])


def run(row: OperatorRow, part: str, setting: Setting, **arguments: Any) -> NDArray[Any]:
    """Call a function of a row with its parameters, on a tape if there are several."""
    function, numbers = getattr(row, part), list(setting.values()) or [0.0]
    if row.name == "controllable_blend":
        numbers = np.tan(np.radians(numbers)).tolist()
    extra: dict[str, Any] = dict.fromkeys(python_function(function).__annotations__, numbers[0])
    if "tape" in extra:
        extra |= {"parameter": 1.0, "tape": [[9.0] * 4, numbers + [0.0] * (4 - len(numbers))]}
    del extra["return"]
    return call(function, **extra | arguments)


def partials(row: OperatorRow, setting: Setting, a: Floats, b: Floats) -> Floats:
    return run(row, "partials", setting, a=a, b=b).astype(np.float64)


def pairs(row: OperatorRow, count: int = 4000) -> tuple[Floats, Floats]:
    """Operands from 0 to 4, of one size and of very different ones, around ½ and 0; negated for `DEEPEST`."""
    rng = np.random.default_rng(0)
    a, b = 4.0 * rng.uniform(0.0, 1.0, (2, count)) ** 2
    tiny = 10.0 ** rng.uniform(-12.0, 0.0, count // 4)
    a[: count // 4] = tiny
    b[count // 8 : 3 * count // 8] = tiny
    b[-count // 8 :] = 0.5 + 0.02 * rng.normal(size=count // 8)
    special = np.array([(x, y) for x in (0.0, 0.25, 0.5, 1.0, 2.0) for y in (0.0, 0.25, 0.5, 1.0, 2.0)])
    sign = -1.0 if row is DEEPEST else 1.0
    a, b = (
        sign * np.concatenate(both).astype(np.float32).astype(np.float64)
        for both in ((a, special[:, 0]), (b, special[:, 1]))
    )
    return a, b


def scale(setting: Setting) -> float:
    """How much a parameter enlarges slopes and rounding."""
    ratio = setting.get("ratio", 1.0)
    return max(ratio, 1.0 / ratio)


def test_the_table_is_complete() -> None:
    assert set(VALUES) == set(ROWS)


@EVERY_ROW
def test_values(row: OperatorRow, setting: Setting) -> None:
    a, b = pairs(row)
    expected = VALUES[row.name](a, b, **setting)
    atol = 2e-6 * scale(setting)
    np.testing.assert_allclose(partials(row, setting, a, b)[:, 0], expected, rtol=1e-5, atol=atol)


@EVERY_ROW
def test_partials_are_differences(row: OperatorRow, setting: Setting) -> None:
    """Away from kinks, where one-sided differences of float64 agree with each other."""
    a, b = pairs(row)
    present = np.minimum(np.abs(a), np.abs(b)) > 1e-3
    a, b = a[present], b[present]
    by_a, by_b, change = oracle.partials(VALUES[row.name], a, b, **setting)
    smooth = change < 1e-3 * scale(setting)
    assert smooth.mean() > 0.95
    seen = partials(row, setting, a, b)[smooth, 1:]
    expected = np.column_stack([by_a, by_b])[smooth]
    np.testing.assert_allclose(seen, expected, rtol=2e-3, atol=2e-3 * scale(setting))


@EVERY_ROW
def test_an_absent_operand(row: OperatorRow, setting: Setting) -> None:
    a, _ = pairs(row)
    zero = np.zeros_like(a)
    right, left = partials(row, setting, a, zero), partials(row, setting, zero, a)
    common = row.support is Support.COMMON
    np.testing.assert_array_equal(right[:, 0], zero if common else a)
    np.testing.assert_array_equal(right[a != 0.0, 1], float(not common))
    if row.like is not None:
        np.testing.assert_array_equal(left[:, 0], a if row.starts_from_zero else zero)


@EVERY_ROW
def test_results_are_finite_and_of_one_sign(row: OperatorRow, setting: Setting) -> None:
    tiny = np.array([0.0, 1e-38, 1e-30, 1e-19, 1e-12, 1e-7, 0.25, 0.5, 1.0, 3.0])
    a, b = (both.ravel() for both in np.meshgrid(tiny, tiny))
    sign = -1.0 if row is DEEPEST else 1.0
    seen = partials(row, setting, sign * a, sign * b)
    assert np.isfinite(seen).all()
    assert (sign * seen[:, 0] >= 0.0).all()


@pytest.mark.parametrize("row", [row for row in ROWS.values() if not row.gradients], ids=lambda row: row.name)
def test_operands_may_be_exchanged_and_nested_where_the_table_says_so(row: OperatorRow) -> None:
    a, b = pairs(row)
    third, value = np.full_like(a, 0.6), VALUES[row.name]
    holds = True
    for setting in SETTINGS.get(row.name, [{}]):
        one, other = value(a, b, **setting), value(b, a, **setting)
        left, right = value(one, third, **setting), value(a, value(b, third, **setting), **setting)
        holds &= np.allclose(one, other, rtol=1e-12) and np.allclose(left, right, rtol=1e-9)
    assert row.commutes == holds


@EVERY_ROW
def test_ranges_contain_samples_and_choices_are_exact(row: OperatorRow, setting: Setting) -> None:
    rng = np.random.default_rng(2)
    ends = np.sort(2.0 * rng.uniform(0.0, 1.0, (2, 1500, 2)) ** 2, axis=2)
    ends[:, ::3] = np.sort(ends[:, ::3, :1] + [0.0, 0.05], axis=2)
    ends[0, ::7, 0] = ends[1, ::5, 0] = 0.0
    ends[0, ::35] = ends[1, ::25] = 0.0
    if row is DEEPEST:
        ends = np.sort(-ends, axis=2)
    ends = ends.astype(np.float32).astype(np.float64)
    bounds = run(row, "range", setting, a=ends[0], b=ends[1]).astype(np.float64)
    choice = run(row, "choice", setting, a=ends[0], b=ends[1])
    rounding = 1e-6 * scale(setting)
    shares = rng.uniform(0.0, 1.0, (2, 40, 1500)).round(1)
    for one, other in zip(*shares, strict=True):
        a, b = (
            low + share * (high - low)
            for share, (low, high) in zip((one, other), ends.transpose(0, 2, 1), strict=True)
        )
        seen = partials(row, setting, a, b)
        assert (seen[:, 0] >= bounds[:, 0] - rounding).all()
        assert (seen[:, 0] <= bounds[:, 1] + rounding).all()
        operands = np.column_stack([a, b])
        present = operands != 0.0  # an absent operand has no gradient
        for keep, column in ((KEEP_LEFT, 0), (KEEP_RIGHT, 1)):
            kept = (choice == keep) & present.any(axis=1)
            np.testing.assert_allclose(seen[kept, 0], operands[kept, column], rtol=1e-6, atol=1e-7)
            expected = np.eye(2)[column] * present[kept]
            np.testing.assert_allclose(seen[kept, 1:] * present[kept], expected, atol=1e-5)
        np.testing.assert_array_equal(seen[choice == KEEP_NONE, 0], 0.0)
    here = run(row, "range", setting, a=ends[0][:, [0, 0]], b=ends[1][:, [0, 0]])
    np.testing.assert_allclose(here[:, 0], here[:, 1], rtol=2e-5, atol=2e-5)


@EVERY_ROW
def test_no_slope_exceeds_its_bound(row: OperatorRow, setting: Setting) -> None:
    """|∂F/∂a ∇a + ∂F/∂b ∇b| for gradients of bounded length; for monotone rows also slopes below 0."""
    rng = np.random.default_rng(1)
    a, b = pairs(row)
    slopes = rng.uniform(0.0, 3.0, (2, len(a)))
    if row.monotone:
        slopes[:, ::2] -= 1.5
    slopes[0, ::7] = slopes[1, ::11] = 0.0
    room = rng.choice([1.0, 1.0, 1.5], (2, len(a)))
    most = {"max_a": a * room[0], "max_b": b * room[1]}
    bound = run(row, "slope", setting, slope_a=slopes[0], slope_b=slopes[1], **most)
    weights = partials(row, setting, a, b)[:, 1:]
    steepest = ((weights if row.monotone else np.abs(weights)) * slopes.T).sum(axis=1)
    assert (steepest <= bound * (1.0 + 1e-4 * np.sign(bound)) + 1e-5).all()
    assert (steepest > 0.5 * bound).mean() > 0.01, "the bound is so loose that this shows nothing"


@EVERY_ROW
def test_monotone_rows_never_fall(row: OperatorRow, setting: Setting) -> None:
    assert not row.monotone or (partials(row, setting, *pairs(row))[:, 1:] >= -1e-6).all()


# -- what is special in a row ---------------------------------------------------------------------------


@pytest.mark.parametrize("a", [0.5, 1.0, 1.0001, 1.7, 3.9])
def test_a_tool_that_barely_reaches_a_place_barely_changes_it(a: float) -> None:
    """The plain complement 1 − b would cut a sum that exceeds 1 down to 1 at once."""
    b = np.array([0.0, 1e-30, 1e-7, 1e-4, 1e-3])
    cut = partials(DIFFERENCE, {}, np.full(5, a), b)[:, 0]
    assert (np.abs(cut - a) <= 8.0 * b + 3e-7 * a).all()


def test_the_cut_of_a_difference_lies_where_the_tool_is_half() -> None:
    """F ≥ ½ inside the solid exactly where the tool is below ½, and F falls as the tool grows."""
    a = np.repeat([0.6, 1.0, 1.5, 4.0], 201)
    b = np.tile(np.linspace(0.0, 1.0, 201), 4)
    cut = partials(DIFFERENCE, {}, a, b)[:, 0]
    sure = np.abs(b - 0.5) > 1e-4
    np.testing.assert_array_equal((cut >= 0.5)[sure], (b < 0.5)[sure])
    assert (np.diff(cut.reshape(4, 201), axis=1) <= 1e-6).all()
    np.testing.assert_allclose(cut[b == 0.5], 0.5, atol=1e-6)


def test_ricci_runs_from_the_sum_to_the_union() -> None:
    a, b = pairs(RICCI)
    np.testing.assert_allclose(partials(RICCI, {"exponent": 1.0}, a, b)[:, 0], a + b, rtol=1e-6)
    gap = partials(RICCI, {"exponent": 100.0}, a, b)[:, 0] - np.maximum(a, b)
    assert (gap >= -1e-6).all()
    assert (gap <= np.maximum(a, b) * (2.0**0.01 - 1.0) + 1e-6).all()


@pytest.mark.parametrize("name", ["r_union", "clean_union"])
def test_a_clean_union_has_the_surface_of_the_union_and_is_smooth_off_its_crease(name: str) -> None:
    a, b = (both.ravel() for both in np.meshgrid(*[np.linspace(0.0, 1.0, 201)] * 2))
    inside = partials(ROWS[name], {}, a, b)[:, 0] >= 0.5
    sure = np.abs(np.maximum(a, b) - 0.5) > 1e-4
    np.testing.assert_array_equal(inside[sure], (np.maximum(a, b) >= 0.5)[sure])
    equal = np.linspace(0.02, 1.0, 99)
    equal = equal[np.abs(equal - 0.5) > 0.02]
    below, above = (partials(ROWS[name], {}, equal, equal + step) for step in (-1e-5, 1e-5))
    np.testing.assert_allclose(below[:, 1:], above[:, 1:], atol=0.02)


def test_a_blend_of_width_one_half_is_that_of_ricci() -> None:
    row = ROWS["superelliptic_blend"]
    a, b = pairs(row)
    seen = partials(row, {"width": 0.5, "exponent": 3.0}, a, b)[:, 0]
    np.testing.assert_allclose(seen, (a**3 + b**3) ** (1 / 3), rtol=1e-5, atol=1e-6)
