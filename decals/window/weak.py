"""Callbacks that keep nobody alive: VTK holds on to whatever it is given."""

import weakref
from collections.abc import Callable


def weakly(method: Callable[[], None]) -> Callable[..., None]:
    """Give a function that calls a method of an object, whatever it is told, as long as the object lives."""
    found = weakref.WeakMethod(method)

    def call(*_: object) -> None:
        alive = found()
        if alive is not None:
            alive()

    return call
