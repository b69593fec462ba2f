"""Callbacks that keep nobody alive: VTK holds on to whatever it is given."""

import weakref
from collections.abc import Callable
from types import MethodType


def weakly(method: Callable[[], None]) -> Callable[..., None]:
    """Give a function that calls a method of an object, whatever it is told, as long as the object lives."""
    assert isinstance(method, MethodType)
    owner, name = weakref.ref(method.__self__), method.__name__

    def call(*_: object) -> None:
        alive = owner()
        if alive is not None:
            getattr(alive, name)()

    return call
