"""Trust: files of other programs, windings, thin parts, sharp edges, framing, attacks and cancelled work.

    python -m tests.bench.trust [--json FILE] [--quick] [--only windings,thin]

Each part counts faults, and the cases in which it looked for them. The parts are modules of their own.
`tests.bench.trust_files` takes the number of files and of processes.
"""

import argparse
import json
import platform
import sys
from importlib import import_module
from pathlib import Path

from tests.bench.decals import Figures, printed, versions

PARTS = ("files", "windings", "framing", "thin", "csg", "attacks", "cancel", "calls")
"""Names of the parts; each is the module `tests.bench.trust_NAME`."""


def measure(parts: list[str], *, quick: bool) -> Figures:
    """Measure parts, and print the figures of each once it has ended."""
    figures: Figures = {}
    machine = f"{platform.machine()}; {versions('numpy', 'warp-lang', 'vtk', 'moderngl')}"
    for name in parts:
        part = import_module(f"tests.bench.trust_{name}")
        figures |= printed(part.measure(quick=quick), part.TARGETS, machine)
    return figures


def main() -> int:
    """Run the benchmark as the command line asks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="fewer cases of each part")
    parser.add_argument("--only", default=",".join(PARTS), help="names of parts, with commas between them")
    options = parser.parse_args()
    parts = options.only.split(",")
    if unknown := set(parts) - set(PARTS):
        parser.error(f"--only: expected names among {', '.join(PARTS)}, got {', '.join(sorted(unknown))}")
    figures = measure(parts, quick=options.quick)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
