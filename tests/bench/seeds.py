"""How evenly seeds lie and what they cost, beside every Python package that samples meshes and is installed.

``python -m tests.bench.seeds [--quick] [--json PATH] [--counts 1000,10000] [--models sphere,dragon]``

Packages that are not installed are listed as absent. All are measured alike: distances between points within
two ideal spacings that face the same way, ideal by the number of points that the package returned. They
sample the mesh, or a fine mesh of the tree; so do we, the tree itself.
"""

import argparse
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from decals.errors import InvalidSeeding
from decals.seeds.evenness import Spacing, evenness, ideal_spacing
from decals.seeds.neighbours import FacingTree
from decals.seeds.relaxation import Relaxation
from decals.surfaces.mesh import MeshSurface
from implicit_decals.apps.errors import UsageError
from tests.bench.seed_models import MODELS, TREES, meshed, surfaces_of
from tests.bench.seed_packages import PACKAGES

COUNTS = (1_000, 10_000, 100_000)
SCHEDULES = (30, 150)
"""Lengths of our schedule; the last is the default."""

HURRY = 20
"""Length of the schedule that runs only until the most even package is met."""

REPEATS = {1_000: 5, 10_000: 3}
"""How often each figure is taken, once for other counts; medians are shown."""


EQUAL = 0.01
"""Packages whose rho differs by less are as even; the fastest of the most even ones is the rival."""


@dataclass(frozen=True)
class Figures:
    """One row of the table."""

    count: int
    spacing: Spacing
    seconds: float


@cache
def model(name: str):
    """Make our surfaces and the meshes for others."""
    surfaces = surfaces_of(name)
    return surfaces, [meshed(tree) for tree in TREES[name]()] if name in TREES else surfaces


def joined(meshes: list[MeshSurface]):
    """All meshes as one: vertices and faces."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)]
    return np.concatenate([mesh.vertices for mesh in meshes]).astype(float), np.concatenate(faces)


def measure(surface: MeshSurface, points) -> Spacing:
    """Evenness of any points on a mesh."""
    positions, normals = surface.project(points)
    distances, _ = FacingTree(positions, normals).nearest(positions, normals, count=6, skip_self=True)
    return evenness(distances, ideal_spacing(surface.area, len(positions)))


def timed(work: Callable, repeats: int):
    """Last answer and median time of a piece of work."""
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        answer = work()
        seconds.append(time.perf_counter() - start)
    return answer, statistics.median(seconds)


def ours(
    surfaces, count: int, iterations: int, repeats: int, device: str, until: float | None = None
) -> Figures:
    """Run our own relaxation, until it is even enough."""

    def work() -> Relaxation:
        relaxation = Relaxation(surfaces, count=count, iterations=iterations, device=device)
        relaxation.run(until=until)
        return relaxation

    relaxation, seconds = timed(work, repeats)
    return Figures(relaxation.count, relaxation.statistics(), seconds)


def theirs(sampler: Callable, meshes, count: int, repeats: int) -> Figures:
    """Run a package."""
    vertices, faces = joined(meshes)
    points, seconds = timed(lambda: sampler(vertices, faces, count), repeats)
    return Figures(len(points), measure(MeshSurface(vertices, faces), points), seconds)


def show(name: str, figures: Figures) -> None:
    found = figures.spacing
    print(
        f"  {name:38s} {figures.count:7d} {found.rho:7.3f} {100 * found.cv:7.2f} {100 * found.cv6:7.2f}"
        f" {100 * found.ringed:7.1f} {figures.seconds:9.3f}",
        flush=True,
    )


def bench(
    names: list[str], counts: list[int], *, device: str, quick: bool, packages: bool
) -> dict[str, float]:
    """Print the table and return its figures."""
    present = {name: make() for name, make in PACKAGES.items()} if packages else {}
    for name, found in present.items():
        print(f"{name}: {found.version if found else 'absent'}")
    figures: dict[str, float] = {}
    for count in counts:
        repeats, ratios = (1 if quick else REPEATS.get(count, 1)), []
        for name in names:
            try:
                surfaces, meshes = model(name)
            except UsageError as error:
                print(f"{name}: absent ({error})")
                continue
            print(f"{name}, {count}\n  {'':38s}   count     rho   cv %  cv6 %  ringed %   seconds")
            ours(surfaces, min(count, 200), 2, 1, device)  # compile kernels
            own = [ours(surfaces, count, length, repeats, device) for length in SCHEDULES]
            for length, row in zip(SCHEDULES, own, strict=True):
                show(f"implicit-decals, {length} steps", row)
            others = []
            for package in filter(None, present.values()):
                try:
                    others.append(theirs(package.sample, meshes, count, repeats))
                    show(package.title, others[-1])
                except (RuntimeError, ValueError, MemoryError, InvalidSeeding) as error:
                    print(f"  {package.title:38s} failed: {' '.join(str(error).split())[:60]}")
            last = own[-1]
            figures |= {
                f"rho_{name}_{count}": last.spacing.rho,
                f"cv_{name}_{count}": last.spacing.cv,
                f"cv6_{name}_{count}": last.spacing.cv6,
                f"s_{name}_{count}": last.seconds,
            }
            if others:
                most = max(row.spacing.rho for row in others)
                best = min(
                    (row for row in others if row.spacing.rho > most - EQUAL), key=lambda row: row.seconds
                )
                met = ours(surfaces, count, HURRY, repeats, device, until=most)
                show("implicit-decals, as even as the best", met)
                ratios.append(best.seconds / met.seconds if met.spacing.rho >= most else 0.0)
        if ratios:
            figures[f"speedup_{count}"] = statistics.median(ratios)
            print(f"time of the most even package over ours, {count}: {figures[f'speedup_{count}']:.1f}")
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer models and 1,000 seeds, within a minute")
    parser.add_argument("--json", type=Path, help="also write the figures there")
    parser.add_argument("--counts", help="numbers of seeds, with commas between")
    parser.add_argument("--models", help=f"some of {', '.join(MODELS)}, with commas between")
    parser.add_argument("--device", default="cpu", help="Warp device of our own")
    parser.add_argument("--alone", action="store_true", help="leave the packages out")
    wish = parser.parse_args()
    names = wish.models.split(",") if wish.models else ["bumpy", "knot"] if wish.quick else list(MODELS)
    counts = [int(text) for text in wish.counts.split(",")] if wish.counts else list(COUNTS)
    if wish.quick and not wish.counts:
        counts = [1000]
    print(f"{' '.join(sys.argv)}\n{platform.platform()}, Python {platform.python_version()}, {wish.device}")
    figures = bench(names, counts, device=wish.device, quick=wish.quick, packages=not wish.alone)
    if wish.json:
        wish.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
