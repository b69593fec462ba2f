"""Killed runs, a Dask cluster, and reports."""

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from blobtree import __version__
from decals.errors import InvalidInput, MissingPackage
from decals.experiments import Grid, Results, report, run
from decals.experiments.workers import _check_versions
from tests.decals.experiments import functions

SCRIPT = """
import sys
from decals.experiments import Grid, run
from tests.decals.experiments import functions
if __name__ == "__main__":
    run(functions.slow, Grid(x=range(40)), sys.argv[1], workers=2)
"""

ROOT = Path(__file__).parents[3]

ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [*sys.path, str(ROOT)]))}
"""Environment of scripts that import these tests."""


def rows(results: Results) -> list[Any]:
    return [(row["x"], row["status"], row["result"]) for row in results.rows]


@pytest.mark.slow
def test_killed_runs_resume_to_the_same_table(tmp_path: Path) -> None:
    expected = rows(run(functions.slow, Grid(x=range(40)), tmp_path / "whole", workers=0))
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    clock, begun = random.Random(7), tmp_path / "out" / "experiment.json"
    for number in range(4):
        child = subprocess.Popen(
            [sys.executable, script, tmp_path / "out"], env=ENVIRONMENT, stderr=subprocess.DEVNULL
        )
        while number and not begun.exists() and child.poll() is None:
            time.sleep(0.1)
        time.sleep(clock.uniform(0.5, 4.0))
        child.kill()
        assert child.wait() in (0, -signal.SIGKILL)
    assert begun.exists()
    results = run(functions.slow, Grid(x=range(40)), tmp_path / "out", workers=2)
    assert rows(results) == expected


@pytest.mark.slow
def test_a_trial_in_which_this_process_ended_runs_in_another_one(tmp_path: Path) -> None:
    """One that was killed from outside gives its row; one that kills its process gives the reason."""
    script = tmp_path / "script.py"
    script.write_text(
        "import sys\nfrom decals.experiments import Grid, run\n"
        "from tests.decals.experiments import functions\n"
        "if __name__ == '__main__':\n"
        "    run(functions.ends, Grid(x=[0, 1, 2, 3], folder=sys.argv[1:]), 'out', workers=0)\n"
    )
    for code in (-signal.SIGKILL, -signal.SIGKILL, 0):
        ended = subprocess.run([sys.executable, script, tmp_path], cwd=tmp_path, env=ENVIRONMENT)
        assert ended.returncode == code
    found = {
        row["x"]: (row["status"], row["error"], row.get("result")) for row in Results(tmp_path / "out").rows
    }
    assert found.pop(1) == ("ended", "ended its process (signal SIGKILL)", None)
    assert found == {x: ("done", None, x) for x in (0, 2, 3)}


@pytest.mark.slow
def test_trials_may_start_processes_which_end_with_them(tmp_path: Path) -> None:
    seconds = 9000 + random.random()
    design = Grid(x=[1, 2, 3], limit=[seconds])
    results = run(functions.with_children, design, tmp_path, workers=1, limit=3)
    found = [(row["x"], row["status"], row["result"]) for row in results.rows]
    assert found == [(1, "done", [1]), (2, "ended", None), (3, "done", [3])]
    running = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True).stdout
    assert f"sleep {seconds:.6f}" not in running


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """A scheduler and two workers, each a process of its own, on a port of TCP."""
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    options = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    dask = [sys.executable, "-m", "dask"]
    started = [
        subprocess.Popen(
            [*dask, "scheduler", "--scheduler-file", file, "--port", "0", "--no-dashboard"], **options
        )  # type: ignore[call-overload]
    ]
    worker = ["worker", "--scheduler-file", file, "--nworkers", "2", "--nthreads", "1", "--no-dashboard"]
    started.append(subprocess.Popen([*dask, *worker], **options))  # type: ignore[call-overload]
    import json

    while not file.exists():
        time.sleep(0.1)
    try:
        yield json.loads(file.read_text())["address"]
    finally:
        for process in started:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@pytest.mark.slow
