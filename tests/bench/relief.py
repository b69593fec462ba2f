"""Relief: cost, first hits and holes of trees that heights move, and the accuracy of moved triangles.

Run ``python -m tests.bench.relief [--size WIDTH HEIGHT] [--views N]``. Heights of first hits are those of
`decals.evaluate` on the closest point of a ball.
"""

import argparse
import statistics
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import decals
from decals import Scene
from decals.apps.gallery import relief as example
from decals.rendering import Renderer, RenderOptions
from decals.scenes.pose import PosedMesh, PosedScene

RUNS = 25
WARM_UP = 8.0
"""Seconds for which frames are drawn first: a graphics card at rest runs slowly."""
SIZE = (400, 300)

Figures = dict[str, float]


def measure(size: tuple[int, int], views: int) -> Figures:
    """Measure the thorns of the gallery: frames over flat ones, first hits, holes and triangles."""
    scene = example.scenes()[1]
    flat = scene.replace(images=[replace(image, relief=0.0) for image in scene.images])  # type: ignore[call-arg]
    begin = time.process_time()
    moved = decals.displace(scene)
    seconds = time.process_time() - begin
    times: dict[str, list[float]] = {"flat": [], "relief": [], "displaced": []}
    shown: dict[str, Scene | PosedScene] = {"flat": flat, "relief": scene, "displaced": moved}
    with Renderer() as renderer:
        end = time.perf_counter() + WARM_UP
        while time.perf_counter() < end:
            renderer.time_frame(scene, RenderOptions(size=size))
        for _ in range(RUNS):
            for name, one in shown.items():
                renderer.time_frame(one, RenderOptions(size=size))  # uploads
                times[name].append(renderer.time_frame(one, RenderOptions(size=size)))
    usual = {name: statistics.median(values) for name, values in times.items()}
    item = moved.objects[0]
    assert isinstance(item, PosedMesh)
    return {
        "flat_ms": 1e3 * usual["flat"],
        "relief_over_flat": usual["relief"] / usual["flat"],
        **first_hits(scene),
        f"holes_{views}_views": float(holes(scene, flat, views)),
        "displaced_over_flat": usual["displaced"] / usual["flat"],
        "displace_s": seconds,
        "triangles": float(len(item.faces)),
        "middle_error": _middle_error(moved, item),
    }


def first_hits(scene: Scene) -> Figures:
    """Return the errors of first hits on a ball over its size, and the share of rays that differ."""
    width, height = SIZE[0] // 8, SIZE[1] // 8
    with Renderer() as renderer:
        buffers = renderer.buffers(scene, RenderOptions(size=(width, height)))
    row, column = np.mgrid[0:height, 0:width].reshape(2, -1)
    rays = scene.camera.rays(width, height)
    ways = rays.directions(column + 0.5, height - row - 0.5)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    start = np.asarray(scene.camera.position)
    rest = scene.objects[0].surface.sample(1, 0)[0]
    radius = float(np.linalg.norm(rest))
    reach = 1.5 * radius

    def outside(times: NDArray[np.float64]) -> NDArray[np.bool_]:
        points = start + times[:, None] * ways
        distances = np.linalg.norm(points, axis=1)
        normals = points / distances[:, None]
        heights = decals.evaluate(scene.decals, radius * normals, normals, images=scene.images).height
        assert heights is not None
        return np.asarray(distances - radius > heights)

    first = -ways @ start - reach
    last = np.full(len(ways), np.inf)
    for time_on in np.arange(0.0, 2 * reach, radius / 500):
        met = np.isinf(last) & ~outside(first + time_on)
        last[met] = (first + time_on)[met]
    hit = np.isfinite(last)
    before = last - radius / 500
    for _ in range(18):
        middle = np.where(hit, 0.5 * (before + last), 0.0)
        free = outside(middle)
        before, last = np.where(free, middle, before), np.where(free, last, middle)
    shown = buffers.object_id.reshape(-1) >= 0
    along = ((buffers.position.reshape(-1, 3) - start) * ways).sum(axis=1)
    errors = np.abs(along - last)[shown & hit] / (2 * np.sqrt(3) * radius)
    return {
        "relief_first_hit_p99": float(np.quantile(errors, 0.99)),
        "relief_first_hit": float(errors.max()),
        "relief_other_rays": float((shown != hit).mean()),
    }


def holes(scene: Scene, flat: Scene, views: int) -> int:
    """Return the pixels of all views that show the flat surface and not the raised one."""
    options = RenderOptions(size=(SIZE[0] // 4, SIZE[1] // 4))
    count = 0
    with Renderer() as renderer:
        for turn in range(views):
            view = scene.camera.turned(360.0 * turn / views)
            raised, level = (
                renderer.buffers(one, options, viewpoint=view).object_id >= 0 for one in (scene, flat)
            )
            count += int((level & ~raised).sum())
    return count


def _middle_error(moved: decals.rendering.SceneLike, item: PosedMesh) -> float:
    """Return the 99th percentile of the error of heights in the middles of triangles, over the size."""
    middles = item.rest.vertices[item.faces].mean(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True) / np.linalg.norm(item.rest.vertices[0])
    normals = middles / np.linalg.norm(middles, axis=1, keepdims=True)
    heights = decals.evaluate(moved.decals, middles, normals, images=moved.images).height
    assert heights is not None
    rises = np.linalg.norm(item.vertices[item.faces], axis=2).mean(axis=1)
    expected = np.linalg.norm(item.rest.vertices[0]) + heights
    size = float(np.linalg.norm(np.ptp(item.vertices, axis=0)))
    return float(np.quantile(np.abs(rises - expected), 0.99)) / size


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, nargs=2, default=SIZE, help="of the frames that are timed")
    parser.add_argument("--views", type=int, default=360, help="in which holes are counted")
    given = parser.parse_args()
    figures = measure((given.size[0], given.size[1]), given.views)
    print(*(f"{name:24} {value:12.4g}" for name, value in figures.items()), sep="\n")
