"""Registries: kinds of nodes by their tags in files, and users' definitions by their names.

A class of nodes registers itself when it is defined. So files, panels and the nodes' own methods find a kind
by its tag, and need not import it. The package's root says how to load kinds (`register_kinds`), which is
done when one is looked up that is not loaded.
"""

import copyreg
from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

from blobtree.errors import UnknownKind

Definition = TypeVar("Definition")

NODE_KINDS: dict[str, type[Any]] = {}
"""The classes of nodes that are loaded, by their tags; `blobtree.nodes.kinds` loads all."""

CUSTOM_TAGS: dict[str, type[Any]] = {}
"""The base classes of users' kinds, by their tags in files."""

LIBRARY_ROWS: list[Any] = []
"""What the loaded kinds of this package put on tapes beyond the core, in any order."""

_loaders: list[Callable[[], object]] = []


def register_kinds(*loaders: Callable[[], object]) -> None:
    """Let functions import kinds when they are needed: the first one those of the core, the others more."""
    _loaders.extend(loaders)


def load_core() -> None:
    """Load all kinds of the core."""
    _loaders[0]()


def load_libraries() -> None:
    """Load all kinds."""
    for load in _loaders:
        load()


def kind_of(tag: str) -> type[Any]:
    """Return the class of nodes with this tag."""
    for load in _loaders:
        if tag in NODE_KINDS:
            break
        load()
    return NODE_KINDS[tag]


def row_of(tag: str) -> Any:
    """Return the row of the kind with this tag."""
    kind = kind_of(tag)
    return getattr(kind, kind.row_name)


class Definitions(dict[str, Definition]):
    """Definitions of one sort by their names in files; `noun` names one in messages."""

    def __init__(self, noun: str) -> None:
        super().__init__()
        self.noun = noun

    def find(self, name: str) -> Definition:
        """Return the definition of this name.

        Raises
        ------
        UnknownKind
            It is not defined in this process.
        """
        if name not in self:
            raise UnknownKind(
                f"{self.noun} {name!r} is not defined in this process (defined: "
                f"{', '.join(sorted(self)) or 'none'}); import the module that defines it (on the "
                "command line: --define), then try again"
            )
        return self[name]

    def load(self, name: str, module: str) -> None:
        """Import the module that defines a name, unless it is defined or no module does.

        Raises
        ------
        UnknownKind
            The module cannot be imported.
        """
        if name in self or module in ("", "__main__"):
            return
        try:
            import_module(module)
        except ImportError as error:
            raise UnknownKind(
                f"{self.noun} {name!r}: its module {module!r} cannot be imported: {error}"
            ) from None

    def unpickled(self, name: str, module: str) -> Definition:
        """Return what a pickle names by its name and its module."""
        self.load(name, module)
        return self.find(name)


class CustomKind(type):
    """The type of node classes that definitions make."""

    kind: str
    digest: str
    parameters: tuple[Any, ...]


CUSTOM_KINDS: Definitions[CustomKind] = Definitions("custom kind")
"""All kinds that are defined in this process, in the order of their definition."""


def unpickled_kind(name: str, module: str) -> CustomKind:
    """Return the class that a pickle names."""
    return CUSTOM_KINDS.unpickled(name, module)


def _pickled(kind: CustomKind) -> str | tuple[Any, ...]:
    """Return how a class is pickled: by its name as a definition, or as a global of its module."""
    return (unpickled_kind, (kind.kind, kind.__module__)) if "kind" in vars(kind) else kind.__qualname__


copyreg.pickle(CustomKind, _pickled)
