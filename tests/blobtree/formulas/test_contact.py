"""Operators of contact: values, partials, bounds and algebra, in float64."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE
from blobtree.formulas.contact import (
    bulge_choice,
    bulge_partials,
    bulge_range,
    press_choice,
    press_partials,
    press_range,
    press_slope,
    rated_field,
    rated_union_choice,
    rated_union_partials,
    rated_union_range,
    rated_union_slope,
)
from tests.blobtree.transpile.warp_functions import call
from tests.oracles.blobtree import Field, pressed_field, rated

Floats = NDArray[np.float64]

SHAPES = [
    (1.0, 0.3, 0.05),
    (4.0, 0.5, 0.125),
    (0.2, 0.1, 0.025),
    (1.0, 0.4, 0.0),
    (100.0, 0.2, 0.01),
    (0.01, 0.5, 0.1),
]
EVERY_SHAPE = pytest.mark.parametrize("shape", SHAPES, ids=str)


def pressed(a: Any, b: Any, shape: tuple[float, float, float]) -> Floats:
    empty = np.zeros((len(a), 3)), np.full(len(a), np.inf)
    return pressed_field(Field(a, *empty), Field(b, *empty), *shape).value


def operands(count: int = 4000) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(0)
    a, b = 1.5 * rng.uniform(0.0, 1.0, (2, count)) ** 1.5
    b[: count // 4] = 0.5 + rng.normal(size=count // 4) * 0.02
    a[-20:] = 0.0
    b[-30:-10] = 0.0
    return a.astype(np.float32).astype(np.float64), b.astype(np.float32).astype(np.float64)


def at_tape(function: Any, shape: tuple[float, float, float], **arguments: Any) -> NDArray[Any]:
    return call(function, **arguments, parameter=1.0, tape=[[9, 9, 9, 9], [*shape, 0.0]])


@EVERY_SHAPE
def test_values_and_algebra(shape: tuple[float, float, float]) -> None:
    a, b = operands()
    seen = at_tape(press_partials, shape, a=a, b=b)
    np.testing.assert_allclose(seen[:, 0], pressed(a, b, shape), atol=2e-6 * max(1.0, shape[0]))
    assert (seen[a == 0.0, 0] == 0.0).all()
    np.testing.assert_array_equal(seen[b == 0.0, 0], a[b == 0.0].astype(np.float32))
    assert (seen[:, 0] >= 0.0).all()


@EVERY_SHAPE
def test_partials_are_differences(shape: tuple[float, float, float]) -> None:
    a, b = operands()
    a, b = a[(a > 1e-3) & (b > 1e-3)], b[(a > 1e-3) & (b > 1e-3)]
    seen, step = at_tape(press_partials, shape, a=a, b=b), 1e-7
    for column, (da, db) in ((1, (step, 0.0)), (2, (0.0, step))):
        ahead = (pressed(a + da, b + db, shape) - pressed(a, b, shape)) / step
        behind = (pressed(a, b, shape) - pressed(a - da, b - db, shape)) / step
        agree = np.abs(ahead - behind) < 1e-3 * max(1.0, shape[0])
        assert agree.mean() > 0.95
        error = np.abs(seen[:, column] - 0.5 * (ahead + behind))[agree]
        assert (error < 1e-3 * max(1.0, *shape, 1.0 / shape[0])).all()


@EVERY_SHAPE
def test_the_field_is_smooth_where_contact_and_bulge_begin_and_end(shape: tuple[float, float, float]) -> None:
    """One-sided differences at m = ½, at the top and at the far edge, for solids near their surface."""
    ratio, width, height = shape
    if height == 0.0:
        return
    a = np.full(3, 0.5)
    edges = rated(0.5 - np.array([0.0, 2.0 * height, width]), 1.0 / ratio)
    step = 1e-6 / max(ratio, 1.0 / ratio)
    ahead = (pressed(a, edges + step, shape) - pressed(a, edges, shape)) / step
    behind = (pressed(a, edges, shape) - pressed(a, edges - step, shape)) / step
    np.testing.assert_allclose(ahead, behind, atol=2e-3 * max(ratio, 1.0 / ratio))
    peak = pressed(np.full(2001, 0.5), np.linspace(0.0, 0.5, 2001), shape).max() - 0.5
    assert 0.8 * height < peak <= height + 1e-9


def test_ratings_are_a_group_and_keep_the_surface() -> None:
    b = np.linspace(0.0, 3.0, 301)
    for first, second in ((2.0, 3.0), (0.1, 7.0), (5.0, 0.2)):
        np.testing.assert_allclose(rated(rated(b, first), second), rated(b, first * second), atol=1e-12)
        seen = call(rated_field, b=b, ratio=first)
        np.testing.assert_allclose(seen[:, 0], rated(b, first), rtol=2e-6, atol=1e-6)
        assert seen[b == 0.5].tolist() == [[0.5, np.float32(first)]]
        assert (np.diff(seen[:, 0]) > 0.0).all()


@EVERY_SHAPE
def test_two_pressed_fields_never_both_exceed_a_half(shape: tuple[float, float, float]) -> None:
    ratio, width, height = shape
    a, b = np.random.default_rng(1).uniform(0.2, 1.2, (2, 200_000))
    one, other = pressed(a, b, shape), pressed(b, a, (1.0 / ratio, width, height))
    assert not ((one > 0.5 + 1e-9) & (other > 0.5 + 1e-9)).any()
    covered = (a > 0.5 + 1e-9) | (b > 0.5 + 1e-9)
    assert (np.maximum(one, other)[covered] >= 0.5 - 1e-9).all()


@EVERY_SHAPE
def test_slopes_ranges_and_choices_hold(shape: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(2)
    centers, sizes = rng.uniform(0.0, 1.2, (2, 3000)), 10.0 ** rng.uniform(-3, -0.3, (2, 3000))
    low, high = (np.maximum(centers + sign * sizes, 0.0).astype(np.float32) for sign in (-1.0, 1.0))
    low[0, ::9] = high[0, ::9] = 0.0
    low[1, 4::9] = high[1, 4::9] = 0.0
    boxes = [np.stack([low[i], high[i]], axis=1) for i in (0, 1)]
    bounds = at_tape(press_range, shape, a=boxes[0], b=boxes[1])
    choice = at_tape(press_choice, shape, a=boxes[0], b=boxes[1])
    slopes = rng.uniform(0.0, 3.0, (2, 3000))
    steepest = at_tape(press_slope, shape, slope_a=slopes[0], slope_b=slopes[1], max_a=high[0], max_b=high[1])
    rounding = 1e-6 * max(1.0, shape[0])
    for _ in range(40):
        a, b = (low + (high - low) * rng.choice([0.0, 1.0, rng.random()], (2, 3000))).astype(np.float64)
        f, by_a, by_b = at_tape(press_partials, shape, a=a, b=b).T
        assert (bounds[:, 0] - rounding <= f).all()
        assert (f <= bounds[:, 1] + rounding).all()
        np.testing.assert_array_equal(f[choice == KEEP_NONE], 0.0)
        np.testing.assert_array_equal(f[choice == KEEP_LEFT], a.astype(np.float32)[choice == KEEP_LEFT])
        assert (np.abs(by_a) * slopes[0] + np.abs(by_b) * slopes[1] <= steepest * (1 + 1e-5) + 1e-6).all()
    assert {KEEP_NONE, KEEP_LEFT, KEEP_BOTH} == set(choice.tolist())
    exact = at_tape(press_range, shape, a=boxes[0][:, [0, 0]], b=boxes[1][:, [0, 0]])
    np.testing.assert_array_equal(exact[:, 0], exact[:, 1])


@EVERY_SHAPE
def test_a_bulge_is_a_pressed_solid_outside_and_the_solid_inside(shape: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(4)
    a, b = operands()
    inside = rated(b.astype(np.float32).astype(np.float64), shape[0]) > 0.5 + 1e-6
    seen, outside = at_tape(bulge_partials, shape, a=a, b=b), at_tape(press_partials, shape, a=a, b=b)
    np.testing.assert_array_equal(seen[inside, 0], a.astype(np.float32)[inside])
    np.testing.assert_array_equal(seen[inside, 1:], np.tile([1.0, 0.0], (inside.sum(), 1)))
    clear = rated(b, shape[0]) < 0.5 - 1e-6
    np.testing.assert_array_equal(seen[clear], outside[clear])
    both = np.sort(rng.uniform(0.0, 1.2, (2, 2, 3000)) ** 1.5, axis=1).astype(np.float32)
    bounds = at_tape(bulge_range, shape, a=both[0].T, b=both[1].T)
    choice = at_tape(bulge_choice, shape, a=both[0].T, b=both[1].T)
    for _ in range(30):
        x, y = (both[:, 0] + (both[:, 1] - both[:, 0]) * rng.random((2, 3000))).astype(np.float64)
        f = at_tape(bulge_partials, shape, a=x, b=y)[:, 0]
        assert (bounds[:, 0] - 1e-6 <= f).all()
        assert (f <= bounds[:, 1] + 1e-6).all()
        np.testing.assert_array_equal(f[choice == KEEP_LEFT], x.astype(np.float32)[choice == KEEP_LEFT])


@pytest.mark.parametrize("ratio", [0.01, 0.5, 1.0, 3.0, 100.0])
def test_rated_unions(ratio: float) -> None:
    rng = np.random.default_rng(3)
    a, b = operands()
    seen = call(rated_union_partials, a=a, b=b, ratio=ratio)
    np.testing.assert_allclose(seen[:, 0], np.maximum(a, rated(b, ratio)), rtol=3e-6, atol=1e-6)
    both = np.sort(rng.uniform(0.0, 1.2, (2, 2, 3000)), axis=1).astype(np.float32)
    boxes = both[0].T, both[1].T
    bounds = call(rated_union_range, a=boxes[0], b=boxes[1], ratio=ratio)
    choice = call(rated_union_choice, a=boxes[0], b=boxes[1], ratio=ratio)
    slopes = rng.uniform(-1.0, 1.0, (2, 3000))
    steepest = call(
        rated_union_slope,
        slope_a=slopes[0],
        slope_b=slopes[1],
        max_a=both[0, 1],
        max_b=both[1, 1],
        ratio=ratio,
    )
    for _ in range(20):
        a, b = (both[:, 0] + (both[:, 1] - both[:, 0]) * rng.random((2, 3000))).astype(np.float64)
        f, by_a, by_b = call(rated_union_partials, a=a, b=b, ratio=ratio).T
        assert (bounds[:, 0] - 1e-6 <= f).all()
        assert (f <= bounds[:, 1] * (1 + 1e-6) + 1e-6).all()
        np.testing.assert_array_equal(f[choice == KEEP_LEFT], a.astype(np.float32)[choice == KEEP_LEFT])
        rise = by_a * slopes[0] + by_b * slopes[1]
        assert (rise <= steepest + 1e-5 * np.maximum(1.0, np.abs(rise))).all()
