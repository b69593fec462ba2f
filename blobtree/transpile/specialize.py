"""Copies of typed functions: over other globals (`rebind`), or with loops over tables unrolled (`unrolled`).

`unrolled` replaces ``for code in range(wp.static(len(TABLE)))`` by a copy of the loop's body for each row.
Warp unrolls such loops too, but only at compile time. The functions in the table are then no reliable part of
the key of Warp's kernel cache: stale kernels are kept, and others are compiled twice. An unrolled function
names its callees, so the key covers them. A row's function that declares fewer parameters than the call has
arguments gets the first ones.
"""

import ast
import dis
import hashlib
import inspect
import linecache
import textwrap
from collections.abc import Iterator, Mapping
from types import CellType, CodeType, FunctionType
from typing import Any, cast

import warp as wp

_GLOBAL_LOOKUPS = {"LOAD_GLOBAL", "LOAD_NAME"}


def referenced_values(function: FunctionType) -> dict[str, Any]:
    """Return the globals and closure variables that `function` and its nested functions read, by name."""
    closure = {
        name: cell.cell_contents
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        if _is_filled(cell)
    }
    scope = function.__globals__
    global_values = {name: scope[name] for name in _global_names(function.__code__) if name in scope}
    return {**global_values, **closure}


def rebind(
    function: FunctionType, replaced: Mapping[str, Any], *, module: str, qualname: str | None = None
) -> FunctionType:
    """Copy `function` with other values for the globals and closure variables named in `replaced`."""
    cells = tuple(
        CellType(replaced[name]) if name in replaced else cell
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    )
    copy = FunctionType(
        function.__code__,
        {**function.__globals__, **replaced},
        function.__name__,
        function.__defaults__,
        cells,
    )
    copy.__annotations__ = dict(function.__annotations__)
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__doc__ = function.__doc__
    copy.__qualname__ = qualname or function.__qualname__
    copy.__module__ = module
    return copy


def warp_function(_function: FunctionType) -> wp.Function:
    """Apply `@wp.func`.

    Warp looks for overloads among the local variables of its caller. This function has none.
    """
    return cast("wp.Function", wp.func(_function))


def parameter_count(function: wp.Function) -> int:
    """Return the number of parameters that a typed function declares."""
    return len(inspect.signature(cast("FunctionType", function.func)).parameters)


def _is_filled(cell: CellType) -> bool:
    """Return True if a closure variable has a value; it has none before its assignment was executed."""
    try:
        cell.cell_contents  # noqa: B018  (reading an empty cell raises)
    except ValueError:
        return False
    return True


def _global_names(code: CodeType) -> list[str]:
    """Return the names of globals that code and its nested code read, without those of attributes."""
    names = {step.argval for step in dis.get_instructions(code) if step.opname in _GLOBAL_LOOKUPS}
    nested = [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return sorted(names.union(*map(_global_names, nested)))


_ORIGINALS: dict[wp.Function, FunctionType] = {}


def unrolled(function: FunctionType) -> Any:
    """Unroll the loops over tables in `function` and apply `@wp.func`; callees must be defined before."""
    result = warp_function(_unroll(function))
    _ORIGINALS[result] = function
    return result


def original_function(function: wp.Function) -> FunctionType | None:
    """Return the function from which `unrolled` made this one, or None."""
    return _ORIGINALS.get(function)


def _unroll(function: FunctionType) -> FunctionType:
    """Return a function of the same name and module without loops over tables."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    (definition,) = tree.body
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list = []
    scope = dict(function.__globals__)
    unroller = _Unroller(scope)
    text = ast.unparse(ast.fix_missing_locations(unroller.visit(tree))) + "\n"
    scope |= unroller.row_functions
    file = f"<blobtree {function.__name__} {hashlib.sha256(text.encode()).hexdigest()[:12]}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    exec(compile(text, file, "exec"), scope)
    result: FunctionType = scope[function.__name__]
    result.__module__ = function.__module__
    return result


class _Unroller(ast.NodeTransformer):
    """Transformer that unrolls loops over tables and evaluates `wp.static`."""

    def __init__(self, scope: dict[str, Any]) -> None:
        self._scope = scope
        self._row: dict[str, int] = {}
        self.row_functions: dict[str, wp.Function] = {}
        """Functions in the rows of tables, by the names that replace them in the source."""

    def visit_For(self, node: ast.For) -> Any:
        """Replace the loop by a copy of its body for each row of the table."""
        match node:
            case ast.For(
                target=ast.Name(id=variable),
                iter=ast.Call(func=ast.Name(id="range"), args=[ast.Call() as limit]),
            ) if _is_static(limit):
                return list(self._copies(node, variable, self._evaluate(limit)))
        return self.generic_visit(node)

    def _copies(self, node: ast.For, variable: str, count: int) -> Iterator[ast.stmt]:
        for row in range(count):
            self._row[variable] = row
            body = ast.parse(ast.unparse(ast.Module(node.body, []))).body
            yield from (self.visit(statement) for statement in body)
            del self._row[variable]

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Replace the variable of the loop by the number of the row."""
        return ast.Constant(self._row[node.id]) if node.id in self._row else node

    def visit_Call(self, node: ast.Call) -> Any:
        """Replace `wp.static(...)` by its value."""
        if isinstance(node.func, ast.Call) and _is_static(node.func):
            node.args = node.args[: parameter_count(self._evaluate(node.func))]
        if not _is_static(node):
            return self.generic_visit(node)
        value = self._evaluate(node)
        if not isinstance(value, wp.Function):
            return ast.Constant(value)
        name = f"{value.key}_{len(self.row_functions)}"
        self.row_functions[name] = value
        return ast.Name(name, ast.Load())

    def _evaluate(self, node: ast.Call) -> Any:
        return eval(ast.unparse(node.args[0]), {**self._scope, **self._row})


def _is_static(node: ast.Call) -> bool:
    return ast.unparse(node.func) == "wp.static"
