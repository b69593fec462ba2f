"""Benchmark of the first minutes: imports, and first results without and with compiled kernels.

Each figure is the time of a fresh process. A cold one finds an empty kernel cache and an empty shader cache
of the graphics driver. It takes the kernels that `.ci/compile_kernels.py` compiled ahead of time, as a wheel
has them. With ``--compile`` it compiles all of them, as in a checkout.

    python -m tests.bench.start
    python -m tests.bench.start --compile --json
    python -m tests.bench.start --silence   # and the longest time in which the documentation's code is silent
"""

import argparse
import json
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.bench.silence import COMMAND, COMPILE, cold_environment, cold_runs, user_environment

ROOT = Path(__file__).resolve().parents[2]

RENDER = ["render", "knot", "--decals", "200", "--output", "knot.png"]
MODEL = """
from blobtree import Point, Segment, polygonize
duck = Point((0, 0, 0), radius=1.0) + Segment((0.9, 0.5, 0), (1.1, 1.3, 0), radius=0.55)
"""
FIRST_RESULTS = {
    "first_picture": COMMAND.format(words=RENDER),
    "first_mesh": MODEL + "polygonize(duck)",
    "first_ray": MODEL + "duck.raycast([(0, 0, 5)], [(0, 0, -1)])",
    "first_creases": MODEL + "polygonize(duck - Point((0, 0, 1), radius=0.5), creases=True)",
}
"""Scripts by the name of their figure; each runs cold, and then warm."""

TIMED = """
import time
begin = time.perf_counter(), time.process_time()
{statement}
print(time.perf_counter() - begin[0], time.process_time() - begin[1])
"""
IMPORTS = {
    "import_decals": "import decals",
    "import_blobtree": "import blobtree; blobtree.Point",
    "import_cover": "from decals import cover",
}
"""Statements whose own time counts, without the start of Python."""
IMPORT_RUNS = 3


@dataclass(frozen=True)
class Cost:
    """Time of a process: on the clock, and on the processors, which other programs hardly affect."""

    wall: float
    processor: float
    output: str = ""


def run(script: str, folder: Path, environment: Mapping[str, str]) -> Cost:
    """Run a script in a new process."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command, settings = [sys.executable, "-c", script], dict(environment)
    ran = subprocess.run(command, cwd=folder, env=settings, capture_output=True, text=True, check=False)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if ran.returncode:
        sys.exit(f"{script}\n{ran.stderr}")
    processor = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return Cost(wall, processor, ran.stdout)


def first_script() -> str:
    """Return the first Python script of README.md."""
    found = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found[1]


def measure(*, compiled: bool) -> dict[str, Cost]:
    """Measure all figures; ``compiled``: compile all kernels, also those that are shipped."""
    start = COMPILE if compiled else ""
    costs = {}
    for name, script in (FIRST_RESULTS | {"readme": first_script()}).items():
        with tempfile.TemporaryDirectory() as folder:
            environment = cold_environment(Path(folder))
            costs[f"{name}_cold"] = run(start + script, Path(folder), environment)
            costs[f"{name}_warm"] = run(start + script, Path(folder), environment)
    with tempfile.TemporaryDirectory() as folder:
        environment = user_environment()
        for name, statement in IMPORTS.items():
            script = TIMED.format(statement=statement)
            runs = [run(script, Path(folder), environment).output.split() for _ in range(IMPORT_RUNS)]
            costs[name] = min((Cost(float(wall), float(own)) for wall, own in runs), key=_wall)
        words = COMMAND.format(words=["--help"])
        costs["help"] = min((run(words, Path(folder), environment) for _ in range(IMPORT_RUNS)), key=_wall)
    return costs


def _wall(cost: Cost) -> float:
    return cost.wall


def main() -> None:
    """Measure, and print a table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--compile", action="store_true", help="do not take kernels compiled ahead of time")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.add_argument("--silence", action="store_true", help="measure the longest silence too; minutes")
    arguments = parser.parse_args()
    costs = measure(compiled=arguments.compile)
    if arguments.silence:
        silences = [run.silence for _, run in cold_runs(COMPILE if arguments.compile else "")]
        costs["silence"] = Cost(max(silences), 0.0)
    if arguments.json:
        figures = {f"{name}_s": round(cost.wall, 3) for name, cost in costs.items()}
        figures |= {f"{name}_processor_s": round(cost.processor, 3) for name, cost in costs.items()}
        print(json.dumps(figures))
        return
    for name, cost in costs.items():
        print(f"{name:20s} {cost.wall:6.2f} s, {cost.processor:6.2f} s of the processors")


if __name__ == "__main__":
    main()
