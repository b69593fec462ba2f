"""Evenness and time of scattering, beside every installed Python package that samples meshes.

``python -m tests.bench.scattering [--quick] [--json PATH] [--counts 1000,10000] [--models sphere,dragon]``

Packages that are not installed are listed as absent. All are measured by distances between points that face
the same way and lie within two ideal spacings of the number that the package returned. Other packages
sample the mesh, or a fine mesh of the tree; this package samples the tree itself. Our particles have normals.
Points of other packages have none, and take those of the closest faces; where sheets of a mesh cross, this
may be the other sheet, and rho is then too low. "mean" is the mean distance to the nearest point over the
ideal spacing.
"""

import platform
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from decals import Relaxation
from decals.errors import InvalidInput, InvalidScattering
from decals.scattering.neighbors import Spacing, ideal_spacing, spacing_of_points
from decals.surfaces import MeshSurface
from tests.bench.command_line import bench_parser, write
from tests.bench.scattering_models import MODELS, TREES, meshed, surfaces_of
from tests.bench.scattering_packages import PACKAGES

COUNTS = (1_000, 10_000, 100_000)
SCHEDULES = (30, 150)
"""Lengths of our schedule; the last is the default."""

SHORT_SCHEDULE = 20
"""Length of the schedule that runs only until the most even package is met."""

REPEATS = {1_000: 5, 10_000: 3}
"""Runs for each figure, 1 for other counts; medians are shown."""


RHO_TOLERANCE = 0.01
"""Difference of rho below which packages are equally even; the fastest such package is compared."""


@dataclass(frozen=True)
class Figures:
    """One row of the table."""

    count: int
    spacing: Spacing
    seconds: float
    processor: float
    """Processor time of all threads, in seconds, which other work on the machine changes little."""


@cache
def model(name: str) -> Any:
    """Return the surfaces for this package, and the meshes for others."""
    surfaces = surfaces_of(name)
    return surfaces, [meshed(tree) for tree in TREES[name]()] if name in TREES else surfaces


