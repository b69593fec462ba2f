"""Figure 14 of the paper: index, time and memory for each model and number of decals, measured here.

`implicit-decals bench table` prints them, and the shipped experiment of that name sweeps them.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals import DecalImage, Decals, Scene
from decals.apps.models.samples import axes_of, sample
from decals.apps.views import Size, frame, parse_view
from decals.index import DecalIndex
from decals.rendering import Renderer
from decals.rendering.options import RenderOptions
from decals.scattering.neighbors import ideal_spacing
from decals.scattering.orientation import tangents
from decals.surfaces import Surface

KILOBYTE, MEGABYTE = 1 << 10, 1 << 20

COVERAGE = 1.6
"""Sum of the areas of all decals over the area of the surface: about that of a gap-free scattering."""

REPULSION_STEPS = 4
"""Steps of repulsion, enough to separate particles that were sampled at nearly the same position."""

NEIGHBORS = 7
"""Nearest particles, the particle itself included, that repel a particle."""

RUNS = 3
"""Runs of each measurement; the median counts."""


@dataclass(frozen=True)
class PaperRow:
    """A row of figure 14: 1600×1200 pixels, Core 2 Quad at 2.66 GHz (one thread), GeForce 8800 Ultra.

    Attributes
    ----------
    voxels : int
        Voxels of the octree.
    build : float
        Time to build the octree, in seconds.
    frame : int
        Time to draw a frame, in milliseconds.
    memory : int
        Video memory of decals and octree, in bytes.
    """

    voxels: int
    build: float
    frame: int
    memory: int


PAPER_ROWS: dict[tuple[str, int], PaperRow] = {
    ("dragon", 100): PaperRow(697, 0.02, 25, 12 * KILOBYTE),
    ("dragon", 1_000): PaperRow(5_753, 0.06, 30, 116 * KILOBYTE),
    ("dragon", 10_000): PaperRow(58_905, 0.78, 32, int(1.14 * MEGABYTE)),
    ("knot", 100): PaperRow(897, 0.02, 25, 14 * KILOBYTE),
    ("knot", 1_000): PaperRow(8_657, 0.09, 25, 127 * KILOBYTE),
    ("knot", 10_000): PaperRow(56_217, 0.80, 26, int(1.13 * MEGABYTE)),
    ("horse", 100): PaperRow(48_121, 0.02, 25, 197 * KILOBYTE),
    ("horse", 1_000): PaperRow(130_833, 1.23, 25, 605 * KILOBYTE),
    ("horse", 10_000): PaperRow(261_561, 2.58, 26, int(1.91 * MEGABYTE)),
    ("spheres", 100): PaperRow(921, 0.02, 25, 13 * KILOBYTE),
    ("spheres", 1_000): PaperRow(7_393, 0.16, 26, 123 * KILOBYTE),
    ("spheres", 10_000): PaperRow(69_889, 1.28, 26, int(1.18 * MEGABYTE)),
}
"""The rows of figure 14 by model and number of decals."""


@dataclass(frozen=True)
class Row:
    """A measured row.

    Attributes
    ----------
    model : str
        Name of the sample.
    decals : int
        Number of decals.
    cells : int
        Cells of the decal index.
    build : float
        Time to build the index, in seconds.
    frame : float
        Time to draw a frame without reading it back, in milliseconds.
    memory : int
        Memory of the decals and the index on the graphics card, in bytes.
    """

    model: str
    decals: int
    cells: int
    build: float
    frame: float
    memory: int

    @property
    def paper(self) -> PaperRow | None:
        """The paper's row for the same model and number of decals."""
        return PAPER_ROWS.get((self.model, self.decals))


def measure(renderer: Renderer, model: str, counts: Sequence[int], size: Size) -> list[Row]:
    """Measure a model with each number of decals.

    Parameters
    ----------
    renderer : decals.rendering.Renderer
    model : str
        Name of a sample.
    counts : sequence of int
        Numbers of decals.
    size : (int, int)
        Width and height of the frame in pixels.

    Returns
    -------
    list of Row
        Times are medians of three runs.
    """
    item = sample(model)
    camera = frame([item], parse_view(None, axes_of(model)), size)
    image = DecalImage.load("scale")
    rows = []
    for count in counts:
        decals = even_decals(item.surface, count=count)
        index = DecalIndex.of(decals)
        build = _median(partial(_seconds, partial(DecalIndex.of, decals)))
        scene = Scene(objects=(item,), camera=camera, decals=decals, images=(image,))
        renderer.time_frame(scene, RenderOptions(size=size))
        rows.append(
            Row(
                model=model,
                decals=count,
                cells=int((index.table.reshape(-1, 4)[:, 0] >= 0).sum()),
                build=build,
                frame=1e3 * _median(partial(renderer.time_frame, scene, RenderOptions(size=size))),
                memory=index.nbytes + decals.packed().nbytes,
            )
        )
    return rows


def even_decals(surface: Surface, *, count: int, seed: int = 0) -> Decals:
    """Distribute equal decals over a surface quickly.

    `decals.scatter` distributes them more evenly and without gaps, but takes minutes for 100,000.
    """
    positions, normals = surface.sample(count, seed)
    spacing = ideal_spacing(surface.area, count)
    for _ in range(REPULSION_STEPS if count > NEIGHBORS else 0):
        positions, normals = surface.project(positions + _displacements(positions, spacing))
    radius = np.sqrt(COVERAGE * surface.area / (np.pi * max(count, 1)))
    return Decals(
        positions=positions,
        normals=normals,
        tangents=tangents(positions, normals, None, seed),
        radii=np.full(count, radius, np.float32),
    )


def _displacements(positions: NDArray[np.float32], spacing: float) -> NDArray[np.float32]:
    """Return a displacement for each particle: away from neighbours, by half of what they are too close."""
    distances, neighbors = cKDTree(positions).query(positions, k=NEIGHBORS)
    offsets = positions[:, None] - positions[neighbors]
    gaps = np.maximum(distances, 1e-6 * spacing)
    push = np.maximum(spacing - gaps, 0.0) / gaps
    push = np.where(neighbors == np.arange(len(positions))[:, None], 0.0, push)
    return np.asarray(0.25 * (push[..., None] * offsets).sum(axis=1), np.float32)


def _median(measure_once: Callable[[], float]) -> float:
    return statistics.median(measure_once() for _ in range(RUNS))


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start
