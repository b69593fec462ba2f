"""Public functions of the package that methods of scenes call.

These functions take scenes, so their files import those of scenes. The root of the package passes in how it
finds a function by its name.
"""

from collections.abc import Callable
from typing import Any

_finders: list[Callable[[str], Any]] = []


def provide(find: Callable[[str], Any]) -> None:
    """Let `find` return public functions by their names."""
    _finders.append(find)


def public(name: str) -> Any:
    """Return the public function or package of this name."""
    return _finders[-1](name)
