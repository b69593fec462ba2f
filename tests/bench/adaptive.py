"""Adaptive cells against cells of one size: processor time, memory and triangles at one chord error.

Each mesh is made in a process of its own, so that its peak of memory is its own. The scenes are a ball with
small bumps, and the 1,000 blobs of `tests.bench.blobtree`.
"""

import argparse
import json
import resource
import subprocess
import sys
import time

from blobtree import Node, Point, Sum, polygonize
from tests.bench.blobtree import blobs
from tests.bench.command_line import bench_parser, show, write

SCENES = ("bumps", "blobs")
RELATIVE_ERRORS = {"bumps": 2e-4, "blobs": 5e-4}
"""Chord errors over the longest side of the model's support."""


def scene(name: str) -> Node:
    """Return the model of a scene."""
    if name == "blobs":
        return Sum(tuple(blobs(1000)))
    bumps = [Point((1.1, 0, 0), radius=0.1), Point((0, 1.05, 0), radius=0.06)]
    return Sum((Point((0, 0, 0), radius=1.0), *bumps))


def measure(name: str, adaptive: bool, relative_error: float) -> dict[str, float]:
    """Return seconds of processor time, gigabytes at most, and triangles of one mesh made in this process."""
    tree = scene(name)
    lower, upper = tree.support
    error = relative_error * float((upper - lower).max())
    polygonize(Point((0, 0, 0), radius=1.0), chord_error=0.01, adaptive=adaptive)  # loads the kernels
    start = time.process_time()
    mesh = polygonize(tree, chord_error=error, adaptive=adaptive, max_triangles=1 << 28)
    seconds = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return {"s": seconds, "gb": peak, "triangles": float(len(mesh.faces))}


def figures_of(name: str, relative_error: float) -> dict[str, float]:
    """Return the figures of a scene with both kinds of cells, each from a process of its own."""
    figures: dict[str, float] = {}
    for kind in ("adaptive", "uniform"):
        command = [sys.executable, "-m", "tests.bench.adaptive", "--one", name, kind, str(relative_error)]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        figures |= {f"{name}_{kind}_{key}": value for key, value in json.loads(output).items()}
    return figures


def main() -> None:
    """Parse the command line and measure."""
    parser = bench_parser("adaptive", __doc__)
    parser.add_argument("--scene", choices=SCENES, help="one scene only")
    parser.add_argument("--error", type=float, help="chord error over the model's size")
    parser.add_argument("--one", nargs=3, metavar=("SCENE", "CELLS", "ERROR"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        name, kind, error = options.one
        print(json.dumps(measure(name, kind == "adaptive", float(error))))
        return
    figures: dict[str, float] = {}
    for name in [options.scene] if options.scene else SCENES:
        figures |= figures_of(name, options.error or RELATIVE_ERRORS[name])
    show(figures)
    write(options.json, figures)


if __name__ == "__main__":
    main()
