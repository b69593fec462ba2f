"""Formulas of lessons as JavaScript, for the pages of lessons."""

import ast
import json
import re
from collections.abc import Mapping

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
    '((m.f(q, 0) + (2 * m.f(q, 1))) >= m.share(q, (q) => (m.owner(q) === 1)))'
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
        kinds = measures[name].arguments
        parts = [
            f"(q) => {part(argument)}" if kind == "formula" else part(argument)
            for kind, argument in zip(kinds, arguments, strict=True)
        ]
        return f"m.{name}({', '.join(['q', *parts])})" if parts else f"m.{name}(q)"

    return part(ast.parse(text.strip(), mode="eval").body)


def pieces(text: str, definitions: Mapping[str, str]) -> list[str]:
    """Return a text with formulas in braces as HTML and formulas in turns; symbols are marked in the HTML."""
    parts = PLACEHOLDER.split(text)
    return [part if i % 2 else marked_text(part, definitions) for i, part in enumerate(parts)]


def marked_text(text: str, definitions: Mapping[str, str]) -> str:
    """Return a text as HTML with marked symbols."""
    escaped = re.sub("&", "&amp;", text).replace("<", "&lt;").replace(">", "&gt;")
    return marked(escaped, definitions=definitions)
