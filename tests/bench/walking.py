"""Walked image mapping: errors against exact log maps, and the cost of pictures and of walks."""

import time
from dataclasses import replace

import numpy as np
import pyvista as pv

import decals
from decals import ImageMapping, Scene
from decals.field import Walks
from decals.field.walk import GRID
from decals.rendering import Renderer, RenderOptions
from tests.decals.field import unfolding
from tests.decals.field.unfolding import Patch, rms

Figures = dict[str, float]

TARGETS = {"walk_edge": "≤ 0.005", "walk_corner": "≤ 0.005", "walk_rim": "≤ 0.005", "walk_bumpy": "≤ 0.005"}
TARGETS["walk_on_rim"] = "≤ 0.005"
TARGETS["walk_pass_over_corrected"] = "≤ 4"
"""Largest RMS errors of the drawn coordinates over the radius."""

RUNS = 7


def patches(*, quick: bool) -> dict[str, list[tuple[Patch, float]]]:
    """Return the surfaces of each figure, and the radii of their decals."""
    seeds = range(2 if quick else 8)
    places = [(0.5, 0.5), (0.7, 0.4), (0.9, 0.3), (0.9, 0.85), (0.95, 0.95)]
    return {
        "edge": [(unfolding.edge(turn, at), 1.0) for turn in (60, 90, 120) for at in (0.1, 0.3, 0.6)],
        "corner": [(unfolding.corner(*place), 1.0) for place in places],
        "rim": [(unfolding.cylinder_rim(depth), radius) for depth, radius in ((0.5, 0.8), (0.2, 0.5))],
        "on_rim": [(unfolding.cylinder_end(inside), 0.8) for inside in (0.0, 0.02, 0.04, 0.1)],
        "on_rim_cut": [(unfolding.cylinder_end(0.0, clear=0.0), 0.8)],
        "bumpy": [(unfolding.bumpy(seed, 0.5, level=5 if quick else 6), 0.5) for seed in seeds],
    }


def covered(model: pv.PolyData, count: int) -> Scene:
    """Return a model under decals so large that most need walks."""
    scene = decals.cover(model, count=count)
    return replace(scene, decals=scene.decals.replace(radii=1.5 * scene.decals.radii))


def cost(scene: Scene, size: tuple[int, int]) -> Figures:
    """Return time and memory of walks, and the time of a picture over that of the corrected mapping."""
    begin = time.perf_counter()
    walks = Walks.over(scene.decals, scene.objects)
    seconds = time.perf_counter() - begin
    grids = (len(walks.texels) - len(walks)) / GRID
    bare = replace(scene, decals=scene.decals[:0])
    drawn = [(bare, ImageMapping.CORRECTED), (scene, ImageMapping.CORRECTED), (scene, ImageMapping.WALKED)]
    times: list[list[float]] = [[] for _ in drawn]
    with Renderer() as renderer, renderer.context.current():
        clock = time.process_time if renderer.context.software else time.perf_counter
        for _ in range(RUNS + 1):
            for each, (model, mapping) in zip(times, drawn, strict=True):
                options = RenderOptions(size, samples=1, mapping=mapping)
                renderer._targets.forget()
                renderer.context.gl.finish()
                begin = clock()
                renderer.draw(model, options)
                renderer.context.gl.finish()
                each.append(clock() - begin)
    none, corrected, walked = (min(each[1:]) for each in times)
    return {
        "walk_ms_a_decal": 1e3 * seconds / len(walks),
        "walk_share": grids / len(walks),
        "walk_mb": walks.texels.nbytes / 1e6,
        "walk_frame_over_corrected": walked / corrected,
        "walk_pass_over_corrected": (walked - none) / (corrected - none),
    }


def measure(*, quick: bool) -> Figures:
    """Measure both; with `quick`, on fewer surfaces and a smaller picture."""
    figures: Figures = {}
    for name, several in patches(quick=quick).items():
        for prefix, mapping in (("walk", ImageMapping.WALKED), ("corrected", ImageMapping.CORRECTED)):
            errors = [patch.errors(radius, mapping) for patch, radius in several]
            figures[f"{prefix}_{name}"] = max(map(rms, errors))
            if prefix == "walk":
                figures[f"{prefix}_{name}_worst"] = float(np.max([error.max() for error in errors]))
    model = pv.Cube().triangulate().subdivide(5)
    size, count = ((320, 240), 60) if quick else ((1600, 1200), 300)
    return figures | cost(covered(model, count), size)
