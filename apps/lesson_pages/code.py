"""Formulas of lessons as JavaScript, for the pages of lessons."""

import ast
import json
import re
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from decals.apps.lab.bindings import AXES, DecalPath, binding
from decals.apps.lab.errors import InvalidLesson
from decals.apps.lab.formulas import Measure
from decals.apps.lab.lesson import PLACEHOLDER
from decals.apps.lab.symbols import marked
from decals.model import Interaction
from decals.record import Contact

SIGNS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
    ast.USub: "-",
    ast.Not: "!",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "===",
    ast.NotEq: "!==",
    ast.And: "&&",
    ast.Or: "||",
}
"""Operators of formulas in JavaScript."""

WORDS = [kind.name.lower() for kind in (*Contact, *Interaction)]
"""Names of modes and interactions, which are texts in JavaScript."""

VARIABLES = "x", "y"

FORMS = {
    "abs": "Math.abs({})",
    "max": "Math.max({}, {})",
    "where": "({} ? {} : {})",
    "count": "m.viewer.decals.numbers.length",
    "contact": "m.viewer.mode",
    "stiffness": "m.viewer.stiffness",
    "layer": "m.row({}).layer",
    "interaction": "m.row({}).interaction",
    "owner": "q.owner",
    "stretch": "q.stretch",
    "folded": "q.folded",
}
"""Measures in plain JavaScript, with places for arguments. The others are methods in ``measures.mjs``."""


def javascript(text: str, measures: Mapping[str, Measure], known: frozenset[str]) -> str:
    """Return a checked formula as an expression of JavaScript, of measures ``m`` at a point ``q``.

    Raises
    ------
    InvalidLesson
        The formula has a measure that pages do not know.

    Examples
    --------
    >>> from decals.apps.lab.measures import MEASURES
    >>> from decals.apps.lesson_pages.code import javascript
    >>> javascript("f(0) + 2*f(1) >= share(owner == 1)", MEASURES, frozenset({"f", "share", "owner"}))
    '((m.f(q, 0) + (2 * m.f(q, 1))) >= m.share(q, (q) => (q.owner === 1)))'
    """

    def part(node: ast.AST) -> str:
        match node:
            case ast.Constant(value=value):
                return json.dumps(value)
            case ast.Name(id=name) if name in VARIABLES:
                return f"q.{name}"
            case ast.Name(id=name) if name in WORDS:
                return json.dumps(name)
            case ast.Name(id=name):
                return call(name, [])
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return call(name, arguments)
            case ast.UnaryOp(op=op, operand=operand):
                return f"({SIGNS[type(op)]}{part(operand)})"
            case ast.BinOp(op=op, left=left, right=right):
                return f"({part(left)} {SIGNS[type(op)]} {part(right)})"
            case ast.BoolOp(op=op, values=values):
                return "(" + f" {SIGNS[type(op)]} ".join(f"!!{part(value)}" for value in values) + ")"
            case ast.Compare(left=left, ops=ops, comparators=others):
                sides = [part(side) for side in (left, *others)]
                pairs = zip(sides[:-1], ops, sides[1:], strict=True)
                return "(" + " && ".join(f"{a} {SIGNS[type(op)]} {b}" for a, op, b in pairs) + ")"
        raise InvalidLesson(f"formula {text!r}: expected a formula of lessons, got {ast.unparse(node)!r}")

    def call(name: str, arguments: list[ast.expr]) -> str:
        if name not in known:
            raise InvalidLesson(
                f"formula {text!r}: pages do not know {name!r}; known are {', '.join(sorted(known))}"
            )
        if name in FORMS:
            return FORMS[name].format(*map(part, arguments))
        kinds = measures[name].arguments
        parts = [
            f"(q) => {part(argument)}" if kind == "formula" else part(argument)
            for kind, argument in zip(kinds, arguments, strict=True)
        ]
        return f"m.{name}({', '.join(['q', *parts])})" if parts else f"m.{name}(q)"

    return part(ast.parse(text.strip(), mode="eval").body)


def said(text: str, code: Callable[[str], str], definitions: Mapping[str, str]) -> str:
    """Return a text with formulas in braces as an expression of JavaScript for its HTML; symbols are marked.

    Code is a function that returns formulas in JavaScript.
    """
    parts = PLACEHOLDER.split(text)
    return " + ".join(
        f"m.say({code(part)})" if i % 2 else script_json(marked_text(part, definitions))
        for i, part in enumerate(parts)
    )


def access(path: str) -> dict[str, "Code"]:
    """Return functions that read and write what a slider moves: a value of a page ``p`` of a lesson.

    The one that writes a value of decals returns the step of undo that it continued or began.
    """
    read, write = {
        "contact": ("p.viewer.mode", "p.viewer.set({ mode: value })"),
        "stiffness": ("p.viewer.stiffness", "p.viewer.set({ stiffness: value })"),
        "mapping": ("undefined", "p.map(value)"),  # the choice shows the value
        **{
            f"probe.{axis}": (f"p.probe[{i}]", f"p.moveProbe(p.probe.with({i}, value))")
            for i, axis in enumerate(AXES)
        },
    }.get(path) or _access_to_decals(path)
    return {"read": Code(f"(p) => {read}"), "write": Code(f"(p, value) => {write}")}


def _access_to_decals(path: str) -> tuple[str, str]:
    match binding(path):
        case DecalPath(row=int(row), name=name) if name in AXES:
            i = AXES.index(name)
            moved = f"p.measures.above({{ ...row, position: row.position.with({i}, value) }})"
            change = f"(row) => (({{ position, normal }}) => ({{ position, normal }}))({moved})"
            return (
                f"p.viewer.decals.rows[{row}]?.position[{i}]",
                f"p.viewer.editRows([{row}], {change}, p.step)",
            )
        case DecalPath(row=row, name=name):
            numbers = "p.viewer.decals.numbers" if row is None else f"[{row}]"
            return (
                f"p.viewer.decals.rows[{row or 0}]?.{name}",
                f"p.viewer.editRows({numbers}, () => ({{ {name}: value }}), p.step)",
            )
    return "undefined", "undefined"  # the sliders of a table are read when its state is shown


class Code(str):
    """A text that is JavaScript."""


def script(value: Any) -> str:
    """Return a value as JavaScript that may stand in a script; `Code` in it stays as it is."""
    match value:
        case Code():
            return value
        case dict():
            return "{" + ", ".join(f"{script_json(name)}: {script(one)}" for name, one in value.items()) + "}"
        case list() | tuple():
            return "[" + ", ".join(map(script, value)) + "]"
    return script_json(value)


def script_json(value: Any) -> str:
    """Return a value as JSON that may stand in a script."""
    return msgspec.json.encode(value).decode().replace("<", "\\u003c")


def marked_text(text: str, definitions: Mapping[str, str]) -> str:
    """Return a text as HTML with marked symbols."""
    escaped = re.sub("&", "&amp;", text).replace("<", "&lt;").replace(">", "&gt;")
    return marked(escaped, definitions=definitions)
