"""What hands do, and what it means: the one table that drives the bindings and prints the help."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum


class Group(Enum):
    """Where a binding stands in the help."""

    DECALS = "Decals"
    MANY = "Many decals"
    SHAPE = "Shape"
    SCENE = "Scene"
    CAMERA = "Camera"


@dataclass(frozen=True)
class Binding:
    """An action, the gestures that ask for it, and what it does in plain words.

    A gesture is modifiers in the order Ctrl, Shift and a name, joined by "+": "Ctrl+Shift+z". Names are
    "Click", "Drag", "WheelUp", "WheelDown", and keys as VTK and X call them, letters in lower case.
    """

    action: str
    gestures: tuple[str, ...]
    text: str
    group: Group


CAMERA = "camera"
"""Action of what is left to the window's camera."""

BINDINGS = (
    Binding("pick", ("Click",), "select the decal under the cursor", Group.DECALS),
    Binding("pick_also", ("Shift+Click",), "select one more, or one less", Group.DECALS),
    Binding("pick_all", ("Ctrl+a",), "select all", Group.DECALS),
    Binding("let_go", ("Escape",), "select none; take a drag back; stop long work", Group.DECALS),
    Binding("move", ("Drag",), "on a selected decal: move what is selected over the surfaces", Group.DECALS),
    Binding("place", ("Ctrl+Click", "a"), "a new decal under the cursor", Group.DECALS),
    Binding("duplicate", ("d",), "duplicate what is selected, or else the held primitive", Group.DECALS),
    Binding(
        "delete", ("Delete", "BackSpace"), "delete what is selected, or else the held primitive", Group.DECALS
    ),
    Binding("larger", ("Ctrl+WheelUp", "plus", "equal", "KP_Add"), "larger", Group.DECALS),
    Binding("smaller", ("Ctrl+WheelDown", "minus", "KP_Subtract"), "smaller", Group.DECALS),
    Binding("turn_left", ("Shift+WheelUp", "comma"), "turn counter-clockwise", Group.DECALS),
    Binding("turn_right", ("Shift+WheelDown", "period"), "turn clockwise", Group.DECALS),
    Binding("next_image", ("i",), "next image", Group.DECALS),
    Binding("previous_image", ("Shift+i",), "image before", Group.DECALS),
    Binding("next_tint", ("t",), "next tint", Group.DECALS),
    Binding("fainter", ("o",), "fainter", Group.DECALS),
    Binding("stronger", ("Shift+o",), "less faint", Group.DECALS),
    Binding("layer_up", ("Prior",), "a layer up", Group.DECALS),
    Binding("layer_down", ("Next",), "a layer down", Group.DECALS),
    Binding("next_interaction", ("k",), "contact, overlap or independent", Group.DECALS),
    Binding("relax", ("x",), "even out the decals around the cursor", Group.MANY),
    Binding("scatter", ("g",), "a new coat on the object under the cursor", Group.MANY),
    Binding("grip", ("m",), "take hold of the primitive under the cursor, or let it go", Group.SHAPE),
    Binding(
        "thicker", ("bracketright",), "the primitive that is held, or under the cursor, thicker", Group.SHAPE
    ),
    Binding("thinner", ("bracketleft",), "the same primitive thinner", Group.SHAPE),
    Binding("next_color", ("c",), "next colour for the same primitive", Group.SHAPE),
    Binding(
        "next_join",
        ("j",),
        "next way to join: blend, soft, union, intersection, difference",
        Group.SHAPE,
    ),
    Binding(
        "new_ball", ("n",), "a ball blended into the tree under the cursor; it is held then", Group.SHAPE
    ),
    Binding("new_limb", ("l",), "the same with a limb that stands out", Group.SHAPE),
    Binding(
        "new_object",
        ("Shift+n",),
        "a ball as a new object, under the cursor or where you look",
        Group.SHAPE,
    ),
    Binding(
        "remove_object", ("Shift+Delete",), "the object under the cursor goes, with its decals", Group.SHAPE
    ),
    Binding("undo", ("Ctrl+z",), "undo", Group.SCENE),
    Binding("redo", ("Ctrl+y", "Ctrl+Shift+z"), "redo", Group.SCENE),
    Binding("save", ("Ctrl+s",), "save", Group.SCENE),
    Binding("help", ("h", "F1"), "show or hide this help", Group.SCENE),
    Binding(CAMERA, ("Drag elsewhere",), "turn the camera", Group.CAMERA),
    Binding(CAMERA, ("Shift+Drag", "Middle drag"), "shift the camera", Group.CAMERA),
    Binding(CAMERA, ("WheelUp", "WheelDown", "Right drag"), "come closer, go away", Group.CAMERA),
    Binding(CAMERA, ("r",), "see everything", Group.CAMERA),
    Binding(CAMERA, ("q",), "close the window", Group.CAMERA),
)

_NAMES = {
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

_OF_BROWSERS = {
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


def of_browser(key: str) -> str:
    """Give the name of a key here from what a browser calls it (``KeyboardEvent.key``)."""
    return _OF_BROWSERS.get(key, key)


def gesture(name: str, *, ctrl: bool = False, shift: bool = False) -> str:
    """Give the name of a gesture, as the table has it."""
    base = name.lower() if len(name) == 1 else name
    return "+".join([*["Ctrl"] * ctrl, *["Shift"] * shift, base])


def actions(bindings: Iterable[Binding] = BINDINGS) -> dict[str, str]:
    """Give the action of each gesture, those of the camera left out."""
    return {
        one: binding.action for binding in bindings if binding.action != CAMERA for one in binding.gestures
    }


def action_of(name: str, *, ctrl: bool = False, shift: bool = False) -> str | None:
    """Give what a gesture asks for; None where it means nothing here.

    What Shift is needed for to type a symbol depends on the keyboard: with symbols it does not count.
    """
    return _ACTIONS.get(gesture(name, ctrl=ctrl, shift=shift and name not in _SYMBOLS))


def shown(one: str) -> str:
    """Give a gesture as people write it."""
    *modifiers, name = one.split("+")
    name = _NAMES.get(name, name.upper() if len(name) == 1 else name)
    return " + ".join([*modifiers, name])


def gestures_of(binding: Binding) -> str:
    """Give all gestures of a binding, as people write them."""
    return ", ".join(dict.fromkeys(shown(one) for one in binding.gestures))


def help_lines(bindings: Iterable[Binding] = BINDINGS) -> list[str]:
    """Give the help as lines for a window, group by group."""
    table = list(bindings)
    width = max(len(gestures_of(binding)) for binding in table)
    lines: list[str] = []
    for group in Group:
        lines.append(group.value)
        lines += [f"  {gestures_of(b):<{width}}  {b.text}" for b in table if b.group is group]
    return lines


def help_table(bindings: Iterable[Binding] = BINDINGS) -> str:
    """Give the help as a table in Markdown."""
    table = list(bindings)
    rows = ["| | gesture | what it does |", "|---|---|---|"]
    for group in Group:
        names = [group.value] + [""] * len(table)
        chosen = [binding for binding in table if binding.group is group]
        rows += [f"| {name} | {gestures_of(b)} | {b.text} |" for name, b in zip(names, chosen, strict=False)]
    return "\n".join(rows) + "\n"


_ACTIONS = actions()
