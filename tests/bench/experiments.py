"""Experiments: overhead of a trial, equal results of all executors, resumed runs, two workers over one.

python -m tests.bench.experiments [--json FILE] [--quick]
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from decals.experiments import Grid, Results, Seeds, run
from tests.decals.experiments import functions

TARGETS = {
    "resume_equal": "1",
    "executors_equal": "1",
    "rows_lost": "0",
    "rows_twice": "0",
    "overhead_ms": "≤ 5",
    "scaling_2": "≥ 1.8",
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


def clustered(folder: Path) -> dict[str, float]:
    """Run 200 trials on a Dask cluster of processes while workers are killed."""
    from distributed import Client, LocalCluster

    seen: list[Any] = []
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):

        def killing(row: Any) -> None:
            seen.append((row["x"], row["seed"]))
            if len(seen) % 60 == 0:
                os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)

        results = run(functions.measured, DESIGN, folder / "dask", scheduler=client, on_row=killing)
    local = [table(run(functions.measured, DESIGN, folder / str(count), workers=count)) for count in (0, 2)]
    return {
        "rows_lost": len({(trial["x"], trial["seed"]) for trial in DESIGN} - set(seen)),
        "rows_twice": len(seen) - len(set(seen)),
        "executors_equal": float(table(results) == local[0] == local[1]),
    }


def pictures_seconds(workers: int, count: int, folder: Path) -> float:
    """Return the clock time of many pictures, after a first one of each worker."""
    design = Grid(count=[200]) * Seeds(count)
    ended: list[float] = []
    run(
        functions.rendered,
        design,
        folder,
        workers=workers,
        on_row=lambda _: ended.append(time.perf_counter()),
    )
    return (ended[-1] - ended[2 * workers]) / (len(ended) - 2 * workers - 1)


def measure(*, quick: bool) -> dict[str, float]:
    """Return all figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        begin = time.perf_counter()
        run(functions.empty, Grid(x=range(1000)), folder / "empty", workers=0)
        figures = {"overhead_ms": time.perf_counter() - begin}
        figures["resume_equal"] = float(resumed(5 if quick else 30, folder))
        figures |= clustered(folder)
        count = 60 if quick else 1000
        one = pictures_seconds(1, count, folder / "one")
        figures["scaling_2"] = one / pictures_seconds(2, count, folder / "two")
        return figures


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help="fewer kills and pictures")
    options = parser.parse_args()
    figures = measure(quick=options.quick)
    for name, value in figures.items():
        print(f"{name:<18}{np.round(value, 3):>10}   {TARGETS[name]}")
    if options.json:
        options.json.write_text(json.dumps(figures))


if __name__ == "__main__":
    main()
