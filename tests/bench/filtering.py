"""One filtered sample a pixel against 256 points of each pixel, and its time against four samples."""

import time
from dataclasses import replace

import numpy as np
import pyvista as pv

import decals
from blobtree import Point
from decals import Scene
from decals.rendering import Renderer, RenderOptions
from tests.decals.rendering.flat_views import FLAT, expected_picture, flat_view, peak_ratio

Figures = dict[str, float]

TARGETS = {
    "psnr_min": "≥ 40",
    "rim_worst": "≤ 8",
    "layers_worst": "≤ 8",
    "frame_mesh_over_four": "≤ 0.33",
    "frame_tree_over_four": "≤ 0.33",
}

ANGLES = (0, 45, 70, 85)
"""Angles between the view and the normal of the plane, in degrees."""

RUNS = 3


def errors(size: tuple[int, int], samples: int) -> Figures:
    """Return the noise of images, and the differences of black and white decals at rims and contact lines."""
    figures: Figures = {}
    worst: list[float] = []
    layers: list[float] = []
    shares: list[float] = []
    with Renderer() as renderer:
        options = RenderOptions(size, samples=1, filtered=True, lights=FLAT)
        for angle in ANGLES:
            off = {}
            for kind in ("waves", "plain", "layers"):
                view = flat_view(angle, kind)
                drawn = renderer.render(view, options)[..., :3]
                off[kind] = np.abs(drawn - expected_picture(view, size, samples=samples))
            figures[f"psnr_{angle}"] = peak_ratio(off["waves"])
            worst.append(float(off["plain"].max()))
            layers.append(float(off["layers"].max()))
            shares.append(float(np.mean(off["plain"].max(axis=-1) > 8.0)))
    figures |= {"psnr_min": min(figures.values()), "rim_worst": max(worst), "layers_worst": max(layers)}
    figures["rim_share_above_8"] = max(shares)
    return figures


def frames(size: tuple[int, int], count: int) -> Figures:
    """Return processor times of whole frames and of decal passes, over those with four samples a pixel."""
    figures: Figures = {}
    models: dict[str, object] = {"mesh": pv.Icosphere(nsub=5), "tree": Point((0, 0, 0), radius=1.0)}
    with Renderer() as renderer:
        for name, model in models.items():
            scene = decals.cover(model, count=count)  # type: ignore[arg-type]  # any model
            four = RenderOptions(size, samples=2)
            one = replace(four, samples=1)
            best = [_seconds(renderer, scene, way) for way in (four, one, replace(one, filtered=True))]
            figures[f"frame_{name}_over_four"] = best[2] / best[0]
            figures[f"frame_{name}_over_one"] = best[2] / best[1]
    return figures


def _seconds(renderer: Renderer, scene: Scene, options: RenderOptions) -> float:
    """Return the least processor time of a frame, or its time on a graphics card."""
    clock = time.process_time if renderer.context.software else time.perf_counter
    times = []
    with renderer.context.current():
        for _ in range(RUNS + 1):
            renderer._targets.forget()
            renderer.context.gl.finish()
            begin = clock()
            renderer.draw(scene, options)
            renderer.context.gl.finish()
            times.append(clock() - begin)
    return min(times[1:])


def measure(*, quick: bool) -> Figures:
    """Measure both; with `quick`, from smaller pictures and 64 points of each pixel."""
    figures = errors((96, 72), 64) if quick else errors((160, 120), 256)
    return figures | frames((320, 240) if quick else (800, 600), 200 if quick else 500)
