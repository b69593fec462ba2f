"""Benchmark of creases: exactness, and cost over meshes of the same cells without creases.

    python -m tests.bench.creases                     # all cores
    python -m tests.bench.creases --device cuda:0     # a graphics card; the host needs NumPy and Warp only

Exactness: union, intersection and difference of two balls, whose crease is a known circle, in cells of three
sizes. Cost: a bored block and a union of 1,000 balls; medians without compilation and the first run.
"""

from functools import reduce
from operator import and_

import numpy as np
import warp as wp

from blobtree import Node, Point, Segment, Union, polygonize
from tests.bench.blobtree import blobs, median_time
from tests.bench.command_line import bench_parser, show, write
from tests.oracles.creases import circle

CENTERS, RADII = ((0.0, 0.0, 0.0), (0.8, 0.13, 0.07)), (1.0, 0.9)
RESOLUTIONS = (16, 40, 100)
TIMED_RESOLUTION = 128
DISTANCE = 6.0


def errors(device: str) -> dict[str, float]:
    """Return the largest distance to the circle in cells, and counts of vertices on it and not on it."""
    first, second = (Point(center, radius=radius) for center, radius in zip(CENTERS, RADII, strict=True))
    ring = circle(CENTERS[0], RADII[0], CENTERS[1], RADII[1])
    worst, met, unmet = 0.0, 0, 0
    for tree in (first | second, first & second, first - second):
        for resolution in RESOLUTIONS:
            mesh = polygonize(tree, resolution=resolution, creases=True, device=device)
            assert mesh.sheet_counts is not None
            cell = float((tree.support[1] - tree.support[0]).max()) / resolution
            worst = max(worst, float(ring.distances(mesh.vertices[mesh.sheet_counts > 1]).max()) / cell)
            met, unmet = met + int((mesh.sheet_counts > 1).sum()), unmet + int((mesh.sheet_counts == 0).sum())
    return {"crease_error_h": worst, "met": met, "unmet": unmet}


def block() -> Node:
    """Intersect six large balls, and subtract two bores."""
    centers = [sign * DISTANCE * axis for axis in np.eye(3) for sign in (-1.0, 1.0)]
    sides: list[Node] = [Point(tuple(center.tolist()), radius=DISTANCE + 1.0) for center in centers]
    bored = reduce(and_, sides) - Segment((0, 0, -3), (0, 0, 3), radius=0.5)
    return (bored - Segment((-3, 0, 0), (3, 0, 0), radius=0.35)).rotate((1, 2, 0), 20.0)


def times(device: str, runs: int) -> dict[str, float]:
    """Return the times without and with creases in ms, and their ratio."""
    figures: dict[str, float] = {}
    for name, tree in (("block", block()), ("union_1000", Union(tuple(blobs(1000))))):
        plain, sharp = (
            median_time(
                lambda tree=tree, creases=creases: polygonize(  # type: ignore[misc]
                    tree, resolution=TIMED_RESOLUTION, creases=creases, device=device
                ),
                runs,
            )
            for creases in (False, True)
        )
        figures |= {
            f"{name}_ms": 1e3 * plain,
            f"{name}_creases_ms": 1e3 * sharp,
            f"{name}_ratio": sharp / plain,
        }
    return figures


def main() -> None:
    """Parse the command line and measure."""
    parser = bench_parser("creases", __doc__)
    parser.add_argument("--device", default="cpu", help="Warp device, such as cuda:0")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    figures = errors(options.device) | times(options.device, options.runs)
    print(f"{wp.get_device(options.device).name}, warp-lang {wp.__version__}")
    show(figures)
    write(options.json, figures)


if __name__ == "__main__":
    main()
