"""Many windows, and several threads on one device: ``python -m tests.endurance --windows 1000 --rounds 100``.

Threads do the same work in different orders at the same time, and each result is compared bit for bit with
that of a thread alone. ``--device cuda:0`` does it on a CUDA device. Windows are opened without a screen,
drawn, edited and closed. Failures and the growth of the memory are printed as JSON; free memory is given back
to the system before each look.
"""

import argparse
import ctypes
import gc
import hashlib
import json
import random
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import blobtree
import decals
from blobtree import Point, Segment, Torus
from decals.editing import MoveDecals
from decals.window import EditWindow
from tests.decals.editing.scenes import one, scene

Work = Callable[[], tuple[Any, ...]]
"""Returns the arrays of one piece of work."""

FIRST_PART = 0.5
"""Part of the windows after which the memory should not grow."""

LOOKS = 20
"""Looks at the memory during a run."""


def works(device: str) -> dict[str, Work]:
    """Return pieces of work on a device, by their names."""
    tree = Point((0, 0, 0), radius=1.0) + Segment((0.9, 0.5, 0), (1.4, 1.3, 0), radius=0.5)
    cut = (tree - Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.2)).twist(20.0)
    rng = np.random.default_rng(1)
    points = rng.uniform(-1.5, 1.5, (20_000, 3)).astype(np.float32)
    starts = np.tile(np.array([0, 0, 6], np.float32), (5000, 1))
    surface = decals.surfaces.ImplicitSurface(tree, device=device)
    mesh = blobtree.polygonize(tree, resolution=48)
    other = decals.surfaces.MeshSurface(mesh.vertices, mesh.faces, device=device)
    placed = decals.scatter(surface, count=200, seed=2)
    positions, normals = surface.project(points)

    def scattered(on: Any) -> tuple[Any, ...]:
        found = decals.scatter(on, count=150, seed=3, device=device)
        return found.positions, found.radii, found.tangents

    def polygonized(model: blobtree.Node) -> tuple[Any, ...]:
        made = blobtree.polygonize(model, resolution=64, device=device)
        return made.vertices, made.faces

    def traced() -> tuple[Any, ...]:
        hits = cut.raycast(starts, points[: len(starts)] - starts, device=device)
        return hits.distances, hits.normals

    def evaluated(contact: decals.Contact) -> tuple[Any, ...]:
        found = decals.evaluate(placed, positions, normals, contact=contact, device=device)
        return found.owner, found.uv

    return {
        "scatter over a tree": partial(scattered, surface),
        "scatter over a mesh": partial(scattered, other),
        "polygonize": partial(polygonized, tree),
        "polygonize a warp": partial(polygonized, cut),
        "trace": traced,
        **{f"evaluate {mode.name}": partial(evaluated, mode) for mode in decals.Contact},
        "project onto a mesh": lambda: other.project(points),
        "project onto a tree": lambda: surface.project(points),
    }


def digest(arrays: tuple[Any, ...]) -> str:
    """Return a hash of arrays."""
    return hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()


def thread_failures(device: str, rounds: int, *, threads: int = 2, seed: int = 0) -> list[str]:
    """Do all pieces of work in several threads at a time; return exceptions and results that differ."""
    todo = works(device)
    expected = {name: digest(work()) for name, work in todo.items()}
    failures: list[str] = []

    def run(number: int) -> None:
        order = random.Random(f"{seed}:{number}")
        for turn in range(rounds):
            for name in order.sample(list(todo), len(todo)):
                try:
                    if digest(todo[name]()) != expected[name]:
                        failures.append(f"thread {number}, round {turn}: {name} differs")
                except Exception:
                    failures.append(
                        f"thread {number}, round {turn}: {name}: {traceback.format_exc(limit=-2)}"
                    )

    started = [threading.Thread(target=run, args=(number,)) for number in range(threads)]
    for thread in started:
        thread.start()
    for thread in started:
        thread.join()
    return failures


def resident_megabytes() -> float:
    """Return the memory that this process has from the system (Linux)."""
    fields = Path("/proc/self/statm").read_text(encoding="ascii").split()
    return int(fields[1]) * 4096 / 1e6


def growth(memory: Sequence[tuple[int, float]], first_part: float) -> float:
    """Return the growth per 1,000 cases after the first part of a run: the slope of the best line.

    Parameters
    ----------
    memory
        Numbers of cases and megabytes then.
    first_part
        Part of the run that is left out.
    """
    steady = [look for look in memory if look[0] >= first_part * memory[-1][0]]
    if len(steady) < 2:
        return 0.0
    numbers, megabytes = np.transpose(steady)
    return 1000.0 * float(np.polyfit(numbers, megabytes, 1)[0])


def kept_megabytes() -> float:
    """Return the memory of this process once all that is free has been given back to the system."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return resident_megabytes()


def window_failures(count: int, *, seed: int = 0) -> tuple[list[str], float]:
    """Open, draw, edit and close windows; return exceptions, and the growth of the memory in MB per 1,000."""
    failures: list[str] = []
    chance = random.Random(seed)
    shown, moved = scene(), one()
    before, memory = threading.enumerate(), list[tuple[int, float]]()
    for number in range(1, count + 1):
        try:
            window = EditWindow(
                shown, off_screen=True, size=(chance.randrange(80, 240), chance.randrange(60, 160))
            )
            window.show()
            window.session.do(MoveDecals([chance.randrange(60)], moved.positions[0], moved.normals[0]))
            window.subplot.draw()
            if chance.random() < 0.5:
                window.session.undo()
                window.subplot.draw()
            window.close()
        except Exception:
            failures.append(f"window {number}: {traceback.format_exc(limit=-2)}")
        if number == 1:
            before = threading.enumerate()
        if number % max(count // LOOKS, 1) == 0:
            memory.append((number, kept_megabytes()))
    left = [thread.name for thread in threading.enumerate() if thread not in before]
    return failures + [f"thread left: {name}" for name in left], growth(memory, FIRST_PART)


def main() -> int:
    """Run the stages of the command line; the exit code is 1 after a failure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--windows", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=3, help="times that each thread does all its work")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    threads = thread_failures(options.device, options.rounds, threads=options.threads, seed=options.seed)
    windows, grown = window_failures(options.windows, seed=options.seed) if options.windows else ([], 0.0)
    figures = {
        "thread_faults": len(threads),
        "thread_cases": options.rounds * options.threads * len(works("cpu")),
        "window_faults": len(windows),
        "window_cases": options.windows,
        "growth_mb_per_1000_windows": round(grown, 1),
    }
    print(json.dumps({**figures, "device": options.device, "failures": [*threads, *windows][:20]}, indent=1))
    return int(bool(threads or windows))


if __name__ == "__main__":
    sys.exit(main())
