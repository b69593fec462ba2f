"""``implicit-decals bench table``: figure 14 of the paper, measured on this machine."""

from rich.console import Console

from decals.apps.commands.options import MAX_DECALS, check_count, parse_size
from decals.apps.commands.progress_bars import progress_bars
from decals.apps.errors import UsageError
from decals.apps.figure_14 import as_table, measure
from decals.apps.models.samples import SAMPLES
from decals.rendering import Renderer

MIN_COLUMNS = 100  # in a narrower console the numbers would be cut off
MODELS = "dragon,knot,horse,spheres"
COUNTS = "100,1000,10000,100000"


def table(*, size: str = "1600x1200", counts: str = COUNTS, models: str = MODELS) -> None:
    """Measure figure 14 of the paper on this machine, and print it beside the paper's numbers.

    The paper used a GeForce 8800 Ultra.

    Parameters
    ----------
    size
        Width and height of the pictures in pixels.
    counts
        Numbers of decals, separated by commas.
    models
        Sample models, separated by commas: creature, dragon, horse, knot, spheres.
    """
    pixels, numbers, names = parse_size(size), parse_counts(counts), parse_models(models)
    with Renderer() as renderer:
        with progress_bars() as progress:
            rows = []
            for step, name in enumerate(names):
                progress("Measuring", step / len(names))
                rows += measure(renderer, name, numbers, pixels)
        Console(width=max(Console().width, MIN_COLUMNS)).print(
            as_table(rows, f"{renderer.context.name}, {size}, {renderer.backend} shader")
        )


def parse_counts(text: str) -> list[int]:
    """Parse numbers of decals such as ``"100,1000"``."""
    try:
        counts = [int(part) for part in text.split(",")]
    except ValueError:
        raise UsageError(f"--counts: expected whole numbers such as 100,1000, got {text!r}") from None
    for count in counts:
        check_count("--counts", count, 1, MAX_DECALS)
    return counts


def parse_models(text: str) -> list[str]:
    """Parse names of samples such as ``"dragon,knot"``."""
    names = text.split(",")
    for name in names:
        if name not in SAMPLES:
            raise UsageError(f"--models: expected samples ({', '.join(SAMPLES)}), got {name!r}")
    return names
