"""Functions that keep their last results, bounded by bytes."""

import threading
from collections.abc import Callable
from typing import Generic, ParamSpec, Protocol, TypeVar


class Sized(Protocol):
    """A result that knows how many bytes it takes, such as an array."""

    @property
    def nbytes(self) -> int:
        """Bytes of the result."""
        ...


Arguments = ParamSpec("Arguments")
Result = TypeVar("Result", bound=Sized)


class SizedCache(Generic[Arguments, Result]):
    """A function that keeps the results that were asked for last; the very last one whatever its size.

    Threads may call it at once; each computes what is missing.

    Parameters
    ----------
    function
        The function; its arguments must be hashable.
    max_bytes
        Bytes of all kept results, at most.
    """

    def __init__(self, function: Callable[Arguments, Result], max_bytes: int) -> None:
        self._function, self._max_bytes = function, max_bytes
        self._results: dict[tuple[object, ...], Result] = {}
        self._bytes = 0
        self._lock = threading.Lock()

    def __call__(self, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        """Return the kept result for these arguments, or compute it."""
        key = (*args, *sorted(kwargs.items()))
        with self._lock:
            if key in self._results:
                result = self._results[key] = self._results.pop(key)  # the last one now
                return result
        result = self._function(*args, **kwargs)
        with self._lock:
            if key not in self._results:
                self._results[key] = result
                self._bytes += result.nbytes
            while self._bytes > self._max_bytes and len(self._results) > 1:
                self._bytes -= self._results.pop(next(iter(self._results))).nbytes
        return result


def sized_cache(
    max_bytes: int,
) -> Callable[[Callable[Arguments, Result]], SizedCache[Arguments, Result]]:
    """Return a decorator that makes a function a `SizedCache` of so many bytes."""
    return lambda function: SizedCache(function, max_bytes)
