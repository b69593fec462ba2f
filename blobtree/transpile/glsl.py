"""Translation of typed functions (`@wp.func`) to GLSL, so that every formula of the project is written once.

The subset: typed scalars and vectors, arithmetic, comparisons, `if`, `for … in range`, `while`, Warp's
maths, and calls of other such functions; docs/custom-nodes.md lists it for users. An array becomes a 2D
texture, 4096 texels wide, that is read with `texelFetch`. A struct of uniforms (`uniform_struct`) becomes the
uniforms themselves. A function that returns several values has `out` parameters for them. Everything else is
refused with file and line.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, get_args, get_origin

import warp as wp

from blobtree.errors import UntranslatableFunction
from blobtree.transpile.builtins import (
    BUILTINS,
    CASTS,
    HELPERS,
    PAIR,
    REGISTERS,
    RESERVED_WORDS,
    Expression,
    type_name,
)
from blobtree.transpile.specialize import parameter_count

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
    PAIR: "float",
    REGISTERS: "float",
}
_SAMPLED = {"sampler2D": ("vec4", ""), "isampler2D": ("int", ".x"), "ivec4_sampler": ("ivec4", "")}
_RESULT = "returned_"
"""Beginning of the names of `out` parameters."""

_UNIFORM_STRUCTS: dict[Any, dict[str, Expression]] = {}


def uniform_struct(**uniforms: str) -> Callable[[type], Any]:
    """Declare a `wp.struct` whose fields are uniforms or constants of the shader.

    A function that takes such a struct has no parameter for it in GLSL, and a field is the uniform itself:
    with ``@uniform_struct(table="index_table")``, ``index.table[i]`` becomes a fetch from ``index_table``.
    A shader must declare these names above the translated library.

    Parameters
    ----------
    uniforms
        Name of the uniform for each field of the class.

    Raises
    ------
    UntranslatableFunction
        The names are not those of the fields, or a field has no type in GLSL.
    """

    def declare(cls: type) -> Any:
        fields = {name: type_name(hint) for name, hint in cls.__annotations__.items()}
        if fields.keys() != uniforms.keys():
            raise UntranslatableFunction(
                f"{cls.__name__}: expected a uniform for each of the fields {', '.join(fields)}, "
                f"got {', '.join(uniforms)}; name one for each"
            )
        for name, glsl_type in fields.items():
            if glsl_type is None:
                raise UntranslatableFunction(f"{cls.__name__}: field {name!r} has no type that GLSL knows")
        struct = wp.struct(cls)
        _UNIFORM_STRUCTS[struct] = {
            name: Expression(uniforms[name], str(glsl_type)) for name, glsl_type in fields.items()
        }
        return struct

    return declare


def uniforms_of(hint: object) -> Mapping[str, Expression] | None:
    """Return the uniforms of a struct by its fields; None for a type that is no struct of uniforms."""
    try:
        return _UNIFORM_STRUCTS.get(hint)
    except TypeError:  # unhashable
        return None


def translate_library(
    functions: Iterable[Any],
    *,
    provided: Iterable[Any] = (),
    constants: Mapping[str, bool | int] | None = None,
) -> str:
    """Return GLSL of `functions` and of all their callees, each once, callees first.

    Parameters
    ----------
    functions
        Typed functions (`wp.Function`).
    provided
        Functions that the shader defines by hand, under the same names. The library only declares them.
    constants
        Values of uniforms and of parameters, by their names, that are always the same. What they exclude is
        left out.

    Raises
    ------
    UntranslatableFunction
        A function leaves the shared subset; the message names file and line.
    """
    declarations = {function.key: _Translator(function).signature() + ";" for function in provided}
    translated: dict[str, str] = {}
    for function in functions:
        _collect(function, translated, frozenset(declarations), constants or {})
    return HELPERS + "\n".join([*declarations.values(), "", *translated.values()])


def translate_choice(chooser: Any, choices: Mapping[int, Any]) -> str:
    """Return GLSL of `chooser`: a call of the function whose code is the first argument, with the others.

    A function that declares fewer parameters gets the first ones. The last function of `choices` takes all
    codes that are left.
    """
    translator = _Translator(chooser)
    signature = translator.signature()
    selector, *arguments = (spell(name) for name in translator.types)
    several = len(translator.returned) > 1
    results = [f"{_RESULT}{i}" for i in range(len(translator.returned))] if several else []
    calls = {
        code: f"{choice.key}({', '.join([*arguments[: parameter_count(choice)], *results])})"
        for code, choice in choices.items()
    }
    form = "{}; return;" if several else "return {};"
    last = list(calls)[-1]
    tests = [
        f"    if ({selector} == {code}) {{ {form.format(call)} }}"
        for code, call in calls.items()
        if code != last
    ]
    return "\n".join([signature + " {", *tests, f"    {form.format(calls[last])}", "}", ""])


def _collect(
    function: wp.Function,
    translated: dict[str, str],
    provided: frozenset[str],
    constants: Mapping[str, bool | int],
) -> None:
    if function.key in translated or function.key in provided:
        return
    translator = _Translator(function, constants)
    source = translator.source()
    for callee in translator.callees:
        _collect(callee, translated, provided, constants)
    translated[function.key] = source


@dataclass
class _Translator:
    """Translation of one function, with the types of its variables and the functions that it calls."""

    function: wp.Function
    constants: Mapping[str, bool | int] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    structs: dict[str, Any] = field(default_factory=dict)
    returned: tuple[str, ...] = ()
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
        """Return the declaration: type of the result, name, parameters; structs of uniforms are left out."""
        self.structs = {name: hint for name, hint in self.hints.items() if uniforms_of(hint) is not None}
        annotations = {
            name: type_name(hint)
            for name, hint in self.hints.items()
            if name not in self.structs and name != "return"
        }
        returned = returned_types(self.hints)
        if not returned:
            raise self.refusal(self.definition, "it does not say what it returns")
        for name, glsl_type in annotations.items():
            if glsl_type is None:
                raise self.refusal(self.definition, f"parameter {name!r} has no type that GLSL knows")
        if len(annotations) + len(self.structs) != len(self.definition.args.args):
            raise self.refusal(self.definition, "a parameter lacks its type")
        self.returned = returned
        self.types = {name: str(glsl_type) for name, glsl_type in annotations.items()}
        parameters = [f"{glsl_type} {spell(name)}" for name, glsl_type in self.types.items()]
        if len(returned) > 1:
            parameters += [f"out {glsl_type} {_RESULT}{i}" for i, glsl_type in enumerate(returned)]
        result = returned[0] if len(returned) == 1 else "void"
        return f"{result} {self.function.key}({', '.join(parameters)})"

    def source(self) -> str:
        """Return the definition."""
        signature = self.signature()
        parameters = set(self.types)
        body = list(self.statements(self.definition.body))
        variables = [
            f"    {glsl_type} {spell(name)};"
            for name, glsl_type in self.types.items()
            if name not in parameters
        ]
        return "\n".join([signature + " {", *variables, *body, "}", ""])

    def refusal(self, node: ast.AST, reason: str) -> UntranslatableFunction:
        line = self.first_line + getattr(node, "lineno", 1) - 1
        return UntranslatableFunction(
            f"{self.file}:{line}: {written_name(self.function)}: {reason}; "
            "use what the guide 'Custom nodes' lists under 'Language of typed functions'"
        )

    # -- statements ---------------------------------------------------------------------------------

    def statements(self, nodes: list[ast.stmt]) -> Iterator[str]:
        """Yield the lines of statements, up to the first that is known to return."""
        for node in nodes:
            yield from self.statement(node)
            if self.returns(node):
                return

    def returns(self, node: ast.stmt) -> bool:
        """Return True for a statement after which no other is reached."""
        if isinstance(node, ast.If) and (taken := self.known(node.test)) is not None:
            return any(map(self.returns, node.body if taken else node.orelse))
        return isinstance(node, ast.Return)

    def statement(self, node: ast.stmt) -> Iterator[str]:
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                return
            case ast.Return(value=value) if value is not None:
                yield from self.returning(node, value)
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Call() as call):
                yield self.unpacking(node, targets, call)
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

    def returning(self, node: ast.Return, value: ast.expr) -> Iterator[str]:
        values = value.elts if isinstance(value, ast.Tuple) else [value]
        results = [self.expression(item) for item in values]
        types = tuple(result.type for result in results)
        if types != self.returned:
            raise self.refusal(node, f"it returns {', '.join(types)}, not {', '.join(self.returned)}")
        if len(results) == 1:
            yield f"    return {results[0].code};"
        else:
            yield from (f"    {_RESULT}{i} = {result.code};" for i, result in enumerate(results))
            yield "    return;"

    def unpacking(self, node: ast.Assign, targets: list[ast.expr], call: ast.Call) -> str:
        """Return the call of a function that returns several values to several variables."""
        callee, arguments, types = self.called(call)
        names = [target.id for target in targets if isinstance(target, ast.Name)]
        if not len(names) == len(targets) == len(types):
            raise self.refusal(node, f"{len(types)} values assigned to {ast.unparse(node.targets[0])}")
        for name, glsl_type in zip(names, types, strict=True):
            if self.types.setdefault(name, glsl_type) != glsl_type:
                raise self.refusal(node, f"{name!r} changes its type to {glsl_type}")
        codes = [*(argument.code for argument in arguments), *map(spell, names)]
        return f"    {callee.key}({', '.join(codes)});"

    def block(self, statements: list[ast.stmt]) -> Iterator[str]:
        for line in self.statements(statements):
            yield "    " + line

    def assignment(self, target: ast.expr, value: Expression) -> str:
        match target:
            case ast.Name(id=name):
                known = self.types.setdefault(name, value.type)
                if known != value.type:
                    raise self.refusal(target, f"{name!r} changes its type from {known} to {value.type}")
                return f"    {spell(name)} = {value.code};"
            case ast.Subscript(value=base) | ast.Attribute(value=base):
                if self.is_uniform(base) or self.is_uniform(target):
                    raise self.refusal(target, f"assignment to {ast.unparse(target)}, which is read-only")
                return f"    {self.expression(target).code} = {value.code};"
            case _:
                raise self.refusal(target, f"assignment to {type(target).__name__}")

    def is_uniform(self, node: ast.expr) -> bool:
        """Return True for a field of a struct of uniforms, and for an array."""
        match node:
            case ast.Attribute(value=ast.Name(id=name)) if name in self.structs:
                return True
            case ast.Name(id=name):
                return self.types.get(name) in _SAMPLED
        return False

    def branch(self, node: ast.If) -> Iterator[str]:
        taken = self.known(node.test)
        if taken is not None:
            yield from self.statements(node.body if taken else node.orelse)
            return
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

    # -- constants ----------------------------------------------------------------------------------

    def known(self, node: ast.expr) -> bool | int | None:
        """Return the value of an expression that `constants` decide; None for any other."""
        if not self.constants:
            return None
        match node:
            case ast.Constant(value=bool() | int() as value):
                return value
            case ast.Name() | ast.Attribute():
                return self.known_name(node)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                operand_value = self.known(operand)
                return None if operand_value is None else not operand_value
            case ast.BoolOp(op=operator, values=parts):
                decisive, values = isinstance(operator, ast.Or), [self.known(part) for part in parts]
                if any(value is not None and bool(value) is decisive for value in values):
                    return decisive
                return None if None in values else not decisive
            case ast.Compare(left=left, ops=[ast.Eq()], comparators=[right]):
                pair = self.known(left), self.known(right)
                return None if None in pair else pair[0] == pair[1]
        return None

    def known_name(self, node: ast.Name | ast.Attribute) -> bool | int | None:
        """Return the value of a constant uniform or parameter, or of a whole number of the module."""
        match node:
            case ast.Attribute(value=ast.Name(id=struct), attr=name) if struct in self.structs:
                return self.constants.get(self.uniform(node, struct, name).code)
            case ast.Name(id=name) if name in self.hints:
                return self.constants.get(name)
            case ast.Attribute(value=ast.Name(id=name)) | ast.Name(id=name) if name in self.scope:
                value = None if name in self.types else self.resolve(node)
                return value if isinstance(value, int) else None
        return None

    # -- expressions --------------------------------------------------------------------------------

    def expression(self, node: ast.expr) -> Expression:
        match node:
            case ast.Constant(value=value):
                return self.literal(node, value)
            case ast.Name(id=name) if name in self.types:
                return Expression(spell(name), self.types[name])
            case ast.Name(id=name) if name in self.structs:
                raise self.refusal(node, f"struct {name!r} as a value; read one of its fields")
            case ast.Attribute(value=ast.Name(id=name), attr=attribute) if name in self.structs:
                return self.uniform(node, name, attribute)
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
            case ast.Compare(ops=[_, _, *_]):
                raise self.refusal(node, f"{ast.unparse(node)} joins comparisons; join them with `and`")
            case _:
                raise self.refusal(node, f"{ast.unparse(node)} is a {type(node).__name__} expression")

    def uniform(self, node: ast.Attribute, struct: str, name: str) -> Expression:
        fields = uniforms_of(self.structs[struct]) or {}
        if name not in fields:
            raise self.refusal(node, f"{ast.unparse(node)} is not known; fields are {', '.join(fields)}")
        return fields[name]

    def literal(self, node: ast.expr, value: object) -> Expression:
        match value:
            case bool():
                return Expression(str(value).lower(), "bool")
            case int():
                return Expression(str(value), "int")
            case float():
                return Expression(repr(value), "float")
            case wp.int32() | wp.float32():
                return self.literal(node, value.value)
            case wp.uint32():
                return Expression(f"{value.value % (1 << 32)}u", "uint")
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
        if value.type == PAIR:
            if not index.code.isdigit():
                raise self.refusal(node, f"{ast.unparse(node)}: expected a number as the index")
            half, component = divmod(int(index.code), 4)
            return Expression(f"{value.code}[{half}][{component}]", "float")
        if value.type in _COMPONENTS:
            return Expression(f"{value.code}[{index.code}]", _COMPONENTS[value.type])
        raise self.refusal(node, f"{value.type} has no elements")

    def call(self, node: ast.Call) -> Expression:
        if node.keywords:
            raise self.refusal(node, "keyword arguments")
        callee = self.resolve(node.func)
        constructor = CASTS[callee] if isinstance(callee, str) else type_name(callee)
        if constructor is not None:
            codes = ", ".join(self.expression(argument).code for argument in node.args)
            zeros = ", ".join(["0.0"] * 32) if constructor == REGISTERS else "0.0"
            return Expression(f"{constructor}({codes or zeros})", constructor)
        if isinstance(callee, wp.Function) and callee.is_builtin():
            if callee.key not in BUILTINS:
                raise self.refusal(node, f"wp.{callee.key} has no equivalent in GLSL")
            return BUILTINS[callee.key](*(self.expression(argument) for argument in node.args))
        function, arguments, returned = self.called(node)
        if len(returned) > 1:
            raise self.refusal(node, f"{len(returned)} values of {ast.unparse(node)} in an expression")
        codes = ", ".join(argument.code for argument in arguments)
        return Expression(f"{function.key}({codes})", returned[0])

    def called(self, node: ast.Call) -> tuple[wp.Function, list[Expression], tuple[str, ...]]:
        """Return the typed function of a call, its arguments, and the types of its results."""
        callee = self.resolve(node.func)
        if not isinstance(callee, wp.Function) or callee.is_builtin():
            raise self.refusal(node, f"{ast.unparse(node.func)} is not a typed function")
        hints = dict(callee.func.__annotations__)
        returned = returned_types(hints)
        hints.pop("return", None)
        arguments = [self.expression(argument) for argument in self.passed(node, list(hints.values()))]
        if callee not in self.callees:
            self.callees.append(callee)
        if not returned:
            raise self.refusal(node, f"{written_name(callee)} does not say what it returns")
        expected = [type_name(hint) for hint in hints.values() if uniforms_of(hint) is None]
        types = [argument.type for argument in arguments]
        if expected != types:
            takes = ", ".join(map(str, expected))
            raise self.refusal(node, f"{written_name(callee)} takes {takes}, got {', '.join(types)}")
        return callee, arguments, returned

    def passed(self, node: ast.Call, hints: list[Any]) -> Iterator[ast.expr]:
        """Yield the arguments that a call has in GLSL: all but the structs of uniforms, which must fit."""
        for number, argument in enumerate(node.args):
            hint = hints[number] if number < len(hints) else None
            if uniforms_of(hint) is None:
                yield argument
            elif not (isinstance(argument, ast.Name) and self.structs.get(argument.id) is hint):
                raise self.refusal(node, f"{ast.unparse(argument)} is not the struct of uniforms expected")


def returned_types(hints: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the types in GLSL of a function's results; none if one of them has no type there."""
    hint = hints.get("return")
    results = get_args(hint) if get_origin(hint) is tuple else (hint,)
    types = [type_name(result) for result in results]
    return () if None in types else tuple(map(str, types))


def written_name(function: wp.Function) -> str:
    """Return the name of a function in its source; copies of custom functions have other keys."""
    return str(getattr(function.func, "__name__", function.key))


def spell(name: str) -> str:
    """Return `name`, with an underscore if GLSL reserves it."""
    return name + "_" if name in RESERVED_WORDS else name
