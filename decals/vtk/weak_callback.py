"""Callbacks for VTK that do not keep their objects alive."""

import weakref
from collections.abc import Callable
from types import MethodType


def weak_callback(method: Callable[[], None]) -> Callable[..., None]:
    """Return a function of any arguments that calls a method while its object lives."""
    assert isinstance(method, MethodType)
    owner, name = weakref.ref(method.__self__), method.__name__

    def call(*_: object) -> None:
        alive = owner()
        if alive is not None:
            getattr(alive, name)()

    return call
