"""The benchmark of starts runs scripts in new processes, and takes the README's own script."""

import os
import sys
from pathlib import Path

import pytest

from tests.bench.silence import COMPILE, page_commands, page_scripts, watch
from tests.bench.start import FIRST_RESULTS, IMPORTS, TIMED, first_script, run

ENVIRONMENT = dict(os.environ) | {"PYTHONPATH": os.pathsep.join(sys.path)}


def test_a_process_is_timed(tmp_path: Path) -> None:
    script = "import time; time.sleep(0.3); print(sum(i * i for i in range(10**6)))"
    cost = run(script, tmp_path, ENVIRONMENT)
    assert cost.output == "333332833333500000\n"
    assert 0.3 < cost.wall < 30.0
    assert 0.01 < cost.processor < 10.0


def test_a_failure_ends_the_benchmark(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="ZeroDivisionError"):
        run("1 / 0", tmp_path, ENVIRONMENT)


def test_imports_are_timed_without_the_start_of_python(tmp_path: Path) -> None:
    cost = run(TIMED.format(statement=IMPORTS["import_decals"]), tmp_path, ENVIRONMENT)
    wall, processor = map(float, cost.output.split())
    assert 0.0 < wall < cost.wall
    assert 0.0 < processor < cost.processor


def test_the_first_script_is_that_of_the_readme() -> None:
    script = first_script()
    assert "decals.cover(" in script
    for name, text in (FIRST_RESULTS | {"readme": script}).items():
        compile(COMPILE + text, name, "exec")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such terminals")
def test_the_longest_silence_of_a_process_is_found(tmp_path: Path) -> None:
    script = """
import sys, time
print("begun", file=sys.stderr, flush=True)
time.sleep(2.0)
print("done" if sys.stdout.isatty() else "no terminal")
"""
    ran = watch(script, tmp_path, ENVIRONMENT)
    assert (ran.code, ran.output.split()) == (0, ["begun", "done"])
    assert ran.before in ("begun", "")  # a loaded machine may take longer to start Python
    assert 1.9 < ran.silence < ran.seconds


def test_scripts_and_commands_of_the_pages_are_found() -> None:
    assert {"README.md", "tour.md", "baking.md"} <= set(page_scripts())
    assert "implicit-decals render knot --decals 800 -o knot.png" in page_commands()
    assert not any("edit" in line for line in page_commands())
