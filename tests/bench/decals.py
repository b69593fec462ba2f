"""Benchmark of decals: time, memory and exactness.

    python -m tests.bench.decals [--json FILE] [--quick]

Times are medians of three or more runs, ratios those of alternating runs, errors those against the float64
oracles of the tests. Other parts:

    --only index [--device cuda:0]   building the index of 100,000 and 1,000,000 decals; needs no graphics
    --only million                   rendering 1,000,000 decals
    --only faults [--seed 2]         stretched, folded, oversized and missing decals on six models
    --only pixels [--seed 2]         pixels of these models on which no image shows, at 3600 x 2700
    --only contact                   folds, stretch, continuity and time of all contact modes
    --only filter                    one filtered sample a pixel against many
    --only walk                      walked image mapping against exact log maps, and its cost
    --only octree                    the paper's octree beside the index
    --only methods                   ray tracer, coordinates at vertices, and fragment shader
    --peers                          mesh-clipped decals, projected boxes, sprites, and maps of the surface
"""

import argparse
import platform
import sys
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import version
from inspect import signature

from tests.bench.command_line import bench_parser, write

Figures = dict[str, float]

TARGETS = {
    "frame_100k_over_100": "≤ 1.3",
    "index_100k_s": "≤ 0.5",
    "edit_100k_ms": "≤ 1",
    "contact_error_rh": "≤ 2e-5",
    "folds_radial": "0",
    "map_torus": "≤ 0.005",
    "map_ellipsoid": "≤ 0.005",
    "map_sphere": "≤ 1e-4",
    "map_cylinder": "≤ 1e-4",
}
"""Targets of the figures. Those of the mapping are RMS errors of the drawn coordinates over the decal's
radius; ``_chord`` marks those of the paper's projection."""


def report(figures: Figures, machine: str) -> str:
    """Return the figures as a readable table."""
    lines = [f"python -m tests.bench.decals {' '.join(sys.argv[1:])}".rstrip(), machine, ""]
    for name in [*TARGETS, *(name for name in figures if name not in TARGETS)]:
        value = f"{figures[name]:.4g}" if name in figures else "not measured"
        lines.append(f"{name:28} {value:>12}  {TARGETS.get(name, '')}".rstrip())
    return "\n".join(lines)


def versions(*packages: str) -> str:
    """Return the versions of packages."""
    return ", ".join(f"{name} {version(name)}" for name in packages)


def graphics() -> str:
    """Describe the processor, the graphics card and the packages."""
    from decals.rendering import Renderer

    with Renderer() as renderer:
        card = f"{renderer.context.name}, {renderer.backend} shaders"
    processor = platform.processor() or platform.machine()
    return f"{processor}; {card}; {versions('numpy', 'warp-lang', 'moderngl')}"


def printed(figures: Figures, targets: Mapping[str, str], machine: str, *, width: int = 28) -> Figures:
    """Print figures with their targets, and the machine on which they were measured; return them."""
    program = getattr(sys.modules["__main__"].__spec__, "name", __name__)
    print(f"python -m {program} {' '.join(sys.argv[1:])}", machine, sep="\n")
    for name, value in figures.items():
        print(f"{name:{width}} {value:12.4g}  {targets.get(name, '')}".rstrip())
    return figures


PARTS = {
    "index": "decal_index.measure",
    "million": "decal_figures.million",
    "faults": "decal_faults.measure",
    "pixels": "decal_pixels.measure",
    "contact": "contact_modes.measure",
    "filter": "filtering.measure",
    "walk": "walking.measure",
    "octree": "paper_octree.measure",
    "methods": "paper_methods.measure",
}
"""Functions that measure parts, with those options of the command line that they name."""

WITHOUT_GRAPHICS = ("index", "faults")


def measure_part(part: str, options: argparse.Namespace) -> Figures:
    """Measure one part, and print its figures."""
    import warp as wp

    from blobtree.device import start_warp

    start_warp()
    name, _, function = PARTS[part].partition(".")
    module = import_module(f"tests.bench.{name}")
    measure = getattr(module, function)
    figures: Figures = measure(**{name: getattr(options, name) for name in signature(measure).parameters})
    if part in WITHOUT_GRAPHICS:
        machine = f"{wp.get_device(options.device).name}; {versions('numpy', 'warp-lang')}"
    else:
        machine = graphics()
    return printed(figures, getattr(module, "TARGETS", {}), machine, width=36)


def measure_peers(*, quick: bool) -> Figures:
    """Measure other methods, and print the figures."""
    from tests.bench import decal_peers

    return decal_peers.run(quick=quick)


def measure_all(*, quick: bool) -> Figures:
    """Measure everything that needs graphics and the tests' oracles, and print the figures."""
    from tests.bench import decal_figures

    figures = decal_figures.measure(quick=quick)
    print(report(figures, graphics()))
    return figures


def main() -> None:
    """Parse the command line, measure and print."""
    parser = bench_parser("decals", __doc__)
    parser.add_argument("--quick", action="store_true", help="within 60 s on two cores")
    parser.add_argument("--only", choices=PARTS, help="measure one part")
    parser.add_argument("--peers", action="store_true", help="measure other methods")
    parser.add_argument("--seed", type=int, default=1, help="seed of --only faults and --only pixels")
    parser.add_argument("--device", default="cpu", help="Warp device of --only index")
    options = parser.parse_args()
    if options.only:
        figures = measure_part(options.only, options)
    elif options.peers:
        figures = measure_peers(quick=options.quick)
    else:
        figures = measure_all(quick=options.quick)
    write(options.json, figures)


if __name__ == "__main__":
    main()
