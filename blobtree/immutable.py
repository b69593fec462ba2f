"""Immutable objects with arrays and lazy values, as pickles and copies have them."""

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from blobtree.lazy import Lazy


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array that nothing changes: itself if it is read-only, else a copy."""
    if array.flags.writeable:
        array = array.copy()
        array.setflags(write=False)
    return array


class Immutable:
    """A base of immutable objects with arrays and `Lazy` values, which makes them fit for other processes.

    Pickles leave out lazy values, such as arrays on devices; what is read makes them again. Its arrays are
    read-only, although most protocols forget that. Copies within a process are the object itself.
    """

    def __getstate__(self) -> dict[str, Any]:
        kind, state = type(self), vars(self).copy()
        return {name: state[name] for name in state if not isinstance(getattr(kind, name, None), Lazy)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        for value in state.values():
            for part in value if isinstance(value, tuple) else (value,):
                if isinstance(part, np.ndarray):
                    part.setflags(write=False)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, _memo: dict[int, Any]) -> Self:
        return self
