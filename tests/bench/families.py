"""Faults of covered models of four families: folded, stretched, oversized, bare and uneven decals.

    python -m tests.bench.families [--models 200] [--first 0] [--only patches] [--folder MODELS] [--json FILE]

Models are those of `tests.decals.family_models` with their numbers, and with ``--folder`` the files there.
Each is covered with 1,000 decals in a process of its own and measured by `decals.measure`. It is printed once
it has ended. With the same ``--out`` a run goes on where it stopped, so take a new folder after a change.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import decals
from decals.experiments import Grid, run
from tests.bench.command_line import bench_parser, show, write
from tests.decals.family_models import FAMILIES, model_of

TARGETS = {
    "families_folded": "≤ 5e-4",
    "families_stretch5": "≤ 0.003",
    "families_radius": "≤ 1.5",
    "families_bare": "0",
    "families_rho": "≥ 0.86",
}
"""Targets of the worst model; a radius is the largest over the median."""

MODELS, COUNT, SAMPLES = 12, 1000, 200_000
"""Models, decals on each, and points at which these are measured."""


def model_row(name: str, seed: int, count: int, samples: int) -> dict[str, float]:
    """Return the figures of a model: a file, or a family and a number."""
    model: Any = name if Path(name).is_file() else model_of(name, seed)
    start = time.perf_counter()
    scene = decals.cover(model, count=count)
    seconds = time.perf_counter() - start
    found = scene.measure(samples=samples)
    return {
        "folded": found.folded,
        "stretch5": found.stretched,
        "radius": float(scene.decals.radii.max() / np.median(scene.decals.radii)),
        "bare": 1.0 - found.coverage,
        "rho": found.rho,
        "cover_s": seconds,
    }


def worst(rows: Sequence[dict[str, Any]], key: str) -> float:
    """Return the worst of a figure, of the models that were measured."""
    values: list[float] = [row[key] for row in rows]
    return min(values) if key == "rho" else max(values)


def measure(names: Sequence[str], options: argparse.Namespace) -> dict[str, float]:
    """Return the worst figures of all models, and of those of each family."""
    with tempfile.TemporaryDirectory() as folder:
        results = run(
            model_row,
            Grid(name=names, seed=[options.seed], count=[options.count], samples=[options.samples]),
            options.out or Path(folder),
            workers=options.workers,
            on_row=lambda row: print(_line(row), flush=True),
            progress=lambda _stage, _fraction: None,
        )
        rows = [row for row in results.rows if row["name"] in names]
    done = [row for row in rows if row["status"] == "done"]
    figures = {key: worst(done, key.removeprefix("families_")) for key in TARGETS}
    figures |= {"families_models": len(rows), "families_failed": len(rows) - len(done)}
    for family in dict.fromkeys(map(_family, names)):
        of_family = [row for row in done if _family(row["name"]) == family]
        for key in TARGETS if of_family else ():
            name = key.removeprefix("families_")
            figures[f"{name}_{family}"] = worst(of_family, name)
    return figures


def _family(name: str) -> str:
    return name.partition("-")[0] if name.partition("-")[0] in FAMILIES else "files"


def _line(row: dict[str, Any]) -> str:
    if row["status"] != "done":
        return f"{row['name']:14} {row['status']}"
    texts = (f"{key.removeprefix('families_')} {row[key.removeprefix('families_')]:.5f}" for key in TARGETS)
    return f"{Path(row['name']).name:14} {'  '.join(texts)}  {row['cover_s']:.1f} s"


def main() -> None:
    parser = bench_parser("families", __doc__)
    parser.add_argument("--models", type=int, default=MODELS, help="number of models")
    parser.add_argument("--first", type=int, default=0, help="number of the first model")
    parser.add_argument("--only", choices=FAMILIES, help="one family")
    parser.add_argument("--folder", type=Path, help="models of one's own, instead of the families")
    parser.add_argument("--count", type=int, default=COUNT, help="decals on each model")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="points at which each is measured")
    parser.add_argument("--seed", type=int, default=1, help="seed of the families")
    parser.add_argument("--workers", type=int, help="processes; one for each core if not given")
    parser.add_argument("--out", type=Path, help="folder of the rows")
    options = parser.parse_args()
    if options.folder:
        names = [str(path) for path in sorted(options.folder.iterdir()) if path.is_file()]
    else:
        families = [options.only] if options.only else list(FAMILIES)
        numbers = range(options.first, options.first + options.models)
        names = [f"{families[number % len(families)]}-{number}" for number in numbers]
    figures = measure(names, options)
    show(figures)
    write(options.json, figures)


if __name__ == "__main__":
    main()
