"""Benchmark of custom skeletons and operators beside built-in ones of the same formula.

    python -m tests.bench.custom_kinds                     # Warp, all cores
    python -m tests.bench.custom_kinds --device cuda:0     # Warp on a graphics card

1,000 points summed in the unit cube (the scene of `tests.bench.blobtree`): built-in, with a custom skeleton,
with a custom sum, and with both. The figures are ratios of medians to the built-in tree over alternating
rounds, of processor time on a CPU and of wall time on a graphics card, without compilation.
"""

import time
from collections.abc import Callable

import numpy as np
import warp as wp

from blobtree import Node, Sum, polygonize
from blobtree.custom import define_operator, define_skeleton
from tests.bench.blobtree import blobs
from tests.bench.command_line import bench_parser, show, write
from tests.bench.tracing import pixel_rays

COUNT = 1_000
RESOLUTION = 128
QUICK_RESOLUTION = 64
SIZE = (200, 150)


@wp.func
def spot(q: wp.vec3, center: wp.vec3) -> wp.vec3:
    """Return the centre: the skeleton is a point."""
    return center


@wp.func
def plus(a: wp.float32, b: wp.float32) -> wp.vec3:
    """Return a sum and its partial derivatives."""
    return wp.vec3(a + b, 1.0, 1.0)


def scenes() -> dict[str, Node]:
    """Return the four trees; the last one is built first, and its kernels serve all."""
    spot_kind = define_skeleton(spot, convex=True)
    plus_kind = define_operator(plus, steepest=1.0, like="blend", monotone=True, order_free=True)
    points = tuple(blobs(COUNT))
    spots = tuple(spot_kind(point.center, radius=point.radius, color=point.color) for point in points)
    both = plus_kind(spots)
    both.tape  # noqa: B018
    return {"built_in": Sum(points), "skeleton": Sum(spots), "operator": plus_kind(points), "both": both}


def ratios(
    work: Callable[[Node], object], trees: dict[str, Node], rounds: int, clock: Callable[[], float]
) -> dict[str, float]:
    """Return the times of the custom trees over those of the built-in tree."""
    for tree in trees.values():
        work(tree)
    times: dict[str, list[float]] = {name: [] for name in trees}
    for _ in range(rounds):
        for name, tree in trees.items():
            start = clock()
            work(tree)
            times[name].append(clock() - start)
    medians = {name: float(np.median(seconds)) for name, seconds in times.items()}
    return {name: medians[name] / medians["built_in"] for name in trees if name != "built_in"}


def figures(device: str, *, quick: bool) -> dict[str, float]:
    """Measure all ratios, and the time of two definitions in seconds."""
    start = time.perf_counter()
    trees = scenes()
    results = {"define_s": time.perf_counter() - start}
    resolution, rounds = (QUICK_RESOLUTION, 3) if quick else (RESOLUTION, 9)
    rays = pixel_rays(SIZE)
    clock = time.process_time if wp.get_device(device).is_cpu else time.perf_counter
    works: dict[str, Callable[[Node], object]] = {
        "mesh": lambda tree: polygonize(tree, resolution=resolution, device=device),
        "rays": lambda tree: tree.raycast(*rays, device=device),
    }
    for part, work in works.items():
        results |= {f"{part}_{name}": ratio for name, ratio in ratios(work, trees, rounds, clock).items()}
    return results


def main() -> None:
    """Parse the command line and measure."""
    parser = bench_parser("custom_kinds", __doc__)
    parser.add_argument("--device", default="cpu", help="Warp device, such as cuda:0")
    parser.add_argument("--quick", action="store_true", help="a coarser mesh and fewer rounds")
    options = parser.parse_args()
    with wp.ScopedDevice(options.device):
        results = figures(options.device, quick=options.quick)
    print(f"{wp.get_device(options.device).name}, warp-lang {wp.__version__}, {COUNT} primitives")
    show(results)
    write(options.json, results)


if __name__ == "__main__":
    main()
