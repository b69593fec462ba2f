"""Results that are kept up to a number of bytes."""

import numpy as np

from blobtree._typing import UInt8Array
from blobtree.sized_cache import sized_cache

computed: list[int] = []


@sized_cache(100)
def zeros(count: int) -> UInt8Array:
    computed.append(count)
    return np.zeros(count, np.uint8)


def test_the_results_that_were_asked_for_last_are_kept() -> None:
    computed.clear()
    zeros(30)
    zeros(40)
    zeros(30)
    zeros(50)  # without the 40 bytes, 80 are kept
    zeros(30)
    assert computed == [30, 40, 50]
    zeros(20)
    assert computed == [30, 40, 50, 20]  # 100 bytes fit
    zeros(40)
    zeros(30)
    assert computed == [30, 40, 50, 20, 40]
    zeros(1000)  # larger than all: kept alone
    zeros(1000)
    zeros(30)
    zeros(1000)
    assert computed == [30, 40, 50, 20, 40, 1000, 30, 1000]


def test_a_result_that_is_still_held_is_found_again() -> None:
    held = zeros(60)
    zeros(70)
    computed.clear()
    assert zeros(60) is held
    del held
    zeros(90)
    zeros(60)
    assert computed == [90, 60]
