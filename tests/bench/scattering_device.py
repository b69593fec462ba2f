"""Time and evenness of the relaxation on one Warp device.

    python -m tests.bench.scattering_device --record meshes.npz                     # anywhere
    python -m tests.bench.scattering_device --device cuda:0 --meshes meshes.npz     # with the GPU

With ``--meshes`` it needs only a few packages, and no other Warp device. Kernels are compiled, and models are
built and copied to the device, before the clock starts.
"""

import platform
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from decals import Relaxation
from tests.bench.command_line import bench_parser, write
from tests.bench.scattering_models import MODELS, surfaces_of, write_meshes

SCHEDULES = (60, 100, 150)
"""Lengths of the schedule; the last is the default."""

RUNS = 3

MAX_SURFACE_DISTANCE = 1e-4
"""Largest distance of a particle from its surface, in spacings."""


def timed(device: str, work: Any) -> Any:
    """Return the result and time of a piece of work, to the last kernel."""
    wp.synchronize_device(device)
    start = time.perf_counter()
    result = work()
    wp.synchronize_device(device)
    return result, time.perf_counter() - start


def relaxed(surfaces: Any, count: int, iterations: int, device: str) -> Any:
    """Run one schedule, and measure the seconds of sampling, stepping and polishing."""
    relaxation, sampling = timed(
        device, lambda: Relaxation(surfaces, count=count, iterations=iterations, device=device)
    )

    def steps() -> None:
        while relaxation.steps < iterations - 1:
            relaxation.step()

    stepping = timed(device, steps)[1]
    polishing = timed(device, relaxation.step)[1]  # the last step polishes
    return relaxation, (sampling, stepping, polishing)


def check(surfaces: Any, relaxation: Relaxation, count: int) -> None:
    """Assert the invariants of a relaxation."""
    assert relaxation.count == count
    assert np.isfinite(relaxation.positions).all()
    for number, surface in enumerate(surfaces):
        own = relaxation.positions[relaxation.surface_ids == number]
        distance = np.linalg.norm(surface.project(own)[0] - own, axis=1).max()
        assert distance <= MAX_SURFACE_DISTANCE * relaxation.spacing, (
            f"{distance / relaxation.spacing:.2e} spacings distance surface {number}"
        )
        for other in surfaces[:number] + surfaces[number + 1 :]:
            assert not other.contains(own).any()


def bench(names: list[str], count: int, device: str, meshes: Path | None) -> dict[str, float]:
    """Print the table and return its figures."""
    figures: dict[str, float] = {}
    for name in names:
        surfaces = surfaces_of(name, device, meshes)
        relaxed(surfaces, count, 12, device)  # compile kernels
        print(f"{name}, {count}\n  steps     rho   cv %  cv6 %   seconds = sampling + stepping + polishing")
        for length in SCHEDULES:
            runs = [relaxed(surfaces, count, length, device) for _ in range(RUNS)]
            parts = [statistics.median(run[1][k] for run in runs) for k in range(3)]
            seconds = statistics.median(sum(run[1]) for run in runs)
            relaxation = runs[-1][0]
            check(surfaces, relaxation, count)
            measured = relaxation.statistics()
            parts_text = " + ".join(f"{part:.3f}" for part in parts)
            print(
                f"  {length:5d} {measured.rho:7.3f} {100 * measured.cv:6.2f} {100 * measured.cv6:6.2f}"
                f" {seconds:9.3f} = {parts_text}",
                flush=True,
            )
            figures |= {
                f"rho_{name}_{count}_{length}": measured.rho,
                f"cv_{name}_{count}_{length}": measured.cv,
                f"cv6_{name}_{count}_{length}": measured.cv6,
                f"s_{name}_{count}_{length}": seconds,
            }
    return figures


def main() -> None:
    parser = bench_parser("scattering_device", __doc__)
    parser.add_argument("--device", default="cuda:0", help="Warp device")
    parser.add_argument("--count", type=int, default=100_000, help="number of particles")
    parser.add_argument("--only", help=f"some of {', '.join(MODELS)}, with commas between")
    parser.add_argument("--meshes", type=Path, metavar="PATH", help="take meshes from a file of --record")
    parser.add_argument("--record", type=Path, metavar="PATH", help="write that file in place of measuring")
    options = parser.parse_args()
    if options.record:
        write_meshes(options.record)
        return
    print(f"{wp.get_device(options.device).name}, Warp {wp.__version__}, Python {platform.python_version()}")
    names = options.only.split(",") if options.only else list(MODELS)
    figures = bench(names, options.count, options.device, options.meshes)
    write(options.json, figures)


if __name__ == "__main__":
    main()
