"""Orders, groups and ranges of whole numbers, in a fraction of the time of NumPy's stable sort."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Int64Array

WholeNumbers = NDArray[np.integer[Any]]


def stable_order(keys: WholeNumbers) -> Int64Array:
    """Return the rows of whole numbers in the order of the numbers; of equal ones the first comes first.

    Number and row are sorted as one number, if they fit into one.
    """
    bits = len(keys).bit_length()
    if len(keys) == 0 or int(keys.min()) < 0 or int(keys.max()) >> (63 - bits):
        return np.argsort(keys, kind="stable")
    packed = (keys.astype(np.int64) << bits) | np.arange(len(keys))
    packed.sort()
    return packed & ((1 << bits) - 1)


def groups(keys: Int64Array) -> tuple[Int64Array, Int64Array, Int64Array]:
    """Return, as `np.unique`, the first row of each group of equal numbers, the group of each, and the sizes.

    Examples
    --------
    >>> import numpy as np
    >>> first, group, counts = groups(np.array([7, 2, 7, 5]))
    >>> first.tolist(), group.tolist(), counts.tolist()
    ([1, 3, 0], [2, 0, 2, 1], [1, 1, 2])
    """
    order, starts, counts = runs(keys)
    group = np.empty(len(keys), np.int64)
    group[order] = np.repeat(np.arange(len(starts)), counts)
    return order[starts], group, counts


def runs(keys: Int64Array) -> tuple[Int64Array, Int64Array, Int64Array]:
    """Return the `stable_order` of numbers, and in it the start and the length of each run of equal ones.

    Examples
    --------
    >>> import numpy as np
    >>> order, starts, counts = runs(np.array([7, 2, 7, 5]))
    >>> order.tolist(), starts.tolist(), counts.tolist()
    ([1, 3, 0, 2], [0, 1, 2], [1, 1, 2])
    """
    order = stable_order(keys)
    ordered = keys[order]
    starts = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1])[: len(keys)])
    return order, starts, np.diff(np.append(starts, len(keys)))


def distinct_numbers(numbers: WholeNumbers, count: int) -> Int64Array:
    """Return each of some numbers once, in order; all are from 0 to below `count`."""
    marked = np.zeros(count, np.bool_)
    marked[numbers.reshape(-1)] = True
    return np.flatnonzero(marked)


def ranges(starts: Int64Array, counts: Int64Array) -> Int64Array:
    """Return whole numbers from each start on, so many of each, one range after another.

    Examples
    --------
    >>> import numpy as np
    >>> ranges(np.array([5, 0]), np.array([2, 3])).tolist()
    [5, 6, 0, 1, 2]
    """
    before = np.cumsum(counts) - counts
    rows: Int64Array = np.arange(int(counts.sum())) + np.repeat(starts - before, counts)
    return rows
