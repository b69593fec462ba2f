"""Functions made anew with other objects behind their names: one source, many sets of tables.

A typed function is written once and names what it calls and reads. `rebound` gives it other globals and other
closure cells; its code, and so its source and its lines in error messages, stay what they were. Vocabularies
instantiate kernels for other tables with it, and own kinds get names that collide with nobody's.
"""

import dis
from collections.abc import Mapping
from types import CellType, CodeType, FunctionType
from typing import Any, cast

import warp as wp

_GLOBAL_LOOKUPS = {"LOAD_GLOBAL", "LOAD_NAME"}


def references(function: FunctionType) -> dict[str, Any]:
    """What the names that `function` reads stand for, those inside its nested functions included."""
    closure = {
        name: cell.cell_contents
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        if _is_filled(cell)
    }
    scope = function.__globals__
    found = {name: scope[name] for name in _global_names(function.__code__) if name in scope}
    return {**found, **closure}


def rebound(
    function: FunctionType, replaced: Mapping[str, Any], *, module: str, qualname: str | None = None
) -> FunctionType:
    """A copy of `function` in which the names in `replaced` stand for other objects."""
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


def typed(_function: FunctionType) -> wp.Function:
    """What `@wp.func` makes; Warp looks for overloads among its caller's locals, so there are none here."""
    return cast("wp.Function", wp.func(_function))


def _is_filled(cell: CellType) -> bool:
    """A cell is empty while the function around it has not come to the name yet."""
    try:
        cell.cell_contents  # noqa: B018  (asking is what may fail)
    except ValueError:
        return False
    return True


def _global_names(code: CodeType) -> list[str]:
    """Names that code looks up outside of itself, not those of attributes; nested code's among them."""
    names = {step.argval for step in dis.get_instructions(code) if step.opname in _GLOBAL_LOOKUPS}
    nested = [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return sorted(names.union(*map(_global_names, nested)))
