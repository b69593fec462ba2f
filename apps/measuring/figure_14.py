"""The paper's figure 14 on this machine: index, time and memory by model and number of decals."""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from rich import box
from rich.table import Table

from decals.grid.index import DecalIndex
from decals.render import Renderer
from decals.scenes.scene import DecalImage, Scene

from ..models.samples import axes_of, sample
from ..views import Size, frame, parse_view
from .coats import even_coat
from .paper import FIGURE_14, PaperRow

RUNS = 3
"""Runs of which the median counts."""


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    model, decals
        What was drawn.
    nodes
        Cells of the index.
    build
        Seconds to build it.
    frame
        Milliseconds to draw a picture, without reading it back.
    memory
        Bytes of records and index on the graphics card.
    """

    model: str
    decals: int
    nodes: int
    build: float
    frame: float
    memory: int

    @property
    def paper(self) -> PaperRow | None:
        """The paper's own line for this model and count."""
        return FIGURE_14.get((self.model, self.decals))


def measure(renderer: Renderer, model: str, counts: Sequence[int], size: Size) -> list[Row]:
    """Measure one model under each number of decals; medians of three runs."""
    item = sample(model)
    camera = frame([item], parse_view(None, axes_of(model)), size)
    image = DecalImage.load("scale")
    rows = []
    for count in counts:
        decals = even_coat(item.surface, count=count)
        index = DecalIndex.of(decals)
        build = _median(partial(_seconds, partial(DecalIndex.of, decals)))
        scene = Scene(objects=(item,), camera=camera, decals=decals, images=(image,))
        renderer.time_frame(scene, size=size)
        rows.append(
            Row(
                model=model,
                decals=count,
                nodes=int((index.table.reshape(-1, 4)[:, 0] >= 0).sum()),
                build=build,
                frame=1e3 * _median(partial(renderer.time_frame, scene, size=size)),
                memory=index.nbytes + decals.packed().nbytes,
            )
        )
    return rows


def as_table(rows: Sequence[Row], title: str) -> Table:
    """Lay the rows out beside the paper's."""
    result = Table(title=title, caption="in brackets: the paper's figure 14", box=box.SIMPLE, padding=(0, 1))
    for heading in ("model", "decals", "index nodes", "build, s", "ms/frame", "memory"):
        result.add_column(heading, justify="left" if heading == "model" else "right", no_wrap=True)
    for row in rows:
        own: tuple[str, ...] = f"{row.nodes:,}", f"{row.build:.3f}", f"{row.frame:.1f}", _bytes(row.memory)
        paper = row.paper
        if paper is not None:
            theirs = f"{paper.voxels:,}", f"{paper.build:.2f}", str(paper.frame), _bytes(paper.memory)
            own = tuple(f"{a} ({b})" for a, b in zip(own, theirs, strict=True))
        result.add_row(row.model, f"{row.decals:,}", *own)
    return result


def _bytes(count: int) -> str:
    return f"{count / 1024:.0f} KB" if count < 1 << 20 else f"{count / (1 << 20):.2f} MB"


def _median(measure_once: Callable[[], float]) -> float:
    return statistics.median(measure_once() for _ in range(RUNS))


def _seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin
