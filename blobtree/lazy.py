"""What is loaded or computed at first access: the public names of packages, and properties of objects."""

import ast
import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Generic, Self, TypeVar, overload

import lazy_loader

Value = TypeVar("Value")


def attach_stub(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a file whose stub lists names of a package.

    Modules are imported at the first use of their names, as by `lazy_loader.attach_stub`, which knows no star
    imports. Meanwhile Python's collector of cycles rests: an import makes many objects that all stay, and
    going through them again and again takes a quarter of its time.
    """
    listed_in = names_of_modules(Path(file).with_suffix(".pyi"))
    load, listed, names = lazy_loader.attach(package, listed_in.pop("", []), listed_in)

    def attribute(name: str) -> Any:
        if not gc.isenabled():  # the user's choice, or an import within another one
            return load(name)
        gc.disable()
        try:
            return load(name)
        finally:
            gc.enable()

    return attribute, listed, names


def names_of_modules(stub: Path) -> dict[str, list[str]]:
    """Return what a stub imports: names by the modules of its folder that have them, modules under "".

    A star imports what the stub of that module imports.
    """
    found: dict[str, list[str]] = {}
    for statement in ast.parse(stub.read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.ImportFrom):
            module, names = statement.module or "", [alias.name for alias in statement.names]
            starred = names_of_modules(stub.with_name(f"{module}.pyi")) if names == ["*"] else {module: names}
            for source, more in starred.items():
                found[source] = [*found.get(source, []), *more]
    return found


@contextmanager
def if_present() -> Iterator[None]:
    """Go on behind a ``with`` block that imports extras of this project which were left out."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("blobtree", "decals"):
            raise


class Lazy(Generic[Value]):
    """A decorator like `functools.cached_property`, without a lock.

    Before Python 3.12, `cached_property` holds one lock for all objects of a class, so a slow computation for
    one object blocks access to all others. Here two threads may compute the same value at once; both get the
    value that was stored first.
    """

    def __init__(self, compute: Callable[[Any], Value]) -> None:
        self._compute = compute
        self.__doc__ = compute.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type | None = None) -> Value: ...

    def __get__(self, instance: object | None, owner: type | None = None) -> Self | Value:
        if instance is None:
            return self
        value: Value = vars(instance).setdefault(self._name, self._compute(instance))
        return value
