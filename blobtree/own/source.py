"""A user's typed function: what it takes, whether every backend can run it, and a name of its own.

Two definitions may use the same names, and a shader has one space of names for all functions. So a user's
function and everything that it calls are made anew under names that carry a digest of their sources.
"""

import ast
import hashlib
import inspect
import linecache
import re
import textwrap
from dataclasses import dataclass, make_dataclass
from types import FunctionType
from typing import Any

import numpy as np
import warp as wp

from blobtree.errors import InvalidDefinition
from blobtree.nodes.tree import Node
from blobtree.typed.glsl import translate_library
from blobtree.typed.instantiate import rebound, references, typed
from blobtree.typed.loop_constants import changed_constants
from blobtree.typed.reference import Precision, reference

PLAIN_NAME = re.compile(r"[A-Za-z](_?[A-Za-z0-9])*")
"""Names that C++, GLSL and JSON take alike."""


@dataclass(frozen=True, eq=False)
class OwnSource:
    """A user's function under a name of its own."""

    name: str
    parameters: dict[str, Any]
    """Types by name, in order."""
    function: wp.Function
    python: FunctionType
    digest: str
    """Of its source, that of all it calls, and the constants that they name."""

    def digest_with(self, *claims: object) -> str:
        """A digest of the function and of what is claimed about it, the same in every process."""
        return hashlib.sha256(repr((self.digest, *claims)).encode()).hexdigest()[:12]

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.python.__code__.co_filename}:{self.python.__code__.co_firstlineno}"

    def refusal(self, reason: str) -> InvalidDefinition:
        """The error that says what is wrong with it."""
        return InvalidDefinition(f"{self.place}: {self.name}: {reason}")

    def reference(self, precision: Precision = np.float64) -> FunctionType:
        """The function as plain Python."""
        return reference(self.python, precision)


def own_source(function: Any, *, returns: Any) -> OwnSource:
    """Read a user's function; nothing is compiled.

    Raises
    ------
    InvalidDefinition
        It is no function with a source and a type for every parameter, or calls itself.
    UntranslatableFunction
        It leaves the subset of Python that Warp and GLSL share; the message names file and line.
    """
    python = _python_function(function)
    _require_source(python)
    hints = _hints(python)
    place = f"{python.__code__.co_filename}:{python.__code__.co_firstlineno}"
    names = list(inspect.signature(python).parameters)
    missing = [name for name in names if name not in hints]
    if missing:
        raise InvalidDefinition(f"{place}: {python.__name__}: parameter {missing[0]!r} lacks its type")
    if hints.get("return") not in (returns, None) or "return" not in hints:
        raise InvalidDefinition(
            f"{place}: {python.__name__}: expected it to return wp.{returns.__name__}, "
            f"got {_spelled(hints.get('return'))}; annotate it `-> wp.{returns.__name__}`"
        )
    _require_plain_names(python)
    digest = hashlib.sha256("\n".join(_sources(python, ())).encode()).hexdigest()[:12]
    made = _renamed(python, digest, {})
    translate_library([made])
    _require_variables(python)
    return OwnSource(python.__name__, {name: hints[name] for name in names}, made, python, digest)


def kind_name(source: OwnSource, name: str | None) -> str:
    """What files call the kind that is made of a function: `name`, or the function's own."""
    wanted = source.name if name is None else name
    if not isinstance(wanted, str) or not PLAIN_NAME.fullmatch(wanted):
        raise source.refusal(f"name: expected letters, digits and single underscores, got {wanted!r}")
    return wanted


def class_name(kind: str) -> str:
    """`super_ellipse` → `SuperEllipse`."""
    return "".join(word[:1].upper() + word[1:] for word in kind.split("_"))


def node_class(
    kind: str, source: OwnSource, fields: list[Any], base: type[Node], namespace: dict[str, Any]
) -> Any:
    """A node class with these fields, at home where the function is."""
    options: dict[str, Any] = {"frozen": True, "eq": False, "repr": False}
    made = make_dataclass(class_name(kind), fields, bases=(base,), namespace=namespace, **options)
    made.__module__ = source.python.__module__
    return made


