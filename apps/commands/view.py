"""``implicit-decals view``: open a window in which decals are pushed by hand."""

from itertools import chain, count
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.console import Console

from decals.scenes.scene import Scene
from decals.window import EditWindow

from ..errors import UsageError
from ..machine.warp_start import start_warp
from ..models.definitions import import_definitions
from ..models.loading import load_models
from ..models.samples import axes_of
from ..output import check_output
from ..views import UPRIGHT, parse_view
from .coat import Coat
from .options import MAX_DECALS, MAX_SEED, Definitions, OptionalWhole, check_count, parse_size
from .progress_bars import progress_bars


def new_file(folder: Path, name: str) -> Path:
    """Give a path of a JSON file that is not there yet: NAME-decals.json, NAME-decals-2.json, ..."""
    endings = chain([""], (f"-{number}" for number in count(2)))
    paths = (folder / f"{name}-decals{ending}.json" for ending in endings)
    return next(path for path in paths if not path.exists())


def view(
    model: Annotated[list[str], Parameter(negative=())],
    /,
    *,
    decals: OptionalWhole = None,
    image: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    up: Annotated[Literal["x", "y", "z"] | None, Parameter(show_default=False)] = None,
    size: str = "1200x800",
    seed: OptionalWhole = None,
    save: Path | None = None,
    define: Definitions = None,
) -> None:
    """Open models or a scene in a window, and push decals by hand.

    Press h in the window for all that can be done.

    Parameters
    ----------
    model
        As for render: mesh files, BlobTrees in JSON, samples, or one saved scene.
    decals
        How many decals there are at first. Default: 500.
    image
        What is on them, as for render; keys change between several. Default: scale.
    up
        The axis that points upward. Default: y, or what suits the sample.
    size
        Width and height of the window in pixels.
    seed
        The same number gives the same decals. Default: 0.
    save
        The JSON file that Ctrl + S writes. Default: the scene that was opened, or a new file here that is
        called after the first model.
    define
        A Python file or module that defines own kinds of nodes, for BlobTrees in JSON that use them. May be
        given several times.
    """
    pixels = parse_size(size)
    if decals is not None:
        check_count("--decals", decals, 0, MAX_DECALS)
    if seed is not None:
        check_count("--seed", seed, 0, MAX_SEED)
    if save is not None:
        check_output(save, (".json",))
    EditWindow.require_screen()
    start_warp()
    import_definitions(define)
    loaded, path = load_models(model), save
    if isinstance(loaded, Scene):
        if decals is not None or image or seed is not None:
            raise UsageError("a saved scene brings its own decals; leave out --decals, --image and --seed")
        scene, path = loaded, path or Path(model[0])
    else:
        with progress_bars() as progress:
            coat = Coat.asked(decals, image, seed)
            where = parse_view(None, axes_of(model[0]) if up is None else UPRIGHT[up])
            scene = coat.scene(loaded, where, pixels, progress)
        path = path or new_file(Path(), Path(model[0]).stem)
    with EditWindow(scene, path=path, size=pixels) as window:
        window.show()
        if window.session.modified:
            Console(stderr=True).print("closed without saving what was changed last", highlight=False)
