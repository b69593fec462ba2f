"""Relief: the cost of pictures by parallax and by triangles, and the accuracy of moved triangles.

Run ``python -m tests.bench.relief``.
"""

import statistics
import time
from dataclasses import replace

import numpy as np

import decals
from decals import Scene
from decals.apps.gallery import relief as example
from decals.rendering import Renderer, RenderOptions
from decals.scenes.pose import PosedMesh, PosedScene

RUNS = 5
SIZE = (400, 300)

Figures = dict[str, float]


def measure() -> Figures:
    """Measure the thorns of the gallery: frames over those of flat decals, and triangles."""
    scene = example.scenes()[1]
    flat = scene.replace(images=[replace(image, relief=0.0) for image in scene.images])  # type: ignore[call-arg]
    begin = time.process_time()
    moved = decals.displace(scene)
    seconds = time.process_time() - begin
    times: dict[str, list[float]] = {"flat": [], "parallax": [], "displaced": []}
    with Renderer() as renderer:
        for run in range(RUNS + 1):
            shown: dict[str, Scene | PosedScene] = {"flat": flat, "parallax": scene, "displaced": moved}
            for name, one in shown.items():
                renderer.time_frame(one, RenderOptions(size=SIZE))  # uploads
                frame = renderer.time_frame(one, RenderOptions(size=SIZE))
                if run:
                    times[name].append(frame)
    usual = {name: statistics.median(values) for name, values in times.items()}
    item = moved.objects[0]
    assert isinstance(item, PosedMesh)
    return {
        "parallax_over_flat": usual["parallax"] / usual["flat"],
        "displaced_over_flat": usual["displaced"] / usual["flat"],
        "displace_s": seconds,
        "triangles": float(len(item.faces)),
        "middle_error": _middle_error(moved, item),
    }


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
    print(*(f"{name:24} {value:12.4g}" for name, value in measure().items()), sep="\n")