def joined(meshes: list[MeshSurface]) -> Any:
    """Return the vertices and faces of all meshes as one."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)]
    return np.concatenate([mesh.vertices for mesh in meshes]).astype(float), np.concatenate(faces)


def measure(surface: MeshSurface, points: Any) -> Spacing:
    """Measure points without normals on a mesh whose sheets do not cross."""
    positions, normals = surface.project(points)
    spacing = ideal_spacing(surface.area, len(positions))
    return spacing_of_points(positions, normals, np.full(len(positions), spacing), spacing)


def timed(work: Callable[[], Any], repeats: int) -> Any:
    """Return the last result and the median times of a piece of work: of the clock, and of processors."""
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter(), time.process_time()
        result = work()
        seconds.append((time.perf_counter() - start[0], time.process_time() - start[1]))
    return result, *map(statistics.median, zip(*seconds, strict=True))


def ours(
    surfaces: Any, count: int, iterations: int, repeats: int, device: str, until: float | None = None
) -> Figures:
    """Run the relaxation of this package, up to a rho if one is given."""

    def work() -> Relaxation:
        relaxation = Relaxation(surfaces, count=count, iterations=iterations, device=device)
        relaxation.run(until=until)
        return relaxation

    relaxation, *times = timed(work, repeats)
    return Figures(relaxation.count, relaxation.statistics(), *times)


def cover_over_relaxation(surfaces: Any, count: int, device: str) -> float:
    """Return the processor time of relaxation and covering radii over that of relaxation alone."""
    relaxation = Relaxation(surfaces, count=count, device=device)
    _, _, relaxed = timed(relaxation.run, 1)
    _, _, covered = timed(relaxation.to_decals, 1)
    return float((relaxed + covered) / relaxed)


def theirs(sampler: Callable[..., Any], meshes: Any, count: int, repeats: int) -> Figures:
    """Run a package."""
    vertices, faces = joined(meshes)
    points, *times = timed(lambda: sampler(vertices, faces, count), repeats)
    return Figures(len(points), measure(MeshSurface(vertices, faces), points), *times)


def show(name: str, figures: Figures) -> None:
    spacing = figures.spacing
    print(
        f"  {name:38s} {figures.count:7d} {spacing.rho:7.3f} {spacing.mean / spacing.ideal:7.3f}"
        f" {spacing.bond_order:7.3f} {100 * spacing.cv:7.2f} {100 * spacing.cv6:7.2f}"
        f" {100 * spacing.ringed:8.1f} {figures.seconds:9.3f} {figures.processor:9.3f}",
        flush=True,
    )


def bench(
    names: list[str], counts: list[int], *, device: str, quick: bool, packages: bool
) -> dict[str, float]:
    """Print the table and return its figures."""
    present = {name: make() for name, make in PACKAGES.items()} if packages else {}
    for name, package in present.items():
        print(f"{name}: {package.version if package else 'absent'}")
    figures: dict[str, float] = {}
    covers: list[float] = []
    for count in counts:
        repeats, ratios = (1 if quick else REPEATS.get(count, 1)), []
        for name in names:
            try:
                surfaces, meshes = model(name)
            except InvalidInput as error:
                print(f"{name}: absent ({error})")
                continue
            print(
                f"{name}, {count}\n  {'':38s}   count     rho    mean    bond    cv %   cv6 %"
                "  ringed %   seconds processor"
            )
            ours(surfaces, min(count, 200), 2, 1, device)  # compile kernels
            own = [ours(surfaces, count, length, repeats, device) for length in SCHEDULES]
            for length, row in zip(SCHEDULES, own, strict=True):
                show(f"implicit-decals, {length} steps", row)
            if count == COUNTS[0]:
                covers.append(cover_over_relaxation(surfaces, count, device))
                print(f"  covering radii too, over relaxation alone: {covers[-1]:.2f}")
            others = []
            for package in filter(None, present.values()):
                try:
                    others.append(theirs(package.sample, meshes, count, repeats))
                    show(package.title, others[-1])
                except (RuntimeError, ValueError, MemoryError, InvalidScattering) as error:
                    print(f"  {package.title:38s} failed: {' '.join(str(error).split())[:60]}")
            last = own[-1]
            figures |= {
                f"rho_{name}_{count}": last.spacing.rho,
                f"cv_{name}_{count}": last.spacing.cv,
                f"cv6_{name}_{count}": last.spacing.cv6,
                f"bond_{name}_{count}": last.spacing.bond_order,
                f"s_{name}_{count}": last.seconds,
                f"cpu_{name}_{count}": last.processor,
            }
            if others:
                most = max(row.spacing.rho for row in others)
                best = min(
                    (row for row in others if row.spacing.rho > most - RHO_TOLERANCE),
                    key=lambda row: row.seconds,
                )
                met = ours(surfaces, count, SHORT_SCHEDULE, repeats, device, until=most)
                show("implicit-decals, as even as the best", met)
                ratios.append(best.seconds / met.seconds if met.spacing.rho >= most else 0.0)
        if ratios:
            figures[f"speedup_{count}"] = statistics.median(ratios)
            print(f"time of the most even package over ours, {count}: {figures[f'speedup_{count}']:.1f}")
    if covers:
        figures["cover_over_relaxation"] = max(covers)
    return figures


def main() -> None:
    parser = bench_parser("scattering", __doc__)
    parser.add_argument(
        "--quick", action="store_true", help="fewer models and 1,000 particles, within a minute"
    )
    parser.add_argument("--counts", help="numbers of particles, with commas between")
    parser.add_argument("--models", help=f"some of {', '.join(MODELS)}, with commas between")
    parser.add_argument("--device", default="cpu", help="Warp device of this package")
    parser.add_argument("--alone", action="store_true", help="leave the packages out")
    options = parser.parse_args()
    names = (
        options.models.split(",") if options.models else ["bumpy", "knot"] if options.quick else list(MODELS)
    )
    counts = [int(text) for text in options.counts.split(",")] if options.counts else list(COUNTS)
    if options.quick and not options.counts:
        counts = [1000]
    print(
        f"{' '.join(sys.argv)}\n{platform.platform()}, Python {platform.python_version()}, {options.device}"
    )
    figures = bench(names, counts, device=options.device, quick=options.quick, packages=not options.alone)
    write(options.json, figures)


if __name__ == "__main__":
    main()
