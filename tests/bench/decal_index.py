"""Building and editing the decal index, on any Warp device: ``python -m tests.bench.decals --only index``.

Needs NumPy, Warp and msgspec; no graphics. The arrays of the decals lie on the device already, as particles
leave them; `index_..._from_host_ms` is with the copy. Times include everything until the device is idle.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from blobtree.formulas.kernels import RIM
from decals.grid.build import build_index
from decals.grid.editor import DecalEditor
from decals.grid.index import DeviceIndex
from decals.model import Decals

Figures = dict[str, float]
COUNTS = {"100k": 100_000, "1m": 1_000_000}
TARGETS = {"index_100k_ms": "≤ 10 on an H200", "index_1m_ms": "≤ 100 on an H200", "edit_1m_ms": "≤ 1"}
RUNS, RUNS_ON_PROCESSOR = 9, 3
EDITS = 200
GAP_FREE = 1.45
"""Influence over the distance of neighbours in a hexagonal tiling at which a golden spiral leaves no gap."""


def coat(count: int, *, spread: float = 0.0) -> Decals:
    """Cover the unit sphere evenly (a golden spiral), with sizes that differ by up to 10^±spread."""
    number = np.arange(count) + 0.5
    height, turn = 1 - 2 * number / count, np.pi * (1 + 5**0.5) * number
    ring = np.sqrt(1 - height**2)
    positions = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
    apart = np.sqrt(8 * np.pi / np.sqrt(3) / count)
    sizes = 10.0 ** np.random.default_rng(0).uniform(-spread, spread, count)
    tangents = np.cross(positions, [0.6, 0.0, 0.8]) + 1e-6
    return Decals(positions, positions, tangents, GAP_FREE * apart * RIM * sizes)


def milliseconds(work: Callable[[], object], device: Any) -> float:
    """Median time of a few runs, each until the device has done all of it."""
    times, warm_up = [], 1
    for run in range(warm_up + (RUNS_ON_PROCESSOR if wp.get_device(device).is_cpu else RUNS)):
        wp.synchronize_device(device)
        begin = time.perf_counter()
        work()
        wp.synchronize_device(device)
        if run >= warm_up:
            times.append(1e3 * (time.perf_counter() - begin))
    return statistics.median(times)


def placed(decals: Decals, device: Any) -> list[Any]:
    """What an index is built from, on a device."""
    return [
        wp.array(decals.positions, dtype=wp.vec3, device=device),
        wp.array(decals.influence, dtype=wp.float32, device=device),
        wp.array(decals.ranks, dtype=wp.int32, device=device),
    ]


def builds(device: Any) -> Figures:
    """Milliseconds to build, bytes and lists of indices of 100,000 and 1,000,000 decals."""
    figures: Figures = {}
    for title, count in COUNTS.items():
        for kind, spread in (("", 0.0), ("_mixed", 0.5)):
            decals = coat(count, spread=spread)
            arrays = placed(decals, device)
            index = build_index(*arrays)
            name = f"index_{title}{kind}"
            figures[f"{name}_ms"] = milliseconds(lambda a=arrays: build_index(*a), device)  # type: ignore[misc]
            held = index.levels, index.table, index.ids
            figures[f"{name}_mb"] = 1e-6 * sum(array.size * array.strides[0] for array in held)
            if not spread:
                figures[f"{name}_from_host_ms"] = milliseconds(
                    lambda d=decals: DeviceIndex.of(d, device),  # type: ignore[misc]
                    device,
                )
    return figures


def edits(count: int = COUNTS["1m"]) -> Figures:
    """Median and worst milliseconds to move one decal of a million: records and index, on the processor."""
    editor, times, rows = DecalEditor(coat(count)), [], []
    editor.change(1, opacities=[0.5])  # loads the kernels
    for number in range(0, count, count // EDITS):
        moved, before = editor[number].positions * np.float32(1.001), editor.version
        begin = time.perf_counter()
        editor.change(number, positions=moved)
        changes = editor.changes(before)
        times.append(1e3 * (time.perf_counter() - begin))
        rows.append(sum(end - first for ranges in changes.values() for first, end in ranges))
    return {
        "edit_1m_ms": statistics.median(times),
        "edit_1m_worst_ms": max(times),
        "edit_1m_rows": statistics.median(rows),
    }


def profile(device: Any) -> list[str]:
    """Where the time of a million goes: what runs on a CUDA device, longest first."""
    arrays = placed(coat(COUNTS["1m"]), device)
    wp.timing_begin(cuda_filter=wp.TIMING_ALL)
    build_index(*arrays)
    spent: dict[str, float] = {}
    for one in wp.timing_end():
        spent[one.name] = spent.get(one.name, 0.0) + one.elapsed
    return [f"{name:60} {ms:8.3f} ms" for name, ms in sorted(spent.items(), key=lambda item: -item[1])]


def measure(device: Any) -> Figures:
    """All figures of this device; edits run on the processor, so they are measured there alone."""
    figures = builds(device)
    if wp.get_device(device).is_cpu:
        return figures | edits()
    print(*profile(device), sep="\n")
    return figures
