"""Warp devices: start of Warp, launches on every core, and memory.

Warp runs a CPU launch on one thread, but runs several launches at once. `launch` therefore divides the
indices of a launch into slices, and runs these on a pool of threads. A slice of a kernel is as long as the
kernel's former launches suggest.
"""

import math
import os
import re
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from copy import copy
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.errors import InvalidDevice, InvalidResolution
from blobtree.kernels import loaded, unusable_cache
from blobtree.progress import check_cancelled

wp.config.log_level = wp.LOG_WARNING  # no banner when Warp starts, no line per compiled module

SLICES_PER_THREAD = 4
"""Slices of a launch per thread; several of them even out slices of unequal cost."""

REPORTED_SLICES_PER_THREAD = 32
"""Slices per thread of a launch with reports, so that reports come often and a cancelled launch ends soon."""

MIN_SLICE = 256
"""Fewest indices of a slice while their cost is not known."""

MIN_SLICE_SECONDS = 2.5e-4
"""Least processor time of a slice; its start takes a tenth of that."""

JOIN_SECONDS = 1e-4
"""Time in which one more thread joins a launch; only one joins at a time."""

CHECKED_SLICE_SECONDS = 0.02
"""Processor time of a slice from which on a launch without reports looks after it whether it is cancelled."""

PAGE_BYTES = 4096
"""Size of a page of memory on most machines."""

MIN_PREFAULTED_PAGES = 1024
"""Size of an array from which several threads touch its pages."""

NO_DRIVER_WARNING = "Could not find or load the NVIDIA CUDA driver"

MEMINFO = Path("/proc/meminfo")
"""File in which Linux reports free memory."""

THREADS_VARIABLE = "BLOBTREE_THREADS"
"""Environment variable that sets the number of threads of launches."""

GIGABYTE = 1e9


# -- Warp and its devices -------------------------------------------------------------------------------


@cache
def start_warp() -> None:
    """Initialise Warp without its warning that there is no CUDA driver, which no setting turns off.

    All kernels also run without CUDA. Other lines that Warp writes to stderr are repeated.

    Raises
    ------
    UnusableCache
        The folder for compiled kernels cannot be made.
    """
    try:
        stderr = os.dup(2)
    except OSError:  # the process has no stderr
        wp.init()
        return
    if sys.stderr is not None:
        sys.stderr.flush()
    with tempfile.TemporaryFile() as captured:
        os.dup2(captured.fileno(), 2)
        try:
            wp.init()
        except OSError as error:
            if error.filename is None:  # not from Warp's cache: a library that cannot be loaded
                raise
            raise unusable_cache(error) from error
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
        captured.seek(0)
        lines = captured.read().decode(errors="replace").splitlines(keepends=True)
    if sys.stderr is not None:
        sys.stderr.write("".join(line for line in lines if NO_DRIVER_WARNING not in line))


def known_device(device: Any = None) -> str:
    """Return the name of a Warp device, by default the current one.

    Raises
    ------
    InvalidDevice
        There is no such device, or it is a CUDA device of a process whose parent had started Warp (fork).
    """
    start_warp()
    try:
        warp_device = wp.get_device(device)
    except (TypeError, ValueError):
        names = ", ".join(repr(str(known)) for known in wp.get_devices())
        raise InvalidDevice(f"device: expected a Warp device ({names}), got {device!r}") from None
    if warp_device.is_cuda and _forked_with_warp:
        raise InvalidDevice(
            f"device: expected 'cpu' in a process forked after its parent had started Warp, got {device!r}, "
            f"which is {warp_device}: CUDA does not survive a fork; use spawn, as in "
            'multiprocessing.get_context("spawn"), or pass device="cpu"'
        )
    return str(warp_device)


# -- processes ------------------------------------------------------------------------------------------

_forked_with_warp = False
"""True in a child made by `os.fork` after its parent had started Warp, and with it CUDA."""


