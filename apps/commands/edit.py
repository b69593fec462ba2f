"""``implicit-decals edit``: the editor window."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from decals.apps.commands.opening import check_options, opened, report_unsaved
from decals.apps.commands.options import (
    ContactName,
    Inputs,
    MappingName,
    OptionalWhole,
    Seed,
    StartImages,
    Stiffness,
    UpAxis,
    parse_size,
)
from decals.apps.memory import import_ahead, keep_memory_low, share_heap
from decals.apps.models.loading import import_definitions
from decals.errors import InvalidInput
from decals.validation import stiffness_number
from decals.window import EditWindow


def edit(
    model: Annotated[list[str] | None, Parameter(negative=(), show_default=False)] = None,
    /,
    *,
    decals: OptionalWhole = None,
    image: StartImages = None,
    up: UpAxis = None,
    size: str = "1200x800",
    contact: ContactName = None,
    stiffness: Stiffness = None,
    mapping: MappingName = None,
    seed: Seed = None,
    save: Path | None = None,
    inputs: Inputs = Inputs(),
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
    size
        Width and height of the window in pixels.
    contact
        Contact mode at the beginning, as for render. P changes it in the window; a saved scene keeps it.
    stiffness
        Stiffness of elastic contact at the beginning, likewise. Shift + P changes it.
    mapping
        Image mapping at the beginning, likewise. U changes it in the window.
    save
        The JSON file that Ctrl + S writes. Default: the opened scene, or a new file such as MODEL-decals.json
        or scene.json.
    """
    share_heap()
    pixels = parse_size(size)
    check_options(decals, seed, save)
    if stiffness is not None:
        stiffness_number(stiffness, InvalidInput)
    EditWindow.require_screen()
    import_definitions(inputs.define)
    opening = opened(model, inputs, decals=decals, image=image, up=up, pixels=pixels, seed=seed, save=save)
    window = EditWindow(
        opening.scene,
        path=opening.path,
        size=pixels,
        recover=opening.recover,
        contact=contact,
        stiffness=stiffness,
        mapping=mapping,
    )
    opening.add_images(window)
    try:
        with window:
            keep_memory_low()
            import_ahead()
            window.show()
    finally:
        report_unsaved(window, "edit")
