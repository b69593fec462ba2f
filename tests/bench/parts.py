"""Benchmarks of several parts, each a module of its own with `measure(quick=…)` and `TARGETS`."""

import platform
from collections.abc import Sequence
from importlib import import_module

from tests.bench.command_line import bench_parser, write
from tests.bench.decals import Figures, printed, versions


def measure(name: str, parts: Sequence[str], *, quick: bool) -> Figures:
    """Measure parts of a benchmark, and print the figures of each once it has ended."""
    figures: Figures = {}
    machine = f"{platform.machine()}; {versions('numpy', 'warp-lang', 'vtk', 'moderngl')}"
    for part in parts:
        module = import_module(f"tests.bench.{name}_{part}")
        figures |= printed(module.measure(quick=quick), module.TARGETS, machine)
    return figures


def run(name: str, parts: Sequence[str], description: str | None) -> int:
    """Run a benchmark of parts as the command line asks."""
    parser = bench_parser(name, description)
    parser.add_argument("--quick", action="store_true", help="fewer cases of each part")
    parser.add_argument("--only", default=",".join(parts), help="names of parts, with commas between them")
    options = parser.parse_args()
    chosen = options.only.split(",")
    if unknown := set(chosen) - set(parts):
        parser.error(f"--only: expected names among {', '.join(parts)}, got {', '.join(sorted(unknown))}")
    write(options.json, measure(name, chosen, quick=options.quick))
    return 0
