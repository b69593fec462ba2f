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
    are defined outside of installed packages. Changes of these packages show in the versions of a row.

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
    while waiting:
        value = waiting.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if isinstance(value, functools.partial):
            parts.add(content_hash([value.args, value.keywords]))
            waiting.append(value.func)
        elif _is_users(value := inspect.unwrap(value)):
            parts.add(_source(value))
            waiting += _used(value, parts)
    return content_hash(parts)


@functools.cache
def _installed() -> tuple[Path, ...]:
    """Return the folders of Python and of installed packages."""
    return tuple({Path(path).resolve() for path in sysconfig.get_paths().values()})


def _is_users(value: Any) -> bool:
    """Return whether a value is a function or a class of the user's own files."""
    module = getattr(value, "__module__", None) or ""  # functions of `exec` have none
    if not isinstance(value, FunctionType | type) or module.partition(".")[0] in OURS:
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
        used = closed.get(name, scope.get(name))
        if isinstance(used, FunctionType | type | functools.partial):
            yield used
        elif used is not None and not inspect.ismodule(used):
            try:
                parts.add(f"{name} {content_hash(used)}")
            except InvalidInput:
                continue  # an object such as a logger
