"""Directional derivatives of typed functions, by a transformation of their source (forward mode).

`directional_derivative` makes from a typed function the typed function of its value and its derivative, as if
every number were a dual number (Griewank & Walther 2008, Evaluating Derivatives, section 3.1). A parameter
that varies is followed by its tangent::

    @wp.func
    def bump(squared_distance: wp.float32) -> wp.float32:
        t = wp.max(1.0 - squared_distance, 0.0)
        return t * t * t

    bump_derivative = directional_derivative(bump)

    @wp.kernel
    def slopes(z: wp.array(dtype=wp.float32), out: wp.array(dtype=wp.float32)):
        i = wp.tid()
        value, slope = bump_derivative(z[i], 1.0)
        out[i] = slope

The gradient of a function of a point is its derivative along (1, 0, 0), (0, 1, 0) and (0, 0, 1), and the
derivative of a gradient along them is the Hessian. `partial_derivatives` follows all of them in one pass,
which computes the value once: a variable then has a tangent for each direction in which it varies.
An operator that reads the gradients of its operands (Gourmel et al. 2013) needs derivatives for its own
gradient: the chain rule takes ∂F/∂(∇a) to H_a.

* Each float, vector or matrix that depends on what varies has a tangent. Integers, bools and structs have
  none. Branches and loops are those of the function itself.
* A call of a typed function becomes a call of its derivative, in those arguments that vary. Built-in
  functions follow the rules in `derivative_rules`.
* An array that varies is followed by an array of tangents of the same layout. Arrays vary only where
  `varying` names them.
* The result is a typed function of the same subset of Python. It can be differentiated again, translated to
  GLSL and run as plain Python.
* At a kink, such as that of `max`, it is the derivative on one side. Where a slope is infinite, such as that
  of `sqrt` at 0, it is 0.
"""

import ast
import hashlib
import inspect
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from threading import RLock
from types import FunctionType, ModuleType, NoneType
from typing import Any, get_args, get_origin

import warp as wp

from blobtree.errors import UntranslatableFunction
from blobtree.transpile.derivative_rules import CASTS, RULES, STEPS, Rule
from blobtree.transpile.specialize import defined, referenced_values, row_choice, warp_function

_OPERATORS: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Mod: "%",
}
_SAME_TYPES = {float: wp.float32, int: wp.int32, bool: wp.bool}
_LOCK = RLock()
"""Held while functions are registered: Warp's registry is not safe for threads."""

Directions = tuple[frozenset[str], ...]
"""The parameters that vary in each direction."""

_TRANSFORMATIONS: dict[tuple[wp.Function, Directions], "_Transformation"] = {}
_PRIMALS: dict[wp.Function, tuple[wp.Function, Directions]] = {}
_PARTIALS: dict[tuple[wp.Function, tuple[str, ...]], wp.Function] = {}


def directional_derivative(function: Any, varying: Iterable[str] | None = None) -> Any:
    """Return the typed function of the value and the derivative of a typed function.

    Parameters
    ----------
    function
        A typed function (`wp.func`).
    varying
        Names of the parameters that vary; by default all floats, vectors and matrices, but no arrays.

    Returns
    -------
    wp.Function
        It takes the parameters of `function` in their order, each one that varies followed by its tangent, of
        the same type. It returns (value, derivative); for a function that returns several values, each float,
        vector or matrix followed by its derivative.

    Raises
    ------
    UntranslatableFunction
        The function uses what has no derivative here; the message names file and line. Or nothing varies, or
        the result is no float, vector or matrix.
    """
    hints = _hints(function)
    numeric = _numeric_parameters(hints)
    names = tuple(numeric if varying is None else varying)
    arrays = [name for name, hint in hints.items() if isinstance(hint, wp.array)]
    for name in names:
        if name not in numeric and name not in arrays:
            raise UntranslatableFunction(
                f"{function.key}: expected names of parameters that have derivatives "
                f"({', '.join(numeric + arrays) or 'it has none'}), got {name!r}"
            )
    if not names:
        raise UntranslatableFunction(f"{function.key}: expected a parameter that varies, got none; name one")
    return derivative_along(function, (frozenset(names),))


