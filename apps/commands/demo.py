"""``implicit-decals demo``: three pictures that show what this is about."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from decals.render import Renderer

from ..errors import UsageError
from ..machine.warp_start import start_warp
from ..models.hatching import hatching, mosaic
from ..models.spanning import spanning
from ..output import check_output, write_picture
from .options import MAX_SAMPLES, TILE, Whole, check_count, parse_size
from .progress_bars import FINDING, progress_bars

PICTURES = ("hero.png", "contact.png", "span.png")


def demo(
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("out"),
    size: str = "1200x900",
    samples: Whole = 2,
) -> None:
    """Draw three pictures that show what this is about.

    hero.png: an implicit creature and a mesh under one coat of scales. contact.png: close by, decals that
    push each other meet in black lines. span.png: one decal across a mesh and an implicit surface.

    Parameters
    ----------
    output
        Folder for the pictures; it is made if it is missing.
    size
        Width and height of the pictures in pixels.
    samples
        Samples per pixel along each axis: 1 is fast, 2 smooth, 4 fine.
    """
    pixels = parse_size(size)
    check_count("--samples", samples, 1, MAX_SAMPLES)
    _make_folder(output)
    for name in PICTURES:
        check_output(output / name, (".png",))
    start_warp()
    with Renderer(max_tile=TILE) as renderer, progress_bars() as progress:
        progress(FINDING, 0.0)
        nest = hatching(progress=progress)
        for name, scene in zip(PICTURES, (nest, mosaic(nest), spanning()), strict=True):
            progress(f"Drawing {name}", 0.0)
            write_picture(output / name, renderer.render(scene, size=pixels, samples=samples))
    for name in PICTURES:
        Console().print(str(output / name), soft_wrap=True, highlight=False)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"could not make the output folder {str(folder)!r} ({error.strerror}); choose another"
        ) from error
