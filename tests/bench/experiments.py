"""Experiments: overhead and memory, equal results of all executors, resumed runs, two workers over one.

python -m tests.bench.experiments [--json FILE] [--quick] [--only overhead,kills,cluster,pictures,memory]

The cluster is a scheduler and workers that the two commands of the page on experiments start.
"""

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from decals.experiments import Grid, Results, Seeds, run
from decals.experiments.workers import used_megabytes
from tests.bench.command_line import bench_parser, write
from tests.decals.experiments import functions

TARGETS = {
    "resume_equal": "1",
    "executors_equal": "1",
    "rows_lost": "0",
    "rows_twice": "0",
    "overhead_ms": "≤ 5",
    "scaling_2": "≥ 1.8",
    "efficiency": "≥ 0.8 with 16 on 16 cores",
    "memory_mb": "≤ 20",
    "pictures_mb": "",
}

SCRIPT = """
import sys
from decals.experiments import Grid, run
from tests.decals.experiments import functions
if __name__ == "__main__":
    run(functions.slow, Grid(x=range(150)), sys.argv[1], workers=2)
"""

DESIGN = Grid(x=range(25)) * Seeds(8)


def table(results: Results) -> list[Any]:
    """Parameters, status and measures of all rows."""
    names = [*results.parameters, "status", *results.measures]
    return [[row.get(name) for name in names] for row in results.rows]


def resumed(kills: int, folder: Path) -> bool:
    """Kill a run and its workers at random moments; return whether the last table is that of a whole run."""
    expected = table(run(functions.slow, Grid(x=range(150)), folder / "whole", workers=2))
    script = folder / "script.py"
    script.write_text(SCRIPT)
    clock = random.Random(3)
    for _ in range(kills):
        child = subprocess.Popen(
            [sys.executable, script, folder / "killed"], start_new_session=True, stderr=subprocess.DEVNULL
        )
        time.sleep(clock.uniform(0.2, 2.0))
        os.killpg(child.pid, signal.SIGKILL)
        child.wait()
    return table(run(functions.slow, Grid(x=range(150)), folder / "killed", workers=2)) == expected


@contextmanager
def cluster_of_commands(folder: Path) -> Iterator[str]:
    """Yield the address of a scheduler and two workers, started as separate processes."""
    file = folder / "scheduler.json"
    dask, log = [sys.executable, "-m", "dask"], (folder / "cluster.log").open("w")
    ports = ["--port", "0", "--dashboard-address", ":0"]
    commands = [[*dask, "scheduler", *ports, "--scheduler-file", str(file)]]
    commands += [
        [*dask, "worker", "--scheduler-file", str(file), "--nthreads", "1", "--dashboard-address", ":0"]
    ] * 2
    children = []
    try:
        for command in commands:
            settings: Any = {"env": os.environ | PYTHON_PATH, "start_new_session": True}
            children.append(subprocess.Popen(command, cwd=folder, stdout=log, stderr=log, **settings))
            while not file.exists():
                time.sleep(0.1)
        yield json.loads(file.read_text())["address"]
    finally:
        for child in children:
            os.killpg(child.pid, signal.SIGKILL)
            child.wait()
        log.close()


PYTHON_PATH = {"PYTHONPATH": str(Path(__file__).parents[2])}
"""The checkout, so that workers can import the functions of the tests."""


def clustered(folder: Path) -> dict[str, float]:
    """Run 200 trials on a Dask cluster of separate processes while workers are killed."""
    from distributed import Client

    seen: list[Any] = []
    with cluster_of_commands(folder) as address, Client(address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=120)

        def killing(row: Any) -> None:
            seen.append((row["x"], row["seed"]))
            if len(seen) % 60 == 0:
                os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)

        results = run(functions.measured, DESIGN, folder / "dask", scheduler=address, on_row=killing)
    local = [table(run(functions.measured, DESIGN, folder / str(count), workers=count)) for count in (0, 2)]
    return {
        "rows_lost": len({(trial["x"], trial["seed"]) for trial in DESIGN} - set(seen)),
        "rows_twice": len(seen) - len(set(seen)),
        "executors_equal": float(table(results) == local[0] == local[1]),
    }


def pictures(count: int, folder: Path, most: int) -> dict[str, float]:
    """Return one worker's time for many pictures over that of several, and how its memory grows.

    Several workers draw as many pictures each as half of the one does, so that they start no longer than two.
    """
    seconds, growth = [], 0.0
    for workers in (1, most):
        ended: list[float] = []
        peaks: list[float] = []

        def note(row: Any, ended: list[float] = ended, peaks: list[float] = peaks) -> None:
            ended.append(time.perf_counter())
            peaks.append(row["peak_mb"])

        out = folder / f"pictures {workers}"
        seeds = Seeds(count * max(1, workers // 2))
        run(functions.rendered, Grid(count=[200]) * seeds, out, workers=workers, on_row=note)
        first = 2 * workers  # the first pictures of each worker compile and warm up
        seconds.append((ended[-1] - ended[first]) / (len(ended) - first - 1))
        if workers == 1:
            growth = max(peaks[-count // 10 :]) - max(peaks[count // 10 : count // 5])
    scaling = seconds[0] / seconds[1]
    return {f"scaling_{most}": scaling, "efficiency": scaling / most, "pictures_mb": growth}


def memory_growth(count: int, folder: Path) -> float:
    """Return by how many megabytes this process grows from the thousandth of many empty trials on."""
    used: list[float] = []
    run(
        functions.empty,
        Grid(x=range(count)),
        folder,
        workers=0,
        on_row=lambda _: used.append(used_megabytes()),
    )
    return max(used[1000:]) - used[999]


def overhead(folder: Path) -> float:
    """Return the milliseconds of an empty trial in this process."""
    begin = time.perf_counter()
    run(functions.empty, Grid(x=range(1000)), folder, workers=0)
    return time.perf_counter() - begin


def parts(folder: Path, *, quick: bool, workers: int) -> dict[str, Callable[[], dict[str, float]]]:
    """Return the parts of the benchmark by name."""
    return {
        "overhead": lambda: {"overhead_ms": overhead(folder / "empty")},
        "memory": lambda: {"memory_mb": memory_growth(2_000 if quick else 10_000, folder / "memory")},
        "kills": lambda: {"resume_equal": float(resumed(5 if quick else 30, folder))},
        "cluster": lambda: clustered(folder),
        "pictures": lambda: pictures(60 if quick else 1000, folder, workers),
    }


def main() -> None:
    """Print the figures."""
    parser = bench_parser("experiments", __doc__)
    parser.add_argument("--quick", action="store_true", help="fewer kills, pictures and trials")
    parser.add_argument("--only", help="parts, with commas between")
    parser.add_argument("--workers", type=int, default=2, help="workers that draw pictures beside one")
    options = parser.parse_args()
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as name:
        every = parts(Path(name), quick=options.quick, workers=options.workers)
        for part in options.only.split(",") if options.only else every:
            for figure, value in every[part]().items():
                figures[figure] = value
                print(f"{figure:<18}{np.round(value, 3):>10}   {TARGETS.get(figure, '')}", flush=True)
    write(options.json, figures)


if __name__ == "__main__":
    main()
