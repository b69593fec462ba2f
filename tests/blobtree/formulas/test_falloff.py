"""The falloff: its inverse, its slope, and the bound on its slope."""

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import ISO, RIM
from blobtree.formulas.falloff import (
    STEEPEST_DISTANCE,
    STEEPEST_SLOPE,
    falloff,
    falloff_derivative,
    falloff_shallowest,
    falloff_slope_bound,
    falloff_steepest,
    falloff_steepness,
)
from tests.blobtree.transpile.warp_functions import call

DISTANCES = np.concatenate([np.linspace(0.0, 1.5, 20_001), [0.0, 1.0, RIM, STEEPEST_DISTANCE, 1e6, 1e18]])


Floats = NDArray[np.floating]


def g(d: Floats) -> Floats:
    return np.asarray(np.maximum(1.0 - d.astype(np.float64) ** 2, 0.0) ** 3)


def slope(d: Floats) -> Floats:
    return np.asarray(6.0 * d * np.maximum(1.0 - d.astype(np.float64) ** 2, 0.0) ** 2)


def test_rim_is_where_the_falloff_is_half() -> None:
    assert ISO == 0.5
    assert pytest.approx(0.454202, abs=1e-6) == RIM
    assert pytest.approx(ISO, abs=1e-15) == (1.0 - RIM**2) ** 3


def test_falloff_is_one_at_the_skeleton_and_zero_beyond_its_reach() -> None:
    values = call(falloff, squared_distance=DISTANCES**2)
    np.testing.assert_allclose(values, g(DISTANCES), atol=3e-7)
    assert values[0] == 1.0
    assert (values[DISTANCES >= 1.0] == 0.0).all()


def test_the_derivative_is_that_of_float64_differences() -> None:
    squared = np.linspace(0.0, 1.2, 1001)
    step = 1e-6
    differences = (g(np.sqrt(squared + step)) - g(np.sqrt(np.maximum(squared - step, 0.0)))) / (
        step + np.minimum(squared, step)
    )
    np.testing.assert_allclose(call(falloff_derivative, squared_distance=squared), differences, atol=1e-5)


def test_steepness_is_the_slope_and_is_largest_where_it_is_said_to_be() -> None:
    seen = call(falloff_steepness, distance=DISTANCES)
    np.testing.assert_allclose(seen, slope(DISTANCES), atol=1e-6)
    assert slope(DISTANCES).max() == pytest.approx(STEEPEST_SLOPE, rel=1e-12)
    assert pytest.approx(1.7173, abs=1e-4) == STEEPEST_SLOPE
    assert np.isfinite(call(falloff_steepness, distance=[3e38, np.inf])).all()


def test_the_slope_bound_is_a_bound_and_is_attained() -> None:
    rng = np.random.default_rng(0)
    distance = np.concatenate([rng.uniform(0.0, 2.0, 4000), [0.0, STEEPEST_DISTANCE, 1.0]]).astype(np.float32)
    reach = np.concatenate([10.0 ** rng.uniform(-4.0, 0.5, 4000), [0.0, 0.0, 0.0]]).astype(np.float32)
    bound = call(falloff_slope_bound, distance=distance, reach=reach)
    inside = np.linspace(-1.0, 1.0, 401)[:, None]
    largest = slope(np.maximum(distance.astype(np.float64) + inside * reach, 0.0)).max(axis=0)
    assert (bound >= largest - 1e-6).all()
    np.testing.assert_allclose(bound, largest, atol=2e-3)


def test_steepest_and_shallowest_slope_of_an_interval() -> None:
    rng = np.random.default_rng(1)
    ends = np.sort(rng.uniform(0.0, 1.5, (2, 4000)), axis=0).astype(np.float32)
    ends[0, ::5] = ends[1, ::5]
    inside = slope(ends[0] + (ends[1] - ends[0]).astype(np.float64) * np.linspace(0.0, 1.0, 401)[:, None])
    steepest = call(falloff_steepest, nearest=ends[0], farthest=ends[1])
    shallowest = call(falloff_shallowest, nearest=ends[0], farthest=ends[1])
    assert (steepest >= inside.max(axis=0) - 1e-6).all()
    assert (shallowest <= inside.min(axis=0) + 1e-6).all()
    np.testing.assert_allclose(steepest, inside.max(axis=0), atol=1e-4)
    np.testing.assert_allclose(shallowest, inside.min(axis=0), atol=1e-4)
