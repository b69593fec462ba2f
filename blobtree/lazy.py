"""Properties that are made when somebody asks for the first time, from any thread."""

from collections.abc import Callable
from typing import Any, Generic, Self, TypeVar, overload

Made = TypeVar("Made")


class Lazy(Generic[Made]):
    """A decorator as `functools.cached_property`, without a lock.

    Before Python 3.12 that has one for all objects of a class: a window that asks one of them would wait for
    what a thread makes of another. Here two threads that ask the same one at once both make it, and get the
    same.
    """

    def __init__(self, make: Callable[[Any], Made]) -> None:
        self._make = make
        self.__doc__ = make.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type | None = None) -> Made: ...

    def __get__(self, instance: object | None, owner: type | None = None) -> Self | Made:
        if instance is None:
            return self
        found: Made = vars(instance).setdefault(self._name, self._make(instance))
        return found
