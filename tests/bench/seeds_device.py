"""The relaxation of seeds on one Warp device, alone: how long it takes, and how even it gets.

    python -m tests.bench.seeds_device --record meshes.npz                     # anywhere
    python -m tests.bench.seeds_device --device cuda:0 --meshes meshes.npz     # on the machine with the card

With ``--meshes`` it needs NumPy, SciPy, msgspec and Warp alone, and no Warp device but the one asked for.
Kernels are compiled before the clock starts; models are built and taken to the device before it, too.
"""

import argparse
import json
import platform
import statistics
import time
from pathlib import Path

import numpy as np
import warp as wp

from decals.seeds.relaxation import Relaxation
from tests.bench.seed_models import MODELS, surfaces_of, write_meshes

SCHEDULES = (60, 100, 150)
"""Lengths of the schedule; the last is the default."""

RUNS = 3

OFF = 1e-4
"""Largest distance of a seed from its surface, in spacings."""


def timed(device: str, work):
    """Answer and time of a piece of work, to the last kernel."""
    wp.synchronize_device(device)
    start = time.perf_counter()
    answer = work()
    wp.synchronize_device(device)
    return answer, time.perf_counter() - start


def relaxed(surfaces, count: int, iterations: int, device: str):
    """Run one schedule; seconds of placing, stepping and polishing come along."""
    made, placing = timed(
        device, lambda: Relaxation(surfaces, count=count, iterations=iterations, device=device)
    )

    def steps() -> None:
        while made.steps < iterations - 1:
            made.step()

    stepping = timed(device, steps)[1]
    polishing = timed(device, made.step)[1]  # the last step polishes
    return made, (placing, stepping, polishing)


def check(surfaces, relaxation: Relaxation, count: int) -> None:
    """Stop if a promise is broken."""
    assert relaxation.count == count
    assert np.isfinite(relaxation.positions).all()
    for number, surface in enumerate(surfaces):
        own = relaxation.positions[relaxation.surface_ids == number]
        off = np.linalg.norm(surface.project(own)[0] - own, axis=1).max()
        assert off <= OFF * relaxation.spacing, (
            f"{off / relaxation.spacing:.2e} spacings off surface {number}"
        )
        for other in surfaces[:number] + surfaces[number + 1 :]:
            assert not other.contains(own).any()


def bench(names: list[str], count: int, device: str, meshes: Path | None) -> dict[str, float]:
    """Print the table and return its figures."""
    figures: dict[str, float] = {}
    for name in names:
        surfaces = surfaces_of(name, device, meshes)
        relaxed(surfaces, count, 12, device)  # compile kernels
        print(f"{name}, {count}\n  steps     rho   cv %  cv6 %   seconds = placing + stepping + polishing")
        for length in SCHEDULES:
            runs = [relaxed(surfaces, count, length, device) for _ in range(RUNS)]
            parts = [statistics.median(run[1][k] for run in runs) for k in range(3)]
            seconds = statistics.median(sum(run[1]) for run in runs)
            relaxation = runs[-1][0]
            check(surfaces, relaxation, count)
            found = relaxation.statistics()
            shown = " + ".join(f"{part:.3f}" for part in parts)
            print(
                f"  {length:5d} {found.rho:7.3f} {100 * found.cv:6.2f} {100 * found.cv6:6.2f}"
                f" {seconds:9.3f} = {shown}",
                flush=True,
            )
            figures |= {
                f"rho_{name}_{count}_{length}": found.rho,
                f"cv_{name}_{count}_{length}": found.cv,
                f"cv6_{name}_{count}_{length}": found.cv6,
                f"s_{name}_{count}_{length}": seconds,
            }
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda:0", help="Warp device")
    parser.add_argument("--count", type=int, default=100_000, help="number of seeds")
    parser.add_argument("--only", help=f"some of {', '.join(MODELS)}, with commas between")
    parser.add_argument("--meshes", type=Path, metavar="PATH", help="take meshes from a file of --record")
    parser.add_argument("--record", type=Path, metavar="PATH", help="write that file in place of measuring")
    parser.add_argument("--json", type=Path, help="also write the figures there")
    wish = parser.parse_args()
    if wish.record:
        write_meshes(wish.record)
        return
    print(f"{wp.get_device(wish.device).name}, Warp {wp.__version__}, Python {platform.python_version()}")
    names = wish.only.split(",") if wish.only else list(MODELS)
    figures = bench(names, wish.count, wish.device, wish.meshes)
    if wish.json:
        wish.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