def generated(name: str, source: str, scope: dict[str, Any]) -> wp.Function:
    """The typed function `name` of a generated `source`, which Warp and GLSL read from `linecache`."""
    file = f"<blobtree {name}>"
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    namespace: dict[str, Any] = {"wp": wp, **scope, "__name__": f"blobtree.own.{name}"}
    exec(compile(source, file, "exec"), namespace)
    return typed(namespace[name])


def _python_function(function: Any) -> FunctionType:
    python = function.func if isinstance(function, wp.Function) else function
    if not isinstance(python, FunctionType):
        raise InvalidDefinition(f"expected a typed function, got {function!r}; write it with `def`")
    if python.__name__ == "<lambda>":
        raise InvalidDefinition(
            f"{python.__code__.co_filename}:{python.__code__.co_firstlineno}: a lambda has no types; "
            "write a typed function with `def`"
        )
    return python


def _require_source(python: FunctionType) -> None:
    try:
        inspect.getsource(python)
    except (OSError, TypeError):
        raise InvalidDefinition(
            f"{python.__name__}: its source cannot be read, so it cannot be compiled; "
            "define it in a file or a notebook, not through exec() or at the plain prompt"
        ) from None


def _hints(python: FunctionType) -> dict[str, Any]:
    """Annotations, those written as text evaluated."""
    try:
        return inspect.get_annotations(python, eval_str=True)
    except Exception as error:  # annotations in quotes are evaluated: they may raise anything
        raise InvalidDefinition(f"{python.__name__}: its annotations cannot be read: {error}") from error


def _spelled(hint: Any) -> str:
    return "no annotation" if hint is None else getattr(hint, "__name__", repr(hint))


def _require_plain_names(python: FunctionType) -> None:
    for name in (*python.__code__.co_varnames, python.__name__):
        if not PLAIN_NAME.fullmatch(name.strip("_") or "x") or name.startswith("gl_"):
            raise InvalidDefinition(
                f"{python.__code__.co_filename}:{python.__code__.co_firstlineno}: {python.__name__}: "
                f"the name {name!r} does not exist in GLSL; use plain letters, digits and single underscores"
            )


def _require_variables(python: FunctionType) -> None:
    """No loop changes what Warp takes for a constant, here and in what is called."""
    lines, first = inspect.getsourcelines(python)
    (definition,) = ast.parse(textwrap.dedent("".join(lines))).body
    assert isinstance(definition, ast.FunctionDef)
    for name, line in changed_constants(definition):
        raise InvalidDefinition(
            f"{python.__code__.co_filename}:{first + line - 1}: {python.__name__}: a loop changes {name!r}, "
            f"which Warp takes for a constant; write `{name} = float(...)` or `int(...)` before the loop"
        )
    for callee in _typed_callees(python).values():
        assert isinstance(callee.func, FunctionType)
        _require_variables(callee.func)


def _typed_callees(python: FunctionType) -> dict[str, wp.Function]:
    return {
        name: value
        for name, value in references(python).items()
        if isinstance(value, wp.Function) and isinstance(value.func, FunctionType)
    }


def _sources(python: FunctionType, callers: tuple[FunctionType, ...]) -> list[str]:
    """The sources of a function and all that it calls, and the constants in them."""
    if python in callers:
        raise InvalidDefinition(f"{python.__name__}: it calls itself, which no shader can; write a loop")
    numbers = {name: value for name, value in references(python).items() if isinstance(value, int | float)}
    found = [inspect.getsource(python), repr(numbers)]
    for callee in _typed_callees(python).values():
        assert isinstance(callee.func, FunctionType)
        found += _sources(callee.func, (*callers, python))
    return found


def _renamed(python: FunctionType, digest: str, made: dict[FunctionType, wp.Function]) -> wp.Function:
    """`python` and what it calls as typed functions whose names end in `digest`."""
    if python not in made:
        callees = {
            name: _renamed(callee.func, digest, made)
            for name, callee in _typed_callees(python).items()
            if isinstance(callee.func, FunctionType)
        }
        name = re.sub(r"[^A-Za-z0-9]+", "_", python.__name__).strip("_")
        qualname = f"own_{name}_{len(made)}_{digest}"
        copy = rebound(python, callees, module=f"blobtree.own.{qualname}", qualname=qualname)
        copy.__annotations__ = _hints(python)
        made[python] = typed(copy)
    return made[python]
