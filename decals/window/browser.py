"""Keys for a window in a browser: trame forwards the mouse, but keys only where a page asks for them."""

import math
from typing import Any

from blobtree.validation import describe
from decals.editing.key_bindings import from_browser
from decals.errors import InvalidEdit
from decals.validation import any_number, instance
from decals.window.window import EditWindow

_ENTER = "$event.currentTarget.entered = true"
"""Note that the pointer is over the element, if only because something above it has closed."""

_MOVE = (
    "$event.currentTarget.dataset.at = [$event.offsetX / $event.target.clientWidth, "
    "$event.offsetY / $event.target.clientHeight]; "
    "if ($event.currentTarget.entered && ($event.movementX || $event.movementY)) {"
    " $event.currentTarget.entered = false;"
    " const field = $event.currentTarget.ownerDocument.activeElement;"
    " if (!field?.matches('input, textarea') || field.taken)"
    " $event.currentTarget.focus({preventScroll: true}) }"
)
"""Record the pointer's position, since trame sends it only while a button is down.

A pointer that moves into the element gives it the focus, so that it receives keys, unless the user may be
typing. A pointer that rests does not. A page sets `taken` of a field whose text has been taken.
"""

_KEY_ARGUMENTS = (
    "[$event.target.style.outline = 'none', ($event.ctrlKey || $event.metaKey) && $event.preventDefault(), "
    "$event.key, $event.ctrlKey || $event.metaKey, $event.shiftKey, $event.currentTarget.dataset.at || '']"
)
"""Arguments of a key press. The first removes the frame that browsers draw around a focused element."""


def browser_keys(window: EditWindow) -> dict[str, Any]:
    """Return attributes that send keys from a trame page to a window.

    Put them on the element around the view of the window's plotter::

        with html.Div(style="height: 100%", **browser_keys(window)):
            PyVistaRemoteView(window.plotter)

    Keys act at the pointer, as in a window. The command key of a Mac is Ctrl. Combinations with Ctrl go to
    the window only, not to the browser.

    Parameters
    ----------
    window : EditWindow
        The window.

    Returns
    -------
    dict
        Attributes of a trame element.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.window import browser_keys
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=10, images=["eye"])
    >>> with decals.window.EditWindow(scene, off_screen=True, size=(80, 60)) as window:
    ...     sorted(browser_keys(window))
    ['keydown', 'mouseenter', 'mousemove', 'tabindex']
    """
    instance("window", window, EditWindow, InvalidEdit, "open one with plotter=...")

    def press(_outline: str, _prevented: object, key: str, ctrl: bool, shift: bool, position: str) -> None:
        press_key(window, key, ctrl=bool(ctrl), shift=bool(shift), position=_parse_position(position))

    return {
        "tabindex": 0,
        "mouseenter": _ENTER,
        "mousemove": _MOVE,
        "keydown": (press, _KEY_ARGUMENTS),
    }


def press_key(
    window: EditWindow,
    key: str,
    *,
    ctrl: bool = False,
    shift: bool = False,
    position: tuple[float, float] | None = None,
) -> bool:
    """Press a key in a window, for example from a button of a page.

    Parameters
    ----------
    window : EditWindow
        The window.
    key : str
        Name of the key in browsers (``KeyboardEvent.key``) or VTK: "z", "Delete", "PageUp", "[".
    ctrl, shift : bool
        Modifiers.
    position : (float, float), optional
        Pointer position from the top left corner, relative to the plotter's width and height. Default: the
        last position.

    Returns
    -------
    bool
        True if the key has an action.

    Raises
    ------
    InvalidEdit
        The window, key or position is not valid.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.window import press_key
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=10, images=["eye"])
    >>> with decals.window.EditWindow(scene, off_screen=True, size=(80, 60)) as window:
    ...     press_key(window, "a", ctrl=True), len(window.actions.state.selection)
    (True, 10)
    """
    instance("window", window, EditWindow, InvalidEdit, "open one with plotter=...")
    if not isinstance(key, str):
        raise InvalidEdit(f"key: expected its name, such as 'z', got {describe(key)}")
    interactor = window.plotter.iren.interactor
    if position is not None:
        right, down = _checked_position(position)
        width, height = window.plotter.window_size
        interactor.SetEventPosition(int(right * width), int((1.0 - down) * height))
    x, y = interactor.GetEventPosition()
    if window.in_other_subplot(x, y):
        return False
    text = key if len(key) == 1 else ""  # other names are those of keys without a character
    used = window.tools.key(from_browser(key), x, y, ctrl=ctrl, shift=shift, text=text)
    if not used and key in ("r", "R") and not ctrl:  # on a screen, VTK handles this key
        window.subplot.vtk_renderer.ResetCamera()
        used = True
    if used:
        window.redraw(whole=not window.tools.dragging)
    return used


def _checked_position(position: object) -> tuple[float, float]:
    """Return two numbers, clamped to [0, 1], or raise `InvalidEdit`."""
    try:
        x, y = (any_number("position", part, InvalidEdit) for part in position)  # type: ignore[attr-defined]
    except (TypeError, ValueError, KeyError) as error:
        raise InvalidEdit(
            f"position: expected parts of width and height, got {describe(position)}"
        ) from error
    return min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0)


def _parse_position(position: str) -> tuple[float, float] | None:
    """Return the two numbers of a text from a page, or None."""
    try:
        x, y = map(float, position.split(","))
    except ValueError:
        return None
    return (x, y) if math.isfinite(x + y) else None
