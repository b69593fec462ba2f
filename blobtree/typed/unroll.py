"""Loops over tables written out: `for code in range(wp.static(len(TABLE)))` is a copy of its body per row.

Warp unrolls such loops too, but only while it compiles. So what it finds in the table is no sure part of the
key under which it keeps compiled kernels: it keeps stale ones, and compiles others again, depending on what
was compiled before them. A function that is written out names what it calls, and Warp sees all of it.
"""

import ast
import hashlib
import inspect
import linecache
import textwrap
from collections.abc import Iterator
from types import FunctionType
from typing import Any

import warp as wp

from blobtree.typed.instantiate import typed

_ORIGINALS: dict[wp.Function, FunctionType] = {}


def unrolled(function: FunctionType) -> Any:
    """What `@wp.func` makes of `function` once its loops over tables are written out.

    What it calls must stand above it.
    """
    made = typed(_written_out(function))
    _ORIGINALS[made] = function
    return made


def original(function: wp.Function) -> FunctionType | None:
    """The function that `unrolled` was given, None where it was not."""
    return _ORIGINALS.get(function)


def _written_out(function: FunctionType) -> FunctionType:
    """A function of the same name and module without loops over tables."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    (definition,) = tree.body
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list = []
    scope = dict(function.__globals__)
    unroller = _Unroller(scope)
    text = ast.unparse(ast.fix_missing_locations(unroller.visit(tree))) + "\n"
    scope |= unroller.named
    file = f"<blobtree {function.__name__} {hashlib.sha256(text.encode()).hexdigest()[:12]}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    exec(compile(text, file, "exec"), scope)
    result: FunctionType = scope[function.__name__]
    result.__module__ = function.__module__
    return result


class _Unroller(ast.NodeTransformer):
    """Replaces loops over tables, and what `wp.static` says in them."""

    def __init__(self, scope: dict[str, Any]) -> None:
        self._scope = scope
        self._turn: dict[str, int] = {}
        self.named: dict[str, wp.Function] = {}
        """Functions of rows, by the names that they are given."""

    def visit_For(self, node: ast.For) -> Any:
        """As many copies of the body as the table has rows."""
        match node:
            case ast.For(
                target=ast.Name(id=variable),
                iter=ast.Call(func=ast.Name(id="range"), args=[ast.Call() as limit]),
            ) if _is_static(limit):
                return list(self._copies(node, variable, self._evaluated(limit)))
        return self.generic_visit(node)

    def _copies(self, node: ast.For, variable: str, count: int) -> Iterator[ast.stmt]:
        for turn in range(count):
            self._turn[variable] = turn
            body = ast.parse(ast.unparse(ast.Module(node.body, []))).body
            yield from (self.visit(statement) for statement in body)
            del self._turn[variable]

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """The loop's variable is a number."""
        return ast.Constant(self._turn[node.id]) if node.id in self._turn else node

    def visit_Call(self, node: ast.Call) -> Any:
        """`wp.static(...)` is what it says."""
        if not _is_static(node):
            return self.generic_visit(node)
        value = self._evaluated(node)
        if not isinstance(value, wp.Function):
            return ast.Constant(value)
        name = f"{value.key}_{len(self.named)}"
        self.named[name] = value
        return ast.Name(name, ast.Load())

    def _evaluated(self, node: ast.Call) -> Any:
        return eval(ast.unparse(node.args[0]), {**self._scope, **self._turn})


def _is_static(node: ast.Call) -> bool:
    return ast.unparse(node.func) == "wp.static"
