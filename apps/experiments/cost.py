"""How time and memory grow with the number of decals, and with that of points in a tree."""

import time
from collections.abc import Callable

import numpy as np

from blobtree import Point, Sum, polygonize
from decals import DecalImage, Decals, Scene, TreeObject, evaluate, scatter
from decals.errors import InvalidInput
from decals.experiments import Grid
from decals.index import DecalIndex
from decals.rendering import Renderer, RenderOptions
from decals.scenes.camera import Camera
from decals.validation import count_number

POINTS = 100_000
"""Points at which decals are evaluated."""

SIZE = (320, 240)
RUNS = 3


def cost(count: int, seed: int = 0) -> dict[str, float]:
    """Time the work on `count` decals on a ball, and the mesh of a sum of `count` points.

    Parameters
    ----------
    count
        Number of decals, and of points.
    seed
        Seed of both.

    Returns
    -------
    dict
        Seconds of ``scatter_s``, ``index_s`` and ``mesh_s``; ``evaluate_us`` of one point, ``frame_ms`` of
        one frame of 320 × 240 pixels; ``index_kb``, memory of the index; ``vertices`` of the mesh. Times are
        the least of three, and that of `scatter` is one.
    """
    count = count_number("count", count, 1, None, InvalidInput)
    ball = TreeObject("ball", Point((0.0, 0.0, 0.0), radius=1.0))
    scatter(ball.surface, count=10, seed=seed)  # kernels are compiled before the clock starts
    begin = time.perf_counter()
    decals = scatter(ball.surface, count=count, seed=seed)
    scattering = time.perf_counter() - begin
    points, normals = ball.surface.sample(POINTS, seed)
    rng = np.random.default_rng(seed)
    centers = rng.random((count, 3))
    radius = 0.5 * count ** (-1 / 3)
    tree = Sum([Point(tuple(center), radius=radius) for center in centers])
    return {
        "scatter_s": scattering,
        "index_s": _least(lambda: DecalIndex.of(decals)),
        "evaluate_us": 1e6 / POINTS * _least(lambda: evaluate(decals, points, normals)),
        "frame_ms": 1e3 * _frame(ball, decals),
        "mesh_s": _least(lambda: polygonize(tree, resolution=96)),
        "index_kb": DecalIndex.of(decals).nbytes / 1024,
        "vertices": len(polygonize(tree, resolution=96).vertices),
    }


def _frame(ball: TreeObject, decals: Decals) -> float:
    """Return the seconds of a frame."""
    camera = Camera(position=(0.0, -4.0, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), fov=30.0)
    scene = Scene(objects=(ball,), camera=camera, images=(DecalImage.load("scale"),), decals=decals)
    options = RenderOptions(size=SIZE, samples=1)
    with Renderer() as renderer:
        return min(renderer.time_frame(scene, options) for _ in range(RUNS + 1))


def _least(work: Callable[[], object]) -> float:
    """Return the least of the seconds of three runs."""
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


experiment = cost
design = Grid(count=[100, 300, 1_000, 3_000])
full = Grid(count=[100, 300, 1_000, 3_000, 10_000, 30_000, 100_000], seed=range(5))
