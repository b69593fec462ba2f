"""``implicit-decals bench table``: the paper's figure 14 on this machine, beside the paper's own numbers."""

from rich.console import Console

from decals.render import Renderer

from ..errors import UsageError
from ..machine.warp_start import start_warp
from ..measuring.figure_14 import as_table, measure
from ..models.samples import SAMPLES
from .options import MAX_DECALS, check_count, parse_size
from .progress_bars import progress_bars

_WIDTH = 100  # columns below which numbers would be cut off
MODELS = "dragon,knot,horse,spheres"
COUNTS = "100,1000,10000,100000"


def table(*, size: str = "1600x1200", counts: str = COUNTS, models: str = MODELS) -> None:
    """Print the paper's figure 14 as this machine has it, beside the paper's numbers (GeForce 8800 Ultra).

    Parameters
    ----------
    size
        Width and height of the pictures in pixels.
    counts
        Numbers of decals, with commas between.
    models
        Samples, with commas between: creature, dragon, horse, knot, spheres.
    """
    pixels, numbers, names = parse_size(size), parse_counts(counts), parse_models(models)
    start_warp()
    with Renderer() as renderer:
        with progress_bars() as progress:
            rows = []
            for step, name in enumerate(names):
                progress("Measuring", step / len(names))
                rows += measure(renderer, name, numbers, pixels)
        Console(width=max(Console().width, _WIDTH)).print(
            as_table(rows, f"{renderer.context.name}, {size}, {renderer.entry} shader")
        )


def parse_counts(text: str) -> list[int]:
    """Read numbers of decals such as ``"100,1000"``."""
    try:
        counts = [int(part) for part in text.split(",")]
    except ValueError:
        raise UsageError(f"--counts: expected whole numbers such as 100,1000, got {text!r}") from None
    for count in counts:
        check_count("--counts", count, 1, MAX_DECALS)
    return counts


def parse_models(text: str) -> list[str]:
    """Read samples such as ``"dragon,knot"``."""
    names = text.split(",")
    for name in names:
        if name not in SAMPLES:
            raise UsageError(f"--models: expected samples ({', '.join(SAMPLES)}), got {name!r}")
    return names
