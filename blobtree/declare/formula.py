"""Formulas: typed functions of kinds, each with its source and a unique name.

A kind declares its formulas in the body of its class, as static functions after `@formula`.

Two definitions may use the same names, and a shader has one namespace for all functions. Hence a user's
function and all functions that it calls are copied under names that carry a digest of their sources. The
formulas of this package are named after their kind instead; tests check them, and no import does.
"""

import ast
import difflib
import hashlib
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, field, replace
from types import FunctionType
from typing import Any

import numpy as np
import warp as wp

from blobtree._typing import Float64Array
from blobtree.errors import InvalidDefinition
from blobtree.transpile.derivative import partial_derivatives
from blobtree.transpile.glsl import translate_library
from blobtree.transpile.python import Precision, find_changed_constants, plain_python
from blobtree.transpile.specialize import defined, rebind, referenced_values, warp_function

PLAIN_NAME = re.compile(r"[A-Za-z](_?[A-Za-z0-9])*")
"""Names that are valid in C++, GLSL and JSON."""


@dataclass(frozen=True, eq=False)
class Formula:
    """A typed function under a unique name."""

    name: str
    parameters: dict[str, Any]
    """Types by name, in order."""
    function: wp.Function
    python: FunctionType
    digest: str
    """Digest of its source, of the functions that it calls, and of their constants."""
    _references: dict[Precision, FunctionType] = field(default_factory=dict, init=False, repr=False)

    def digest_with(self, *claims: object) -> str:
        """Return a digest of the function and the claims about it, the same in every process."""
        return hashlib.sha256(repr((self.digest, *claims)).encode()).hexdigest()[:12]

    @property
    def location(self) -> str:
        """File and line of the function."""
        return f"{self.python.__code__.co_filename}:{self.python.__code__.co_firstlineno}"

    def refusal(self, reason: str) -> InvalidDefinition:
        """Return the error that states the function's location and a reason."""
        label = self.python.__qualname__.rpartition("<locals>.")[2]
        return InvalidDefinition(f"{self.location}: {label}: {reason}")

    def reference(self, precision: Precision = np.float64) -> FunctionType:
        """Return the function as plain Python, in a floating-point type; it is translated once."""
        if precision not in self._references:
            assert isinstance(self.function.func, FunctionType)
            self._references[precision] = plain_python(self.function.func, precision)
        return self._references[precision]


class Declared:
    """A formula in the body of a class, before the class exists."""

    def __init__(self, function: Any) -> None:
        self.function = function


def formula(function: Callable[..., Any] | Formula) -> Any:
    """Mark a function in the body of a kind as one of its formulas: a static, typed function.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import Falloff, formula
    >>> class Parabola(Falloff):
    ...     @formula
    ...     def value(d: wp.float32) -> wp.float32:
    ...         return 1.0 - d * d
    >>> round(Parabola().rim, 4)
    0.7071
    """
    return Declared(function)


def is_own(kind: Any) -> bool:
    """Return True for a kind of this package."""
    return str(kind.__module__).partition(".")[0] == __name__.partition(".")[0]


def tag_of(kind: type) -> str:
    """Return the name of a kind in files: its `tag`, or the name of its class, `SoftObject` → `soft_object`.

    Raises
    ------
    InvalidDefinition
        It is no plain name.
    """
    tag = vars(kind).get("tag", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__).lower())
    if not isinstance(tag, str) or not PLAIN_NAME.fullmatch(tag):
        raise InvalidDefinition(
            f"{kind.__qualname__}: tag: expected letters, digits and single underscores, got {tag!r}"
        )
    return tag


def require_claims(kind: type, sort: str) -> None:
    """Raise `InvalidDefinition` for a misspelt claim in the body of a kind.

    That is a value in lower case, or a class method with nearly the name of another, which no base has.
    """
    known = [name for name in dir(kind.__mro__[1]) if not name.startswith("_")]
    for name, value in vars(kind).items():
        if name.startswith("_") or name in ("tag", *known, *inspect.get_annotations(kind)):
            continue
        alike = difflib.get_close_matches(name, known, 1)
        plain = name.islower() and not (
            hasattr(value, "__get__") or isinstance(value, type | Declared | Field)
        )
        if plain or (isinstance(value, classmethod) and alike):
            meant = f"; did you mean {alike[0]!r}?" if alike else ""
            raise InvalidDefinition(
                f"{kind.__qualname__}: {name!r} is no claim of {sort}{meant}; begin a name of your own with "
                "an underscore"
            )


