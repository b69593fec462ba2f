"""Variables that Warp takes for constants: what GLSL and Python allow and Warp does not.

`x = 0.0` is a constant to Warp, which a loop may not change; `x = float(0.0)` is a variable. Warp says so
when a kernel is compiled, which may be long after the function was written.
"""

import ast
from collections.abc import Iterator


def changed_constants(definition: ast.FunctionDef) -> Iterator[tuple[str, int]]:
    """Names, and the lines on which a loop changes what was a plain number before it."""
    constants: set[str] = set()
    for statement in definition.body:
        yield from _changed(statement, constants, in_loop=False)


def _changed(statement: ast.stmt, constants: set[str], *, in_loop: bool) -> Iterator[tuple[str, int]]:
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
                yield from _changed(inner, constants, in_loop=True)
        case ast.If(body=body, orelse=orelse):
            for inner in (*body, *orelse):
                yield from _changed(inner, constants, in_loop=in_loop)


def _is_number(value: ast.expr) -> bool:
    match value:
        case ast.Constant(value=int() | float()):
            return True
        case ast.UnaryOp(operand=operand):
            return _is_number(operand)
    return False