def derivative_along(function: Any, directions: Directions) -> wp.Function:
    """Return the typed function of a value and its derivatives in several directions, see `Directions`.

    Each parameter is followed by its tangents, one for each direction in which it varies. Each float, vector
    or matrix of the result is followed by its derivatives in all directions.
    """
    with _LOCK:
        return _compiled(_transformation(function, directions))


def partial_derivatives(function: Any, varying: Iterable[str] | None = None) -> Any:
    """Return the typed function of the value and the partial derivatives of a typed function, in one pass.

    Parameters
    ----------
    function
        A typed function (`wp.func`) with one result.
    varying
        Names of the floats and vectors by whose components it is derived; by default all.

    Returns
    -------
    wp.Function
        It takes the parameters of `function`. It returns the value and its derivative by each component of
        each parameter that varies, in their order.

    Raises
    ------
    UntranslatableFunction
        As for `directional_derivative`.
    """
    hints = _hints(function)
    numeric = [name for name in _numeric_parameters(hints) if len(_shape(hints[name])) < 2]
    names = tuple(numeric if varying is None else varying)
    if not names or not set(names) <= set(numeric):
        raise UntranslatableFunction(
            f"{function.key}: expected names of floats or vectors ({', '.join(numeric) or 'it has none'}), "
            f"got {', '.join(names) or 'none'}"
        )
    with _LOCK:
        if (function, names) not in _PARTIALS:
            _PARTIALS[function, names] = _partials(function, names, hints)
        return _PARTIALS[function, names]


def _partials(function: wp.Function, names: tuple[str, ...], hints: dict[str, Any]) -> wp.Function:
    units = {name: _units(_plain(hints[name])) for name in names}
    derivative = derivative_along(function, tuple(frozenset([name]) for name in names for _ in units[name]))
    parameters = [name for name in hints if name != "return"]
    arguments = ", ".join(", ".join([name, *units.get(name, ())]) for name in parameters)
    results = ", ".join(f"result{number}" for number in range(1 + sum(map(len, units.values()))))
    text = (
        f"def {function.key}_partials_{'_'.join(names)}({', '.join(parameters)}):\n"
        f'    """Return the value and the partial derivatives of {function.key}."""\n'
        f"    {results} = {derivative.key}({arguments})\n"
        f"    return {results}\n"
    )
    made = defined(text[4 : text.index("(")], text, {"wp": wp, derivative.key: derivative})
    made.__annotations__ = {**hints, "return": _hints(derivative)["return"]}
    made.__module__ = derivative.func.__module__
    return warp_function(made)


def _units(kind: Any) -> list[str]:
    """Return the source of the unit tangents of a float or a vector."""
    if kind is wp.float32:
        return ["1.0"]
    size = kind._length_
    rows = [", ".join(f"{float(i == j)}" for j in range(size)) for i in range(size)]
    return [f"wp.vec{size}({row})" for row in rows]


def differentiated(function: Any) -> tuple[wp.Function, Directions] | None:
    """Return the function and the directions of which this is the derivative, or None."""
    return _PRIMALS.get(function)


def _numeric_parameters(hints: dict[str, Any]) -> list[str]:
    return [name for name, hint in hints.items() if name != "return" and is_differentiable(hint)]


def is_differentiable(kind: Any) -> bool:
    """Return True for the types of numbers that have tangents: floats, and vectors and matrices of them."""
    kind = _plain(kind)
    return kind is wp.float32 or getattr(kind, "_wp_scalar_type_", None) is wp.float32


def _transformation(function: wp.Function, directions: Directions) -> "_Transformation":
    key = (function, directions)
    if key not in _TRANSFORMATIONS:
        _TRANSFORMATIONS[key] = _Transformation(function, directions)
    return _TRANSFORMATIONS[key]


def _compiled(transformation: "_Transformation") -> wp.Function:
    """Return the typed function of a transformation, which Warp and `inspect` can read again."""
    if transformation.derivative is None:
        callees = {name: _compiled(callee) for name, callee in transformation.callees.items()}
        scope = {**transformation.scope, **callees}
        made = defined(transformation.name, transformation.text, scope)
        made.__annotations__ = transformation.annotations()
        made.__module__ = f"{transformation.python.__module__}.derivatives"
        transformation.derivative = warp_function(made)
        _PRIMALS[transformation.derivative] = transformation.function, transformation.directions
    return transformation.derivative


