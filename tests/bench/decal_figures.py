"""Figures of `tests.bench.decals` that need graphics: frames, edits, exactness of contact and mapping."""

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from decals import Contact, Decals, ImageMapping, Scene
from decals.index import DecalEditor, DecalIndex
from decals.rendering import Renderer, RenderOptions
from decals.rendering.decal_data import DecalData
from tests.bench.scenes import bench_scene
from tests.decals.field import log_maps, test_contact, test_radial
from tests.decals.field.kernels import slopes_of_rays
from tests.vectors import unit

RUNS = 3
FOLD_SLACK = 0.0
"""A ray folds where the slope of the image coordinate along it is below this."""

Figures = dict[str, float]


def frames(size: tuple[int, int], few: Scene, many: Scene) -> dict[int, list[float]]:
    """Return the seconds of alternating frames with few and many decals, by their number."""
    times: dict[int, list[float]] = {len(few.decals): [], len(many.decals): []}
    with Renderer() as renderer:
        for run in range(RUNS + 1):
            for scene in (few, many):
                renderer.time_frame(
                    scene, RenderOptions(size=size)
                )  # uploads, as the renderer drops the data of other scenes
                seconds = renderer.time_frame(scene, RenderOptions(size=size))
                if run:
                    times[len(scene.decals)].append(seconds)
    return times


def frame_ratio(size: tuple[int, int], few: Scene, many: Scene) -> Figures:
    """Return the time of a frame with 100,000 decals over that with 100."""
    hundred, maximum = (statistics.median(seconds) for seconds in frames(size, few, many).values())
    return {"frame_100k_over_100": maximum / hundred}


def million(*, quick: bool) -> Figures:
    """Measure frames, index and memory of 1,000,000 decals, and the ratio of frames to 100 decals."""
    size = (320, 240) if quick else (800, 600)
    few, many = (bench_scene("knot", count, size) for count in (100, 1_000_000))
    begin = time.perf_counter()
    index = DecalIndex.of(many.decals)
    seconds = time.perf_counter() - begin
    hundred, maximum = (statistics.median(seconds) for seconds in frames(size, few, many).values())
    return {
        "index_1m_s": seconds,
        "memory_1m_mb": 1e-6 * (index.nbytes + many.decals.packed().nbytes),
        "frame_1m_ms": 1e3 * maximum,
        "frame_1m_over_100": maximum / hundred,
    }


def index(decals: Decals) -> Figures:
    """Return the time to index 100,000 decals on the processor, in seconds."""
    DecalIndex.of(decals)
    return {"index_100k_s": median_seconds(lambda: DecalIndex.of(decals))}


def edits(decals: Decals) -> Figures:
    """Return the median time and upload of moving one of 100,000 decals: records, index and textures."""
    editor, times, sent = DecalEditor(decals), [], []
    with Renderer() as renderer, renderer.context.current():
        data = DecalData(renderer.context, editor)
        for number in range(0, len(decals), len(decals) // 100):
            begin = time.perf_counter()
            editor.change(number, positions=editor[number].positions * np.float32(1.0001))
            sent.append(data.update(editor))
            times.append(time.perf_counter() - begin)
        data.release()
    return {"edit_100k_ms": 1e3 * statistics.median(times), "edit_100k_bytes": statistics.median(sent)}


def contact(points: int) -> Figures:
    """Return the largest error of r in rim radii at adversarial points, in the modes PRODUCT and MIN."""
    rng, worst = np.random.default_rng(0), 0.0
    for make in test_contact.SETS:
        for count in (2, 3, 6):
            shape = (points // len(test_contact.SETS) // 3, count)
            at, centres, influence = (a.astype(np.float32) for a in make(rng, shape))
            for mode in (Contact.PRODUCT, Contact.MIN):
                owner, rims = test_contact.rims_through_warp(at, centres, influence, mode)
                expected_owner, expected = test_contact.rims_in_float64(at, centres, influence, mode)
                both = (owner >= 0) & (expected_owner >= 0)
                worst = max(worst, float(np.abs(rims - expected)[both].max()))
    return {"contact_error_rh": worst}


def folds(rays: int) -> Figures:
    """Count the rays on which RADIAL contact folds: 1 to 8 neighbours, sizes to 20:1, half in a plane."""
    total, slopes = 0, []
    for flat in (False, True):
        rng = np.random.default_rng(flat)
        decals = test_radial.clusters(rng, flat=flat)
        owners = rng.integers(0, len(decals), rays // 2)
        owners = np.where(
            decals.radii[owners] > 0.05, owners, owners // test_radial.MEMBERS * test_radial.MEMBERS
        )
        directions = unit(rng.normal(size=(rays // 2, 3)) * [1, 1, 0 if flat else 1])
        inputs: list[Any] = [
            wp.array(owners, dtype=wp.int32, device="cpu"),
            wp.array(directions, dtype=wp.vec3, device="cpu"),
            int(Contact.RADIAL),
        ]
        outputs = [wp.zeros(rays // 2, dtype=wp.float32, device="cpu") for _ in range(2)]
        least, most = test_radial.launch(slopes_of_rays, rays // 2, decals, inputs, outputs)
        total += int((least < FOLD_SLACK).sum())
        slopes += [least.min(), most.max()]
    return {"folds_radial": total, "slope_least": float(min(slopes)), "slope_most": float(max(slopes))}


def mapping(points: int) -> Figures:
    """Return the RMS error of drawn coordinates against log maps over the radius, for both mappings."""
    figures = {}
    for name in ("torus", "ellipsoid", "sphere", "cylinder"):
        for suffix, mode in (("", ImageMapping.CORRECTED), ("_chord", ImageMapping.CHORD)):
            error = log_maps.drawn_error(name, mapping=mode, discs=points // 10, points=10)
            figures[f"map_{name}{suffix}"] = error
    return figures


def median_seconds(work: Callable[[], object]) -> float:
    """Return the median time of some runs."""
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def measure(*, quick: bool) -> Figures:
    """Measure all figures; with `quick`, from smaller samples and pictures."""
    size, samples, map_points = ((320, 240), 100_000, 1000) if quick else ((800, 600), 1_000_000, 4000)
    few, many = (bench_scene("knot", count, size) for count in (100, 100_000))
    parts: list[Callable[[], Figures]] = [
        lambda: frame_ratio(size, few, many),
        lambda: index(many.decals),
        lambda: edits(many.decals),
        lambda: contact(samples),
        lambda: folds(samples),
        lambda: mapping(map_points),
    ]
    figures: Figures = {}
    for part in parts:
        figures |= part()
    return figures
