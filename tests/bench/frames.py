"""Benchmark of whole pictures on a graphics card: milliseconds of each step, by OpenGL timer queries.

    python -m tests.bench.frames dragon --decals 10000 --size 1600x1200 --contact elastic --json

``apart`` is the part of the pixels whose colours differ by more than 3 of 255 between the two backends.
"""

import argparse
import json
import statistics
from collections import defaultdict
from typing import Any

import numpy as np

from decals import Contact, Scene
from decals.rendering import Context, Renderer, RenderOptions
from decals.rendering.frame_plan import plan_frame
from decals.rendering.options import viewpoint_of
from decals.rendering.pixel_pass import PassBackend
from decals.rendering.targets import WHOLE_SLOT
from decals.rendering.viewpoint import WHOLE, PictureView
from tests.bench.scenes import bench_scene

WARM_UP = 3


def step_name(step: Any) -> str:
    """Return the function of a step, such as ``LightPass.draw``."""
    return str(step.func.__qualname__)


def step_times(renderer: Renderer, scene: Scene, options: RenderOptions, runs: int) -> dict[str, float]:
    """Return the median milliseconds of each step of a picture with one sample a pixel."""
    times: dict[str, list[float]] = defaultdict(list)
    with renderer.context.current():
        uploaded = renderer._uploads.scene(scene, options)
        tile = PictureView.of(viewpoint_of(scene, None), options.size, uploaded.bounds).whole()
        targets = renderer._targets.of(WHOLE_SLOT, options.size)
        renderer._camera.use(tile)
        query = renderer.context.gl.query(time=True)
        for run in range(WARM_UP + runs):
            plan = plan_frame(scene, uploaded, tile, options, targets, None, depth=False)
            for step in plan.steps:
                with query:
                    step(WHOLE)
                if run >= WARM_UP:
                    times[step_name(step)].append(1e-6 * query.elapsed)
    return {name: statistics.median(each) for name, each in times.items()}


def measure(scene: Scene, options: RenderOptions, runs: int) -> dict[str, float]:
    """Time both backends on one scene, and compare their pictures."""
    figures: dict[str, float] = {}
    pictures = []
    for backend in PassBackend:
        with Context.standalone(backend=backend) as context, Renderer(context) as renderer:
            pictures.append(renderer.render(scene, options).astype(int))
            times = step_times(renderer, scene, options, runs)
            figures |= {f"{backend}_{name}_ms": seconds for name, seconds in times.items()}
            figures[f"{backend}_frame_ms"] = sum(times.values())
    figures["apart"] = float((np.abs(pictures[0] - pictures[1]).max(axis=-1) > 3).mean())
    return figures


def main() -> None:
    """Parse the command line, make the scene, and print the figures."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.frames", description=__doc__)
    parser.add_argument("model", help="dragon, horse or knot, or the file of a mesh")
    parser.add_argument("--decals", type=int, default=10_000)
    parser.add_argument("--contact", choices=[mode.name.lower() for mode in Contact], default="elastic")
    parser.add_argument("--size", default="1600x1200")
    parser.add_argument("--runs", type=int, default=25)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    width, height = (int(part) for part in arguments.size.split("x"))
    size = width, height
    scene = bench_scene(arguments.model, arguments.decals, size)
    options = RenderOptions(size=size, samples=1, contact=Contact[arguments.contact.upper()])
    figures = measure(scene, options, arguments.runs)
    print(json.dumps(figures, indent=1) if arguments.json else figures)


if __name__ == "__main__":
    main()
