"""``implicit-decals edit``: the editor window."""

from itertools import chain, count
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.console import Console

from decals import Scene
from decals.apps.commands.options import (
    MAX_DECALS,
    MAX_SEED,
    Definitions,
    OptionalWhole,
    ScatterOptions,
    Trust,
    check_count,
    parse_size,
)
from decals.apps.commands.progress_bars import progress_bars
from decals.apps.models.loading import import_definitions, load_models
from decals.apps.models.samples import axes_of
from decals.apps.output import check_output
from decals.apps.views import UPRIGHT, parse_view
from decals.errors import InvalidInput
from decals.window import EditWindow


def new_file(folder: Path, name: str) -> Path:
    """Return the first path that does not exist: NAME.json, NAME-2.json, ..."""
    endings = chain([""], (f"-{number}" for number in count(2)))
    paths = (folder / f"{name}{ending}.json" for ending in endings)
    return next(path for path in paths if not path.exists())


def edit(
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
    trust: Trust = False,
) -> None:
    """Open models or a scene in an editor window.

    Press h in the window for a list of keys.

    Parameters
    ----------
    model
        Mesh files, BlobTrees in JSON, samples, or one saved scene, as for render.
    decals
        Number of decals scattered at the start. Default: 500.
    image
        Image of the decals, as for render. Can be repeated. Default: scale.
    up
        The axis that points upward. Default: y, or the axis of the sample.
    size
        Width and height of the window in pixels.
    seed
        Seed of the random numbers: equal seeds give equal decals. Default: 0.
    save
        The JSON file that Ctrl + S writes. Default: the opened scene, or a new file MODEL-decals.json.
    define
        A Python file or module that defines the custom nodes of BlobTrees in JSON. Its code is run. Can be
        repeated.
    trust
        Let a scene read files outside its folder, and any number of images.
    """
    pixels = parse_size(size)
    if decals is not None:
        check_count("--decals", decals, 0, MAX_DECALS)
    if seed is not None:
        check_count("--seed", seed, 0, MAX_SEED)
    if save is not None:
        check_output(save, (".json",))
    EditWindow.require_screen()
    import_definitions(define)
    loaded, path = load_models(model, trust=trust), save
    if isinstance(loaded, Scene):
        if decals is not None or image or seed is not None:
            raise InvalidInput("a saved scene has its own decals; leave out --decals, --image and --seed")
        scene, path = loaded, path or Path(model[0])
    else:
        with progress_bars() as progress:
            options = ScatterOptions.from_arguments(decals, image, seed)
            where = parse_view(None, axes_of(model[0]) if up is None else UPRIGHT[up])
            scene = options.scene(loaded, where, pixels, progress)
        path = path or new_file(Path(), f"{Path(model[0]).stem}-decals")

    def load_recovered(path: Path) -> Scene:
        recovered = load_models([str(path)], trust=trust)
        if not isinstance(recovered, Scene):
            raise InvalidInput(f"expected a scene in the recovery file {str(path)!r}, got a model")
        return recovered

    window = EditWindow(scene, path=path, size=pixels, recover=load_recovered)
    try:
        with window:
            window.show()
    finally:
        _report_unsaved(window)


def _report_unsaved(window: EditWindow) -> None:
    """Say where unsaved changes are, if the window was closed with some."""
    files, console = window.actions.files, Console(stderr=True, soft_wrap=True)
    if files.recovery.exists:
        console.print(
            f"unsaved changes are kept in {files.recovery.path}; "
            f"`implicit-decals edit {files.path}` opens them",
            highlight=False,
            markup=False,
        )
    elif window.session.modified:
        console.print("closed without saving the last changes", highlight=False)
