"""Typed functions as plain Python, in double or single precision, for trials of custom definitions.

A typed function is Python already. `plain_python` replaces Warp's maths by NumPy's, in the function and in
all its callees, so that it runs at once, without a compiler. `find_changed_constants` finds variables that
Warp would take for constants.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from functools import partial
from types import FunctionType
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.transpile.specialize import referenced_values

Precision = type[np.float64] | type[np.float32]


class Vector(np.ndarray[Any, np.dtype[np.floating[Any]]]):
    """Vector of up to four components, which are also named x, y, z and w."""

    x = property(lambda self: self[0])
    y = property(lambda self: self[1])
    z = property(lambda self: self[2])
    w = property(lambda self: self[3])


def vector(*components: Any, size: int = 0, precision: Precision = np.float64) -> Vector:
    """Return a vector of these components; a single number fills it, and no number leaves it zero."""
    if len(components) == 1 and np.ndim(components[0]):
        components = tuple(components[0])
    if len(components) <= 1:
        components = (components[0] if components else 0.0,) * size
    return np.array(components, precision).view(Vector)


def plain_python(function: FunctionType, precision: Precision = np.float64) -> FunctionType:
    """Return `function` and all its callees as plain Python of this precision."""
    return PythonTranslation(precision).function(function)


def _normalize(v: Any) -> Any:
    length = np.linalg.norm(v)
    return v / length if length > 0.0 else v * 0.0


def _filled(shape: tuple[int, ...], kind: type[np.generic], *components: Any) -> NDArray[Any]:
    """Return an array of these components, of zeros without any."""
    return np.array(components, kind).reshape(shape) if components else np.zeros(shape, kind)


def _whole_vector(size: int) -> Callable[..., NDArray[np.int64]]:
    return lambda *components: np.array(components or (0,) * size, np.int64)


def _round(x: Any) -> Any:
    """Return the nearest whole number, and of two the one away from 0."""
    whole = np.trunc(x)
    return whole + np.sign(x) if abs(x - whole) >= 0.5 else whole


def _whole_of_32_bits(x: Any) -> int:
    """Return a whole number as devices keep it: from −2³¹ to 2³¹ − 1."""
    return (int(x) + (1 << 31)) % (1 << 32) - (1 << 31)


_MATHS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in ("abs", "ceil", "cos", "cross", "dot", "exp", "floor", "log")},
    **{name: getattr(np, name) for name in ("cbrt", "cosh", "degrees", "log2", "log10", "radians", "rint")},
    **{name: getattr(np, name) for name in ("sin", "sinh", "sqrt", "tan", "tanh", "trunc")},
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
    "frac": lambda x: x - np.trunc(x),
    "round": _round,
    "sign": lambda x: -1.0 if x < 0.0 else 1.0,
    "step": lambda x: 1.0 if x < 0.0 else 0.0,
    "where": lambda condition, chosen, other: chosen if condition else other,
    "int32": _whole_of_32_bits,
    "uint32": lambda x: np.uint32(int(x) % (1 << 32)),
    "bool": bool,
    **{f"vec{size}i": _whole_vector(size) for size in (2, 3, 4)},
}
"""NumPy's functions by the names that Warp gives them, for all that GLSL shares (`builtins`)."""


_WHOLE = (int, np.integer)


def divide(a: Any, b: Any) -> Any:
    """Return a / b as devices compute it: integers are truncated, and division by 0 is no error."""
    if not (isinstance(a, _WHOLE) and isinstance(b, _WHOLE)):
        return np.divide(a, b)
    size = abs(int(a)) // abs(int(b)) if b else 0
    return size if (a < 0) == (b < 0) else -size


def remainder(a: Any, b: Any) -> Any:
    """Return a % b as devices compute it: with the sign of a."""
    if not (isinstance(a, _WHOLE) and isinstance(b, _WHOLE)):
        return np.fmod(a, b)
    return a - b * divide(a, b)


MAX_LOOP_TURNS = 65_535
"""Loop turns that one call may take in all: the limit of one loop in the software rasteriser llvmpipe."""


class EndlessLoop(RuntimeError):
    """Loops that take more turns than `MAX_LOOP_TURNS`."""


def count_turn(turns: int, line: int) -> int:
    """Count a turn of a loop; raise `EndlessLoop` after the last that is allowed."""
    if turns >= MAX_LOOP_TURNS:
        raise EndlessLoop(
            f"the loop in line {line} takes more than {MAX_LOOP_TURNS:,} turns; let it end sooner"
        )
    return turns + 1


_HELPERS = {"_divide": divide, "_remainder": remainder, "_count_turn": count_turn}
_OPERATOR_CALLS: dict[type[ast.operator], str] = {ast.Div: "_divide", ast.Mod: "_remainder"}


