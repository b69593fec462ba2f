"""Results that are kept up to a number of bytes, or as long as an object lives."""

import gc

import numpy as np

from blobtree._typing import UInt8Array
from blobtree.sized_cache import kept_with, sized_cache

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


class Owner:
    """An object that results are kept with."""


def owner_of(pair: tuple[Owner, float]) -> Owner:
    return pair[0]


def test_a_result_is_kept_as_long_as_its_owner_lives() -> None:
    counted: list[float] = []

    @kept_with(owner_of)
    def scaled(pair: tuple[Owner, float], factor: float = 2.0) -> float:
        counted.append(pair[1])
        return factor * pair[1]

    one, other = Owner(), Owner()
    assert scaled((one, 3.0)) == 6.0
    assert scaled((one, 4.0)) == 6.0  # of the same owner
    assert scaled((other, 4.0), factor=0.5) == 2.0
    assert counted == [3.0, 4.0]
    del other
    gc.collect()
    assert len(scaled._results) == 1
