"""Compare the contact modes: folds, stretch, continuity and the time of the decal pass.

    python -m tests.bench.decals --only contact [--json FILE] [--quick]

The sets are dense and random: a decal and 1 to 7 neighbours anywhere in its reach, half of the sets in a
plane, sizes to 1:1, 2:1, 20:1 and 100:1 in equal parts. The figures concern the map from the surface around
the first decal to its image.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
import warp as wp
from numpy.typing import NDArray

from decals import Contact
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS
from decals.rendering import Renderer, RenderOptions
from decals.rendering.decal_pass import DecalPass
from tests.bench.contact_mode_kernels import places_in_sets
from tests.bench.scenes import bench_scene

Array = NDArray[np.float64]
Figures = dict[str, float]

MEMBERS = 8
RATIOS = 1.0, 2.0, 20.0, 100.0
FOLD_STEPS = 16
FOLD_TOLERANCE = 1e-2
"""Sine of the angle between two steps of the image that float32 can cause."""
STEP = 1e-3
"""Step of the derivatives along and across rays, in radii."""
TURN_STEP = 2e-3
"""Angle across the rays on which folds are counted."""
TURN = np.radians(0.01)
"""Angle between the rays whose images are compared."""
RUNS = 5

TARGETS = {
    "folds_default": "0",
    "stretch_p95_over_paper": "≤ 1",
    "jump_worst": "≤ 1e-3",
    "pass_default_over_paper": "≤ 1.3",
}


class Sets:
    """Sets of decals, the first of each at the origin, and a ray of each from there."""

    def __init__(self, count: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        ratio = np.array(RATIOS)[np.arange(count) % len(RATIOS)][:, None]
        self.radii = ratio ** rng.uniform(-0.5, 0.5, (count, MEMBERS))
        flat = (rng.random(count) < 0.5)[:, None, None]
        ways = rng.normal(size=(count, MEMBERS, 3)) * np.where(flat, [1, 1, 0], 1)
        ways /= np.linalg.norm(ways, axis=2, keepdims=True)
        distances = (self.radii + self.radii[:, :1]) * rng.uniform(0, 1, self.radii.shape)
        self.centres = ways * distances[..., None]
        self.centres[:, 0] = 0
        self.radii[np.arange(MEMBERS) > rng.integers(1, MEMBERS, (count, 1))] = 0
        self.angles = rng.uniform(0, 2 * np.pi, count)
        self.distances = np.sqrt(rng.uniform(1e-4, 1, count))
        self._arrays: list[Any] = [
            wp.array(self.centres, dtype=wp.vec3, ndim=2, device="cpu"),
            wp.array(self.radii, dtype=wp.float32, ndim=2, device="cpu"),
        ]

    def places(
        self, contact: Contact, distances: Array, angles: Array, stiffness: float = DEFAULT_STIFFNESS
    ) -> Array:
        """Return places in the image, ``[n, 2]``, at distances in radii in the planes z = 0.

        They are NaN where the first decal does not show.
        """
        rays = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
        points: Any = wp.array(rays * (distances * self.radii[:, 0])[:, None], dtype=wp.vec3, device="cpu")
        places = wp.zeros(len(angles), dtype=wp.vec3, device="cpu")
        modes = int(contact), float(stiffness)
        wp.launch(places_in_sets, len(angles), [points, *modes, *self._arrays], [places], device="cpu")
        found: Array = places.numpy().astype(np.float64)
        return np.where(found[:, 2:] < 0, np.nan, found[:, :2])


def folds(contact: Contact, rays: int, seed: int = 0) -> int:
    """Return the number of rays with a fold: a place where the image of a small triangle is turned over.

    Each ray has sixteen triangles, with one side along it and one across.
    """
    sets = Sets(rays, seed)
    folded = np.zeros(rays, bool)
    begin = np.random.default_rng(seed + 1).uniform(0, 1, rays)
    for step in range(FOLD_STEPS):
        t = (step + begin) / FOLD_STEPS
        place, farther = (sets.places(contact, t + shift, sets.angles) for shift in (0.0, STEP))
        along, across = farther - place, sets.places(contact, t, sets.angles + TURN_STEP) - place
        area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
        sides = np.linalg.norm(along, axis=1) * np.linalg.norm(across, axis=1)
        folded |= area < -FOLD_TOLERANCE * np.maximum(sides, STEP**2)
    return int(folded.sum())


def stretch(contact: Contact, points: int, seed: int = 0) -> Array:
    """Return the ratio of the singular values of the map at random points of the first decals."""
    sets = Sets(points, seed)
    t, angles = sets.distances, sets.angles
    inner, outer = (sets.places(contact, t + shift, angles) for shift in (-STEP, STEP))
    left, right = (sets.places(contact, t, angles + shift / t) for shift in (-STEP, STEP))
    along, across = (outer - inner) / (2 * STEP), (right - left) / (2 * STEP)
    squares = (along**2 + across**2).sum(axis=1)
    determinant = np.abs(along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0])
    larger = np.sqrt((squares + np.sqrt(np.maximum(squares**2 - 4 * determinant**2, 0))) / 2)
    ratio: Array = larger**2 / np.maximum(determinant, 1e-9)
    return ratio[np.isfinite(ratio)]


def jump(contact: Contact, points: int, seed: int = 0) -> float:
    """Return the largest distance between images on rays 0.01° apart."""
    sets = Sets(points, seed)
    pair = (sets.places(contact, sets.distances, sets.angles + shift) for shift in (0.0, TURN))
    return float(np.nanmax(np.linalg.norm(np.subtract(*pair), axis=1)))


@contextmanager
def timed_passes(renderer: Renderer, times: list[float]) -> Iterator[None]:
    """Record the seconds of each decal pass."""
    draw = DecalPass.draw

    def timed(self: DecalPass, *arguments: Any, **options: Any) -> None:
        renderer.context.gl.finish()
        begin = time.perf_counter()
        draw(self, *arguments, **options)
        renderer.context.gl.finish()
        times.append(time.perf_counter() - begin)

    with patch.object(DecalPass, "draw", timed):
        yield


def passes(size: tuple[int, int], count: int) -> Figures:
    """Return the time of the decal pass in every mode over that of eq. 5, from alternating runs."""
    scene = bench_scene("knot", count, size)
    times: dict[Contact, list[float]] = {contact: [] for contact in Contact}
    with Renderer() as renderer, renderer.context.current():
        for _ in range(RUNS + 1):
            for contact, seconds in times.items():
                options = RenderOptions(size=size, samples=1, contact=contact)
                frame: list[float] = []
                with timed_passes(renderer, frame):
                    renderer.time_frame(scene, options)
                seconds.append(sum(frame))
    paper = times[Contact.PRODUCT][1:]
    ratios = {
        contact: median(own / other for own, other in zip(seconds[1:], paper, strict=True))
        for contact, seconds in times.items()
    }
    figures = {f"pass_{contact.name.lower()}_over_paper": ratio for contact, ratio in ratios.items()}
    return figures | {"pass_default_over_paper": ratios[DEFAULT_CONTACT]}


def measure(*, quick: bool) -> Figures:
    """Measure all modes; with `quick`, from fewer rays and smaller pictures."""
    rays = 100_000 if quick else 1_000_000
    figures: Figures = {"folds_default": folds(DEFAULT_CONTACT, rays)}
    for contact in Contact:
        name, ratios = contact.name.lower(), stretch(contact, rays // 5)
        figures |= {
            f"folded_share_{name}": folds(contact, rays // 10) / (rays // 10),
            f"stretch_median_{name}": float(np.median(ratios)),
            f"stretch_p95_{name}": float(np.quantile(ratios, 0.95)),
            f"stretch_p999_{name}": float(np.quantile(ratios, 0.999)),
            f"jump_{name}": jump(contact, rays),
        }
    default = DEFAULT_CONTACT.name.lower()
    figures["stretch_p95_over_paper"] = figures[f"stretch_p95_{default}"] / figures["stretch_p95_product"]
    figures["jump_worst"] = figures[f"jump_{default}"]
    return figures | passes((400, 300) if quick else (1600, 1200), 10_000)
