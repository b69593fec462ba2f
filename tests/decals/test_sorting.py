"""Orders and groups of whole numbers, against NumPy's."""

import numpy as np
import pytest

from decals.sorting import distinct_numbers, groups, stable_order


@pytest.mark.parametrize("count", [0, 1, 2, 3, 1000, 1 << 10])
@pytest.mark.parametrize("most", [1, 2, 50, 1 << 40, (1 << 53) - 1, (1 << 63) - 1])
def test_orders_and_groups_are_those_of_numpy(count: int, most: int) -> None:
    rng = np.random.default_rng(count)
    keys = np.minimum(rng.integers(0, most, max(count // 2, 1)), most)[
        rng.integers(0, max(count // 2, 1), count)
    ]
    keys[: count // 100] = most
    assert np.array_equal(stable_order(keys), np.argsort(keys, kind="stable"))
    _, *expected = np.unique(keys, return_index=True, return_inverse=True, return_counts=True)
    for given, known in zip(groups(keys), expected, strict=True):
        assert np.array_equal(given, known)


def test_negative_numbers_are_ordered_too() -> None:
    keys = np.array([3, -1, 3, -(1 << 60), 0, -1])
    assert stable_order(keys).tolist() == [3, 1, 5, 4, 0, 2]


def test_distinct_numbers_are_those_of_numpy() -> None:
    numbers = np.random.default_rng(1).integers(0, 50, (40, 3))
    assert np.array_equal(distinct_numbers(numbers, 60), np.unique(numbers))
