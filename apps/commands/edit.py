"""``implicit-decals edit``: the editor window."""

from typing import Annotated

from cyclopts import Parameter

from decals.apps.commands.opening import check_options, opened, report_unsaved
from decals.apps.commands.options import Inputs, Rules, Start, parse_size
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
    rules: Rules = Rules(),
    inputs: Inputs = Inputs(),
) -> None:
    """Open models or a scene in an editor window.

    Press h in the window for a list of keys. Contact mode, stiffness and image mapping are those at the
    beginning: P, Shift + P and U change them in the window, and a saved scene keeps them.

    Parameters
    ----------
    model
        Mesh files, BlobTrees in JSON, programs (vm, frep), samples, or one saved scene, as for render.
        Default: an empty scene, in which N adds a ball.
    size
        Width and height of the window in pixels.
    """
    share_heap()
    pixels = parse_size(size)
    check_options(start)
    if rules.stiffness is not None:
        stiffness_number(rules.stiffness, InvalidInput)
    EditWindow.require_screen()
    import_definitions(inputs.define)
    opening = opened(model, start, inputs, pixels)
    window = EditWindow(
        opening.scene, path=opening.path, size=pixels, recover=opening.recover, **rules.given()
    )
    opening.add_images(window)
    try:
        with window:
            keep_memory_low()
            import_ahead()
            window.show()
    finally:
        report_unsaved(window, "edit")
