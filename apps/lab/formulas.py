"""Formulas of lessons: arithmetic and comparisons of measures, such as ``distance(0, 1) < 2*radius(0)``.

A formula is parsed and checked when a lesson is loaded. It can only name measures, so that files of lessons
need no trust.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from decals.apps.lab.errors import InvalidLesson

MAX_LENGTH = 300
"""Most characters of a formula."""


def _of_numbers(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return an operator that takes truth values as 0 and 1."""
    return lambda *operands: function(*(1.0 * operand for operand in operands))


OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: _of_numbers(operator.add),
    ast.Sub: _of_numbers(operator.sub),
    ast.Mult: _of_numbers(operator.mul),
    ast.Div: _of_numbers(np.divide),
    ast.Pow: _of_numbers(np.power),
    ast.USub: _of_numbers(operator.neg),
    ast.Not: np.logical_not,
    ast.And: np.logical_and,
    ast.Or: np.logical_or,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
"""Operators of formulas."""

Evaluate = Callable[[Any], Any]
"""A formula, or a part of one, as a function of a scope."""


@dataclass(frozen=True)
class Measure:
    """A name that formulas can use.

    Attributes
    ----------
    function
        Function of a scope and the arguments.
    arguments
        Kind of each argument: "number", or "formula" for one that is evaluated at other points.
    """

    function: Callable[..., Any]
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Formula:
    """A checked formula.

    Attributes
    ----------
    text
        The formula as written.
    part
        Computes its value.

    Examples
    --------
    >>> from decals.apps.lab.formulas import Measure, parse
    >>> measures = {"double": Measure(lambda scope, x: 2 * x, ("number",))}
    >>> formula = parse("double(3) + x > 10", measures, {"x"})
    >>> bool(formula.evaluate({"x": 5.0}))
    True
    """

    text: str
    part: Evaluate

    def evaluate(self, scope: Any) -> Any:
        """Return the value in a scope: a number, a truth value, or an array; NaN if undefined."""
        with np.errstate(all="ignore"):
            return self.part(scope)


def parse(text: object, measures: Mapping[str, Measure], variables: frozenset[str] | set[str]) -> Formula:
    """Return a checked formula.

    Parameters
    ----------
    text
        The formula.
    measures
        Names of functions and values.
    variables
        Names that the scope gives, ``scope["x"]``.

    Raises
    ------
    InvalidLesson
        The text is no formula, or names something that does not exist.
    """
    if not isinstance(text, str) or not text.strip() or len(text) > MAX_LENGTH:
        raise InvalidLesson(f"expected a formula of 1 to {MAX_LENGTH} characters, got {text!r:.60}")
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InvalidLesson(f"expected a formula such as 'distance(0, 1) < 2', got {text!r}") from None
    return Formula(text, _Parser(text, measures, variables).part(tree.body))


@dataclass(frozen=True)
class _Parser:
    text: str
    measures: Mapping[str, Measure]
    variables: frozenset[str] | set[str]

    def part(self, node: ast.AST) -> Evaluate:
        """Return a part of the formula as a function of the scope."""
        match node:
            case ast.Constant(value=bool() | int() | float() as value):
                number = np.float64(value)
                return lambda scope: number
            case ast.Name(id=name):
                return self._name(name)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(name, arguments)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
                return self._applied(op, operand)
            case ast.BinOp(op=op, left=left, right=right) if type(op) in OPERATORS:
                return self._applied(op, left, right)
            case ast.BoolOp(op=op, values=values):
                return self._joined(OPERATORS[type(op)], [self.part(value) for value in values])
            case ast.Compare(left=left, ops=ops, comparators=others) if {*map(type, ops)} <= {*OPERATORS}:
                sides = [left, *others]
                pairs = zip(ops, sides[:-1], sides[1:], strict=True)
                return self._joined(np.logical_and, [self._applied(*pair) for pair in pairs])
        raise InvalidLesson(
            f"formula {self.text!r}: expected numbers, measures, + - * / **, comparisons, and, or, not; "
            f"got {ast.unparse(node)!r}"
        )

    def _applied(self, op: ast.AST, *operands: ast.AST) -> Evaluate:
        function, parts = OPERATORS[type(op)], [self.part(operand) for operand in operands]
        return lambda scope: function(*(part(scope) for part in parts))

    @staticmethod
    def _joined(function: Callable[..., Any], parts: list[Evaluate]) -> Evaluate:
        def evaluate(scope: Any) -> Any:
            value = parts[0](scope)
            for part in parts[1:]:
                value = function(value, part(scope))
            return value

        return evaluate

    def _name(self, name: str) -> Evaluate:
        if name in self.variables:
            return lambda scope: scope[name]
        return self._call(name, [])

    def _call(self, name: str, arguments: list[ast.expr]) -> Evaluate:
        measure = self.measures.get(name)
        if measure is None:
            known = ", ".join(sorted({*self.measures, *self.variables}))
            raise InvalidLesson(f"formula {self.text!r}: unknown name {name!r}; known are {known}")
        if len(arguments) != len(measure.arguments):
            raise InvalidLesson(
                f"formula {self.text!r}: {name} takes {len(measure.arguments)} arguments, "
                f"got {len(arguments)}"
            )
        parts = [self.part(argument) for argument in arguments]
        kinds = measure.arguments

        def evaluate(scope: Any) -> Any:
            pairs = zip(kinds, parts, strict=True)
            return measure.function(scope, *(p if kind == "formula" else p(scope) for kind, p in pairs))

        return evaluate
