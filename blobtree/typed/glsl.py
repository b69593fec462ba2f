"""Typed `@wp.func` → GLSL, so that every formula of the project is written once.

The subset: typed scalars and vectors, arithmetic, comparisons, `if`, `for … in range`, `while`, Warp's
maths, calls of other such functions. Arrays become 4096-wide 2D textures read with `texelFetch`.
Whatever lies outside is refused with file and line, never guessed.
"""

import ast
import inspect
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import warp as wp

from blobtree.errors import UntranslatableFunction
from blobtree.typed.builtins import BUILTINS, CASTS, HELPERS, RESERVED_WORDS, Expression, type_name

TEXTURE_WIDTH_BITS = 12
"""Data textures are 1 << 12 = 4096 texels wide: room for an index of millions."""

_INFIX = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_BITWISE = {ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.LShift: "<<", ast.RShift: ">>"}
_COMPARISON = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_COMPONENTS = {
    "vec2": "float",
    "vec3": "float",
    "vec4": "float",
    "ivec2": "int",
    "ivec3": "int",
    "ivec4": "int",
}
_SAMPLED = {"sampler2D": ("vec4", ""), "isampler2D": ("int", ".x"), "ivec4_sampler": ("ivec4", "")}


def translate_library(functions: Iterable[Any], *, provided: Iterable[Any] = ()) -> str:
    """GLSL source of `functions` and of everything they call, each once, callees first.

    Parameters
    ----------
    functions
        What `@wp.func` makes.
    provided
        Functions that the shader defines by hand, under the same names; they are only declared.

    Raises
    ------
    UntranslatableFunction
        A function leaves the shared subset; the message names file and line.
    """
    declarations = {function.key: _Translator(function).signature() + ";" for function in provided}
    translated: dict[str, str] = {}
    for function in functions:
        _collect(function, translated, frozenset(declarations))
    return HELPERS + "\n".join([*declarations.values(), "", *translated.values()])


def translate_choice(chooser: Any, choices: Mapping[int, Any]) -> str:
    """GLSL of `chooser`, which calls the one of `choices` that its first argument names, with the others.

    The last choice is not asked for: one that does not occur never does.
    """
    translator = _Translator(chooser)
    signature = translator.signature()
    selector, *arguments = (spell(name) for name in translator.types)
    calls = {code: f"{choice.key}({', '.join(arguments)})" for code, choice in choices.items()}
    last = list(calls)[-1]
    tests = [
        f"    if ({selector} == {code}) {{ return {call}; }}" for code, call in calls.items() if code != last
    ]
    return "\n".join([signature + " {", *tests, f"    return {calls[last]};", "}", ""])


def _collect(function: wp.Function, translated: dict[str, str], provided: frozenset[str]) -> None:
    if function.key in translated or function.key in provided:
        return
    translator = _Translator(function)
    source = translator.source()
    for callee in translator.callees:
        _collect(callee, translated, provided)
    translated[function.key] = source