def test_a_cluster_gives_each_row_once_though_workers_are_killed(tmp_path: Path, scheduler: str) -> None:
    from distributed import Client

    seen: list[Any] = []
    with Client(scheduler, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)

        def killed(row: Any) -> None:
            seen.append(row)
            if len(seen) in (15, 40):
                process = next(iter(client.run(os.getpid).values()))
                os.kill(process, signal.SIGKILL)

        results = run(functions.slow, Grid(x=range(60)), tmp_path / "out", scheduler=client, on_row=killed)
        threads = run(
            functions.variable, Grid(name=["BLOBTREE_THREADS"]), tmp_path / "threads", scheduler=client
        )
    assert threads.rows[0]["result"] == "1", "each worker has one core"
    assert Counter(row["x"] for row in seen) == Counter(range(60))
    assert rows(results) == rows(run(functions.slow, Grid(x=range(60)), tmp_path / "here", workers=0))


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("decals.experiments.workers.CONNECT_SECONDS", 1.0)
    with pytest.raises(InvalidInput, match="no Dask scheduler answers"):
        run(functions.slow, Grid(x=[1]), tmp_path, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(InvalidInput, match="scheduler: expected an address or a Dask client"):
        run(functions.slow, Grid(x=[1]), tmp_path, scheduler=3)


class Cluster:
    """A client of a cluster whose workers answer as given."""

    def __init__(self, answers: list[Any]) -> None:
        self.answers = answers

    def run(self, _function: Any, on_error: str) -> dict[int, Any]:
        assert on_error == "return"
        return dict(enumerate(self.answers))


def test_workers_of_other_versions_are_refused_but_not_those_that_end() -> None:
    lost = OSError("Stream is closed")
    _check_versions(Cluster([__version__, lost]))
    with pytest.raises(InvalidInput, match=r"have version 0\.0\.1 of implicit-decals"):
        _check_versions(Cluster([__version__, "0.0.1", lost]))
    with pytest.raises(InvalidInput, match=r"cannot import this package \(No module named 'decals'\)"):
        _check_versions(Cluster([ModuleNotFoundError("No module named 'decals'"), __version__]))


def test_without_dask_a_scheduler_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    with pytest.raises(MissingPackage, match="Dask is not installed"):
        run(functions.slow, Grid(x=[1]), tmp_path, scheduler="tcp://127.0.0.1:9")


def test_intervals_hold_the_mean_as_often_as_they_say(tmp_path: Path) -> None:
    """Means of 20 uniform numbers: about 95 of 100 intervals hold 0.5."""
    design = Grid(x=range(100)) * Grid(seed=range(20))
    groups = run(functions.measured, design, tmp_path, workers=0).interval("value", by="x")
    assert len(groups) == 100
    assert 85 <= sum(group["low"] <= 0.5 <= group["high"] for group in groups) <= 100
    with pytest.raises(InvalidInput, match="expected one of"):
        Results(tmp_path).interval("other")


def test_frames_have_all_columns(tmp_path: Path) -> None:
    results = run(functions.measured, Grid(x=[2, 1]), tmp_path, workers=0)
    frame = pytest.importorskip("pandas", reason="frames need pandas") and results.to_pandas()
    assert list(frame["x"]) == [1, 2]
    assert list(frame["x2"]) == [1, 4]
    assert set(frame.columns) == {*results.rows[0]}


def test_a_report_shows_measures_pictures_errors_and_versions(tmp_path: Path) -> None:
    results = run(functions.drawn, Grid(count=[4, 8, -1]), tmp_path / "out", workers=0)
    report(results, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert page.count("data:image/png") == 2
    assert 'alt="count2 against count"' in page
    assert 'alt="count 4"' in page
    assert "count: expected" in page
    assert "warp-lang" in page
    assert "2 done, 1 failed" in page or "1 failed, 2 done" in page
    assert "http" not in page.replace("http://www.w3.org", "")


def test_texts_that_look_like_pictures_and_formulas_are_texts(tmp_path: Path) -> None:
    (tmp_path / "secret.png").write_bytes(b"secret")
    texts = ["none.png", "../secret.png", str(tmp_path / "secret.png"), "$\\frac$", "<script>"]
    results = run(functions.named, Grid(text=texts), tmp_path / "out", workers=0)
    report(results, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "data:image/png" not in page
    assert "data:image/svg" in page
    assert "<script" not in page