def _hints(function: wp.Function) -> dict[str, Any]:
    return dict(getattr(function.func, "__annotations__", {}))


@dataclass(frozen=True)
class _Dual:
    """Source of an expression and of its tangents."""

    code: str
    tangents: tuple[str | None, ...] = ()
    """A text for each direction, None where the tangent is 0; empty if all are."""
    type: Any = None
    """Type in Warp; None where it has no part in any derivative."""

    def along(self, direction: int) -> str | None:
        """Return the tangent in a direction, None if it is 0."""
        return self.tangents[direction] if self.tangents else None

    @property
    def varies(self) -> bool:
        """True if a tangent is not 0."""
        return any(tangent is not None for tangent in self.tangents)


class _Transformation:
    """The source of a function's derivative.

    The body is written again and again, until no more variables are found that need tangents: one that gets
    its tangent late in a loop may be read before.
    """

    def __init__(self, function: wp.Function, directions: Directions) -> None:
        assert isinstance(function.func, FunctionType), f"{function.key} is built in"
        self.function = function
        self.python = function.func
        self.directions = directions
        self.hints = _hints(function)
        lines, self.first_line = inspect.getsourcelines(self.python)
        definition = ast.parse(textwrap.dedent("".join(lines))).body[0]
        assert isinstance(definition, ast.FunctionDef)
        self.definition = definition
        self.parameters = [argument.arg for argument in definition.args.args]
        names = {node.id for node in ast.walk(definition) if isinstance(node, ast.Name)} | set(
            self.parameters
        )
        self.scope: dict[str, Any] = {**self.python.__globals__, **referenced_values(self.python)}
        letters = ["d"] if len(directions) == 1 else [f"d{chr(97 + i)}" for i in range(len(directions))]
        self.prefixes = [_fresh_prefix(letter, names) for letter in letters]
        self.temporary = _fresh_prefix("v", names)
        self.name = self.unique_name()
        self.scope["wp"] = wp
        self.active = {(name, i) for i, varying in enumerate(directions) for name in varying}
        self.types: dict[str, Any] = {}
        self.depends = set(range(len(directions))) if row_choice(function) else set[int]()
        """Directions in which the result varies. That of a switch over a table does so with other rows."""
        self.lines: list[str] = []
        self.indent = "    "
        self.count = 0
        self.callees: dict[str, _Transformation] = {}
        """The derivatives that it calls, by their names in its source."""
        self.derivative: wp.Function | None = None
        self.text = self.source()

    def unique_name(self) -> str:
        """Return the derivative's name; that of a closure tells it from others of the same source."""
        along = "_and_".join("_".join(sorted(varying)) for varying in self.directions)
        name = f"{self.function.key}_along_{along}"
        if self.python.__closure__:
            values = referenced_values(self.python).items()
            keys = [f"{name}={_label(value)}" for name, value in sorted(values)]
            name += "_" + hashlib.sha256("\n".join(keys).encode()).hexdigest()[:8]
        return re.sub(r"_+", "_", re.sub(r"\W+", "_", name)).strip("_")

    def source(self) -> str:
        """Return the source of the derivative."""
        known: tuple[int, int] | None = None
        while known != (len(self.active), len(self.depends)):
            known = len(self.active), len(self.depends)
            self.lines, self.count, self.callees = [], 0, {}
            self.types = {name: _plain(hint) for name, hint in self._parameter_hints()}
            for statement in self.definition.body:
                self.statement(statement)
        parameters = [item for name in self.parameters for item in [name, *self.tangents_of_parameter(name)]]
        doc = f'    """Return the values of {self.name} and their derivatives."""'
        return "\n".join([f"def {self.name}({', '.join(parameters)}):", doc, *self.lines, ""])

    def annotations(self) -> dict[str, Any]:
        """Return the types of the derivative's parameters and results."""
        result: dict[str, Any] = {}
        for name, hint in self._parameter_hints():
            result[name] = hint
            result |= dict.fromkeys(self.tangents_of_parameter(name), hint)
        results = [
            kind
            for kind in self._results()
            for kind in [kind] * (1 + len(self.directions) * is_differentiable(kind))
        ]
        result["return"] = tuple.__class_getitem__(tuple(results))
        return result

    def _parameter_hints(self) -> Iterator[tuple[str, Any]]:
        for name in self.parameters:
            if name not in self.hints:
                raise self.refusal(self.definition, f"parameter {name!r} lacks its type")
            yield name, self.hints[name]

    def _results(self) -> tuple[Any, ...]:
        returned = self.hints.get("return", NoneType)
        results = get_args(returned) if get_origin(returned) is tuple else (returned,)
        if not any(map(is_differentiable, results)):
            raise self.refusal(self.definition, "it does not say that it returns floats or vectors of floats")
        return results

    def refusal(self, node: ast.AST, reason: str) -> UntranslatableFunction:
        line = self.first_line + getattr(node, "lineno", 1) - 1
        return UntranslatableFunction(
            f"{inspect.getsourcefile(self.python)}:{line}: {self.python.__name__}: {reason}; "
            "its derivative is not known"
        )

    # -- names --------------------------------------------------------------------------------------

    def tangent(self, name: str, direction: int) -> str:
        """Return the name of a variable's tangent."""
        return f"{self.prefixes[direction]}{name}"

    def tangents_of_parameter(self, name: str) -> list[str]:
        return [self.tangent(name, i) for i, varying in enumerate(self.directions) if name in varying]

    def each_direction(self, tangent: Callable[[int], str | None]) -> tuple[str | None, ...]:
        """Return the tangents of an expression by a function of the direction."""
        return tuple(tangent(direction) for direction in range(len(self.directions)))

    def emit(self, line: str) -> None:
        self.lines.append(self.indent + line)

    def fresh(self) -> str:
        self.count += 1
        return f"{self.temporary}{self.count}"

    def atom(self, code: str) -> str:
        """Return the name of an expression's value, which is computed once."""
        if re.fullmatch(r"\w+|\d+\.\d*|\w+\.[xyzw]|\w+\[\w+\]", code):
            return code
        name = self.fresh()
        self.emit(f"{name} = {code}")
        return name

    def type_code(self, kind: Any) -> str:
        """Return source that names a type."""
        name = getattr(kind, "__name__", "")
        for spelled in (name.removesuffix("f"), name):
            if getattr(wp, spelled, None) is kind:
                return f"wp.{spelled}"
        alias = next((name for name, value in self.scope.items() if value is kind), None)
        if alias is None:
            alias = f"{self.temporary}_type{len(self.scope)}"
            self.scope[alias] = kind
        return alias

    def zero(self, kind: Any) -> str:
        """Return source of a variable 0; a plain 0.0 would be a constant, which no loop may change."""
        return "wp.float32(0.0)" if kind is wp.float32 else f"{self.type_code(kind)}()"

    # -- statements ---------------------------------------------------------------------------------

    def statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass() | ast.Break() | ast.Continue():
                if not isinstance(node, ast.Expr):
                    self.emit(ast.unparse(node))
            case ast.Return(value=value) if value is not None:
                self.returned(node, value)
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Call() as call):
                self.unpacked(node, targets, call)
            case ast.Assign(targets=[target], value=value):
                self.assignment(target, self.dual(value))
            case ast.AnnAssign(target=target, value=value) if value is not None:
                self.assignment(target, self.dual(value))
            case ast.AugAssign(target=target, op=operator, value=value):
                read = ast.parse(ast.unparse(target), mode="eval").body
                combined = ast.copy_location(ast.BinOp(read, operator, value), node)
                self.assignment(target, self.dual(combined))
            case ast.If():
                self.emit(f"if {ast.unparse(node.test)}:")
                self.block(node.body)
                if node.orelse:
                    self.emit("else:")
                    self.block(node.orelse)
            case ast.While(orelse=[]):
                self.emit(f"while {ast.unparse(node.test)}:")
                self.block(node.body)
            case ast.For(target=ast.Name(id=name), orelse=[]):
                self.types[name] = wp.int32
                self.emit(f"for {name} in {ast.unparse(node.iter)}:")
                self.block(node.body)
            case _:
                raise self.refusal(node, f"{type(node).__name__} statement")

    def block(self, statements: list[ast.stmt]) -> None:
        outer, self.indent = self.indent, self.indent + "    "
        start = len(self.lines)
        for statement in statements:
            self.statement(statement)
        if len(self.lines) == start:
            self.emit("pass")
        self.indent = outer

    def returned(self, node: ast.Return, value: ast.expr) -> None:
        results = self._results()
        values = value.elts if isinstance(value, ast.Tuple) else [value]
        if len(values) != len(results):
            raise self.refusal(node, f"it returns {len(values)} values, not {len(results)}")
        codes: list[str] = []
        for item, kind in zip(values, results, strict=True):
            dual = self.dual(item)
            codes.append(dual.code)
            if is_differentiable(kind):
                tangents = self.each_direction(dual.along)
                self.depends.update(i for i, tangent in enumerate(tangents) if tangent is not None)
                codes += [tangent or self.zero(_plain(kind)) for tangent in tangents]
        self.emit(f"return {', '.join(codes)}")

    def assignment(self, target: ast.expr, value: _Dual) -> None:
        match target:
            case ast.Name(id=name):
                known = self.types.setdefault(name, value.type)
                self.types[name] = value.type if known is None else known
                for tangent, moved in self.tangents_to_assign(name, value):
                    if value.type is None:
                        raise self.refusal(target, f"the type of {name!r} is not known")
                    self.emit(f"{tangent} = {moved or self.zero(value.type)}")
                self.emit(f"{name} = {value.code}")
            case ast.Subscript(value=ast.Name(id=name)) | ast.Attribute(value=ast.Name(id=name)):
                place = ast.unparse(target)[len(name) :]
                for tangent, moved in self.tangents_to_assign(name, value):
                    kind = self.dual(target).type
                    self.emit(f"{tangent}{place} = {moved or self.zero(kind)}")
                self.emit(f"{name}{place} = {value.code}")
            case _:
                raise self.refusal(target, f"assignment to {ast.unparse(target)}")

    def tangents_to_assign(self, name: str, value: _Dual) -> list[tuple[str, str | None]]:
        """Return the names of a variable's tangents, with the tangents of the value that it gets."""
        moved = self.each_direction(value.along)
        self.active.update((name, i) for i, tangent in enumerate(moved) if tangent is not None)
        return [(self.tangent(name, i), moved[i]) for i in range(len(moved)) if (name, i) in self.active]

    def unpacked(self, node: ast.Assign, targets: list[ast.expr], call: ast.Call) -> None:
        """Write the assignment of a function's several results to several variables."""
        callee = self.resolved(call.func)
        returned = _hints(callee).get("return") if isinstance(callee, wp.Function) else None
        kinds = [_plain(kind) for kind in get_args(returned)]
        if len(kinds) != len(targets):
            raise self.refusal(
                node, f"{ast.unparse(call.func)} does not say that it returns {len(targets)} values"
            )
        arguments = [self.dual(argument) for argument in call.args]
        for target, dual in zip(targets, self.results_of_call(call, callee, arguments, kinds), strict=True):
            self.assignment(target, dual)

    def results_of_call(
        self, call: ast.Call, callee: wp.Function, arguments: list[_Dual], kinds: list[Any]
    ) -> list[_Dual]:
        """Write the call of a typed function, and return its results."""
        moving, derivative = self.derivative_in(callee, arguments)
        names: list[str] = []
        duals: list[_Dual] = []
        for kind in kinds:
            value = self.fresh()
            changes = {i: self.fresh() for i in moving} if derivative and is_differentiable(kind) else {}
            names += [value, *changes.values()]
            known = {i: n for i, n in changes.items() if derivative and moving.index(i) in derivative.depends}
            duals.append(_Dual(value, self.each_direction(known.get) if known else (), kind))
        code = self.derivative_call(derivative, moving, arguments) if derivative else ast.unparse(call)
        self.emit(f"{', '.join(names)} = {code}")
        return duals

    # -- expressions --------------------------------------------------------------------------------

    def dual(self, node: ast.expr) -> _Dual:
        """Return an expression and its tangent; write the steps that both need before."""
        text = ast.unparse(node)
        match node:
            case ast.Constant(value=value):
                return _Dual(text, type=_SAME_TYPES.get(type(value)))
            case ast.Name(id=name) if name in self.types:
                tangents = self.each_direction(
                    lambda i: self.tangent(name, i) if (name, i) in self.active else None
                )
                return _Dual(text, tangents, self.types[name])
            case ast.Name() | ast.Attribute() if self.is_constant(node):
                value = self.resolved(node)
                return _Dual(text, type=_SAME_TYPES.get(type(value), type(value)))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self.by_rule("negative", RULES["negative"], [self.dual(operand)], "-{0}")
            case ast.UnaryOp(op=ast.Not()) | ast.BoolOp() | ast.Compare():
                return _Dual(f"({text})", type=wp.bool)
            case ast.BinOp(left=left, op=operator, right=right):
                return self.binary(node, operator, self.dual(left), self.dual(right))
            case ast.IfExp():
                return self.choice(node)
            case ast.Subscript(value=value, slice=index):
                return self.element(node, self.dual(value), index)
            case ast.Attribute(value=value, attr=component):
                vector = self.dual(value)
                if component not in "xyzw" or not is_differentiable(vector.type):
                    return _Dual(text)
                tangents = tuple(tangent and f"{tangent}.{component}" for tangent in vector.tangents)
                return _Dual(f"{vector.code}.{component}", tangents, wp.float32)
            case ast.Call():
                return self.call(node)
            case _:
                raise self.refusal(node, f"{text} is a {type(node).__name__} expression")

    def is_constant(self, node: ast.expr) -> bool:
        """Return True for the name of a number outside the function."""
        if isinstance(node, ast.Attribute):
            root: ast.expr = node
            while isinstance(root, ast.Attribute):
                root = root.value
            return isinstance(root, ast.Name) and root.id not in self.types and root.id in self.scope
        return isinstance(node, ast.Name) and node.id in self.scope

    def resolved(self, node: ast.expr) -> Any:
        """Return what a name outside the function stands for."""
        match node:
            case ast.Name(id=name) if name in self.scope:
                return self.scope[name]
            case ast.Name(id="float" | "int" | "bool" as name):
                return {"float": float, "int": int, "bool": bool}[name]
            case ast.Attribute(value=value, attr=name):
                owner = self.resolved(value)
                if hasattr(owner, name):
                    return getattr(owner, name)
        raise self.refusal(node, f"{ast.unparse(node)} is not known")

    def binary(self, node: ast.BinOp, operator: ast.operator, left: _Dual, right: _Dual) -> _Dual:
        sign = _OPERATORS.get(type(operator))
        if sign is None:
            if left.varies or right.varies:
                raise self.refusal(node, f"{type(operator).__name__} of {ast.unparse(node)}")
            return _Dual(f"({ast.unparse(node)})", type=left.type)
        kind = _product_type(left.type, right.type) if sign == "*" else left.type
        return self.by_rule(sign, RULES[sign], [left, right], f"({{0}} {sign} {{1}})", kind)

    def by_rule(self, name: str, rule: Rule, arguments: list[_Dual], form: str, kind: Any = None) -> _Dual:
        """Return a call by its rule; `form` is the source of the call itself."""
        if kind is None:
            kind = (
                wp.float32
                if rule.scalar
                else next((a.type for a in arguments if a.type is not wp.bool), None)
            )
        if not any(argument.varies for argument in arguments):
            return _Dual(form.format(*(argument.code for argument in arguments)), type=kind)
        codes = [self.atom(argument.code) for argument in arguments]
        code = form.format(*codes)
        moved = [
            [tangent and self.atom(tangent) for tangent in (a.along(i) for a in arguments)]
            for i in range(len(self.directions))
        ]
        varying = [partial for i, partial in enumerate(rule.partials) if arguments[i].varies]
        if any("{r}" in partial for partial in varying):
            code = self.atom(code)
        zero = self.zero(kind) if any("{zero}" in partial for partial in rule.partials) else ""

        def tangent(direction: int) -> str | None:
            tangents = moved[direction]
            if not any(tangents):
                return None
            if not rule.componentwise or kind is wp.float32:
                return _sum(rule, codes, tangents, code, zero)
            parts = [
                _sum(
                    rule,
                    [f"{c}[{i}]" for c in codes],
                    [t and f"{t}[{i}]" for t in tangents],
                    f"{code}[{i}]",
                    "",
                )
                for i in range(kind._length_)
            ]
            return f"{self.type_code(kind)}({', '.join(parts)})"

        return _Dual(code, self.each_direction(tangent), kind)

    def choice(self, node: ast.IfExp) -> _Dual:
        """Return ``x if condition else y``, written as branches, of which only one is computed."""
        value, names = self.fresh(), [self.fresh() for _ in self.directions]
        start, count = len(self.lines), self.count
        chosen = other = _Dual("")
        tangents: dict[int, str] = {}
        for attempt in range(2):  # first to learn the type, and what varies
            del self.lines[start:]
            self.count = count
            if attempt:
                for name in (value, *tangents.values()):
                    self.emit(f"{name} = {self.zero(chosen.type or other.type)}")
            self.emit(f"if {ast.unparse(node.test)}:")
            chosen = self.branch(node.body, value, tangents)
            self.emit("else:")
            other = self.branch(node.orelse, value, tangents)
            tangents = {i: name for i, name in enumerate(names) if chosen.along(i) or other.along(i)}
            if not tangents:
                del self.lines[start:]
                return _Dual(f"({ast.unparse(node)})", type=chosen.type)
        return _Dual(value, self.each_direction(tangents.get), chosen.type or other.type)

    def branch(self, node: ast.expr, value: str, tangents: dict[int, str]) -> _Dual:
        outer, self.indent = self.indent, self.indent + "    "
        dual = self.dual(node)
        self.emit(f"{value} = {dual.code}")
        if dual.type is not None and is_differentiable(dual.type):
            for direction, name in tangents.items():
                self.emit(f"{name} = {dual.along(direction) or self.zero(dual.type)}")
        self.indent = outer
        return dual

    def element(self, node: ast.Subscript, value: _Dual, index: ast.expr) -> _Dual:
        kind = _element_type(value.type)
        position = ast.unparse(index)
        if not value.varies:
            return _Dual(f"{value.code}[{position}]", type=kind)
        if isinstance(index, ast.Call):
            position = self.atom(position)
        return _Dual(
            f"{self.atom_of_vector(value.code)}[{position}]",
            tuple(t and f"{self.atom_of_vector(t)}[{position}]" for t in value.tangents),
            kind,
        )

    def atom_of_vector(self, code: str) -> str:
        """Return source that a subscript may follow."""
        return code if re.fullmatch(r"[\w.]+(\[[^\[\]]*\])?", code) else self.atom(code)

    def call(self, node: ast.Call) -> _Dual:
        if node.keywords:
            raise self.refusal(node, "keyword arguments")
        callee = self.resolved(node.func)
        arguments = [self.dual(argument) for argument in node.args]
        form = f"{ast.unparse(node.func)}({', '.join(f'{{{i}}}' for i in range(len(arguments)))})"
        if isinstance(callee, type):
            return self.construction(callee, arguments, form)
        if not isinstance(callee, wp.Function):
            raise self.refusal(node, f"{ast.unparse(node.func)} is not a typed function")
        if callee.is_builtin():
            return self.built_in(node, callee.key, arguments, form)
        returned = _hints(callee).get("return")
        kind = _plain(returned)
        if not is_differentiable(kind) or self.derivative_in(callee, arguments)[1] is None:
            return _Dual(form.format(*(argument.code for argument in arguments)), type=kind)
        return self.results_of_call(node, callee, arguments, [kind])[0]

    def construction(self, kind: type, arguments: list[_Dual], form: str) -> _Dual:
        """Return a cast, or a vector or matrix of components."""
        kind = _plain(kind)
        code = form.format(*(argument.code for argument in arguments))
        if not is_differentiable(kind):
            return _Dual(code, type=kind)

        def tangent(direction: int) -> str | None:
            if all(argument.along(direction) is None for argument in arguments):
                return None
            zeros = ["0.0" if a.type is wp.float32 else self.zero(a.type) for a in arguments]
            return form.format(
                *(a.along(direction) or zero for a, zero in zip(arguments, zeros, strict=True))
            )

        return _Dual(code, self.each_direction(tangent), kind)

    def built_in(self, node: ast.Call, name: str, arguments: list[_Dual], form: str) -> _Dual:
        code = form.format(*(argument.code for argument in arguments))
        if name in CASTS:
            return _Dual(code, arguments[0].tangents if name == "float32" else (), CASTS[name])
        if name in STEPS:
            return _Dual(code, type=arguments[0].type)
        if name in RULES and len(RULES[name].partials) == len(arguments):
            return self.by_rule(name, RULES[name], arguments, form)
        if any(argument.varies for argument in arguments):
            raise self.refusal(node, f"wp.{name}")
        return _Dual(code)

    def derivative_in(
        self, callee: wp.Function, arguments: list[_Dual]
    ) -> "tuple[list[int], _Transformation | None]":
        """Return the directions in which arguments vary, and the derivative, None if it is 0."""
        names = [name for name in _hints(callee) if name != "return"]
        varying = [
            frozenset(name for name, argument in zip(names, arguments, strict=True) if argument.along(i))
            for i in range(len(self.directions))
        ]
        moving = [i for i, names_of_direction in enumerate(varying) if names_of_direction]
        if not moving:
            return moving, None
        derivative = _transformation(callee, tuple(varying[i] for i in moving))
        return moving, derivative if derivative.depends else None

    def derivative_call(
        self, derivative: "_Transformation", moving: list[int], arguments: list[_Dual]
    ) -> str:
        alias = derivative.name
        while self.callees.setdefault(alias, derivative) is not derivative:
            alias += "_"
        codes = [
            code
            for argument in arguments
            for code in (argument.code, *(argument.along(i) for i in moving))
            if code is not None
        ]
        return f"{alias}({', '.join(codes)})"


