"""``implicit-decals demo``: three pictures that show the method."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from decals.apps.commands.options import MAX_SAMPLES, TILE, Whole, check_count, parse_size
from decals.apps.commands.progress_bars import PREPARING, progress_bars
from decals.apps.errors import UsageError
from decals.apps.gallery import spanning
from decals.apps.models.demo_scenes import nest_scene, tile_scene
from decals.apps.output import check_output, write_picture
from decals.rendering import Renderer
from decals.rendering.options import RenderOptions

PICTURES = ("hero.png", "contact.png", "span.png")


def demo(
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))] = Path("out"),
    size: str = "1200x900",
    samples: Whole = 2,
) -> None:
    """Draw three pictures that show the method.

    hero.png: an implicit creature and a mesh, covered with scales. contact.png: a close-up of tiles that
    push each other. span.png: one decal across a mesh and an implicit surface.

    Parameters
    ----------
    output
        Folder for the pictures. It is created if it does not exist.
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
    with Renderer(max_tile=TILE) as renderer, progress_bars() as progress:
        progress(PREPARING, 0.0)
        nest = nest_scene(progress=progress)
        for name, scene in zip(PICTURES, (nest, tile_scene(nest), spanning.scene(fov=27.0)), strict=True):
            progress(f"Drawing {name}", 0.0)
            write_picture(output / name, renderer.render(scene, RenderOptions(size=pixels, samples=samples)))
    for name in PICTURES:
        Console().print(str(output / name), soft_wrap=True, highlight=False)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"could not make the output folder {str(folder)!r} ({error.strerror}); choose another"
        ) from error
