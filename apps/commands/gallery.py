"""``implicit-decals gallery``: list the examples, or draw their pictures."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from decals.apps import gallery as examples
from decals.apps.commands.options import Whole, check_count
from decals.apps.output import PICTURE_SUFFIXES, check_output, print_names, print_path
from decals.errors import InvalidInput
from decals.output_folder import output_folder

FOLDER = Path("gallery")
"""Default folder of the pictures of all examples."""
MAX_SIDE = 4096
"""Longest side of a panel, in pixels: a picture has up to five panels."""


def gallery(
    name: examples.Example | None = None,
    /,
    *,
    all_: Annotated[bool, Parameter(name="--all", negative=())] = False,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"), show_default=False)] = None,
    side: Whole = examples.SIDE,
) -> None:
    """List the examples, or draw their pictures.

    Parameters
    ----------
    name
        The example to draw.
    all_
        Draw all examples.
    output
        The picture: png, jpg, webp or tif. Default: NAME.png. With --all, the folder of the pictures, which
        is created if it does not exist. Default: gallery.
    side
        Width and height of each panel of a picture in pixels.
    """
    check_count("--side", side, 1, MAX_SIDE)
    if all_ and name is not None:
        raise InvalidInput(f"expected --all or the name of an example, got both; leave out {name!r} or --all")
    if all_:
        folder = output or FOLDER
        with output_folder(folder, InvalidInput):
            _draw({each: folder / f"{each}.png" for each in examples.EXAMPLES}, side)
    elif name is not None:
        _draw({name: output or Path(f"{name}.png")}, side)
    elif output is not None:
        raise InvalidInput("--output: expected the name of an example, or --all; add one of them")
    else:
        notes = dict.fromkeys(examples.DOWNLOADED, " (downloads its meshes on first use)")
        print_names({each: examples.title(each) + notes.get(each, "") for each in examples.EXAMPLES})


def _draw(pictures: dict[str, Path], side: int) -> None:
    """Draw examples into files, also if the meshes of some cannot be downloaded."""
    # The list of examples does without these imports, which take more than a second.
    from decals.apps.commands.progress_bars import progress_bars
    from decals.apps.gallery.helpers import example_picture
    from decals.rendering import Renderer

    for path in pictures.values():
        check_output(path, PICTURE_SUFFIXES)
    failures: dict[str, InvalidInput] = {}
    with progress_bars() as progress, Renderer() as renderer:
        for name, path in pictures.items():
            progress(f"drawing {name}", 0.0)
            try:
                panels = import_module(f"{examples.__name__}.{name}").panels()
            except InvalidInput as error:
                failures[name] = error
                continue
            example_picture(renderer, name, panels, side).save(path)
    for name, path in pictures.items():
        if name not in failures:
            print_path(path)
    if failures:
        raise InvalidInput(f"could not draw {', '.join(failures)}: {next(iter(failures.values()))}")
