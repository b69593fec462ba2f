"""What decals cost and how exact they are: ``python -m tests.bench.decals [--json PATH] [--quick]``.

Every figure is measured in this one run: times as medians of three or more, ratios between runs that
alternate, errors against the float64 oracles of the tests. Figures whose subject is missing are left out, and
it is said. Other parts of it, each alone:

    --only index [--device cuda:0]   building the index of 100,000 and 1,000,000 decals; no graphics needed
    --only million                   1,000,000 decals rendered
    --peers                          mesh-clipped decals, log maps and uv at vertices beside ours
"""

import argparse
import json
import platform
import sys
from importlib.metadata import version
from pathlib import Path

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
"""What each figure ought to be; the mapping's are RMS errors of what is drawn, over the decal's radius, and
``_chord`` beside them those of the paper's projection."""


def report(figures: Figures, machine: str) -> str:
    """Lay figures out for people."""
    lines = [f"python -m tests.bench.decals {' '.join(sys.argv[1:])}".rstrip(), machine, ""]
    for name in [*TARGETS, *(name for name in figures if name not in TARGETS)]:
        value = f"{figures[name]:.4g}" if name in figures else "not measured"
        lines.append(f"{name:28} {value:>12}  {TARGETS.get(name, '')}".rstrip())
    return "\n".join(lines)


def versions(*packages: str) -> str:
    """Versions of some packages."""
    return ", ".join(f"{name} {version(name)}" for name in packages)


def graphics() -> str:
    """Name what everything is measured on."""
    from decals.render import Renderer

    with Renderer() as renderer:
        card = f"{renderer.context.name}, {renderer.entry} shaders"
    processor = platform.processor() or platform.machine()
    return f"{processor}; {card}; {versions('numpy', 'warp-lang', 'moderngl')}"


def index_alone(device: str) -> Figures:
    """Measure the index on a device, and print."""
    import warp as wp

    from tests.bench import decal_index

    wp.init()
    print(f"python -m tests.bench.decals {' '.join(sys.argv[1:])}")
    print(f"{wp.get_device(device).name}; numpy {version('numpy')}, warp {wp.__version__}", flush=True)
    figures = decal_index.measure(device)
    for name, value in figures.items():
        print(f"{name:28} {value:12.4g}  {decal_index.TARGETS.get(name, '')}".rstrip())
    return figures


def rendered_million(*, quick: bool) -> Figures:
    """Draw a million decals, and print."""
    from tests.bench import decal_figures

    figures = decal_figures.million((320, 240) if quick else (800, 600))
    print(f"python -m tests.bench.decals {' '.join(sys.argv[1:])}", graphics(), sep="\n")
    print(*(f"{name:28} {value:12.4g}" for name, value in figures.items()), sep="\n")
    return figures


def peers(*, quick: bool) -> Figures:
    """Measure what one would pick instead, and print."""
    from tests.bench import decal_peers

    return decal_peers.run(quick=quick)


def everything(*, quick: bool) -> Figures:
    """Measure all that needs graphics and the tests' oracles, and print."""
    from tests.bench import decal_figures

    figures = decal_figures.measure(quick=quick)
    print(report(figures, graphics()))
    return figures


def main() -> None:
    """Read the command line, measure and print."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.decals", description=__doc__)
    parser.add_argument("--json", type=Path, help="also write one flat object {figure: number}")
    parser.add_argument("--quick", action="store_true", help="within 60 s on two cores")
    parser.add_argument("--only", choices=["index", "million"], help="one part alone")
    parser.add_argument("--peers", action="store_true", help="what one would pick instead, in one run")
    parser.add_argument("--device", default="cpu", help="Warp device of --only index")
    options = parser.parse_args()
    if options.only == "million":
        figures = rendered_million(quick=options.quick)
    elif options.only:
        figures = index_alone(options.device)
    elif options.peers:
        figures = peers(quick=options.quick)
    else:
        figures = everything(quick=options.quick)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
