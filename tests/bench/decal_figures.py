"""What `tests/bench/decals.py` measures with graphics: frames, edits, exactness of contact and mapping."""

import statistics
import time
from collections.abc import Callable

import numpy as np
import warp as wp

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.grid.editor import DecalEditor
from decals.grid.index import DecalIndex
from decals.model import Decals
from decals.render import Renderer
from decals.render.decal_data import DecalData
from decals.scenes.scene import Scene
from tests.bench.scenes import bench_scene
from tests.decals.field import log_maps, test_contact, test_radial

RUNS = 3
FOLD_SLACK = 0.0
"""A ray folds where the image coordinate falls along it."""

Figures = dict[str, float]


def frames(size: tuple[int, int], few: Scene, many: Scene) -> dict[int, list[float]]:
    """Seconds of frames under few and many decals at equal coverage, by their number, in turn."""
    times: dict[int, list[float]] = {len(few.decals): [], len(many.decals): []}
    with Renderer() as renderer:
        for run in range(RUNS + 1):
            for scene in (few, many):
                renderer.time_frame(scene, size=size)  # uploads: the renderer forgets what a picture lacks
                seconds = renderer.time_frame(scene, size=size)
                if run:
                    times[len(scene.decals)].append(seconds)
    return times


def frame_ratio(size: tuple[int, int], few: Scene, many: Scene) -> Figures:
    """Time of a frame under 100,000 decals over that under 100."""
    hundred, most = (statistics.median(seconds) for seconds in frames(size, few, many).values())
    return {"frame_100k_over_100": most / hundred}


def million(size: tuple[int, int]) -> Figures:
    """Frame time under 1,000,000 decals over that under 100, at equal coverage; index and memory."""
    few, many = (bench_scene("knot", count, size) for count in (100, 1_000_000))
    begin = time.perf_counter()
    built = DecalIndex.of(many.decals)
    seconds = time.perf_counter() - begin
    hundred, most = (statistics.median(seconds) for seconds in frames(size, few, many).values())
    return {
        "index_1m_s": seconds,
        "memory_1m_mb": 1e-6 * (built.nbytes + many.decals.packed().nbytes),
        "frame_1m_ms": 1e3 * most,
        "frame_1m_over_100": most / hundred,
    }


def index(decals: Decals) -> Figures:
    """Seconds to index 100,000 decals on the processor."""
    DecalIndex.of(decals)
    return {"index_100k_s": median_seconds(lambda: DecalIndex.of(decals))}


def edits(decals: Decals) -> Figures:
    """Median milliseconds to move one decal of 100,000: records, index, and what goes to the card."""
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
    """Largest error of r, in rim radii, over adversarial points in both pushing modes."""
    rng, worst = np.random.default_rng(0), 0.0
    for make in test_contact.SETS:
        for count in (2, 3, 6):
            arrays = [a.astype(np.float32) for a in make(rng, (points // len(test_contact.SETS) // 3, count))]
            for mode in (Contact.PAPER, Contact.SMOOTH):
                owner, rims = test_contact.rims_through_warp(*arrays, mode)
                expected_owner, expected = test_contact.rims_in_float64(*arrays, mode)
                both = (owner >= 0) & (expected_owner >= 0)
                worst = max(worst, float(np.abs(rims - expected)[both].max()))
    return {"contact_error_rh": worst}


def folds(rays: int) -> Figures:
    """Rays on which radial contact folds: 1 to 8 neighbours, sizes to 20:1, half of them in a plane."""
    total, slopes = 0, []
    for flat in (False, True):
        rng = np.random.default_rng(flat)
        decals = test_radial.clusters(rng, flat=flat)
        owners = rng.integers(0, len(decals), rays // 2)
        owners = np.where(
            decals.radii[owners] > 0.05, owners, owners // test_radial.MEMBERS * test_radial.MEMBERS
        )
        away = test_radial.unit(rng.normal(size=(rays // 2, 3)) * [1, 1, 0 if flat else 1])
        before = [wp.array(owners, dtype=wp.int32, device="cpu"), wp.array(away, dtype=wp.vec3, device="cpu")]
        after = [wp.zeros(rays // 2, dtype=wp.float32, device="cpu") for _ in range(2)]
        least, most = test_radial.launch(test_radial.slopes_of_rays, rays // 2, decals, before, after)
        total += int((least < FOLD_SLACK).sum())
        slopes += [least.min(), most.max()]
    return {"folds_radial": total, "slope_least": float(min(slopes)), "slope_most": float(max(slopes))}


def mapping(points: int) -> Figures:
    """RMS error of what is drawn against log maps, over the radius, 0.5; the chord's beside it."""
    figures = {}
    for name in ("torus", "ellipsoid", "sphere", "cylinder"):
        for suffix, mode in (("", Mapping.CORRECTED), ("_chord", Mapping.CHORD)):
            error = log_maps.drawn_error(name, mapping=mode, discs=points // 10, points=10)
            figures[f"map_{name}{suffix}"] = error
    return figures


def median_seconds(work: Callable[[], object]) -> float:
    """Median time of a few runs."""
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def measure(*, quick: bool) -> Figures:
    """Measure everything; quickly, in smaller samples and pictures."""
    size, samples, some = ((320, 240), 100_000, 1000) if quick else ((800, 600), 1_000_000, 4000)
    few, many = (bench_scene("knot", count, size) for count in (100, 100_000))
    parts: list[Callable[[], Figures]] = [
        lambda: frame_ratio(size, few, many),
        lambda: index(many.decals),
        lambda: edits(many.decals),
        lambda: contact(samples),
        lambda: folds(samples),
        lambda: mapping(some),
    ]
    figures: Figures = {}
    for part in parts:
        figures |= part()
    return figures
