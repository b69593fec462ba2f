"""What was uploaded stays as long as the scene still shows it."""

from collections.abc import Callable, Hashable
from typing import Generic, Protocol, TypeVar


class Releasable(Protocol):
    """Something on the graphics card."""

    def release(self) -> None:
        """Give the memory back."""
        ...


T = TypeVar("T", bound=Releasable)


class Kept(Generic[T]):
    """Things on the graphics card, each made once for the (immutable) objects that it shows.

    Objects are told apart by identity, and are held for as long as their things are.
    """

    def __init__(self) -> None:
        self._things: dict[Hashable, tuple[tuple[object, ...], T]] = {}
        self._used: set[Hashable] = set()

    def get(self, make: Callable[[], T], *shown: object) -> T:
        """Give the thing that shows these objects; make it if there is none."""
        key = tuple(id(item) for item in shown)
        if key not in self._things:
            self._things[key] = shown, make()
        self._used.add(key)
        return self._things[key][1]

    def sweep(self) -> None:
        """Release what was not asked for since the last sweep."""
        for key in set(self._things) - self._used:
            self._things.pop(key)[1].release()
        self._used.clear()

    def release(self) -> None:
        """Release everything."""
        self._used.clear()
        self.sweep()
