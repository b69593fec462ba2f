"""Memory of long sessions: what ended edits used goes back, what first edits need is there before them."""

import ctypes
import gc
import importlib
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

CYCLE_THRESHOLDS = 700, 10, 10
"""Python's own thresholds for its search of cycles; the command line begins with higher ones."""

ALLOCATION = {-1: 4_000_000, -3: 1_000_000}
"""Options of glibc's ``mallopt``: free bytes at the end of the heap that are kept (M_TRIM_THRESHOLD), and
bytes from which on memory is returned as soon as it is free (M_MMAP_THRESHOLD)."""

WORK_ALLOCATION = {-1: 64_000_000, -3: 32_000_000}
"""The same options while long work runs: it takes an eighth longer if the system clears every array anew."""

MAX_HEAPS = -8
"""Option of ``mallopt``: number of heaps (M_ARENA_MAX)."""

TRIM_SECONDS = 10.0
"""Time between two returns of free memory to the system."""

ACTIVE_SHARE = 0.1
"""Share of one core from which on a process has been active, so that memory may have become free."""

FIRST_USED = "blobtree.derivatives.sensitivity_kernels"
"""The module whose kernels the first drag of a surface needs; its import takes 0.2 s and 12 MB."""

IMPORT_SECONDS = 10.0
"""Time for the first pictures of a session."""


def share_heap() -> None:
    """Let all threads share one heap; call this before any thread has begun.

    Otherwise glibc makes heaps for the first threads, eight for each core. They all get gaps, as a thread's
    results are freed by others.
    """
    if (library := _glibc()) is not None:
        library.mallopt(MAX_HEAPS, 1)


def _glibc() -> Any:
    """Return the C library if it is glibc, else None."""
    library = ctypes.CDLL(None) if sys.platform.startswith("linux") else None
    return library if hasattr(library, "malloc_trim") else None


@contextmanager
def made_to_stay() -> Iterator[None]:
    """Within a ``with`` block, such as one of imports, all that is made stays: Python looks for no cycles.

    Later searches leave it out too. That takes half a second less until a session is there.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def keep_memory_low(trim_seconds: float = TRIM_SECONDS) -> None:
    """Free the memory of ended edits soon, now that a session begins.

    Large arrays are in cycles here and there. Python searches for cycles only among what is made from now on.
    All modules together have half a million objects, so that it would search seldom, and for 0.2 s. glibc
    returns large arrays to the system. A thread returns smaller ones, whose heap has gaps.

    Parameters
    ----------
    trim_seconds
        Time between two returns of small pieces.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*CYCLE_THRESHOLDS)
    gc.collect()  # the thresholds of the next search follow from what this one has found
    if (library := _glibc()) is None:
        return
    _session.kept_low = True
    for option, value in ALLOCATION.items():
        library.mallopt(option, value)
    threading.Thread(
        target=_trim_for_ever, args=(library, trim_seconds), name="return of free memory", daemon=True
    ).start()


@dataclass
class _Session:
    """State of the process: memory is kept low, and long work runs."""

    kept_low: bool = False
    working: bool = False


_session = _Session()


def keep_for_work(working: bool) -> None:
    """Let long work use its memory again and again, and return it to the system afterwards.

    Call this whenever work may have begun or ended. It has no effect before `keep_memory_low`.

    Parameters
    ----------
    working
        True while long work runs.
    """
    if _session.kept_low and working != _session.working and (library := _glibc()) is not None:
        _session.working = working
        for option, value in (WORK_ALLOCATION if working else ALLOCATION).items():
            library.mallopt(option, value)


def _trim_for_ever(library: Any, seconds: float) -> None:
    """Return free memory to the system now and then, unless the process rests; takes 1 to 30 ms each time."""
    while True:
        before = time.process_time()
        time.sleep(seconds)
        if time.process_time() - before > ACTIVE_SHARE * seconds:
            library.malloc_trim(0)


def import_ahead(seconds: float = IMPORT_SECONDS) -> None:
    """Import and load in a thread, after some time, what the first clicks and drags would wait for."""

    def make_ready() -> None:
        importlib.import_module(FIRST_USED)
        from decals.apps.first_inputs import load_first_kernels

        load_first_kernels()

    timer = threading.Timer(seconds, make_ready)
    timer.daemon = True
    timer.start()