def _forget_threads() -> None:
    """In a forked child: drop the pools, whose threads exist only in the parent."""
    global _forked_with_warp
    _cached_pool.cache_clear()
    _forked_with_warp = _forked_with_warp or wp._src.context.runtime is not None


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_forget_threads)


# -- threads and launches -------------------------------------------------------------------------------


class _ThreadSettings(threading.local):
    """Settings of the launches of one thread."""

    leaves_core_free = False


_settings = _ThreadSettings()


@contextmanager
def core_left_free() -> Iterator[None]:
    """Within a ``with`` block, run the launches of this thread on one core less, in a pool of their own.

    Use it in background threads. A window then keeps a core, and its launches do not queue behind the others.
    """
    before, _settings.leaves_core_free = _settings.leaves_core_free, True
    try:
        yield
    finally:
        _settings.leaves_core_free = before


@cache
def _core_count() -> int:
    """Return the number of cores for launches; asking the system takes as long as a small launch.

    The variable ``BLOBTREE_THREADS`` sets it: several processes that share a machine then have a core each.
    """
    given = os.environ.get(THREADS_VARIABLE, "")
    return int(given) if given.isdecimal() and int(given) else os.cpu_count() or 1


def _thread_count() -> int:
    """Return the number of threads for a launch of this thread."""
    return max(1, _core_count() - _settings.leaves_core_free)


def _thread_pool() -> ThreadPoolExecutor:
    """Return the threads for a launch of this thread."""
    return _cached_pool(_thread_count(), _settings.leaves_core_free)


@cache
def _cached_pool(workers: int, leaves_core_free: bool) -> ThreadPoolExecutor:
    name = "blobtree, one core left free" if leaves_core_free else "blobtree"
    return ThreadPoolExecutor(max_workers=workers, thread_name_prefix=name)


_index_seconds: WeakKeyDictionary[wp.Kernel, float] = WeakKeyDictionary()
"""Processor time per index of kernels that ran on the CPU, as far as it is known."""


