"""Memory that is handed out is whole, whatever its size; who leaves room takes fewer threads."""

from threading import Thread

import numpy as np
import pytest

import blobtree.launch as blobtree_launch
from blobtree.launch import fresh_memory, leaving_room


@pytest.mark.parametrize("count", [0, 1, 5000, 2_000_000])
@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_fresh_memory_can_be_written_and_read(count: int, dtype: type) -> None:
    array = fresh_memory((count, 3), dtype)
    assert (array.shape, array.dtype, array.flags.c_contiguous) == ((count, 3), dtype, True)
    array[:] = np.arange(count)[:, None] % 1000
    assert np.array_equal(array[:, 2], np.arange(count) % 1000)


def test_who_leaves_room_does_so_in_its_own_thread_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blobtree_launch, "_cores", lambda: 4)
    usual = blobtree_launch._threads()
    elsewhere = []
    with leaving_room():
        assert blobtree_launch._workers() == 3
        assert blobtree_launch._threads() is not usual
        other = Thread(target=lambda: elsewhere.append(blobtree_launch._workers()))
        other.start()
        other.join()
        with leaving_room():
            assert blobtree_launch._workers() == 3
        assert blobtree_launch._workers() == 3
    assert elsewhere == [4]
    assert blobtree_launch._threads() is usual


def test_the_only_core_is_not_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blobtree_launch, "_cores", lambda: 1)
    with leaving_room():
        assert blobtree_launch._workers() == 1
