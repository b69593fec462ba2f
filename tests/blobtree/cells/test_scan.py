"""Prefix sums on a device against NumPy, up to the largest total that int32 holds."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree.cells.scan import compact, exclusive_scan, where_negative
from blobtree.cells.scan_kernels import flag_sign, gather
from blobtree.device import launch
from blobtree.errors import InvalidResolution

LARGEST = np.iinfo(np.int32).max


def uploaded(numbers: list[int]) -> Any:
    return wp.array(np.array(numbers, np.int32), dtype=wp.int32, device="cpu")


@pytest.mark.parametrize("counts", [[0], [3, 0, 2, 0], [LARGEST - 1, 1, 0]], ids=["none", "few", "most"])
def test_sums_leave_out_their_own_count(counts: list[int]) -> None:
    starts, total = exclusive_scan(uploaded(counts), "things")
    assert total == sum(counts)
    assert starts.numpy().tolist() == np.cumsum([0, *counts[:-1]], dtype=np.int64).tolist()


def test_sums_may_begin_at_a_number() -> None:
    starts, total = exclusive_scan(uploaded([3, 0, 2, 0]), "things", start=7)
    assert starts.numpy().tolist() == [7, 10, 10, 12]
    assert total == 12


@pytest.mark.parametrize(
    "counts", [[LARGEST, 1, 0], [LARGEST] * 4 + [0]], ids=["one too many", "twice around"]
)
def test_sums_beyond_32_bits_are_refused(counts: list[int]) -> None:
    with pytest.raises(InvalidResolution, match="things: more than 32 bits can number"):
        exclusive_scan(uploaded(counts), "things")


def test_indices_of_flags_and_signs() -> None:
    assert compact(uploaded([0, 1, 1, 0, 1, 0])).numpy().tolist() == [1, 2, 4]
    numbers = uploaded([5, -1, 0, -7])
    assert where_negative(numbers).numpy().tolist() == [1, 3]
    assert where_negative(numbers, negative=False).numpy().tolist() == [0, 2]


def test_kernels_find_the_same_indices() -> None:
    """Only cards run these."""
    flags = uploaded([0, 0, 0, 0])
    launch(flag_sign, 4, [uploaded([5, -1, 0, -7]), True], [flags], "cpu")
    assert flags.numpy().tolist() == [0, 1, 0, 1]
    indices = uploaded([0, 0, 0])
    launch(gather, 5, [uploaded([0, 0, 1, 2, 2, 3])], [indices], "cpu")
    assert indices.numpy().tolist() == [1, 2, 4]
