"""Content of functions as digests, which are the same in every process and on every machine."""

import ast
import builtins
import dis
import functools
import importlib.util
import inspect
import sys
import sysconfig
import textwrap
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from enum import Enum
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

from blobtree.identity import content_hash
from decals.errors import ImplicitDecalsError, InvalidInput
from decals.experiments.design import Trial

INNER = ("__wrapped__", "func", "fget", "__func__", "pyfunc", "py_func")
"""Attributes in which wrappers, such as caches, properties and kernels of Warp, hold their function."""

OURS = ("blobtree", "decals")
"""Packages whose versions a row names, so that their functions need no digest."""


def trial_hash(trial: Trial) -> str:
    """Return the content hash of the parameters of a trial; functions count by `fingerprint`.

    Raises
    ------
    InvalidInput
        A parameter has no content hash.

    Examples
    --------
    >>> trial_hash({"count": 10, "seed": 0}) == trial_hash({"seed": 0, "count": 10})
    True
    """
    return content_hash({name: _parameter(name, value) for name, value in trial.items()})


def _parameter(name: str, value: Any) -> Any:
    """Return a value with a content hash that stands for a parameter."""
    try:
        content_hash(value)
    except ImplicitDecalsError as error:
        if callable(value):
            return fingerprint(value)
        raise InvalidInput(f"parameter {name!r}: {error}") from None
    return value


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a digest of the source of a function, and of all that it uses from the user's own files.

    Comments and layout do not count. Functions, classes and values that the source names count too, if they
    are defined outside of installed packages, or in the function's own module: also defaults of arguments,
    decorators, modules of the user, and what objects hold. Changes of installed packages show in the
    versions of a row.

    Parameters
    ----------
    function : callable
        A function, a method, a class, an object that can be called, or a `functools.partial` of one.

    Examples
    --------
    >>> def f(x):
    ...     return x
    >>> fingerprint(f) == fingerprint(f)
    True
    """
    parts: set[str] = set()
    seen: dict[int, Any] = {}
    waiting: list[tuple[str, Any]] = [("", function)]
    home = getattr(inspect.unwrap(getattr(function, "func", function)), "__module__", None)
    while waiting:
        name, value = waiting.pop()
        label = getattr(value, "__qualname__", getattr(value, "__name__", None))
        if isinstance(label, str):  # of functions, also of packages
            parts.add(f"{name} {_source(value) if label.endswith('<lambda>') else label}")
        if isinstance(value, FunctionType | type) and _counts(value, home):
            parts.add(_source(value))
        if (content := _content(value)) is not None:
            parts.add(f"{name} {content}")
        if id(value) not in seen:
            seen[id(value)] = value
            waiting += _inside(value, home, known=content is not None)
    return content_hash(parts)


def _content(value: Any) -> str | None:
    """Return the content hash of a value; None of functions, and of objects such as a logger."""
    with suppress(ImplicitDecalsError):
        return content_hash(value)
    return None


def _inside(value: Any, home: str | None, *, known: bool) -> Iterable[tuple[str, Any]]:
    """Return names and values of what a value uses or holds; with `known` its content is known already."""
    if isinstance(value, functools.partial):
        return [("function", value.func), ("arguments", value.args), ("keywords", value.keywords)]
    if isinstance(value, MethodType):
        return [("function", value.__func__), ("object", value.__self__)]
    if isinstance(value, FunctionType):
        return [*_wrapped(value), *(_used(value) if _counts(value, home) else ())]
    if isinstance(value, type):
        return _members(value) if _counts(value, home) else ()
    own = [("class", type(value))] if _counts(type(value), home) else []
    if known or isinstance(value, ModuleType):
        return own
    if isinstance(value, dict):
        return [(repr(key), member) for key, member in value.items()]
    if isinstance(value, list | tuple):
        return [(str(number), member) for number, member in enumerate(value)]
    return [*own, *(getattr(value, "__dict__", {}).items() if own else ()), *_wrapped(value)]


def _wrapped(value: Any) -> list[tuple[str, Any]]:
    """Return the functions that a wrapper holds."""
    inner = ((name, getattr(value, name, None)) for name in INNER)
    return [(name, function) for name, function in inner if isinstance(function, FunctionType)]


@functools.cache
def _installed() -> tuple[Path, ...]:
    """Return the folders of Python and of installed packages."""
    return tuple({Path(path).resolve() for path in sysconfig.get_paths().values()})


def _counts(value: Any, home: str | None) -> bool:
    """Return True if a function or class is from the user's own files, or from the module `home`."""
    module = getattr(value, "__module__", None) or ""  # functions of `exec` have none
    return module == home or _is_own(module)


