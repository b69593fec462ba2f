"""Controls of a panel, from the parameters that classes of nodes declare."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from math import isfinite
from typing import Any, Self

from blobtree import Node
from blobtree.colors import Rgb, Rgba
from blobtree.declare.falloff import Falloff
from blobtree.declare.parameters import UNITS, Parameter, Quantity, described, parameters_of
from blobtree.formulas.falloffs import FALLOFF_NAMES
from blobtree.transpile.python import plain_python
from blobtree.validation import describe
from decals.apps.sandbox.words import TEXTS
from decals.editing.new_nodes import alternatives, name_of
from decals.errors import InvalidEdit
from decals.options import Option, options_of
from decals.validation import number_of, one_of

SLIDER_REACH = 4.0
"""Largest value of a slider for a number without unit and range, over the present value or 1."""

CURVE_STEPS = 24
"""Pieces of the curve of a falloff."""

STEPS = 200
"""Steps of a slider from end to end."""

KIND = "kind"
"""Name of the control of a node's class."""

VECTORS = (Quantity.POINT, Quantity.DIRECTION, Quantity.EXTENTS, Quantity.SEMI_AXES)
SIGNED = (Quantity.DISTANCE, Quantity.ANGLE, Quantity.FACTOR, Quantity.NUMBERS)
NUMBERS = (Quantity.LENGTH, Quantity.RADIUS, Quantity.WIDTH, *SIGNED)
LISTS = (Quantity.POINTS, Quantity.RADII, Quantity.FACTORS, Quantity.DISTANCES)
ANGLE_REACH = 360.0
"""Largest value of a slider for an angle without a range, in degrees."""


@dataclass(frozen=True)
class Control:
    """One control of a panel; plain values, as a page receives them.

    Attributes
    ----------
    name
        Name of the parameter.
    kind
        "number" (a slider and a field), "field" (a number alone), "vector" and "list" (fields), "color",
        "choice", "choices" (any number of them), "switch", "path" (a field for a text), or "text" (shown).
    value
        The present value: a number, numbers, "#rrggbb", or text.
    doc
        What the parameter means, with unit and range.
    unit
        Its unit, or "".
    low, high, step
        Ends and step of the slider. The field takes any value that the node accepts.
    choices
        Texts of a choice.
    curve
        Points of the curve of a choice, in a square of the size 1, as SVG writes them; "" for none.
    label
        What the page calls it; by default its name in words.
    word
        The word of the theory that it is, see `words`; "" for others.
    """

    name: str
    kind: str
    value: Any
    doc: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0
    choices: tuple[str, ...] = ()
    curve: str = ""
    label: str = ""
    word: str = ""

    @classmethod
    def choice(cls, name: str, value: str, choices: Iterable[str], doc: str) -> Self:
        """Return the choice of one of several texts."""
        return cls(name, "choice", value, doc, choices=tuple(choices))

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or re.sub("[_.]", " ", self.name))


def controls_of(node: Node, size: float) -> list[dict[str, Any]]:
    """Return the controls of a node's parameters, in the order of their declaration.

    Parameters
    ----------
    node
        The node.
    size
        Size of the object, for the ends of sliders of lengths.
    """
    values = ((declared, getattr(node, name)) for name, declared in parameters_of(type(node)).items())
    return [vars(_control(declared, value, size)) for declared, value in values if value != {}]


def kind_control(node: Node) -> list[dict[str, Any]]:
    """Return the control of a node's class; none for a class that the menus do not offer."""
    name, choices = name_of(type(node)), alternatives(node)
    doc = "class of the node: operands, colour and falloff stay"
    return [vars(Control.choice(KIND, name, choices, doc))] if name in choices else []


def _control(parameter: Parameter, value: Any, size: float) -> Control:
    doc, quantity = described(parameter), parameter.quantity
    unit = UNITS.get(quantity, "°" if quantity is Quantity.ANGLE else "")
    if quantity is Quantity.COLOR:
        return Control(parameter.name, "color", hex_color(value), doc)
    if quantity is Quantity.FALLOFF:
        names, curve = tuple(FALLOFF_NAMES), _curve(value)
        return Control(parameter.name, "choice", _falloff_name(value), doc, choices=names, curve=curve)
    if quantity is Quantity.CHOICE:
        return Control.choice(parameter.name, value, parameter.choices, doc)
    if quantity is Quantity.OUTLINE:
        return Control(parameter.name, "path", value.path, doc)
    if quantity in NUMBERS and not isinstance(value, tuple):
        low, high = _ends(parameter, value, size)
        step = 1.0 if parameter.whole else (high - low) / STEPS
        return Control(parameter.name, "number", value, doc, unit, low, high, step)
    if quantity in VECTORS or quantity is Quantity.NUMBERS:
        return Control(parameter.name, "vector", list(value), doc, unit)
    if quantity in LISTS:
        rows = [list(row) if isinstance(row, tuple) else row for row in value]
        return Control(parameter.name, "list", rows, doc, unit)
    return Control(parameter.name, "text", _shortened(value), doc, unit)