def _slice_count(kernel: wp.Kernel, count: int, *, reported: bool) -> int:
    """Return the number of slices of a launch: many for all threads, but none that is too short.

    A launch with reports is long work. It has the same slices every time, so that it reports as often.
    """
    by_indices = -(-count // MIN_SLICE)
    if reported:
        return min(_thread_count() * REPORTED_SLICES_PER_THREAD, by_indices)
    known = kernel in _index_seconds
    most = int(_expected_seconds(kernel, count) / MIN_SLICE_SECONDS) if known else by_indices
    return max(1, min(_thread_count() * SLICES_PER_THREAD, count, most))


def _worker_count(kernel: wp.Kernel, count: int, slices: int) -> int:
    """Return the number of threads with which a launch ends first.

    A launch of t seconds of processor time takes n j + t / n seconds with n threads, j to join for each.
    """
    quickest = math.sqrt(_expected_seconds(kernel, count) / JOIN_SECONDS)
    return max(1, int(min(_thread_count(), slices, quickest)))


def _expected_seconds(kernel: wp.Kernel, count: int) -> float:
    """Return the processor time of a launch by former ones, infinite without."""
    return count * _index_seconds.get(kernel, math.inf)


def _note_cost(kernel: wp.Kernel, index_seconds: float) -> None:
    """Keep the cost of an index; it falls by half at most, since the next indices may cost more again."""
    _index_seconds[kernel] = max(index_seconds, _index_seconds.get(kernel, 0.0) / 2.0)


def launch(
    kernel: wp.Kernel,
    count: int,
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    device: str,
    *,
    step: Callable[[float], None] | None = None,
) -> None:
    """Run `kernel` for the indices below `count`, on the CPU in slices on every core.

    The first parameter of the kernel is the first index of the slice; `inputs` and `outputs` follow. `step`
    is called with the fraction done. An exception in `step` ends the launch once the running slices are done.

    Raises
    ------
    Cancelled
        The work that launches the kernel was cancelled.
    """
    if count == 0:
        return
    check_cancelled()
    start_warp()
    loaded(kernel, device)
    if not wp.get_device(device).is_cpu:
        wp.launch(kernel, dim=count, inputs=[0, *inputs], outputs=[*outputs], device=device)
        return
    slices = _slice_count(kernel, count, reported=step is not None)
    numbers = iter(range(slices))  # a free thread takes the next slice
    finished: list[float] = []  # processor time of each slice that is done
    packed: Any = wp.launch(
        kernel, dim=1, inputs=[0, *inputs], outputs=[*outputs], device=device, record_cmd=True
    )

    def run(after_each: Callable[[], None]) -> None:
        command = copy(packed)
        command.params = [*packed.params]  # each thread sets bounds and first index of its own
        for number in numbers:
            first, last = count * number // slices, count * (number + 1) // slices
            began = time.thread_time()
            command.set_dim(last - first)
            command.set_param_at_index(0, first)
            command.launch()
            finished.append(time.thread_time() - began)
            after_each()

    reported = 0

    def report() -> None:
        nonlocal reported
        while step is not None and reported < len(finished):
            reported += 1
            step(reported / slices)
        if step is None and finished[-1] > CHECKED_SLICE_SECONDS:
            check_cancelled()

    workers = _worker_count(kernel, count, slices)
    others = [_thread_pool().submit(run, lambda: None) for _ in range(workers - 1)]
    try:
        run(report)
    finally:
        deque(numbers, maxlen=0)  # after an error, no further slice begins
        for other in others:
            if not other.cancel():
                other.result()
    report()
    _note_cost(kernel, sum(finished) / count)


# -- memory ---------------------------------------------------------------------------------------------


def array_on(device: str, values: Any, kind: Any) -> Any:
    """Return numbers as an array of Warp on a device; there it is not copied if it need not be."""
    scalar = getattr(kind, "_wp_scalar_type_", kind)
    rows = np.ascontiguousarray(values, wp.dtype_to_numpy(scalar))
    return wp.array(rows, dtype=kind, device=device, copy=False)


def prefaulted_array(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Return an uninitialised array whose pages all threads have touched.

    A copy into memory that was never touched is slow: it waits for the system page after page.
    """
    array = np.empty(shape, dtype)
    pages = array.reshape(-1).view(np.uint8)[::PAGE_BYTES]
    if len(pages) > MIN_PREFAULTED_PAGES:
        list(_thread_pool().map(lambda part: part.fill(0), np.array_split(pages, _thread_count())))
    return array


def on_host(array: Any) -> NDArray[Any]:
    """Return the numbers of an array of Warp; those of the CPU share its memory."""
    if array.device.is_cpu:
        shared: NDArray[Any] = array.numpy()
        return shared
    scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)
    host = prefaulted_array((*array.shape, *getattr(array.dtype, "_shape_", ())), wp.dtype_to_numpy(scalar))
    wp.copy(wp.array(host, dtype=array.dtype, device="cpu", copy=False), array)
    wp.synchronize_device(array.device)
    return host


def available_memory(device: str) -> float | None:
    """Return the free bytes of a Warp device, or None if the system does not report them."""
    warp_device = wp.get_device(device)
    if warp_device.is_cuda:
        return float(warp_device.free_memory)
    if not MEMINFO.exists():
        return None
    match = re.search(r"MemAvailable:\s+(\d+) kB", MEMINFO.read_text(encoding="ascii"))
    return 1024.0 * float(match[1]) if match else None


def demand_memory(size: float, device: str, noun: str) -> None:
    """Raise an error that names `noun` if fewer than `size` bytes are free.

    Raises
    ------
    InvalidResolution
        The device has less free memory, as far as it is known.
    """
    free = available_memory(device)
    if free is not None and size > free:
        raise InvalidResolution(
            f"{noun} would take {size / GIGABYTE:.3g} GB, {free / GIGABYTE:.3g} GB are free on {device}; "
            "take larger cells"
        )