def _is_own(module: str) -> bool:
    """Return True if a module is one of the user."""
    return _is_of_user(module, getattr(sys.modules.get(module), "__file__", None))


def _is_of_user(module: str, file: str | None) -> bool:
    """Return whether a module lies neither in this package, nor in Python, nor in an installed package."""
    if module.partition(".")[0] in (*OURS, *sys.builtin_module_names):
        return False
    return file is None or not any(Path(file).resolve().is_relative_to(folder) for folder in _installed())


def _source(value: Any) -> str:
    """Return the source without comments and layout; the code where there is no source of its own."""
    if getattr(value, "__name__", "") == "<lambda>":  # a line may hold several
        return _bytecode(value)
    try:
        return ast.dump(ast.parse(textwrap.dedent(inspect.getsource(value))))
    except (OSError, TypeError, SyntaxError):
        return _bytecode(value)


def _bytecode(value: Any) -> str:
    return "".join(f"{code.co_code.hex()} {code.co_names} {_constants(code)}" for code in _codes(value))


def _constants(code: CodeType) -> str:
    return str([_constant(value) for value in code.co_consts if not isinstance(value, CodeType)])


def _constant(value: Any) -> str:
    """Return a constant as a text that does not depend on the order of a set."""
    if isinstance(value, tuple | frozenset):
        texts = [_constant(member) for member in value]
        return f"{type(value).__name__} {texts if isinstance(value, tuple) else sorted(texts)}"
    return repr(value)


def _codes(value: Any) -> Iterator[CodeType]:
    """Yield the code of a function, and the code inside it."""
    waiting = [value.__code__] if isinstance(value, FunctionType) else []
    while waiting:
        code = waiting.pop()
        yield code
        waiting += [constant for constant in code.co_consts if isinstance(constant, CodeType)]


def _members(kind: type) -> Iterator[tuple[str, Any]]:
    """Yield bases, methods, properties and values of a class."""
    yield from (("base", base) for base in kind.__bases__)
    if issubclass(kind, Enum):
        yield from ((member.name, member.value) for member in kind)
    for name, member in vars(kind).items():
        if isinstance(member, FunctionType | staticmethod | classmethod) or not name.startswith("_"):
            yield name, member


def _used(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield the values that the source of a function names, its defaults, and those of the user's modules."""
    yield "defaults", function.__defaults__ or ()
    yield "defaults by name", function.__kwdefaults__ or {}
    closed = inspect.getclosurevars(function).nonlocals
    scope = {**vars(builtins), **function.__globals__, **closed}
    names = {name for code in _codes(function) for name in (*code.co_names, *code.co_freevars)}
    found = {name: scope[name] for name in names if name in scope}
    yield from found.items()
    waiting = [value for value in found.values() if isinstance(value, ModuleType)]
    waiting += _imported(function)
    while waiting:
        if _is_own((module := waiting.pop()).__name__):
            members = {name: vars(module)[name] for name in names if name in vars(module)}
            yield from members.items()
            waiting += [value for value in members.values() if isinstance(value, ModuleType)]


def _imported(function: FunctionType) -> Iterator[ModuleType]:
    """Yield the modules of the user that a function imports."""
    package = function.__globals__.get("__package__") or ""
    for code in _codes(function):
        instructions = list(dis.get_instructions(code))
        for level, _, imported in zip(instructions, instructions[1:], instructions[2:], strict=False):
            if imported.opname == "IMPORT_NAME":
                name = "." * int(level.argval or 0) + str(imported.argval)
                with suppress(Exception):  # of any kind, as the module is the user's; the trial shows it
                    yield from _own_module(name, package)


def _own_module(name: str, package: str) -> Iterator[ModuleType]:
    """Yield the module of a name if it is the user's; others, which may be large, are not imported."""
    full = importlib.util.resolve_name(name, package)
    spec = importlib.util.find_spec(full.partition(".")[0])
    if spec is not None and spec.origin and _is_of_user(spec.name, spec.origin):
        yield importlib.import_module(full)
