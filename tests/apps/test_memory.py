"""Memory of long sessions."""

import sys

import pytest

from decals.apps import memory
from tests.programs import output_of

PIECES = """
import sys, time
from pathlib import Path
from decals.apps.memory import keep_memory_low

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

keep_memory_low(trim_seconds=float(sys.argv[1]))
pieces = [bytes(2000) for _ in range(30_000)]
kept = pieces[::100]  # the heap has gaps
before = resident()
del pieces
after = resident()
end = time.monotonic() + 20.0
while resident() > before - 40.0 and time.monotonic() < end and float(sys.argv[1]) < 1.0:
    sum(range(100_000))
print(before - after, before - resident())
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have another allocator")
@pytest.mark.parametrize(("seconds", "returned"), [(0.05, True), (100.0, False)])
def test_a_session_returns_the_gaps_of_its_heap(seconds: float, returned: bool) -> None:
    at_once, later = map(float, output_of(PIECES, str(seconds)).split())
    assert (later > 40.0) == returned
    assert at_once < 40.0 or returned


HEAPS = """
import ctypes, sys, threading
from decals.apps.memory import share_heap

if sys.argv[1] == "shared":
    share_heap()
begun = threading.Barrier(5)

def work():
    kept = [bytes(1000) for _ in range(100)]
    begun.wait()

for _ in range(4):
    threading.Thread(target=work).start()
begun.wait()
library = ctypes.CDLL(None)
output = ctypes.c_void_p.in_dll(library, "stdout")
library.malloc_info(0, output)
library.fflush(output)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have another allocator")
@pytest.mark.parametrize("kind", ["shared", "several"])
def test_all_threads_share_a_heap(kind: str) -> None:
    assert (output_of(HEAPS, kind).count("<heap nr=") == 1) == (kind == "shared")


AHEAD = """
import sys, time
import blobtree
from decals.apps.memory import FIRST_USED, import_ahead

import_ahead(0.1)
assert FIRST_USED not in sys.modules
end = time.monotonic() + 60.0
while FIRST_USED not in sys.modules and time.monotonic() < end:
    time.sleep(0.01)
import importlib
print(hasattr(importlib.import_module(FIRST_USED), "evaluate_sensitivities"))
"""


@pytest.mark.slow
def test_kernels_of_the_first_drag_are_imported_ahead() -> None:
    assert output_of(AHEAD) == "True\n"


KEPT = """
import gc, weakref
from decals.apps.memory import made_to_stay

class Node: pass

def cycle():
    node = Node()
    node.itself = node
    return weakref.ref(node)

gc.collect()
try:
    with made_to_stay():
        enabled, kept = gc.isenabled(), cycle()
        raise OSError
except OSError:
    later = cycle()
gc.collect()
print(enabled, gc.isenabled(), kept() is not None, later() is None)
"""


def test_what_is_made_to_stay_is_left_out_of_the_search_for_cycles() -> None:
    assert output_of(KEPT) == "False True True True\n"


FAULTS = """
import resource, numpy as np
from decals.apps.memory import keep_for_work, keep_memory_low

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        np.ones(2_000_000)  # 16 MB: 3,906 pages
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

def held():
    return int(open("/proc/self/statm").read().split()[1])

keep_for_work(True)  # no effect yet
keep_memory_low(3600.0)
resting = faults()
keep_for_work(True)
faults()
working, kept = faults(), held()
keep_for_work(False)
after = faults()
print(resting, working, after, kept - held())
"""


class Library:
    """Stands for the C library: it records the calls."""

    def __init__(self) -> None:
        self.options: list[tuple[int, int]] = []

    def mallopt(self, option: int, value: int) -> int:
        self.options.append((option, value))
        return 1


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> Library:
    library = Library()
    monkeypatch.setattr(memory, "_glibc", lambda: library)
    monkeypatch.setattr(memory, "_session", memory._Session())
    return library


def test_only_changes_of_a_session_that_keeps_memory_low_set_options(
    library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory.keep_for_work(working=True)
    assert library.options == []
    monkeypatch.setattr(memory, "_session", memory._Session(kept_low=True))
    for working, options in ((False, {}), (True, memory.WORK_ALLOCATION), (False, memory.ALLOCATION)):
        library.options.clear()
        for _ in range(3):  # the page asks ten times a second
            memory.keep_for_work(working=working)
        assert dict(library.options) == options
        assert len(library.options) == len(options)


def test_another_c_library_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_glibc", lambda: None)
    monkeypatch.setattr(memory, "_session", memory._Session(kept_low=True))
    memory.keep_for_work(working=True)
    assert not memory._session.working


@pytest.mark.skipif(memory._glibc() is None, reason="the options are those of glibc")
def test_work_takes_its_memory_from_the_system_once() -> None:
    resting, working, after, returned = map(int, output_of(FAULTS).split())
    assert working < 0.1 * resting  # page faults; large pages take fewer in all
    assert after > 0.5 * resting
    assert returned > 3000