def option_control(
    option: Option, value: Any, low: float | None = None, high: float | None = None
) -> dict[str, Any]:
    """Return the control of an option of a function or a class, with other ends of its slider, if given."""
    kind, choices, values = "field", option.choices, option.values
    low, high = values.low if low is None else low, values.high if high is None else high
    if option.kind is bool:
        kind = "switch"
    elif choices:
        kind = "choice"
        named = value if value is None or hasattr(value, "name") else option.kind(value)
        value = "none" if named is None else named.name.lower()
    elif option.kind in (Rgb, Rgba):
        kind, value = "color", hex_color(tuple(value)[:3])
    elif isfinite(high - low):
        kind = "number"
        low, high = (low, high) if value is None else (min(low, value), max(high, value))
    if kind != "number":
        low = high = 0.0
    step = 1.0 if option.kind is int else (high - low) / STEPS
    slider = values.unit, low, high, step, choices
    word = option.name if option.name in TEXTS else ""
    return vars(Control(option.name, kind, value, option.doc, *slider, label=values.label, word=word))


def parsed_option(of: Any, name: Any, raw: Any) -> Any:
    """Return what a page sent for an option of a function or a class, or raise `InvalidEdit`."""
    options = options_of(of)
    return options[one_of("option", name, options, InvalidEdit)].parsed(raw, InvalidEdit)


def _ends(parameter: Parameter, value: float | None, size: float) -> tuple[float, float]:
    """Return the ends of a slider: the declared range, or one that holds the value."""
    present = abs(value or 0.0)
    match parameter.quantity:
        case Quantity.ANGLE:
            reach = max(ANGLE_REACH, present)
        case Quantity.FACTOR | Quantity.NUMBERS:
            reach = SLIDER_REACH * max(1.0, present)
        case _:
            reach = max(size, present)
    least = -reach if parameter.quantity in SIGNED else reach / STEPS
    return max(parameter.low, least), min(parameter.high, reach)


def hex_color(rgb: tuple[float, float, float]) -> str:
    """Return a colour as pages write it, "#rrggbb"."""
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in rgb)


def _falloff_name(falloff: Falloff) -> str:
    return next((name for name, other in FALLOFF_NAMES.items() if other == falloff), falloff.name)


@cache
def _curve(falloff: Falloff) -> str:
    """Return the field over the distance, from the top left to the bottom right; "" if its source is gone."""
    try:
        plain: Any = plain_python(falloff.value.func)  # type: ignore[arg-type]  # a Python function
    except OSError:
        return ""
    values = [float(plain(step / CURVE_STEPS)) for step in range(CURVE_STEPS + 1)]
    return " ".join(f"{step / CURVE_STEPS:.3f},{1.0 - value:.3f}" for step, value in enumerate(values))


def _shortened(value: Any) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def parsed(node: Node, name: str, raw: Any) -> Any:
    """Return what a page sent for a parameter as the value that the node's class takes.

    Raises
    ------
    InvalidEdit
        The node has no such parameter, or the text is no number.
    """
    declared = parameters_of(type(node))
    parameter = declared[one_of("parameter", name, declared, InvalidEdit)]
    if parameter.quantity is Quantity.WIDTH and raw in (None, ""):
        return None
    if parameter.quantity in (Quantity.COLOR, Quantity.FALLOFF, Quantity.CHOICE):
        return raw
    if parameter.quantity is Quantity.OUTLINE:
        return parameter.check(raw)

    def numbers(part: Any) -> Any:
        if isinstance(part, list | tuple):
            return tuple(map(numbers, part))
        return number_of(name, part, InvalidEdit)

    return numbers(raw)


def exchanged(value: Any, index: object, raw: Any) -> Any:
    """Return nested tuples with one number exchanged."""
    if index in ((), []):
        return raw
    if not isinstance(index, list) or not isinstance(value, tuple) or index[0] not in range(len(value)):
        raise InvalidEdit(f"index: expected that of a number of the parameter, got {describe(index)}")
    first, *rest = index
    return (*value[:first], exchanged(value[first], rest, raw), *value[first + 1 :])