def declared_formulas(kind: type, tag: str, results: Mapping[str, Any]) -> dict[str, Formula]:
    """Take the formulas out of the body of a class, and return them by name.

    `results` has the type of the result of each formula that the sort of the kind knows.

    Raises
    ------
    InvalidDefinition
        A formula has no types, no source or an unknown name.
    UntranslatableFunction
        A formula leaves the subset of Python that Warp and GLSL share.
    """
    formulas = {}
    for name, declared in list(vars(kind).items()):
        if isinstance(declared, Declared):
            if name not in results:
                known = ", ".join(results)
                raise InvalidDefinition(
                    f"{kind.__qualname__}: formula {name!r}: expected one of {known}; remove @formula, or "
                    "rename it"
                )
            if is_own(kind):
                formulas[name] = _own_formula(declared.function, f"{tag}_{name}")
            else:
                formulas[name] = formula_of(declared.function, returns=results[name])
            delattr(kind, name)
    return formulas


def _own_formula(given: FunctionType | wp.Function, name: str) -> Formula:
    """Return a formula of this package under a name, or a function of the module as it is."""
    python = python_function(given)
    if python is given:
        python.__qualname__ = name
    hints = {key: hint for key, hint in python.__annotations__.items() if key != "return"}
    function = given if isinstance(given, wp.Function) else warp_function(python)
    return Formula(name, hints, function, python, "")


def formula_of(function: Any, *, returns: Any) -> Formula:
    """Read a user's function without compiling it; one that has been read is returned as it is.

    Raises
    ------
    InvalidDefinition
        It is not a function with a source and a type for every parameter, or it calls itself.
    UntranslatableFunction
        It leaves the subset of Python that Warp and GLSL share; the message names file and line.
    """
    if isinstance(function, Formula):
        return function
    python = python_function(function)
    _require_source(python)
    hints = _hints(python)
    location = f"{python.__code__.co_filename}:{python.__code__.co_firstlineno}"
    names = list(inspect.signature(python).parameters)
    missing = [name for name in names if name not in hints]
    if missing:
        raise InvalidDefinition(f"{location}: {python.__name__}: parameter {missing[0]!r} lacks its type")
    if hints.get("return") not in (returns, None) or "return" not in hints:
        raise InvalidDefinition(
            f"{location}: {python.__name__}: expected it to return {spelled(returns)}, "
            f"got {spelled(hints.get('return'))}; annotate it `-> {spelled(returns)}`"
        )
    _require_plain_names(python)
    digest = hashlib.sha256("\n".join(_sources(python, ())).encode()).hexdigest()[:12]
    function_copy = _renamed(python, digest, {})
    translate_library([function_copy])
    _require_variables(python)
    return Formula(python.__name__, {name: hints[name] for name in names}, function_copy, python, digest)


def returned_type(function: Any) -> Any:
    """Return the annotated type of a function's result, None if it has none."""
    return _hints(python_function(function)).get("return")


def kind_name(source: Formula, name: str | None) -> str:
    """Return the name of a kind in files: `name`, or that of its function."""
    kind = source.name if name is None else name
    if not isinstance(kind, str) or not PLAIN_NAME.fullmatch(kind):
        raise source.refusal(f"name: expected letters, digits and single underscores, got {kind!r}")
    return kind


def class_name(kind: str) -> str:
    """Return the name of a kind's class: `super_ellipse` → `SuperEllipse`."""
    return "".join(word[:1].upper() + word[1:] for word in kind.split("_"))


def generated(
    kind: str, digest: str, part: str, template: str, scope: dict[str, Any], **texts: str
) -> wp.Function:
    """Return the typed function of a template, a part of a kind; `scope` has what it calls.

    Kinds of this package have no digest.
    """
    name = f"custom_{kind}_{part}_{digest}" if digest else f"made_{kind}_{part}"
    known = {"wp": wp, "__name__": f"blobtree.custom.{name}", **scope}
    return warp_function(defined(name, template.format(name=name, **texts), known))


def derived(source: Formula, varying: Sequence[str], template: str, least: float | None = None) -> Formula:
    """Return a function of the value and the partial derivatives of a user's function.

    The template's ``{partials}`` is the call that returns both, ``{typed}`` are the typed parameters.
    Those that vary are raised to `least` in the call.

    Raises
    ------
    UntranslatableFunction
        The function has no derivative here; the message names file and line.
    """
    partials = partial_derivatives(source.function, varying)
    typed = ", ".join(f"{name}: {spelled(kind)}" for name, kind in source.parameters.items())
    raised = {name: f"wp.max({name}, {least!r})" for name in varying if least is not None}
    call = f"{partials.key}({', '.join(raised.get(name, name) for name in source.parameters)})"
    scope = {partials.key: partials}
    function = generated(source.name, source.digest, "derived", template, scope, typed=typed, partials=call)
    return replace(source, function=function)


