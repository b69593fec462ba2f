"""Content of functions as digests, which are the same in every process and on every machine."""

import ast
import functools
import inspect
import sys
import sysconfig
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from blobtree.identity import content_hash
from decals.errors import InvalidInput
from decals.experiments.design import Trial

OURS = ("blobtree", "decals")
"""Packages whose versions a row names, so that their functions need no digest."""


def trial_hash(trial: Trial) -> str:
    """Return the content hash of the parameters of a trial; functions count by `fingerprint`.

    Examples
    --------
    >>> trial_hash({"count": 10, "seed": 0}) == trial_hash({"seed": 0, "count": 10})
    True
    """
    return content_hash(
        {
            name: fingerprint(value) if isinstance(value, FunctionType) else value
            for name, value in trial.items()
        }
    )


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a digest of the source of a function, and of all that it uses from the user's own files.

    Comments and layout do not count. Functions, classes and values that the source names count too, if they
    are defined outside of installed packages, or in the function's own module. Changes of installed packages
    show in the versions of a row.

    Parameters
    ----------
    function : callable
        A function, a class, or a `functools.partial` of one.

    Examples
    --------
    >>> def f(x):
    ...     return x
    >>> fingerprint(f) == fingerprint(f)
    True
    """
    parts: set[str] = set()
    seen: set[int] = set()
    waiting: list[Any] = [function]
    home = getattr(inspect.unwrap(getattr(function, "func", function)), "__module__", None)
    while waiting:
        value = waiting.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if isinstance(value, functools.partial):
            parts.add(content_hash([value.args, value.keywords]))
            waiting.append(value.func)
        elif _counts(value := inspect.unwrap(value), home):
            parts.add(_source(value))
            waiting += _used(value, parts)
    return content_hash(parts)


@functools.cache
def _installed() -> tuple[Path, ...]:
    """Return the folders of Python and of installed packages."""
    return tuple({Path(path).resolve() for path in sysconfig.get_paths().values()})


def _counts(value: Any, home: str | None) -> bool:
    """Return whether a value is a function or a class of the user's own files, or of the module `home`."""
    module = getattr(value, "__module__", None) or ""  # functions of `exec` have none
    if not isinstance(value, FunctionType | type):
        return False
    if module == home:
        return True
    if module.partition(".")[0] in OURS:
        return False
    file = getattr(sys.modules.get(module), "__file__", None)
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
    return repr([constant for constant in code.co_consts if not isinstance(constant, CodeType)])


def _codes(value: Any) -> Iterator[CodeType]:
    """Yield the code of a function or of the methods of a class, and the code inside it."""
    methods = vars(value).values() if isinstance(value, type) else (value,)
    waiting = [method.__code__ for method in methods if isinstance(method, FunctionType)]
    while waiting:
        code = waiting.pop()
        yield code
        waiting += [constant for constant in code.co_consts if isinstance(constant, CodeType)]


def _used(value: Any, parts: set[str]) -> Iterator[Any]:
    """Yield functions and classes that the source names; add the hashes of its other values to `parts`."""
    scope = getattr(value, "__globals__", None) or vars(sys.modules[value.__module__])
    closed = inspect.getclosurevars(value).nonlocals if isinstance(value, FunctionType) else {}
    for name in {name for code in _codes(value) for name in (*code.co_names, *code.co_freevars)}:
        yield from _functions_of(name, closed.get(name, scope.get(name)), parts)


def _functions_of(name: str, value: Any, parts: set[str]) -> Iterator[Any]:
    """Yield the functions of a value or a table of them; add the hash of other values to `parts`."""
    if isinstance(value, FunctionType):
        parts.add(f"{name} {_source(value) if value.__name__ == '<lambda>' else value.__qualname__}")
    if isinstance(value, FunctionType | type | functools.partial):
        yield value
    elif isinstance(value, dict | list | tuple) and any(map(callable, _members(value).values())):
        for key, member in _members(value).items():
            yield from _functions_of(f"{name}[{key!r}]", member, parts)
    elif value is not None and not inspect.ismodule(value):
        try:
            parts.add(f"{name} {content_hash(value)}")
        except InvalidInput:
            return  # an object such as a logger


def _members(value: dict[Any, Any] | list[Any] | tuple[Any, ...]) -> dict[Any, Any]:
    return value if isinstance(value, dict) else dict(enumerate(value))
