"""``implicit-decals edit``: the editor window."""

from typing import Annotated

from cyclopts import Parameter

from decals.apps.commands.opening import check_options, opened, report_unsaved
from decals.apps.commands.options import (
    ContactName,
    Inputs,
    MappingName,
    Start,
    Stiffness,
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
    start: Start = Start(),
    size: str = "1200x800",
    contact: ContactName = None,
    stiffness: Stiffness = None,
    mapping: MappingName = None,
    inputs: Inputs = Inputs(),
) -> None:
    """Open models or a scene in an editor window.

    Press h in the window for a list of keys.

    Parameters
    ----------
    model
        Mesh files, BlobTrees in JSON, samples, or one saved scene, as for render. Default: an empty scene, in
        which N adds a ball.
    size
        Width and height of the window in pixels.
    contact
        Contact mode at the beginning, as for render. P changes it in the window; a saved scene keeps it.
    stiffness
        Stiffness of elastic contact at the beginning, likewise. Shift + P changes it.
    mapping
        Image mapping at the beginning, likewise. U changes it in the window.
    """
    share_heap()
    pixels = parse_size(size)
    check_options(start)
    if stiffness is not None:
        stiffness_number(stiffness, InvalidInput)
    EditWindow.require_screen()
    import_definitions(inputs.define)
    opening = opened(model, start, inputs, pixels)
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
