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

import platform
import sys
from collections.abc import Mapping
from importlib.metadata import version

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


def measure_index(device: str) -> Figures:
    """Measure the index on a device, and print the figures."""
    import warp as wp

    from blobtree.device import start_warp
    from tests.bench import decal_index

    start_warp()
    machine = f"{wp.get_device(device).name}; numpy {version('numpy')}, warp {wp.__version__}"
    return printed(decal_index.measure(device), decal_index.TARGETS, machine)


def measure_million(*, quick: bool) -> Figures:
    """Render a million decals, and print the figures."""
    from tests.bench import decal_figures

    return printed(decal_figures.million((320, 240) if quick else (800, 600)), {}, graphics())


def measure_faults(seed: int, *, quick: bool) -> Figures:
    """Measure the faults of covered models, and print the figures."""
    from tests.bench import decal_faults

    figures = decal_faults.measure(seed, quick=quick)
    return printed(figures, decal_faults.TARGETS, versions("numpy", "warp-lang"))


def measure_pixels(seed: int, *, quick: bool) -> Figures:
    """Count pixels of covered models without an image, and print the figures."""
    from tests.bench import decal_pixels

    return printed(decal_pixels.measure(seed, quick=quick), decal_pixels.TARGETS, graphics())


def measure_contact(*, quick: bool) -> Figures:
    """Compare the contact modes, and print the figures."""
    from tests.bench import contact_modes

    return printed(contact_modes.measure(quick=quick), contact_modes.TARGETS, graphics())


def measure_filter(*, quick: bool) -> Figures:
    """Compare one filtered sample a pixel with many, and print the figures."""
    from tests.bench import filtering

    return printed(filtering.measure(quick=quick), filtering.TARGETS, graphics())


def measure_walk(*, quick: bool) -> Figures:
    """Measure the walked image mapping, and print the figures."""
    from tests.bench import walking

    return printed(walking.measure(quick=quick), walking.TARGETS, graphics())


def measure_paper(part: str, *, quick: bool) -> Figures:
    """Measure the paper's octree, or its three methods of drawing, and print the figures."""
    from tests.bench import paper_methods, paper_octree

    measure = paper_octree.measure if part == "octree" else paper_methods.measure
    return printed(measure(quick=quick), {}, graphics(), width=36)


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
    parser.add_argument(
        "--only",
        choices=["index", "million", "faults", "pixels", "contact", "filter", "walk", "octree", "methods"],
        help="measure one part",
    )
    parser.add_argument("--peers", action="store_true", help="measure other methods")
    parser.add_argument("--seed", type=int, default=1, help="seed of --only faults and --only pixels")
    parser.add_argument("--device", default="cpu", help="Warp device of --only index")
    options = parser.parse_args()
    if options.only == "million":
        figures = measure_million(quick=options.quick)
    elif options.only == "faults":
        figures = measure_faults(options.seed, quick=options.quick)
    elif options.only == "pixels":
        figures = measure_pixels(options.seed, quick=options.quick)
    elif options.only == "contact":
        figures = measure_contact(quick=options.quick)
    elif options.only == "filter":
        figures = measure_filter(quick=options.quick)
    elif options.only == "walk":
        figures = measure_walk(quick=options.quick)
    elif options.only in ("octree", "methods"):
        figures = measure_paper(options.only, quick=options.quick)
    elif options.only:
        figures = measure_index(options.device)
    elif options.peers:
        figures = measure_peers(quick=options.quick)
    else:
        figures = measure_all(quick=options.quick)
    write(options.json, figures)


if __name__ == "__main__":
    main()