@dataclass
class _Translator:
    """One function on its way to GLSL: knows the types of its names and whom it calls."""

    function: wp.Function
    types: dict[str, str] = field(default_factory=dict)
    returned: str = ""
    callees: list[wp.Function] = field(default_factory=list)

    def __post_init__(self) -> None:
        python_function = self.function.func
        assert python_function is not None, f"{self.function.key} is built in"
        lines, self.first_line = inspect.getsourcelines(python_function)
        self.hints = python_function.__annotations__
        self.file = inspect.getsourcefile(python_function)
        self.scope: dict[str, Any] = {
            **python_function.__globals__,
            **inspect.getclosurevars(python_function).nonlocals,
        }
        definition = ast.parse(textwrap.dedent("".join(lines))).body[0]
        assert isinstance(definition, ast.FunctionDef)
        self.definition = definition

    def signature(self) -> str:
        """What the function returns, its name, and its parameters."""
        annotations = {name: type_name(hint) for name, hint in self.hints.items()}
        returned = annotations.pop("return", None)
        if returned is None:
            raise self.refusal(self.definition, "it does not say what it returns")
        for name, glsl_type in annotations.items():
            if glsl_type is None:
                raise self.refusal(self.definition, f"parameter {name!r} has no type that GLSL knows")
        if len(annotations) != len(self.definition.args.args):
            raise self.refusal(self.definition, "a parameter lacks its type")
        self.returned = returned
        self.types = {name: str(glsl_type) for name, glsl_type in annotations.items()}
        parameters = ", ".join(f"{glsl_type} {spell(name)}" for name, glsl_type in self.types.items())
        return f"{returned} {self.function.key}({parameters})"

    def source(self) -> str:
        """The whole function."""
        signature = self.signature()
        parameters = set(self.types)
        body = [line for statement in self.definition.body for line in self.statement(statement)]
        variables = [
            f"    {glsl_type} {spell(name)};"
            for name, glsl_type in self.types.items()
            if name not in parameters
        ]
        return "\n".join([signature + " {", *variables, *body, "}", ""])

    def refusal(self, node: ast.AST, reason: str) -> UntranslatableFunction:
        line = self.first_line + getattr(node, "lineno", 1) - 1
        return UntranslatableFunction(
            f"{self.file}:{line}: {self.function.key}: {reason}; "
            "stay within the subset that Warp and GLSL share (see blobtree/typed/glsl.py)"
        )

    # -- statements ---------------------------------------------------------------------------------

    def statement(self, node: ast.stmt) -> Iterator[str]:
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                return
            case ast.Return(value=value) if value is not None:
                result = self.expression(value)
                if result.type != self.returned:
                    raise self.refusal(node, f"it returns {result.type}, not {self.returned}")
                yield f"    return {result.code};"
            case ast.Assign(targets=[target], value=value):
                yield self.assignment(target, self.expression(value))
            case ast.AnnAssign(target=target, value=value) if value is not None:
                yield self.assignment(target, self.expression(value))
            case ast.AugAssign(target=target, op=operator, value=value):
                yield self.assignment(
                    target, self.binary(node, operator, self.expression(target), self.expression(value))
                )
            case ast.If():
                yield from self.branch(node)
            case ast.While(test=test, orelse=[]):
                yield f"    while ({self.expression(test).code}) {{"
                yield from self.block(node.body)
                yield "    }"
            case ast.For(
                target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range")) as span, orelse=[]
            ):
                yield from self.counted_loop(name, span, node.body)
            case ast.Break():
                yield "    break;"
            case ast.Continue():
                yield "    continue;"
            case _:
                raise self.refusal(node, f"{type(node).__name__} statement")

    def block(self, statements: list[ast.stmt]) -> Iterator[str]:
        for statement in statements:
            for line in self.statement(statement):
                yield "    " + line

    def assignment(self, target: ast.expr, value: Expression) -> str:
        match target:
            case ast.Name(id=name):
                known = self.types.setdefault(name, value.type)
                if known != value.type:
                    raise self.refusal(target, f"{name!r} changes its type from {known} to {value.type}")
                return f"    {spell(name)} = {value.code};"
            case ast.Subscript() | ast.Attribute():
                return f"    {self.expression(target).code} = {value.code};"
            case _:
                raise self.refusal(target, f"assignment to {type(target).__name__}")

    def branch(self, node: ast.If) -> Iterator[str]:
        yield f"    if ({self.expression(node.test).code}) {{"
        yield from self.block(node.body)
        if node.orelse:
            yield "    } else {"
            yield from self.block(node.orelse)
        yield "    }"

    def counted_loop(self, name: str, span: ast.Call, body: list[ast.stmt]) -> Iterator[str]:
        bounds = [self.expression(argument).code for argument in span.args]
        start, stop, step = {1: ["0", *bounds, "1"], 2: [*bounds, "1"], 3: bounds}[len(bounds)]
        self.types.setdefault(name, "int")
        counter, order = spell(name), ">" if step.lstrip("(").startswith("-") else "<"
        yield f"    for ({counter} = {start}; {counter} {order} {stop}; {counter} += {step}) {{"
        yield from self.block(body)
        yield "    }"

    # -- expressions --------------------------------------------------------------------------------

    def expression(self, node: ast.expr) -> Expression:
        match node:
            case ast.Constant(value=value):
                return self.literal(node, value)
            case ast.Name(id=name) if name in self.types:
                return Expression(spell(name), self.types[name])
            case ast.Name(id=name) if name in self.scope:
                return self.literal(node, self.scope[name])
            case ast.BinOp(left=left, op=operator, right=right):
                return self.binary(node, operator, self.expression(left), self.expression(right))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                negated = self.expression(operand)
                return Expression(f"(-{negated.code})", negated.type)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Expression(f"(!{self.expression(operand).code})", "bool")
            case ast.BoolOp(op=operator, values=values):
                joint = " && " if isinstance(operator, ast.And) else " || "
                return Expression(
                    "(" + joint.join(self.expression(value).code for value in values) + ")", "bool"
                )
            case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in _COMPARISON:
                symbol = _COMPARISON[type(operator)]
                return Expression(
                    f"({self.expression(left).code} {symbol} {self.expression(right).code})", "bool"
                )
            case ast.IfExp(test=test, body=body, orelse=orelse):
                chosen, other = self.expression(body), self.expression(orelse)
                if chosen.type != other.type:
                    raise self.refusal(node, f"{chosen.type} and {other.type} do not mix")
                return Expression(
                    f"({self.expression(test).code} ? {chosen.code} : {other.code})", chosen.type
                )
            case ast.Subscript(value=value, slice=index):
                return self.element(node, self.expression(value), self.expression(index))
            case ast.Attribute(value=value, attr=component) if component in "xyzw":
                vector = self.expression(value)
                return Expression(f"{vector.code}.{component}", _COMPONENTS[vector.type])
            case ast.Attribute() | ast.Name():
                return self.literal(node, self.resolve(node))
            case ast.Call():
                return self.call(node)
            case _:
                raise self.refusal(node, f"{type(node).__name__} expression")

    def literal(self, node: ast.expr, value: object) -> Expression:
        match value:
            case bool():
                return Expression(str(value).lower(), "bool")
            case int():
                return Expression(str(value), "int")
            case float():
                return Expression(repr(value), "float")
            case wp.uint32():
                return Expression(f"{value.value}u", "uint")
            case _:
                raise self.refusal(node, f"{ast.unparse(node)} is no number")

    def resolve(self, node: ast.expr) -> object:
        match node:
            case ast.Name(id=name) if name in self.scope:
                return self.scope[name]
            case ast.Name(id=name) if name in CASTS:
                return name
            case ast.Attribute(value=value, attr=name):
                owner = self.resolve(value)
                if hasattr(owner, name):
                    return getattr(owner, name)
        raise self.refusal(node, f"{ast.unparse(node)} is not known")

    def binary(
        self, node: ast.AST, operator: ast.operator, left: Expression, right: Expression
    ) -> Expression:
        kind = type(operator)
        if kind in _BITWISE:
            return Expression(f"({left.code} {_BITWISE[kind]} {right.code})", left.type)
        if kind is ast.Mod:
            whole = (
                f"trunc({left.code} / {right.code})"
                if left.type == "float"
                else f"({left.code} / {right.code})"
            )
            return Expression(f"({left.code} - {right.code} * {whole})", left.type)
        vectors = left.type in _COMPONENTS and right.type in _COMPONENTS
        if kind not in _INFIX or (vectors and kind in (ast.Mult, ast.Div)):
            raise self.refusal(node, f"{kind.__name__} of {left.type} and {right.type}")
        scalar_pair = left.type not in _COMPONENTS and right.type not in _COMPONENTS
        if left.type != right.type and (vectors or scalar_pair):
            raise self.refusal(node, f"{left.type} and {right.type} do not mix")
        result = left.type if left.type in _COMPONENTS else right.type
        return Expression(f"({left.code} {_INFIX[kind]} {right.code})", result)

    def element(self, node: ast.Subscript, value: Expression, index: Expression) -> Expression:
        if value.type in _SAMPLED:
            element_type, swizzle = _SAMPLED[value.type]
            mask = (1 << TEXTURE_WIDTH_BITS) - 1
            texel = f"ivec2({index.code} & {mask}, {index.code} >> {TEXTURE_WIDTH_BITS})"
            return Expression(f"texelFetch({value.code}, {texel}, 0){swizzle}", element_type)
        if value.type in _COMPONENTS:
            return Expression(f"{value.code}[{index.code}]", _COMPONENTS[value.type])
        raise self.refusal(node, f"{value.type} has no elements")

    def call(self, node: ast.Call) -> Expression:
        if node.keywords:
            raise self.refusal(node, "keyword arguments")
        arguments = [self.expression(argument) for argument in node.args]
        codes = ", ".join(argument.code for argument in arguments)
        callee = self.resolve(node.func)
        constructor = CASTS[callee] if isinstance(callee, str) else type_name(callee)
        if constructor is not None:
            return Expression(f"{constructor}({codes or '0.0'})", constructor)
        if not isinstance(callee, wp.Function):
            raise self.refusal(node, f"{ast.unparse(node.func)} is not a typed function")
        if callee.is_builtin():
            if callee.key not in BUILTINS:
                raise self.refusal(node, f"wp.{callee.key} has no twin in GLSL")
            return BUILTINS[callee.key](*arguments)
        if callee not in self.callees:
            self.callees.append(callee)
        hints = dict(getattr(callee.func, "__annotations__", {}))
        returned = type_name(hints.pop("return", None))
        if returned is None:
            raise self.refusal(node, f"{callee.key} does not say what it returns")
        expected, given = [type_name(hint) for hint in hints.values()], [a.type for a in arguments]
        if expected != given:
            raise self.refusal(
                node, f"{callee.key} takes {', '.join(map(str, expected))}, got {', '.join(given)}"
            )
        return Expression(f"{callee.key}({codes})", returned)


def spell(name: str) -> str:
    """`name`, kept apart from the words that GLSL reserves."""
    return name + "_" if name in RESERVED_WORDS else name
