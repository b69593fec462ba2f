"""``implicit-decals bench table``: figure 14 of the paper, measured on this machine.

The table has index, time and memory for each model and number of decals.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.spatial import cKDTree

from decals import DecalImage, Decals, Scene
from decals.apps.commands.options import MAX_DECALS, check_count, parse_size
from decals.apps.commands.progress_bars import progress_bars
from decals.apps.models.samples import SAMPLES, axes_of, sample
from decals.apps.views import Size, frame, parse_view
from decals.errors import InvalidInput
from decals.index import DecalIndex
from decals.rendering import Renderer
from decals.rendering.options import RenderOptions
from decals.scattering.neighbors import ideal_spacing
from decals.scattering.orientation import tangents
from decals.surfaces import Surface

MIN_COLUMNS = 100  # in a narrower console the numbers would be cut off
MODELS = "dragon,knot,horse,spheres"
COUNTS = "100,1000,10000,100000"

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


def table(*, size: str = "1600x1200", counts: str = COUNTS, models: str | None = None) -> None:
    """Measure figure 14 of the paper on this machine, and print it beside the paper's numbers.

    The paper used a GeForce 8800 Ultra.

    Parameters
    ----------
    size
        Width and height of the pictures in pixels.
    counts
        Numbers of decals, separated by commas.
    models
        Sample models, separated by commas: creature, dragon, horse, knot, spheres. Default: all but
        creature; those that cannot be downloaded are left out.
    """
    pixels, numbers, names = parse_size(size), parse_counts(counts), parse_models(models or MODELS)
    missing = []
    with Renderer() as renderer:
        with progress_bars() as progress:
            rows = []
            for step, name in enumerate(names):
                progress("measuring", step / len(names))
                try:
                    rows += measure(renderer, name, numbers, pixels)
                except InvalidInput as error:
                    if models is not None:
                        raise
                    missing.append(f"{name} is left out: {error}")
        Console(width=max(Console().width, MIN_COLUMNS)).print(
            as_table(rows, f"{renderer.context.name}, {size}, {renderer.backend} shader")
        )
    for line in missing:
        Console(stderr=True, soft_wrap=True).print(line, markup=False, highlight=False)


def parse_counts(text: str) -> list[int]:
    """Parse numbers of decals such as ``"100,1000"``."""
    try:
        counts = [int(part) for part in text.split(",")]
    except ValueError:
        raise InvalidInput(f"--counts: expected whole numbers such as 100,1000, got {text!r}") from None
    for count in counts:
        check_count("--counts", count, 1, MAX_DECALS)
    return counts


def parse_models(text: str) -> list[str]:
    """Parse names of samples such as ``"dragon,knot"``."""
    names = text.split(",")
    for name in names:
        if name not in SAMPLES:
            raise InvalidInput(f"--models: expected samples ({', '.join(SAMPLES)}), got {name!r}")
    return names


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


def as_table(rows: Sequence[Row], title: str) -> Table:
    """Return a table of measured rows with the paper's figures in brackets."""
    result = Table(title=title, caption="in brackets: figure 14 of the paper", box=box.SIMPLE, padding=(0, 1))
    for heading in ("model", "decals", "index cells", "build, s", "ms/frame", "memory"):
        result.add_column(heading, justify="left" if heading == "model" else "right", no_wrap=True)
    for row in rows:
        cells: tuple[str, ...]
        cells = f"{row.cells:,}", f"{row.build:.3f}", f"{row.frame:.1f}", _format_bytes(row.memory)
        if (paper := row.paper) is not None:
            memory = _format_bytes(paper.memory)
            original = f"{paper.voxels:,}", f"{paper.build:.2f}", str(paper.frame), memory
            cells = tuple(f"{a} ({b})" for a, b in zip(cells, original, strict=True))
        result.add_row(row.model, f"{row.decals:,}", *cells)
    return result


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


def _format_bytes(count: int) -> str:
    return f"{count / KILOBYTE:.0f} KB" if count < MEGABYTE else f"{count / MEGABYTE:.2f} MB"


def _median(measure_once: Callable[[], float]) -> float:
    return statistics.median(measure_once() for _ in range(RUNS))


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start