def _sum(rule: Rule, codes: list[str], tangents: list[str | None], result: str, zero: str) -> str:
    """Return the sum of the partial derivatives in the arguments that have tangents."""
    terms = [
        partial.format(*codes, d=tangent, r=result, zero=zero)
        for partial, tangent in zip(rule.partials, tangents, strict=True)
        if tangent is not None
    ]
    return f"({' + '.join(terms)})" if len(terms) > 1 or terms[0][0] == "-" or " " in terms[0] else terms[0]


def _plain(hint: Any) -> Any:
    """Return Warp's type for one of Python's."""
    return _SAME_TYPES.get(hint, hint) if isinstance(hint, type) else hint


def _label(value: Any) -> Any:
    """Return a value for a hash that is the same everywhere; the text of a module would hold its path."""
    return value.__name__ if isinstance(value, ModuleType) else getattr(value, "key", value)


def _shape(kind: Any) -> tuple[int, ...]:
    """Return the shape of a vector or matrix type; () for others."""
    shape: tuple[int, ...] = getattr(kind, "_shape_", ())
    return shape


def _product_type(left: Any, right: Any) -> Any:
    """Return the type of a product: of a number with anything, or of a matrix with a vector or matrix."""
    if left is wp.float32:
        return right
    if right is wp.float32 or right is None:
        return left
    rows, columns = _shape(left), _shape(right)
    if len(rows) == 2 and len(columns) == 1:
        return _standard(wp.types.vector(length=rows[0], dtype=wp.float32))
    if len(rows) == 2 and len(columns) == 2:
        return wp.types.matrix(shape=(rows[0], columns[1]), dtype=wp.float32)
    return left


def _element_type(kind: Any) -> Any:
    """Return the type of an element of a vector, of a row of a matrix, or of an item of an array."""
    if isinstance(kind, wp.array):
        return _plain(kind.dtype)
    shape = _shape(kind)
    if len(shape) == 2:
        return _standard(wp.types.vector(length=shape[1], dtype=kind._wp_scalar_type_))
    return getattr(kind, "_wp_scalar_type_", None)


def _standard(kind: Any) -> Any:
    """Return Warp's own name of a vector type, such as `wp.vec4`, which other types equal only in C++."""
    lengths = {2: wp.vec2, 3: wp.vec3, 4: wp.vec4}
    return lengths.get(kind._length_, kind) if kind._wp_scalar_type_ is wp.float32 else kind


def _fresh_prefix(letter: str, names: set[str]) -> str:
    """Return a beginning of names that no variable has."""
    number = 1
    while any(
        name.startswith(prefix := f"{letter}_" if number == 1 else f"{letter}{number}_") for name in names
    ):
        number += 1
    return prefix
