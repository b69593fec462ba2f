"""Batches against loops: many sets of decals or trees in one launch, many views in one context.

python -m tests.bench.batches [--device DEVICE] [--sets N] [--only NAME] [--json FILE] [--quick]
"""

import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

import blobtree
import decals
from blobtree import Node, Point, Segment, Sum
from blobtree.device import known_device
from blobtree.tracing import Hits
from decals import Decals
from decals.index import DecalBatch, DecalIndex
from tests.bench.command_line import bench_parser, write

TARGETS = {"evaluate_speedup": "≥ 20 on a card"}

SETS, DECALS, POINTS = 1000, 200, 1000

PRIMITIVES, RAYS, RESOLUTION = 10, 1000, 32


def sphere_points(rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    """Return points on the unit sphere."""
    ways = rng.normal(size=(count, 3))
    points: NDArray[np.float32] = (ways / np.linalg.norm(ways, axis=1, keepdims=True)).astype(np.float32)
    return points


def random_sets(count: int) -> list[Decals]:
    """Return sets of decals on a sphere, of sizes that differ threefold."""
    sets = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        centres = sphere_points(rng, DECALS)
        tangents = np.cross(centres, rng.normal(size=(DECALS, 3)))
        sets.append(Decals(centres, centres, tangents, rng.uniform(0.05, 0.15, DECALS)))
    return sets


def alternately(functions: dict[str, Callable[[], Any]], device: str, repeats: int) -> dict[str, float]:
    """Return the median seconds of functions that run in turns, after a first run of each."""
    seconds: dict[str, list[float]] = {name: [] for name in functions}
    for turn in range(repeats + 1):
        for name, function in functions.items():
            wp.synchronize_device(device)
            begin = time.perf_counter()
            function()
            wp.synchronize_device(device)
            if turn:
                seconds[name].append(time.perf_counter() - begin)
    return {name: statistics.median(values) for name, values in seconds.items()}


def evaluate_figures(device: str, count: int, repeats: int) -> dict[str, float]:
    """Return the seconds of one batch and of a loop, and ratios, also with indices made before."""
    sets = random_sets(count)
    points = sphere_points(np.random.default_rng(0), POINTS)
    indices = [DecalIndex.of(part) for part in sets]
    indexed = DecalBatch(sets, device)
    functions: dict[str, Callable[[], Any]] = {
        "batch": lambda: decals.evaluate_batch(sets, points, points, device=device),
        "loop": lambda: [decals.evaluate(part, points, points, device=device) for part in sets],
        "batch_indexed": lambda: decals.evaluate_batch(indexed, points, points, device=device),
        "indexed": lambda: [
            decals.evaluate(part, points, points, index=index, device=device)
            for part, index in zip(sets, indices, strict=True)
        ],
    }
    seconds = alternately(functions, device, repeats)
    batch = functions["batch"]()
    loop = functions["loop"]()
    equal = [np.array_equal(found.owner, alone.owner) for found, alone in zip(batch, loop, strict=True)]
    bits = [found.uv.tobytes() == alone.uv.tobytes() for found, alone in zip(batch, loop, strict=True)]
    return {
        "evaluate_batch_s": seconds["batch"],
        "evaluate_loop_s": seconds["loop"],
        "evaluate_speedup": seconds["loop"] / seconds["batch"],
        "evaluate_speedup_indexed": seconds["indexed"] / seconds["batch_indexed"],
        "evaluate_equal_owners": float(np.mean(equal)),
        "evaluate_equal_bits": float(np.mean(bits)),
    }


def render_figures(device: str, count: int, repeats: int) -> dict[str, float]:
    """Return the seconds of one batch of small pictures of a scene, and of a loop of `render`."""
    scene = decals.cover(Point((0, 0, 0), radius=1.0), count=DECALS)
    angles = np.linspace(0.0, 2.0 * np.pi, count // 10, endpoint=False)
    cameras = [decals.Camera((4.0 * np.cos(angle), 1.0, 4.0 * np.sin(angle))) for angle in angles]
    functions: dict[str, Callable[[], Any]] = {
        "batch": lambda: list(decals.render_batch(scene, viewpoints=cameras, size=(160, 120))),
        "loop": lambda: [decals.render(scene, viewpoint=camera, size=(160, 120)) for camera in cameras],
    }
    seconds = alternately(functions, device, repeats)
    pairs = zip(functions["batch"](), functions["loop"](), strict=True)
    return {
        "render_batch_s": seconds["batch"],
        "render_speedup": seconds["loop"] / seconds["batch"],
        "render_equal": float(np.mean([np.array_equal(picture, alone) for picture, alone in pairs])),
    }


def random_trees(count: int) -> list[Node]:
    """Return trees of points and segments that blend, all of different shapes and sizes."""
    trees: list[Node] = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        starts, ends = rng.uniform(-1.0, 1.0, (2, PRIMITIVES // 2, 3))
        points = [Point(start, radius=rng.uniform(0.2, 0.6)) for start in starts]
        segments = [Segment(start, end, radius=0.2) for start, end in zip(starts, ends, strict=True)]
        trees.append(Sum((*points, *segments)))
    return trees


def raycast_figures(device: str, count: int, repeats: int) -> dict[str, float]:
    """Return the seconds of rays through many trees at once, and through one after the other."""
    trees = random_trees(count)
    origins = 5.0 * sphere_points(np.random.default_rng(0), RAYS)
    directions = np.random.default_rng(1).normal(scale=0.3, size=(RAYS, 3)) - origins / 5.0
    functions: dict[str, Callable[[], Any]] = {
        "batch": lambda: blobtree.raycast_batch(trees, origins, directions, device=device),
        "loop": lambda: [tree.raycast(origins, directions, device=device) for tree in trees],
    }
    seconds = alternately(functions, device, repeats)
    names = [field.name for field in fields(Hits)]
    pairs = list(zip(functions["batch"](), functions["loop"](), strict=True))
    return {
        "raycast_batch_s": seconds["batch"],
        "raycast_loop_s": seconds["loop"],
        "raycast_speedup": seconds["loop"] / seconds["batch"],
        "raycast_hits": float(np.mean([hits.hit.mean() for hits, _ in pairs])),
        "raycast_equal_bits": share_of_equal(pairs, names),
    }


def polygonize_figures(device: str, count: int, repeats: int) -> dict[str, float]:
    """Return the seconds of many meshes at once, and of one after the other."""
    trees = random_trees(count)
    functions: dict[str, Callable[[], Any]] = {
        "batch": lambda: blobtree.polygonize_batch(trees, resolution=RESOLUTION, device=device),
        "loop": lambda: [blobtree.polygonize(tree, resolution=RESOLUTION, device=device) for tree in trees],
    }
    seconds = alternately(functions, device, repeats)
    pairs = list(zip(functions["batch"](), functions["loop"](), strict=True))
    return {
        "polygonize_batch_s": seconds["batch"],
        "polygonize_loop_s": seconds["loop"],
        "polygonize_speedup": seconds["loop"] / seconds["batch"],
        "polygonize_equal_bits": share_of_equal(pairs, ["vertices", "faces", "normals", "colors"]),
    }


def share_of_equal(pairs: Iterable[tuple[Any, Any]], names: Sequence[str]) -> float:
    """Return the share of pairs whose arrays have the same bits."""
    equal = [
        all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in names) for a, b in pairs
    ]
    return float(np.mean(equal))


FIGURES: dict[str, Callable[[str, int, int], dict[str, float]]] = {
    "evaluate": evaluate_figures,
    "raycast": raycast_figures,
    "polygonize": polygonize_figures,
    "render": render_figures,
}


def main() -> None:
    """Print the figures."""
    parser = bench_parser("batches", __doc__)
    parser.add_argument("--device", help="Warp device; the default one if not given")
    parser.add_argument("--sets", type=int, default=SETS)
    parser.add_argument("--only", choices=tuple(FIGURES), action="append")
    parser.add_argument("--quick", action="store_true", help="a tenth of the sets")
    options = parser.parse_args()
    device = known_device(options.device)
    count = options.sets // 10 if options.quick else options.sets
    print(f"{device} ({wp.get_device(device).name})")
    print(f"{count} sets of {DECALS} decals at {POINTS} points")
    print(f"{count} trees of {PRIMITIVES} primitives: {RAYS} rays through each, meshes of {RESOLUTION} cells")
    figures: dict[str, float] = {}
    for name in options.only or FIGURES:
        figures |= FIGURES[name](device, count, 1 if options.quick else 3)
    for name, value in figures.items():
        print(f"{name:<26}{value:>10.4g}   {TARGETS.get(name, '')}")
    write(options.json, figures)


if __name__ == "__main__":
    main()