class _DeviceArithmetic(ast.NodeTransformer):
    """Transformer: operators whose meaning differs on devices change, and loops count their turns."""

    def __init__(self, first: int) -> None:
        self._first = first

    def visit_For(self, node: ast.For) -> ast.stmt:
        return self._count_turns(node)

    def visit_While(self, node: ast.While) -> ast.stmt:
        return self._count_turns(node)

    def _count_turns(self, node: ast.For | ast.While) -> ast.stmt:
        line = self._first + node.lineno - 1
        self.generic_visit(node)
        node.body[:0] = ast.parse(f"_turns = _count_turn(_turns, {line})").body
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if type(node.op) not in _OPERATOR_CALLS:
            return node
        return ast.Call(ast.Name(_OPERATOR_CALLS[type(node.op)], ast.Load()), [node.left, node.right], [])

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        """Write ``a += b`` as ``a = a + b``: arrays would change in place, vectors on devices do not."""
        read = ast.parse(ast.unparse(node.target), mode="eval").body
        return self.visit(ast.Assign([node.target], ast.BinOp(read, node.op, node.value)))  # type: ignore[no-any-return]  # ast.visit is untyped


def _compile(function: FunctionType, scope: dict[str, Any]) -> FunctionType:
    """Compile `function` over `scope`, at the same lines, with device arithmetic and loops that end."""
    lines, first = inspect.getsourcelines(function)
    tree = ast.parse(textwrap.dedent("".join(lines)))
    (definition,) = tree.body
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list = []
    definition.returns = None
    for argument in definition.args.args:
        argument.annotation = None
    _DeviceArithmetic(first).visit(tree)
    definition.body[:0] = ast.parse("_turns = 0").body
    ast.increment_lineno(tree, first - 1)
    exec(compile(ast.fix_missing_locations(tree), function.__code__.co_filename, "exec"), scope)
    result: FunctionType = scope[function.__name__]
    return result


class _Warp:
    """Stand-in for the module `warp`, with NumPy's maths."""

    def __init__(self, maths: dict[str, Callable[..., Any]]) -> None:
        self._maths = maths

    def __getattr__(self, name: str) -> Any:
        return self._maths[name] if name in self._maths else getattr(wp, name)


class PythonTranslation:
    """Plain Python of functions, all in one precision; each is translated once."""

    def __init__(self, precision: Precision) -> None:
        vectors = {f"vec{size}": partial(vector, size=size, precision=precision) for size in (2, 3, 4)}
        self._maths = {**_MATHS, "float32": precision, **vectors}
        self._stand_ins = {id(getattr(wp, name)): stand_in for name, stand_in in self._maths.items()}
        self._warp = _Warp(self._maths)
        self._float = precision
        self._translated: dict[FunctionType, FunctionType] = {}

    def function(self, function: FunctionType) -> FunctionType:
        """Return a function as plain Python."""
        if function not in self._translated:
            seen = {name: self._substitute(value) for name, value in referenced_values(function).items()}
            scope = {**function.__globals__, **seen, "float": self._float, **_HELPERS}
            self._translated[function] = _compile(function, scope)
        return self._translated[function]

    def _substitute(self, value: Any) -> Any:
        if value is wp:
            return self._warp
        if id(value) in self._stand_ins:
            return self._stand_ins[id(value)]
        if isinstance(value, wp.uint32 | wp.int32 | wp.float32):
            return self._stand_ins[id(type(value))](value.value)
        if isinstance(value, wp.Function) and isinstance(value.func, FunctionType):
            return self._callee(value.func)
        if isinstance(value, type) and hasattr(value, "_shape_"):  # a vector or matrix of another size
            whole = vars(value)["_wp_scalar_type_"] in (wp.int32, wp.uint32)
            return partial(_filled, value._shape_, np.int64 if whole else self._float)
        return value

    def _callee(self, function: FunctionType) -> Callable[..., Any]:
        """Return a function that is translated when it is first called: tables name many, and use few."""
        return lambda *arguments: self.function(function)(*arguments)


def find_changed_constants(definition: ast.FunctionDef) -> Iterator[tuple[str, int]]:
    """Yield each variable that starts as a plain number and changes in a loop, with the line."""
    constants: set[str] = set()
    for statement in definition.body:
        yield from _find_changed(statement, constants, in_loop=False)


def _find_changed(statement: ast.stmt, constants: set[str], *, in_loop: bool) -> Iterator[tuple[str, int]]:
    match statement:
        case ast.Assign(targets=[ast.Name(id=name)], value=value):
            if in_loop and name in constants:
                yield name, statement.lineno
            elif not in_loop:
                (constants.add if _is_number(value) else constants.discard)(name)
        case ast.AugAssign(target=ast.Name(id=name)):
            if in_loop and name in constants:
                yield name, statement.lineno
            elif not in_loop:
                constants.discard(name)
        case ast.For(body=body) | ast.While(body=body):
            for inner in body:
                yield from _find_changed(inner, constants, in_loop=True)
        case ast.If(body=body, orelse=orelse):
            for inner in (*body, *orelse):
                yield from _find_changed(inner, constants, in_loop=in_loop)


def _is_number(value: ast.expr) -> bool:
    match value:
        case ast.Constant(value=int() | float()):
            return True
        case ast.UnaryOp(operand=operand):
            return _is_number(operand)
    return False
