"""Benchmark of opening a window: blocks until the first whole frame.

``python -m tests.bench.opening MODEL DECALS WIDTH HEIGHT`` runs in a separate process, so that it includes
the start of Python and Warp.
"""

import json
import subprocess
import sys
import time

from decals.editing import EditSession
from decals.window import EditWindow
from decals.window.frames import FrameState
from tests.bench.scenes import bench_scene

Figures = dict[str, float]


class Ticking(EditWindow):
    """An off-screen window that schedules frames as on a screen: its driver calls `tick`."""

    ticking = True


def measure(name: str, size: tuple[int, int], count: int) -> Figures:
    """Open a window on a model; measure VTK's first frame without decals separately.

    A block is a time in which the window handles no input, in wall time and in processor time of all threads,
    which other programs do not affect. The longest blocks are printed with their work.
    """
    ticks, used, what, seen = [], [], [], 0.0
    session = EditSession(bench_scene(name, count, size))
    with Ticking(session, off_screen=True, size=size) as window:
        begin = time.perf_counter()
        window.begin()
        window._end_screenshots()  # pyvista's screenshot of the first frame would draw it whole at once
        window.plotter.show(auto_close=False, interactive=False)
        vtk = time.perf_counter() - begin
        while window.frames.state is FrameState.COARSE or window.subplot.warming_up:
            at, busy = time.perf_counter(), time.process_time()
            window.tick()
            now = time.perf_counter()
            ticks.append(1e3 * (now - at))
            used.append(1e3 * (time.process_time() - busy))
            what.append(window.warmup.status or "drawing")
            seen = seen or (not window.subplot.warming_up) * (now - begin)
        whole = time.perf_counter() - begin
    longest = sorted(zip(ticks, used, what, strict=True), reverse=True)[:4]
    prefix = f"{name}_{count}_open"
    print(f"{prefix}:", ", ".join(f"{took:.0f} ms ({own:.0f}) {said}" for took, own, said in longest))
    return {
        f"{prefix}_vtk_ms": 1e3 * vtk,
        f"{prefix}_longest_block_ms": max(ticks),
        f"{prefix}_longest_used_ms": max(used),
        f"{prefix}_slices": len(ticks),
        f"{prefix}_seen_s": seen,
        f"{prefix}_whole_s": whole,
    }


def opening(name: str, size: tuple[int, int], count: int) -> Figures:
    """Measure in another process, and print the longest blocks."""
    run = [sys.executable, "-m", "tests.bench.opening", name, str(count), *map(str, size)]
    said, figures = subprocess.run(run, capture_output=True, text=True, check=True).stdout.splitlines()[-2:]
    print(said)
    result: Figures = json.loads(figures)
    return result


if __name__ == "__main__":
    model, decals, *sides = sys.argv[1:]
    print(json.dumps(measure(model, (int(sides[0]), int(sides[1])), int(decals))))
