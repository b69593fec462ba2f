"""Own kinds by name: how a file or another process finds the definition of a node.

A tree holds the names of its kinds, not their sources. Whoever loads it must have made the same definitions,
by importing the module that makes them; a definition made again under the same name takes its place.
"""

import copyreg
import importlib
from typing import Any

from blobtree.errors import UnknownKind


class OwnKind(type):
    """The type of node classes that `define_skeleton` and `define_operator` make."""

    kind: str
    digest: str
    parameters: tuple[Any, ...]


_KINDS: dict[str, OwnKind] = {}


def register(kind: OwnKind) -> None:
    """Make `kind` the one of its name."""
    _KINDS[kind.kind] = kind


def registered(name: str) -> OwnKind | None:
    """The kind of this name, None where there is none."""
    return _KINDS.get(name)


def find_kind(name: str) -> OwnKind:
    """The kind of this name.

    Raises
    ------
    UnknownKind
        This process has no definition of it.
    """
    if name not in _KINDS:
        known = ", ".join(sorted(_KINDS)) or "none"
        raise UnknownKind(
            f"own kind {name!r} is not defined in this process (defined: {known}); import the module that "
            "calls define_skeleton or define_operator for it (on the command line: --define), then try again"
        )
    return _KINDS[name]


def _unpickled(name: str, module: str) -> OwnKind:
    """The kind of this name, its module imported where nobody has done so yet."""
    if name not in _KINDS and module != "__main__":
        try:
            importlib.import_module(module)
        except ImportError as error:
            raise UnknownKind(
                f"own kind {name!r}: its module {module!r} cannot be imported: {error}"
            ) from None
    return find_kind(name)


def _pickled(kind: OwnKind) -> tuple[Any, ...]:
    return _unpickled, (kind.kind, kind.__module__)


copyreg.pickle(OwnKind, _pickled)
