"""How long a window blocks from when it opens until a whole frame is there.

``python -m tests.bench.opening MODEL DECALS WIDTH HEIGHT``, in a process of its own: what Python and Warp do
once belongs to it.
"""

import json
import subprocess
import sys
import time

from decals.edit import EditSession
from decals.window import EditWindow
from tests.bench.scenes import bench_scene

Figures = dict[str, float]


class Ticking(EditWindow):
    """A window without a screen whose frames come as on one: whoever drives it calls `tick`."""

    ticking = True  # type: ignore[assignment]


def measure(name: str, size: tuple[int, int], count: int) -> Figures:
    """Open a window on a model; VTK's own first frame, without anything of ours, is counted apart.

    A block is the time between two chances for the window to listen, on the clock and in processor time of
    all threads, which other work on the machine does not lengthen; what the longest ones did is printed.
    """
    ticks, used, what, seen = [], [], [], 0.0
    session = EditSession(bench_scene(name, count, size))
    with Ticking(session, off_screen=True, size=size) as window:
        begin = time.perf_counter()
        window.begin()
        window._end_screenshots()  # pyvista takes one of the first frame, which would be drawn whole at once
        window.plotter.show(auto_close=False, interactive=False)
        vtk = time.perf_counter() - begin
        while window._moved or window.stage.waiting:
            at, busy = time.perf_counter(), time.process_time()
            window.tick()
            now = time.perf_counter()
            ticks.append(1e3 * (now - at))
            used.append(1e3 * (time.process_time() - busy))
            what.append(window.waiting.news or "drawing")
            seen = seen or (not window.stage.waiting) * (now - begin)
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
    """Measure in another process; the longest blocks are printed."""
    run = [sys.executable, "-m", "tests.bench.opening", name, str(count), *map(str, size)]
    said, figures = subprocess.run(run, capture_output=True, text=True, check=True).stdout.splitlines()[-2:]
    print(said)
    result: Figures = json.loads(figures)
    return result


if __name__ == "__main__":
    model, decals, *sides = sys.argv[1:]
    print(json.dumps(measure(model, (int(sides[0]), int(sides[1])), int(decals))))
