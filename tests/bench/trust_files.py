"""Generated files of all formats: crashes, hangs, foreign exceptions, and valid files that are misread.

    python -m tests.bench.trust_files [--cases 200000] [--workers 16] [--seed 1] [--json FILE]

Each worker reads ranges of the cases in forked children; see `tests.fuzz`. A case follows from the seed and
its number, so a failed one can be read again with ``--first NUMBER --cases 1``. Each range that has ended is
printed with its failures, so a campaign that was interrupted goes on with ``--first``. The figures say how
many files of each format were read, since their shares differ (`tests.structured.formats`).
"""

import multiprocessing
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from tests.bench.command_line import bench_parser, write
from tests.fuzz import Outcome, format_of, run_stage, structured_case

TARGETS = {"file_faults": "0", "file_misread": "0"}
"""Targets of the figures."""

CHUNK = 2000
"""Cases that one run of a worker reads."""

_MISREAD = re.compile(r"\d+: MisreadError:")


def measure(*, quick: bool) -> dict[str, float]:
    """Read generated files, few of them if the run is to be quick."""
    figures, _ = campaign(400 if quick else 200_000, workers=os.cpu_count() or 1)
    return figures


def campaign(
    cases: int,
    *,
    workers: int,
    seed: int = 1,
    first: int = 0,
    report: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, float], list[str]]:
    """Return the figures of a number of cases, and a line for each failure; report each range of cases."""
    size, end = min(CHUNK, -(-cases // workers)), first + cases
    ranges = [(start, min(start + size, end)) for start in range(first, end, size)]
    spawn = multiprocessing.get_context("spawn")
    lines: list[str] = []
    with tempfile.TemporaryDirectory() as name, ProcessPoolExecutor(workers, spawn) as pool:
        outcomes = pool.map(partial(_read, Path(name), seed), ranges)
        for (start, stop), outcome in zip(ranges, outcomes, strict=True):
            failures = [
                *(f"{number}: crash" for number in outcome.crashes),
                *(f"{number}: hang" for number in outcome.hangs),
                *outcome.foreign,
            ]
            report("\n".join([f"{start} to {stop - 1}: {len(failures)} failures", *failures]))
            lines += failures
    misread = sum(bool(_MISREAD.match(line)) for line in lines)
    figures: dict[str, float] = {
        "file_cases": cases,
        "file_faults": len(lines) - misread,
        "file_misread": misread,
    }
    counts = Counter(map(format_of, range(first, end)))
    return figures | {f"file_cases_{name}": count for name, count in sorted(counts.items())}, lines


def _read(folder: Path, seed: int, bounds: tuple[int, int]) -> Outcome:
    """Read a range of cases in a folder of its own."""
    first, end = bounds
    own = folder / str(first)
    own.mkdir()
    return run_stage(lambda work: structured_case(work, seed), end, own, first)


def main() -> int:
    """Run the campaign that the command line asks for; the exit code is 1 after a failure."""
    parser = bench_parser("trust_files", __doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    options = parser.parse_args()
    figures, failures = campaign(
        options.cases,
        workers=options.workers,
        seed=options.seed,
        first=options.first,
        report=lambda line: print(line, file=sys.stderr, flush=True),
    )
    print("\n".join([*(f"{key:16} {value:g}" for key, value in figures.items()), *failures]))
    write(options.json, {**figures, "failures": failures})
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
