"""Keys for a window in a browser: trame sends the mouse by itself, keys only where a page asks for them."""

import math
from typing import Any

from decals.checks import finite, instance, shown
from decals.edit.keys import of_browser
from decals.errors import InvalidEdit
from decals.window.window import EditWindow

_HOVER = "$event.currentTarget.focus({preventScroll: true})"
"""Keys go to what has the focus: here, what is under the pointer."""

_PLACE = (
    "$event.currentTarget.dataset.at = [$event.offsetX / $event.target.clientWidth, "
    "$event.offsetY / $event.target.clientHeight]"
)
"""trame tells of the pointer only while a button is down."""

_KEY = (
    "[$event.target.style.outline = 'none', ($event.ctrlKey || $event.metaKey) && $event.preventDefault(), "
    "$event.key, $event.ctrlKey || $event.metaKey, $event.shiftKey, $event.currentTarget.dataset.at || '']"
)
"""Browsers draw a frame around what gets keys, here over the picture."""


def browser_keys(window: EditWindow) -> dict[str, Any]:
    """Attributes for the element of a trame page around the view of a window's plotter, so that keys work.

    ::

        with html.Div(style="height: 100%", **browser_keys(window)):
            PyVistaRemoteView(window.plotter)

    While the pointer is over the view, keys act where it points, as in a window. The command key of a Mac is
    Ctrl. Combinations with Ctrl go to the window alone, the browser's own meaning of them does not happen.
    """
    instance("window", window, EditWindow, InvalidEdit, "open one with plotter=...")

    def press(_outline: str, _prevented: object, key: str, ctrl: bool, shift: bool, place: str) -> None:
        press_key(window, key, ctrl=bool(ctrl), shift=bool(shift), place=_fractions(place))

    return {
        "tabindex": 0,
        "mouseenter": _HOVER,
        "mousemove": _PLACE,
        "keydown": (press, _KEY),
    }


def press_key(
    window: EditWindow,
    key: str,
    *,
    ctrl: bool = False,
    shift: bool = False,
    place: tuple[float, float] | None = None,
) -> bool:
    """Press a key in a window: from a button of a page, for instance.

    Parameters
    ----------
    window
        Where to.
    key
        As a browser calls it (``KeyboardEvent.key``) or as VTK does: "z", "Delete", "PageUp", "[".
    ctrl, shift
        Whether these are down.
    place
        Where the pointer is, in parts of the plotter's width and of its height, from the top left corner;
        where it was last, if not given.

    Returns
    -------
    bool
        Whether the key means something.
    """
    instance("window", window, EditWindow, InvalidEdit, "open one with plotter=...")
    if not isinstance(key, str):
        raise InvalidEdit(f"key: expected its name, such as 'z', got {shown(key)}")
    interactor = window.plotter.iren.interactor
    if place is not None:
        right, down = _parts(place)
        width, height = window.plotter.window_size
        interactor.SetEventPosition(int(right * width), int((1.0 - down) * height))
    x, y = interactor.GetEventPosition()
    used = not window.elsewhere(x, y) and window.tools.key(of_browser(key), x, y, ctrl=ctrl, shift=shift)
    if used:
        window.redraw(whole=not window.tools.dragging)
    return used


def _parts(place: object) -> tuple[float, float]:
    """Two numbers, held within the window."""
    try:
        x, y = (finite("place", part, InvalidEdit) for part in place)  # type: ignore[attr-defined]
    except (TypeError, ValueError, KeyError) as error:
        raise InvalidEdit(f"place: expected parts of width and height, got {shown(place)}") from error
    return min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0)


def _fractions(place: str) -> tuple[float, float] | None:
    """Two numbers as a page writes them down, or nothing."""
    try:
        x, y = map(float, place.split(","))
    except ValueError:
        return None
    return (x, y) if math.isfinite(x + y) else None
