"""Resources on the GPU, kept for the values that they represent."""

from collections.abc import Callable, Hashable
from typing import Generic, Protocol, TypeVar


class Releasable(Protocol):
    """A resource on the GPU."""

    def release(self) -> None:
        """Release the memory."""
        ...


Resource = TypeVar("Resource", bound=Releasable)


class GpuCache(Generic[Resource]):
    """Resources on the GPU, each made once for the (immutable) objects that it represents.

    Objects are compared by identity, and kept alive as long as their resources.
    """

    def __init__(self) -> None:
        self._entries: dict[Hashable, tuple[tuple[object, ...], Resource]] = {}
        self._used: set[Hashable] = set()

    def get(self, make: Callable[[], Resource], *objects: object) -> Resource:
        """Return the resource of these objects; make it at the first call."""
        key = tuple(id(item) for item in objects)
        if key not in self._entries:
            self._entries[key] = objects, make()
        self._used.add(key)
        return self._entries[key][1]

    def find(self, *objects: object) -> Resource | None:
        """Return the resource of these objects, or None before the first call of `get`."""
        return self._entries.get(tuple(id(item) for item in objects), (None, None))[1]

    def sweep(self) -> None:
        """Release the resources that `get` did not return since the last sweep."""
        for key in set(self._entries) - self._used:
            self._entries.pop(key)[1].release()
        self._used.clear()

    def release(self) -> None:
        """Release everything."""
        self._used.clear()
        self.sweep()
