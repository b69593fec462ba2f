"""Typed functions read as plain Python, in double or single precision: what a definition is tried with.

A typed function is Python already. `reference` gives it a `wp` whose maths is NumPy's, and what it calls too:
the formula runs as it is written, at once and without a compile.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable
from functools import partial
from types import FunctionType
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.typed.instantiate import references

Precision = type[np.float64] | type[np.float32]


class Vector(np.ndarray[Any, np.dtype[np.floating[Any]]]):
    """A small vector with components x, y, z, w."""

    x = property(lambda self: self[0])
    y = property(lambda self: self[1])
    z = property(lambda self: self[2])
    w = property(lambda self: self[3])


def vector(*components: Any, size: int = 0, precision: Precision = np.float64) -> Vector:
    """A vector of these components; of zeros where none, of one number where one is given."""
    if len(components) == 1 and np.ndim(components[0]):
        components = tuple(components[0])
    if len(components) <= 1:
        components = (components[0] if components else 0.0,) * size
    return np.array(components, precision).view(Vector)


def reference(function: FunctionType, precision: Precision = np.float64) -> FunctionType:
    """`function` in plain Python, and with it everything that it calls."""
    return _Reading(precision).function(function)


def _normalize(v: Any) -> Any:
    length = np.linalg.norm(v)
    return v / length if length > 0.0 else v * 0.0


def _whole_vector(size: int) -> Callable[..., NDArray[np.int64]]:
    return lambda *components: np.array(components or (0,) * size, np.int64)


_MATHS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in ("abs", "ceil", "cos", "cross", "dot", "exp", "floor", "log")},
    **{name: getattr(np, name) for name in ("sin", "sqrt", "tan", "trunc")},
    **{name: getattr(np, "arc" + name[1:]) for name in ("acos", "asin", "atan", "atan2")},
    "clamp": lambda x, low, high: np.minimum(np.maximum(x, low), high),
    "cw_div": np.divide,
    "cw_mul": np.multiply,
    "length": np.linalg.norm,
    "length_sq": lambda v: np.dot(v, v),
    "lerp": lambda a, b, t: a * (1.0 - t) + b * t,
    "max": np.maximum,
    "min": np.minimum,
    "normalize": _normalize,
    "pow": np.power,
    "sign": lambda x: -1.0 if x < 0.0 else 1.0,
    "where": lambda condition, chosen, other: chosen if condition else other,
    "int32": int,
    "uint32": np.uint32,
    "bool": bool,
    **{f"vec{size}i": _whole_vector(size) for size in (2, 3, 4)},
}
"""Warp's names, as far as GLSL shares them (`builtins`)."""


def divided(a: Any, b: Any) -> Any:
    """A / b as devices have it: whole numbers lose what is behind the point, and 0 is no error."""
    if isinstance(a, int | np.integer) and isinstance(b, int | np.integer):
        return int(np.trunc(a / b)) if b else 0
    return np.divide(a, b)


def remainder(a: Any, b: Any) -> Any:
    """A % b as devices have it: with the sign of a."""
    if isinstance(a, int | np.integer) and isinstance(b, int | np.integer):
        return a - b * divided(a, b)
    return np.fmod(a, b)


MOST_TURNS = 65_535
"""Turns that the loops of one call may take: as many as the software rasteriser llvmpipe lets one take."""


class EndlessLoop(RuntimeError):
    """The loops of a function turn more often than any device should."""


def counted(turns: int, line: int) -> int:
    """One turn more; `EndlessLoop` beyond the last."""
    if turns >= MOST_TURNS:
        raise EndlessLoop(f"the loop in line {line} takes more than {MOST_TURNS:,} turns; let it end sooner")
    return turns + 1


_HELPERS = {"_divided": divided, "_remainder": remainder, "_counted": counted}
_WORDS: dict[type[ast.operator], str] = {ast.Div: "_divided", ast.Mod: "_remainder"}


class _AsOnDevices(ast.NodeTransformer):
    """Operators that mean something else in Python than on devices become calls; loops count turns."""

    def __init__(self, first: int) -> None:
        self._first = first

    def visit_For(self, node: ast.For) -> ast.stmt:
        return self._counting(node)

    def visit_While(self, node: ast.While) -> ast.stmt:
        return self._counting(node)

    def _counting(self, node: ast.For | ast.While) -> ast.stmt:
        line = self._first + node.lineno - 1
        self.generic_visit(node)
        node.body[:0] = ast.parse(f"_turns = _counted(_turns, {line})").body
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if type(node.op) not in _WORDS:
            return node
        return ast.Call(ast.Name(_WORDS[type(node.op)], ast.Load()), [node.left, node.right], [])

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        if type(node.op) not in _WORDS:
            self.generic_visit(node)
            return node
        read = ast.parse(ast.unparse(node.target), mode="eval").body
        return self.visit(ast.Assign([node.target], ast.BinOp(read, node.op, node.value)))  # type: ignore[no-any-return]  # ast.visit is untyped


def _in_words(function: FunctionType, scope: dict[str, Any]) -> FunctionType:
    """`function` over `scope`, at the same lines, with a device's arithmetic and loops that end."""
    lines, first = inspect.getsourcelines(function)
    tree = ast.parse(textwrap.dedent("".join(lines)))
    (definition,) = tree.body
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list = []
    definition.returns = None
    for argument in definition.args.args:
        argument.annotation = None
    _AsOnDevices(first).visit(tree)
    definition.body[:0] = ast.parse("_turns = 0").body
    ast.increment_lineno(tree, first - 1)
    exec(compile(ast.fix_missing_locations(tree), function.__code__.co_filename, "exec"), scope)
    result: FunctionType = scope[function.__name__]
    return result


class _Warp:
    """What a function sees in place of the module `warp`."""

    def __init__(self, maths: dict[str, Callable[..., Any]]) -> None:
        self._maths = maths

    def __getattr__(self, name: str) -> Any:
        return self._maths[name] if name in self._maths else getattr(wp, name)


class _Reading:
    """Functions made anew for one precision."""

    def __init__(self, precision: Precision) -> None:
        vectors = {f"vec{size}": partial(vector, size=size, precision=precision) for size in (2, 3, 4)}
        self._maths = {**_MATHS, "float32": precision, **vectors}
        self._stand_ins = {id(getattr(wp, name)): stand_in for name, stand_in in self._maths.items()}
        self._warp = _Warp(self._maths)
        self._float = precision
        self._made: dict[FunctionType, FunctionType] = {}

    def function(self, function: FunctionType) -> FunctionType:
        if function not in self._made:
            seen = {name: self._substitute(value) for name, value in references(function).items()}
            scope = {**function.__globals__, **seen, "float": self._float, **_HELPERS}
            self._made[function] = _in_words(function, scope)
        return self._made[function]

    def _substitute(self, value: Any) -> Any:
        if value is wp:
            return self._warp
        if id(value) in self._stand_ins:
            return self._stand_ins[id(value)]
        if isinstance(value, wp.Function) and isinstance(value.func, FunctionType):
            return self.function(value.func)
        return value
