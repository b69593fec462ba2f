"""Arrays of any size, and the number of threads of launches."""

from threading import Thread

import numpy as np
import pytest

import blobtree.device as blobtree_launch
from blobtree.device import core_left_free, prefaulted_array


@pytest.mark.parametrize("count", [0, 1, 5000, 2_000_000])
@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_prefaulted_arrays_can_be_written_and_read(count: int, dtype: type) -> None:
    array = prefaulted_array((count, 3), dtype)
    assert array.shape == (count, 3)
    assert array.dtype == dtype
    assert array.flags.c_contiguous
    array[:] = np.arange(count)[:, None] % 1000
    assert np.array_equal(array[:, 2], np.arange(count) % 1000)


def test_a_core_is_left_free_by_one_thread_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blobtree_launch, "_core_count", lambda: 4)
    usual = blobtree_launch._thread_pool()
    elsewhere = []
    with core_left_free():
        assert blobtree_launch._thread_count() == 3
        assert blobtree_launch._thread_pool() is not usual
        other = Thread(target=lambda: elsewhere.append(blobtree_launch._thread_count()))
        other.start()
        other.join()
        with core_left_free():
            assert blobtree_launch._thread_count() == 3
        assert blobtree_launch._thread_count() == 3
    assert elsewhere == [4]
    assert blobtree_launch._thread_pool() is usual


def test_the_only_core_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blobtree_launch, "_core_count", lambda: 1)
    with core_left_free():
        assert blobtree_launch._thread_count() == 1
