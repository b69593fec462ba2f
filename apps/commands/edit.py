"""``implicit-decals edit``: the editor window."""

from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.console import Console

from decals import Camera, Contact, DecalImage, ImageMapping, Scene
from decals.apps.commands.options import (
    DEFAULT_IMAGES,
    MAX_DECALS,
    MAX_SEED,
    ContactName,
    Definitions,
    MappingName,
    OptionalWhole,
    Trust,
    check_count,
    parse_size,
)
from decals.apps.commands.progress_bars import PREPARING, progress_bars
from decals.apps.commands.scatter_options import ScatterOptions
from decals.apps.models.loading import import_definitions, load_models
from decals.apps.models.samples import axes_of
from decals.apps.output import check_output
from decals.apps.views import UPRIGHT, Axes, parse_view
from decals.editing import AddImage, recovery_path
from decals.errors import InvalidInput
from decals.window import EditWindow


def new_file(folder: Path, name: str) -> Path:
    """Return the first path that does not exist: NAME.json, NAME-2.json, ..."""
    endings = chain([""], (f"-{number}" for number in count(2)))
    paths = (folder / f"{name}{ending}.json" for ending in endings)
    return next(path for path in paths if not path.exists())


def edit(
    model: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    /,
    *,
    decals: OptionalWhole = None,
    image: Annotated[
        list[str] | None, Parameter(name=("--image", "--images"), negative=(), show_default=False)
    ] = None,
    up: Annotated[Literal["x", "y", "z"] | None, Parameter(show_default=False)] = None,
    size: str = "1200x800",
    contact: ContactName = "product",
    mapping: MappingName = "corrected",
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
        Mesh files, BlobTrees in JSON, samples, or one saved scene, as for render. Default: an empty scene, in
        which N adds a ball.
    decals
        Number of decals scattered at the start. Default: 500.
    image
        Image of the decals, as for render. Can be repeated. A saved scene keeps its images, and these are
        added. Default: scale.
    up
        The axis that points upward. Default: y, or the axis of the sample.
    size
        Width and height of the window in pixels.
    contact
        Contact mode at the beginning, as for render; a scene does not store it. P changes it in the window.
    mapping
        Image mapping at the beginning, likewise. U changes it in the window.
    seed
        Seed of the random numbers: equal seeds give equal decals. Default: 0.
    save
        The JSON file that Ctrl + S writes. Default: the opened scene, or a new file such as MODEL-decals.json
        or scene.json.
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
    added: tuple[DecalImage, ...] = ()
    path = save
    if not model or _is_unsaved(model):
        if decals is not None or seed is not None:
            raise InvalidInput("an empty scene has no decals; name a model, or leave out --decals and --seed")
        scene = _empty_scene(image or DEFAULT_IMAGES, UPRIGHT[up or "y"])
        path = path or (Path(model[0]) if model else new_file(Path(), "scene"))
    else:
        with progress_bars() as progress:
            progress(PREPARING, 0.0)
            loaded = load_models(model, trust=trust)
            if isinstance(loaded, Scene):
                if decals is not None or seed is not None:
                    raise InvalidInput("a saved scene has its own decals; leave out --decals and --seed")
                scene, path = loaded, path or Path(model[0])
                added = tuple(DecalImage.load(source) for source in image or ())
            else:
                options = ScatterOptions.from_arguments(decals, image, seed)
                where = parse_view(None, axes_of(model[0]) if up is None else UPRIGHT[up])
                scene = options.scene(loaded, where, pixels, progress)
                path = path or new_file(Path(), f"{Path(model[0]).stem}-decals")

    def load_recovered(path: Path) -> Scene:
        recovered = load_models([str(path)], trust=trust)
        if not isinstance(recovered, Scene):
            raise InvalidInput(f"expected a scene in the recovery file {str(path)!r}, got a model")
        return recovered

    window = EditWindow(
        scene,
        path=path,
        size=pixels,
        recover=load_recovered,
        contact=Contact[contact.upper()],
        mapping=ImageMapping[mapping.upper()],
    )
    for picture in added:
        window.session.do(AddImage(picture))
    try:
        with window:
            window.show()
    finally:
        _report_unsaved(window)


def _is_unsaved(models: list[str]) -> bool:
    """Return True for one scene file that was never saved, with a recovery file beside it."""
    first = Path(models[0])
    return (
        len(models) == 1 and first.suffix == ".json" and not first.exists() and recovery_path(first).is_file()
    )


def _empty_scene(images: Sequence[str], axes: Axes) -> Scene:
    """Return a scene without objects, whose camera looks at the origin."""
    where = parse_view(None, axes)
    corner = np.ones(3, np.float32)
    camera = Camera.framing((-corner, corner), direction=where.direction, up=where.up)
    return Scene(objects=(), camera=camera, images=tuple(DecalImage.load(source) for source in images))


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
