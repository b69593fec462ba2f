"""Copies of typed functions over other globals (`rebind`), and functions that choose by a code (`RowChoice`).

Warp can unroll a loop over a table too, but only at compile time. The functions in the table are then no
reliable part of the key of Warp's kernel cache: stale kernels are kept, and others are compiled twice. The
text of a `RowChoice` names its callees, so the key covers them.
"""

import dis
import hashlib
import inspect
import linecache
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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


def defined(name: str, text: str, scope: dict[str, Any]) -> FunctionType:
    """Return the function `name` of a generated text, which `inspect` and Warp can read again."""
    file = f"<blobtree {name} {hashlib.sha256(text.encode()).hexdigest()[:12]}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    exec(compile(text, file, "exec"), scope)
    function: FunctionType = scope[name]
    return function


@dataclass(frozen=True, eq=False)
class RowChoice:
    """A typed function that takes a code, and returns the attribute of that row of a table.

    The attribute is a number, a bool or three or four numbers; or a typed function, which is called with the
    other parameters. One that declares fewer parameters gets the first ones.
    """

    prototype: FunctionType
    """Its name, types and docstring; it has no body."""
    table: str
    """Name of the table in an instruction set."""
    attribute: str

    def over(self, rows: Sequence[Any], module: str) -> wp.Function:
        """Return the function for a table."""
        result = warp_function(self._written(rows, module))
        _CHOICES[result] = self
        return result

    def fill(self, function: wp.Function, rows: Sequence[Any]) -> None:
        """Write a function anew, for another table, before Warp compiles it."""
        assert isinstance(function.func, FunctionType)
        full = warp_function(self._written(rows, function.func.__module__))
        function.func, function.adj = full.func, full.adj

    def _written(self, rows: Sequence[Any], module: str) -> FunctionType:
        code, *arguments = inspect.signature(self.prototype).parameters
        returned = self.prototype.__annotations__["return"]
        scope: dict[str, Any] = {"wp": wp, "__name__": module}
        lines = [
            f"def {self.prototype.__name__}({', '.join([code, *arguments])}):",
            f'    """{inspect.getdoc(self.prototype)}"""',
            f"    result = {_EMPTY.get(returned) or f'wp.{returned.__name__[:4]}()'}",
        ]
        for number, row in enumerate(rows):
            value = getattr(row, self.attribute)
            if isinstance(value, wp.Function):
                name = f"{value.key}_{number}"
                scope[name] = value
                text = f"{name}({', '.join(arguments[: parameter_count(value)])})"
            elif isinstance(value, tuple):
                text = f"wp.vec{len(value)}{value}"
            else:
                text = f"bool({value})" if isinstance(value, bool) else repr(value)
            lines += [f"    if {code} == {number}:", f"        result = {text}"]
        function = defined(self.prototype.__name__, "\n".join([*lines, "    return result", ""]), scope)
        function.__annotations__ = dict(self.prototype.__annotations__)
        function.__qualname__ = self.prototype.__qualname__
        return function


_EMPTY: dict[Any, str] = {wp.float32: "float(0.0)", wp.int32: "int(0)", wp.bool: "bool(False)"}
"""Numbers as Warp's variables, by type."""

_CHOICES: dict[wp.Function, RowChoice] = {}


def row_choice(function: wp.Function) -> RowChoice | None:
    """Return how a function chooses by a code, or None if it does not."""
    return _CHOICES.get(function)
