"""``implicit-decals bench table``: figure 14 of the paper, measured on this machine.

The table has index, time and memory for each model and number of decals.
"""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from decals.apps.commands.options import MAX_DECALS, check_count, parse_size, parse_whole
from decals.apps.commands.progress_bars import progress_bars
from decals.apps.models.figure_14 import KILOBYTE, MEGABYTE, Row, measure
from decals.apps.models.samples import SAMPLES
from decals.errors import InvalidInput
from decals.rendering import Renderer

MIN_COLUMNS = 100  # in a narrower console the numbers would be cut off
MODELS = "dragon,knot,horse,spheres"
COUNTS = "100,1000,10000,100000"


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
        counts = [parse_whole(part) for part in text.split(",")]
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


def _format_bytes(count: int) -> str:
    return f"{count / KILOBYTE:.0f} KB" if count < MEGABYTE else f"{count / MEGABYTE:.2f} MB"
