"""Values that are kept: those that were used last, up to a size, and those of objects that live."""

import threading
import weakref
from collections.abc import Callable, Hashable
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, TypeVar


class Sized(Protocol):
    """A result that knows how many bytes it takes, such as an array."""

    @property
    def nbytes(self) -> int:
        """Bytes of the result."""
        ...


Arguments = ParamSpec("Arguments")
Result = TypeVar("Result", bound=Sized)
Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")
First = TypeVar("First")


class LastUsed(Generic[Key, Value]):
    """Keeps the values that were used last; the very last one whatever its size.

    Others are found as long as something else holds them. Threads may use it at once; each makes what is
    missing.

    Parameters
    ----------
    max_size
        Size of all kept values, at most.
    """

    def __init__(self, max_size: int) -> None:
        self._max_size, self._size = max_size, 0
        self._kept: dict[Key, tuple[Value, int]] = {}
        self._alive: weakref.WeakValueDictionary[Key, Value] = weakref.WeakValueDictionary()
        self._lock = threading.Lock()

    def get(self, key: Key, make: Callable[[], Value], size: Callable[[Value], int]) -> Value:
        """Return the value of a key; make it if it is neither kept nor in use."""
        with self._lock:
            value = self._alive.get(key)
        if value is None:
            value = make()
        with self._lock:
            value = self._alive.setdefault(key, value)  # another thread may have made it too
            self._size -= self._kept.pop(key, (value, 0))[1]
            self._kept[key] = value, size(value)  # the last one now
            self._size += self._kept[key][1]
            while self._size > self._max_size and len(self._kept) > 1:
                self._size -= self._kept.pop(next(iter(self._kept)))[1]
        return value

    def values(self) -> list[Value]:
        """Return the values that are kept or in use."""
        return list(self._alive.values())

    def clear(self) -> None:
        """Keep none of the values."""
        with self._lock:
            self._kept.clear()
            self._size = 0


class SizedCache(Generic[Arguments, Result]):
    """A function that keeps its last results.

    Parameters
    ----------
    function
        The function; its arguments must be hashable.
    max_bytes
        Bytes of all kept results, at most.
    """

    def __init__(self, function: Callable[Arguments, Result], max_bytes: int) -> None:
        self._function = function
        self._results: LastUsed[tuple[object, ...], Result] = LastUsed(max_bytes)

    def __call__(self, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        """Return the kept result for these arguments, or compute it."""
        key = (*args, *sorted(kwargs.items()))
        return self._results.get(key, lambda: self._function(*args, **kwargs), lambda result: result.nbytes)


def sized_cache(
    max_bytes: int,
) -> Callable[[Callable[Arguments, Result]], SizedCache[Arguments, Result]]:
    """Return a decorator that makes a function a `SizedCache` of so many bytes."""
    return lambda function: SizedCache(function, max_bytes)


class KeptWith(Generic[First, Arguments, Value]):
    """A function that keeps its result as long as an object of its first argument lives.

    Parameters
    ----------
    function
        The function. Its further arguments must not change its result.
    owner
        Returns the object of a first argument.
    """

    def __init__(
        self, function: Callable[Concatenate[First, Arguments], Value], owner: Callable[[First], Any]
    ) -> None:
        self._function, self._owner = function, owner
        self._results: weakref.WeakKeyDictionary[Any, Value] = weakref.WeakKeyDictionary()

    def __call__(self, first: First, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Value:
        """Return the kept result for the first argument, or compute it."""
        owner = self._owner(first)
        if owner not in self._results:
            self._results.setdefault(owner, self._function(first, *args, **kwargs))
        return self._results[owner]


def kept_with(
    owner: Callable[[First], Any],
) -> Callable[[Callable[Concatenate[First, Arguments], Value]], KeptWith[First, Arguments, Value]]:
    """Return a decorator that makes a function a `KeptWith` the owners of its first arguments."""
    return lambda function: KeptWith(function, owner)
