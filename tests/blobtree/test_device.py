"""Arrays of any size, and the number of threads of launches."""

from threading import Thread
from typing import Any

import numpy as np
import pytest
import warp as wp

import blobtree.device as blobtree_launch
from blobtree.cells.scan import arange
from blobtree.cells.scan_kernels import enumerate_indices
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


class _Kernel:
    """Stands for a kernel whose cost is given."""


def test_slices_are_as_long_as_former_launches_of_a_kernel_suggest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blobtree_launch, "_core_count", lambda: 4)
    kernel: Any = _Kernel()

    def slices(index_seconds: float | None) -> int:
        if index_seconds is not None:
            blobtree_launch._note_cost(kernel, index_seconds)
        return blobtree_launch._slice_count(kernel, 100_000, reported=False)

    unknown: Any = _Kernel()
    assert slices(None) == 16, "four per thread while the cost is not known"
    assert slices(1e-8) == 4, "a thousandth of a second is four slices"
    assert [slices(0.0), slices(0.0), slices(0.0)] == [2, 1, 1], "the cost falls by half at most"
    assert slices(1e-4) == 16
    assert blobtree_launch._slice_count(kernel, 8, reported=False) == 3, "few indices may cost much"
    assert blobtree_launch._slice_count(unknown, 300, reported=False) == 2, "or little: 256 are a slice"
    blobtree_launch._index_seconds[kernel] = 0.0
    assert blobtree_launch._slice_count(kernel, 100_000, reported=True) == 128, "reports come as often"


def test_threads_join_a_launch_where_that_ends_it_sooner(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blobtree_launch, "_core_count", lambda: 16)
    kernel: Any = _Kernel()

    def workers(seconds: float | None, slices: int = 64) -> int:
        if seconds is not None:
            blobtree_launch._index_seconds[kernel] = seconds / 1000
        return blobtree_launch._worker_count(kernel, 1000, slices)

    assert workers(None) == 16, "all while the cost is not known"
    assert [workers(0.0), workers(1e-3), workers(1e-2), workers(1.0)] == [1, 3, 10, 16]
    assert workers(1.0, slices=5) == 5, "each has a slice"


def test_an_error_of_a_step_ends_a_launch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blobtree_launch, "_core_count", lambda: 1)
    written: Any = wp.zeros(100_000, dtype=wp.int32, device="cpu")

    def step(done: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        blobtree_launch.launch(enumerate_indices, len(written), [], [written], "cpu", step=step)
    assert 0 < np.count_nonzero(written.numpy()) < 50_000, "slices that had not begun are left out"
    blobtree_launch.launch(enumerate_indices, len(written), [], [written], "cpu")
    assert np.array_equal(written.numpy(), np.arange(100_000))


@pytest.mark.parametrize("slices", [1, 7])
def test_a_launch_reaches_every_index_and_notes_the_cost(
    slices: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blobtree_launch, "_slice_count", lambda *_, **__: slices)
    noted: dict[Any, float] = {}
    monkeypatch.setattr(blobtree_launch, "_index_seconds", noted)
    assert np.array_equal(arange(10_000, "cpu").numpy(), np.arange(10_000))
    assert [0.0 < cost < 1e-3 for cost in noted.values()] == [True]
