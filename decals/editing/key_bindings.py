"""Key bindings: gestures, the decorator that registers a method as their action, and the help text."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeVar

Method = TypeVar("Method", bound=Callable[..., None])


class Group(Enum):
    """Section of the help in which an action stands; its decorator `action` registers one."""

    SELECTION = "Selection"
    DECALS = "Decals"
    MANY = "Many decals"
    BRUSHES = "Brushes"
    SHAPE = "Shape"
    SCENE = "Scene"
    CAMERA = "Camera"

    def action(
        self, name: str, *gestures: str, summary: str, repeats: bool = False
    ) -> Callable[[Method], Method]:
        """Register a method as the action of some gestures; see `Binding` for the parameters."""

        def register(method: Method) -> Method:
            _REGISTERED[method] = Binding(name, gestures, summary, self, repeats)
            return method

        return register


@dataclass(frozen=True)
class Binding:
    """An action, its gestures, and its line in the help.

    Attributes
    ----------
    action
        Name of the action.
    gestures
        Each is modifiers in the order Ctrl, Shift and a name, joined by "+", such as "Ctrl+Shift+z". Names
        are "Click", "Drag", "WheelUp", "WheelDown", and keys as VTK and X name them, with letters in lower
        case.
    summary
        What the action does, in plain words.
    group
        Section of the help.
    repeats
        If True, repetitions with the same selection become one undo entry.
    """

    action: str
    gestures: tuple[str, ...]
    summary: str
    group: Group
    repeats: bool = False


_REGISTERED: dict[Any, Binding] = {}


def registered_actions(owner: type) -> dict[str, tuple[Binding, Callable[..., None]]]:
    """Return binding and method of each action of a class by its name, in the order of definition."""
    methods = [member for member in vars(owner).values() if callable(member) and member in _REGISTERED]
    return {_REGISTERED[method].action: (_REGISTERED[method], method) for method in methods}


CAMERA = "camera"
"""Action of gestures that pyvista handles."""

UNREGISTERED = (
    Binding("move", ("Drag",), "on a selected decal: move the selected decals", Group.SELECTION),
    Binding(CAMERA, ("Drag elsewhere",), "turn the camera", Group.CAMERA),
    Binding(CAMERA, ("Shift+Drag", "Middle drag"), "shift the camera", Group.CAMERA),
    Binding(CAMERA, ("WheelUp", "WheelDown", "Right drag"), "zoom", Group.CAMERA),
    Binding(CAMERA, ("r",), "show everything", Group.CAMERA),
)
"""Gestures of the help that are not actions: the drag of decals, and those that pyvista handles."""

_KEY_LABELS = {
    "plus": "+",
    "equal": "=",
    "minus": "−",
    "KP_Add": "+",
    "KP_Subtract": "−",
    "comma": ",",
    "period": ".",
    "bracketleft": "[",
    "bracketright": "]",
    "Prior": "Page up",
    "Next": "Page down",
    "BackSpace": "Backspace",
    "WheelUp": "Wheel up",
    "WheelDown": "Wheel down",
}
_SYMBOLS = {"plus", "minus", "comma", "period", "bracketleft", "bracketright", "equal"}
"""Keys for which Shift does not count: keyboards differ in the symbols that need it."""

_BROWSER_KEYS = {
    "+": "plus",
    "=": "equal",
    "-": "minus",
    ",": "comma",
    "<": "comma",
    ".": "period",
    ">": "period",
    "[": "bracketleft",
    "{": "bracketleft",
    "]": "bracketright",
    "}": "bracketright",
    "PageUp": "Prior",
    "PageDown": "Next",
    "Backspace": "BackSpace",
}


def from_browser(key: str) -> str:
    """Return VTK's name of a key from a browser's name (``KeyboardEvent.key``)."""
    return _BROWSER_KEYS.get(key, key)


def gesture_name(name: str, *, ctrl: bool = False, shift: bool = False) -> str:
    """Return the name of a gesture as `Binding` spells it."""
    base = name.lower() if len(name) == 1 else name
    return "+".join([*["Ctrl"] * ctrl, *["Shift"] * shift, base])


def format_gesture(gesture: str) -> str:
    """Return a gesture as the help shows it, such as "Ctrl + Z"."""
    *modifiers, name = gesture.split("+")
    name = _KEY_LABELS.get(name, name.upper() if len(name) == 1 else name)
    return " + ".join([*modifiers, name])


def format_gestures(binding: Binding) -> str:
    """Return all gestures of a binding as the help shows them."""
    return ", ".join(dict.fromkeys(format_gesture(gesture) for gesture in binding.gestures))


class KeyTable:
    """Bindings, sorted by their groups; finds the action of a gesture, and prints the help.

    Parameters
    ----------
    bindings
        The bindings; within a group they keep their order.
    """

    def __init__(self, bindings: Iterable[Binding]) -> None:
        groups = list(Group)
        self.bindings = tuple(sorted(bindings, key=lambda binding: groups.index(binding.group)))
        self._actions = {
            gesture: binding.action
            for binding in self.bindings
            if binding.action != CAMERA
            for gesture in binding.gestures
        }

    def action_of(self, name: str, *, ctrl: bool = False, shift: bool = False) -> str | None:
        """Return the action of a key, click or wheel step, or None."""
        return self._actions.get(gesture_name(name, ctrl=ctrl, shift=shift and name not in _SYMBOLS))

    def help_lines(self) -> list[str]:
        """Return the help as lines for a window, group by group."""
        width = max(len(format_gestures(binding)) for binding in self.bindings)
        lines: list[str] = []
        for group in Group:
            lines.append(group.value)
            bindings = [binding for binding in self.bindings if binding.group is group]
            lines += [f"  {format_gestures(binding):<{width}}  {binding.summary}" for binding in bindings]
        return lines

    def help_table(self) -> str:
        """Return the help as a table in Markdown."""
        rows = ["| | gesture | action |", "|---|---|---|"]
        shown: set[Group] = set()
        for binding in self.bindings:
            heading = "" if binding.group in shown else binding.group.value
            shown.add(binding.group)
            rows.append(f"| {heading} | {format_gestures(binding)} | {binding.summary} |")
        return "\n".join(rows) + "\n"
