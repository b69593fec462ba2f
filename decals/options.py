"""Options that functions and classes declare, as a form shows them: kind, usual range, unit and text.

A parameter is an option if its annotation is a number, a truth value, a colour or an enumeration, or contains
`Values`. A parameter whose type is a class with options, such as a background, is replaced by those options.
The text is that of the docstring.
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, is_dataclass
from enum import Enum
from functools import cache, reduce
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from blobtree.colors import Rgb, Rgba, color_rgb
from blobtree.declare.parameters import with_parameters
from blobtree.validation import describe, truth
from decals.errors import InvalidInput
from decals.validation import member, number_of, one_of, whole_number

MAX_WHOLE = 1 << 53
"""Largest whole number that pages and files hold exactly."""

Source = Callable[..., Any]
"""A function, or a class whose fields are options."""


@dataclass(frozen=True)
class Values:
    """Usual values of an option, in its annotation; the function or class checks the values itself.

    Attributes
    ----------
    low, high
        Ends of a slider; other values are typed in.
    unit
        Unit of a number.
    kind
        Type of one value, where an array holds one for each decal or pixel.
    label
        What a form calls the option in place of its name.
    """

    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    kind: Any = None
    label: str = ""


@dataclass(frozen=True)
class Option:
    """One option.

    Attributes
    ----------
    name
        Name of the parameter; "background.top" for the field `top` of its value.
    kind
        Its type: `int`, `float`, `bool`, a subclass of `Enum`, or `Rgb` or `Rgba` for a colour.
    doc
        What it means.
    values
        Its usual values.
    optional
        None is a value, too.
    default
        Its value if none is given.
    """

    name: str
    kind: Any
    doc: str
    values: Values
    optional: bool
    default: Any

    @property
    def choices(self) -> tuple[str, ...]:
        """Names of an enumeration, and of None."""
        named = tuple(one.name.lower() for one in self.kind) if _is_enum(self.kind) else ()
        return ("none",) * self.optional + named if named else ()

    def parsed(self, raw: Any, error: type[InvalidInput]) -> Any:
        """Return a value that a form sent, perhaps as text, or raise an error."""
        if raw in (None, "", "none") and self.optional:
            return None
        if self.choices:
            one_of(self.name, raw, self.choices, error)
            return member(self.name, raw, self.kind, error)
        if self.kind is bool:
            return truth(self.name, raw, error)
        if self.kind in (Rgb, Rgba):
            return color_rgb(self.name, raw, error)
        number = number_of(self.name, raw, error)
        if self.kind is int:
            if not number.is_integer():
                raise error(f"{self.name}: expected a whole number, got {describe(raw)}")
            return whole_number(self.name, int(number), -MAX_WHOLE, MAX_WHOLE, error)
        return number


def _is_enum(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Enum)


@cache
def options_of(source: Source) -> Mapping[str, Option]:
    """Return the options of a function or a class by their names, in the order of their declaration.

    Examples
    --------
    >>> from decals.options import options_of
    >>> from decals.rendering import Drawing
    >>> stiffness = options_of(Drawing)["stiffness"]
    >>> stiffness.kind, stiffness.values.low
    (<class 'float'>, 1.0)
    """
    docs, found = described(source), dict[str, Option]()
    for name, parameter in inspect.signature(source).parameters.items():
        kinds, values = _kinds(parameter.annotation)
        optional, default = type(None) in kinds, parameter.default
        kinds = [kind for kind in kinds if kind is not type(None)]
        kind = next(filter(_is_enum, kinds), kinds[0] if len(kinds) == 1 else None)
        if kind in (bool, int, float, Rgb, Rgba) or _is_enum(kind):
            found[name] = Option(name, kind, docs.get(name, ""), values, optional, default)
        elif is_dataclass(kind):
            for part in options_of(kind).values():  # type: ignore[arg-type]  # a class
                first = part.default if optional else reduce(getattr, part.name.split("."), default)
                whole = f"{name}.{part.name}"
                found[whole] = Option(whole, part.kind, part.doc, part.values, part.optional, first)
    return found


def _kinds(annotation: Any) -> tuple[list[Any], Values]:
    """Return the types of an annotation, and its usual values."""
    if get_origin(annotation) is Annotated:
        inner, *marks = get_args(annotation)
        values = next((mark for mark in marks if isinstance(mark, Values)), Values())
        return ([values.kind] if values.kind is not None else _kinds(inner)[0]), values
    parts = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
    return [*parts], Values()


def described(source: Source) -> dict[str, str]:
    """Return the first sentence on each parameter, from the docstring."""
    text, found = (inspect.getdoc(source) or "").replace("`", ""), dict[str, str]()
    for names, doc in re.findall(r"^(\w+(?:, \w+)*)(?: : .*)?\n((?:    .*(?:\n|$))+)", text, re.MULTILINE):
        found |= dict.fromkeys(names.split(", "), " ".join(doc.split()).split(". ")[0].rstrip("."))
    return found


def inherit_descriptions(kind: type) -> None:
    """Add to the docstring of a class the parameters that only its base describes."""
    title, own, known = "Parameters\n----------", inspect.cleandoc(kind.__doc__ or ""), described(kind)
    section = inspect.cleandoc(kind.__bases__[0].__doc__ or "").partition(title)[2].partition("\n\n")[0]
    entries = re.findall(r"^(\w+)(\n(?:    .*(?:\n|$))+)", section, re.MULTILINE)
    inherited = "".join(f"\n{name}{text.rstrip()}" for name, text in entries if name not in known)
    own = own if title in own else with_parameters(own, ())
    kind.__doc__ = own.replace(title, title + inherited, 1)


def values_of(source: Source, given: Any) -> dict[str, Any]:
    """Return the values that an object of a class has for its options, except of parts that are None."""
    values: dict[str, Any] = {}
    for name in options_of(source):
        *parts, last = name.split(".")
        part = reduce(getattr, parts, given)
        if part is not None:
            values[name] = getattr(part, last)
    return values


def arguments_of(source: Source, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values of options as arguments of the function or class, which may be objects themselves."""
    arguments: dict[str, Any] = {}
    for name, parameter in inspect.signature(source).parameters.items():
        parts = {key[len(name) + 1 :]: value for key, value in values.items() if key.startswith(f"{name}.")}
        if name in values:
            arguments[name] = values[name]
        elif parts:
            kind: Any = next(filter(is_dataclass, _kinds(parameter.annotation)[0]))
            arguments[name] = kind(**arguments_of(kind, parts))
    return arguments
