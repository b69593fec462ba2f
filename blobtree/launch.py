"""Launching kernels on every core: Warp runs a CPU launch on one thread, but lets several run at once."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.errors import InvalidDevice

SLICES_PER_THREAD = 4
"""More slices than threads even out slices of unequal cost."""

WATCHED_SLICES_PER_THREAD = 32
"""Still more of them where somebody watches, so that reports come often and a cancelled launch ends soon."""

SMALLEST_SLICE = 256

PAGE = 4096
"""Bytes that the system hands out at once, on most machines."""

PAGES_WORTH_SHARING = 1024


@cache
def _cores() -> int:
    """How many there are; asking the system takes as long as a small launch."""
    return os.cpu_count() or 1


class _Manners(threading.local):
    """How the launches of a thread behave toward those of others."""

    leaves_room = False


_manners = _Manners()


@contextmanager
def leaving_room() -> Iterator[None]:
    """Within a ``with`` block, let launches of this thread leave a core to others, and not be in their way.

    Threads that nobody waits for should: a window then still has its core, and its own launches do not queue
    behind theirs.
    """
    before, _manners.leaves_room = _manners.leaves_room, True
    try:
        yield
    finally:
        _manners.leaves_room = before


def _workers() -> int:
    """Threads for a launch of this thread."""
    return max(1, _cores() - _manners.leaves_room)


def _threads() -> ThreadPoolExecutor:
    return _pool(_workers(), _manners.leaves_room)


@cache
def _pool(workers: int, leaves_room: bool) -> ThreadPoolExecutor:
    """Threads that are there for all launches of one kind."""
    name = "blobtree, leaving room" if leaves_room else "blobtree"
    return ThreadPoolExecutor(max_workers=workers, thread_name_prefix=name)


def known_device(device: Any = None) -> str:
    """The name of a Warp device, by default the current one; `InvalidDevice` if there is none such."""
    try:
        return str(wp.get_device(device))
    except (TypeError, ValueError):
        there = ", ".join(repr(str(one)) for one in wp.get_devices())
        raise InvalidDevice(f"device: expected a Warp device ({there}), got {device!r}") from None


def launch(
    kernel: wp.Kernel,
    count: int,
    inputs: Sequence[Any],
    outputs: Sequence[Any],
    device: str,
    *,
    step: Callable[[float], None] | None = None,
) -> None:
    """Run `kernel` for the indices below `count`; its first parameter is the index that a slice starts at.

    `step` is told the fraction done; what it raises ends the launch with the slices under way.
    """
    if count == 0:
        return
    if not wp.get_device(device).is_cpu:
        wp.launch(kernel, dim=count, inputs=[0, *inputs], outputs=[*outputs], device=device)
        return
    per_thread = SLICES_PER_THREAD if step is None else WATCHED_SLICES_PER_THREAD
    slices = min(_workers() * per_thread, -(-count // SMALLEST_SLICE))
    bounds = [count * i // slices for i in range(slices + 1)]
    wp.load_module(kernel.module, device=device)

    def run(first: int, last: int) -> None:
        wp.launch(kernel, dim=last - first, inputs=[first, *inputs], outputs=[*outputs], device=device)

    if slices == 1:
        run(0, count)
        return
    done = _threads().map(run, bounds[:-1], bounds[1:])
    for number, _ in enumerate(done, 1):
        if step is not None:
            step(number / slices)


def fresh_memory(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """An array whose pages are there already: all threads ask the system for them, which takes it long.

    What is copied into memory that was never touched waits for page after page.
    """
    array = np.empty(shape, dtype)
    pages = array.reshape(-1).view(np.uint8)[::PAGE]
    if len(pages) > PAGES_WORTH_SHARING:
        list(_threads().map(lambda part: part.fill(0), np.array_split(pages, _workers())))
    return array
