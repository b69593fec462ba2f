"""What a page of the sandbox shows and does: an edit window, seen as plain values.

The page (`decals.apps.sandbox.page`) draws these values and sends its events here. All behaviour is in the
window's session and its actions.
"""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from blobtree.custom.definition import custom_kinds
from decals.apps.sandbox import catalog
from decals.apps.sandbox.controls import controls_of, parsed
from decals.apps.sandbox.outline import key_of, outline, parse_key
from decals.errors import ImplicitDecalsError, InvalidEdit
from decals.scenes.objects import bounds_of
from decals.validation import describe
from decals.window import EditWindow

REST_SECONDS = 1.0
"""A slider that rests so long has ended its edit: one moved by keys does not tell its end."""

MAX_HISTORY = 200
"""Most entries of the history that a page lists."""


class Sandbox:
    """The state of a sandbox page, and the events that it understands.

    Parameters
    ----------
    window
        The edited window. Its plotter is the view of the page.

    Notes
    -----
    Events never raise for bad values: the scene stays as it was, and `status` says why. An unknown event is
    a mistake of the page and raises.
    """

    def __init__(self, window: EditWindow) -> None:
        self._window = window
        self._last_step = math.inf
        self._rows: list[dict[str, Any]] = []
        self._objects: Any = None
        self._images: Any = None
        self._measured: tuple[object, float] = None, 1.0

    # -- values -----------------------------------------------------------------------------------------

    def values(self) -> dict[str, Any]:
        """Return all values of the page, by their names there."""
        window, state = self._window, self._window.actions.state
        session = window.session
        return {
            "title": window.actions.files.title,
            "status": self.status,
            "busy": window.busy,
            "outline": self._outline(),
            "selected": "" if state.primitive is None else key_of(*state.primitive),
            "panel": self._panel(),
            "done": list(session.labels[-MAX_HISTORY:]),
            "undone": list(session.undone_labels[:MAX_HISTORY]),
        }

    @property
    def status(self) -> str:
        """The last message, and the progress of background work."""
        state = self._window.actions.state
        parts = (self._window.warmup.status, state.background.progress, state.prompt.text, state.message)
        return "   ".join(filter(None, parts))

    @staticmethod
    def catalog() -> dict[str, list[str]]:
        """Return the names of the kinds that can be added, by family."""
        return {
            "primitives": catalog.primitives(),
            "modifiers": catalog.modifiers(),
            "combinations": catalog.combinations(),
            "custom": [kind.__name__ for kind in custom_kinds()],
        }

    def _outline(self) -> list[dict[str, Any]]:
        """Return the rows of the outline; they change only with the objects and images."""
        document = self._window.document
        if self._objects is not document.objects or self._images is not document.images:
            self._rows = outline(document)
            self._objects, self._images = document.objects, document.images
        return self._rows

    def _panel(self) -> dict[str, Any]:
        """Return title and controls of the selected node."""
        if self._window.actions.state.primitive is None:
            return {"kind": "", "doc": "", "controls": [], "operands": 0}
        node = self._window.actions.trees.selected_node
        return {
            "kind": type(node).__name__,
            "doc": (type(node).__doc__ or "").strip().split("\n")[0],
            "controls": controls_of(node, self._size()),
            "operands": len(node.children),
        }

    def _size(self) -> float:
        """Return the size of the scene when the node was selected: sliders keep their ends."""
        selected = self._window.actions.state.primitive
        if self._measured[0] != selected:
            low, high = bounds_of(self._window.document.objects)
            self._measured = selected, float((high - low).max())
        return self._measured[1]

    # -- events -----------------------------------------------------------------------------------------

    def select(self, key: str) -> None:
        """Select the node of a row; the row of an object selects its root, "" selects nothing."""
        with self._reported():
            trees = self._window.actions.trees
            if key == "":
                self._window.actions.state.primitive = None
                return
            if isinstance(key, str) and key.startswith("object "):
                key = key.removeprefix("object ")
            try:
                number, path = parse_key(key)
            except (AttributeError, ValueError):
                raise InvalidEdit(f"row: expected one of a node, got {describe(key)}") from None
            trees.select_node(number, path)

    def set_value(self, name: str, raw: Any, last: bool = True) -> None:
        """Set a parameter of the selected node to what a control sent; see `TreeActions.set_parameter`."""
        with self._reported(whole=bool(last)):
            trees = self._window.actions.trees
            trees.set_parameter(name, parsed(trees.selected_node, name, raw), last=bool(last))
            self._last_step = math.inf if last else time.monotonic()

    def settle(self) -> None:
        """End the edit of a slider that has rested for a while; call this regularly."""
        if time.monotonic() - self._last_step > REST_SECONDS:
            self._last_step = math.inf
            with self._reported():
                self._window.actions.trees.end_drag()

    def set_component(self, name: str, index: list[int], raw: Any) -> None:
        """Set one number of a parameter of the selected node: ``index`` leads to it through lists."""
        with self._reported():
            node = self._window.actions.trees.selected_node
            value = parsed(node, name, _exchanged(getattr(node, str(name), ()), index, raw))
            self._window.actions.trees.set_parameter(name, value)

    def add(self, kind: str) -> None:
        """Add a primitive of a kind: blended to the selected node, or as an object."""
        with self._reported():
            center, size = self._window.actions.trees.place_of_new_node()
            self._window.actions.trees.add_node(catalog.new_node(kind, center=center, size=size))

    def wrap(self, kind: str) -> None:
        """Put the selected node under a new node with one operand, such as a warp."""
        with self._reported():
            node = self._window.actions.trees.selected_node
            low, high = node.bounds
            size = float((high - low).max())
            self._window.actions.trees.replace_node(catalog.new_node(kind, (node,), size=size))

    def combine(self, kind: str) -> None:
        """Combine the operands of the selected node in another way."""
        with self._reported():
            node = self._window.actions.trees.selected_node
            if len(node.children) < 2:
                raise InvalidEdit(
                    f"select a node with two or more operands; a {type(node).__name__} has fewer"
                )
            self._window.actions.trees.replace_node(catalog.new_node(kind, node.children))

    def unwrap(self) -> None:
        """Replace the selected node by its only operand."""
        with self._reported():
            node = self._window.actions.trees.selected_node
            if len(node.children) != 1:
                raise InvalidEdit(
                    f"select a node with one operand; a {type(node).__name__} has {len(node.children)}"
                )
            self._window.actions.trees.replace_node(node.children[0])

    def perform(self, action: str) -> None:
        """Carry out an action of the key table at the middle of the view."""
        with self._reported():
            width, height = self._window.plotter.window_size
            self._window.actions.perform(action, lambda: self._window.tools.at(width / 2, height / 2))

    def go_to(self, entry: int) -> None:
        """Undo or redo until so many entries of the history are done."""
        with self._reported():
            session = self._window.session
            total = len(session.labels) + len(session.undone_labels)
            if isinstance(entry, bool) or not isinstance(entry, int) or not 0 <= entry <= total:
                raise InvalidEdit(f"history: expected an entry from 0 to {total}, got {describe(entry)}")
            self._window.background.require_idle(computing=False)
            while len(session.labels) > entry:
                session.undo()
            while len(session.labels) < entry:
                session.redo()

    @contextmanager
    def _reported(self, *, whole: bool = True) -> Iterator[None]:
        """Turn errors of the event into the message, and draw the result."""
        try:
            yield
        except ImplicitDecalsError as error:
            self._window.actions.state.show(str(error))
        self._window.redraw(whole=whole)


def _exchanged(value: Any, index: object, raw: Any) -> Any:
    """Return nested tuples with one number exchanged."""
    if index == []:
        return raw
    if not isinstance(index, list) or not isinstance(value, tuple) or index[0] not in range(len(value)):
        raise InvalidEdit(f"index: expected that of a number of the parameter, got {describe(index)}")
    first, *rest = index
    return (*value[:first], _exchanged(value[first], rest, raw), *value[first + 1 :])
