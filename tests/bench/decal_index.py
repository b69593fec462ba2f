"""Benchmark of building and editing the decal index: ``python -m tests.bench.decals --only index``.

Needs NumPy, Warp and msgspec, but no graphics. The arrays of the decals are on the device before timing
starts; `index_..._from_host_ms` includes their upload. Times end when the device is idle.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from blobtree import RIM
from decals import Decals
from decals.index import DecalEditor
from decals.index.build import build_index
from decals.index.index import index_on

Figures = dict[str, float]
COUNTS = {"100k": 100_000, "1m": 1_000_000}
TARGETS = {"index_100k_ms": "≤ 10 on an H200", "index_1m_ms": "≤ 100 on an H200", "edit_1m_ms": "≤ 1"}
RUNS, RUNS_ON_PROCESSOR = 9, 3
EDITS = 200
GAP_FREE = 1.45
"""Influence radius over neighbour distance from which a golden spiral leaves no gap."""


def spiral_decals(count: int, *, spread: float = 0.0) -> Decals:
    """Return decals along a golden spiral on the unit sphere, with sizes that vary by up to 10^±spread."""
    number = np.arange(count) + 0.5
    height, turn = 1 - 2 * number / count, np.pi * (1 + 5**0.5) * number
    ring = np.sqrt(1 - height**2)
    positions = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
    distance = np.sqrt(8 * np.pi / np.sqrt(3) / count)
    sizes = 10.0 ** np.random.default_rng(0).uniform(-spread, spread, count)
    tangents = np.cross(positions, [0.6, 0.0, 0.8]) + 1e-6
    return Decals(positions, positions, tangents, GAP_FREE * distance * RIM * sizes)


def milliseconds(work: Callable[[], object], device: Any) -> float:
    """Return the median time of some runs, each until the device is idle."""
    times, warm_up = [], 1
    for run in range(warm_up + (RUNS_ON_PROCESSOR if wp.get_device(device).is_cpu else RUNS)):
        wp.synchronize_device(device)
        begin = time.perf_counter()
        work()
        wp.synchronize_device(device)
        if run >= warm_up:
            times.append(1e3 * (time.perf_counter() - begin))
    return statistics.median(times)


def device_arrays(decals: Decals, device: Any) -> list[Any]:
    """Return the inputs of an index on a device."""
    return [
        wp.array(decals.positions, dtype=wp.vec3, device=device),
        wp.array(decals.influence, dtype=wp.float32, device=device),
        wp.array(decals.ranks, dtype=wp.int32, device=device),
    ]


def builds(device: Any) -> Figures:
    """Measure building time in ms and size in MB of indices of 100,000 and 1,000,000 decals."""
    figures: Figures = {}
    for title, count in COUNTS.items():
        for kind, spread in (("", 0.0), ("_mixed", 0.5)):
            decals = spiral_decals(count, spread=spread)
            arrays = device_arrays(decals, device)
            index = build_index(*arrays)
            name = f"index_{title}{kind}"
            figures[f"{name}_ms"] = milliseconds(lambda a=arrays: build_index(*a), device)  # type: ignore[misc]
            arrays_of_index = index.levels, index.table, index.ids
            figures[f"{name}_mb"] = 1e-6 * sum(array.size * array.strides[0] for array in arrays_of_index)
            if not spread:
                figures[f"{name}_from_host_ms"] = milliseconds(
                    lambda d=decals: index_on(d, device),  # type: ignore[misc]
                    device,
                )
    return figures


def edits(count: int = COUNTS["1m"]) -> Figures:
    """Measure the time in ms to move one of a million decals: records and index, on the processor."""
    editor, times, rows = DecalEditor(spiral_decals(count)), [], []
    editor.change(1, opacities=[0.5])  # loads the kernels
    for number in range(0, count, count // EDITS):
        moved, before = editor[number].positions * np.float32(1.001), editor.version
        begin = time.perf_counter()
        editor.change(number, positions=moved)
        changes = editor.changed_rows(before)
        times.append(1e3 * (time.perf_counter() - begin))
        rows.append(sum(end - first for ranges in changes.values() for first, end in ranges))
    return {
        "edit_1m_ms": statistics.median(times),
        "edit_1m_worst_ms": max(times),
        "edit_1m_rows": statistics.median(rows),
    }


def profile(device: Any) -> list[str]:
    """Return the kernels that run for a million decals on a CUDA device, longest first."""
    arrays = device_arrays(spiral_decals(COUNTS["1m"]), device)
    wp.timing_begin(cuda_filter=wp.TIMING_ALL)
    build_index(*arrays)
    spent: dict[str, float] = {}
    for one in wp.timing_end():
        spent[one.name] = spent.get(one.name, 0.0) + one.elapsed
    return [f"{name:60} {ms:8.3f} ms" for name, ms in sorted(spent.items(), key=lambda item: -item[1])]


def measure(device: Any) -> Figures:
    """Measure all figures of a device; edits run only on the processor."""
    figures = builds(device)
    if wp.get_device(device).is_cpu:
        return figures | edits()
    print(*profile(device), sep="\n")
    return figures