def result_of(
    source: Formula,
    function: Callable[..., Any],
    arguments: list[Any],
    where: Callable[[], str],
    size: int,
) -> Float64Array:
    """Return the result of a function as `size` numbers; raise `InvalidDefinition` otherwise.

    `where` says for errors at which arguments it is called.
    """
    try:
        with np.errstate(all="ignore"):
            result = np.array(function(*arguments), np.float64, ndmin=1)
    except ArithmeticError as error:
        raise source.refusal(f"for {where()} it fails: {error}; it must have a result everywhere") from error
    except Exception as error:  # the function is the user's own
        raise source.refusal(f"for {where()} it fails: {type(error).__name__}: {error}") from error
    if result.shape != (size,) or not all(map(math.isfinite, result.tolist())):  # quicker than NumPy's
        wanted = "a finite number" if size == 1 else f"{size} finite numbers"
        raise source.refusal(f"for {where()} it returns {shown(result)}; expected {wanted}")
    return result


def shown(numbers: Any) -> str:
    """Return a number, or several in parentheses, as messages show them."""
    flat = np.ravel(np.asarray(numbers, np.float64)).tolist()
    text = ", ".join(f"{number:.6g}" for number in flat)
    return text if len(flat) == 1 else f"({text})"


def python_function(function: Any) -> FunctionType:
    """Return the Python function of a user's function; raise `InvalidDefinition` for anything else."""
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
    """Return the annotations; those written as text are evaluated."""
    try:
        return inspect.get_annotations(python, eval_str=True)
    except Exception as error:  # annotations in quotes are evaluated: they may raise anything
        raise InvalidDefinition(f"{python.__name__}: its annotations cannot be read: {error}") from error


def spelled(hint: Any) -> str:
    """Return a type as users write it."""
    if hint is None:
        return "no annotation"
    name = getattr(hint, "__name__", repr(hint))
    name = re.sub(r"^(vec[234])f$", r"\1", name)  # the names of Warp's own classes end in f
    return f"wp.{name}" if getattr(wp, name, None) is hint else name


def _require_plain_names(python: FunctionType) -> None:
    for name in (*python.__code__.co_varnames, python.__name__):
        if not PLAIN_NAME.fullmatch(name.strip("_") or "x") or name.startswith("gl_"):
            raise InvalidDefinition(
                f"{python.__code__.co_filename}:{python.__code__.co_firstlineno}: {python.__name__}: "
                f"the name {name!r} does not exist in GLSL; use plain letters, digits and single underscores"
            )


def _require_variables(python: FunctionType) -> None:
    """Raise `InvalidDefinition` if a loop here, or in a called function, changes a constant of Warp's."""
    lines, first = inspect.getsourcelines(python)
    (definition,) = ast.parse(textwrap.dedent("".join(lines))).body
    assert isinstance(definition, ast.FunctionDef)
    for name, line in find_changed_constants(definition):
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
        for name, value in referenced_values(python).items()
        if isinstance(value, wp.Function) and isinstance(value.func, FunctionType)
    }


def _sources(python: FunctionType, callers: tuple[FunctionType, ...]) -> list[str]:
    """Return the sources of a function and of the functions that it calls, with their constants."""
    if python in callers:
        raise InvalidDefinition(f"{python.__name__}: it calls itself, which no shader can; write a loop")
    numbers = {
        name: value for name, value in referenced_values(python).items() if isinstance(value, int | float)
    }
    sources = [inspect.getsource(python), repr(numbers)]
    for callee in _typed_callees(python).values():
        assert isinstance(callee.func, FunctionType)
        sources += _sources(callee.func, (*callers, python))
    return sources


def _renamed(python: FunctionType, digest: str, renamed: dict[FunctionType, wp.Function]) -> wp.Function:
    """Return `python` as a typed function whose name, and those of its callees, end in `digest`."""
    if python not in renamed:
        callees = {
            name: _renamed(callee.func, digest, renamed)
            for name, callee in _typed_callees(python).items()
            if isinstance(callee.func, FunctionType)
        }
        name = re.sub(r"[^A-Za-z0-9]+", "_", python.__name__).strip("_")
        qualname = f"custom_{name}_{len(renamed)}_{digest}"
        copy = rebind(python, callees, module=f"blobtree.custom.{qualname}", qualname=qualname)
        copy.__annotations__ = _hints(python)
        renamed[python] = warp_function(copy)
    return renamed[python]
