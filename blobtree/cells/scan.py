"""Prefix sums, compaction and ranges on a device; only totals are copied to the host.

On the processor NumPy finds indices, which takes less time than a launch.
"""

from typing import Any, TypeAlias

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.cells.scan_kernels import enumerate_indices, flag_sign, gather, summarize
from blobtree.device import array_on, launch
from blobtree.errors import InvalidResolution

DeviceArray: TypeAlias = Any
"""A Warp array; the name of the variable says of what."""

MAX_TOTAL = (1 << 31) - 1
"""Largest int32."""


def exclusive_scan(counts: DeviceArray, noun: str, *, start: int = 0) -> tuple[DeviceArray, int]:
    """Return `start` plus the exclusive prefix sums of int32 `counts` (n + 1), and `start` plus their total.

    The last count is 0, so the last sum is the total. `noun` names the counted objects in the error.

    Raises
    ------
    InvalidResolution
        The total exceeds 32 bits.
    """
    if start > 0:
        behind: DeviceArray = wp.full(len(counts) + 1, start, dtype=wp.int32, device=counts.device)
        wp.copy(behind, counts, dest_offset=1)
        starts, total = exclusive_scan(behind, noun)
        return starts[1:], total
    starts = wp.empty_like(counts)
    wp.utils.array_scan(counts, starts, inclusive=False)
    if counts.device.is_cpu:  # a launch would take longer than the sum
        total = int(counts.numpy().sum(dtype=np.int64))
        overflow = total > MAX_TOTAL
    else:
        summary: DeviceArray = wp.zeros(2, dtype=wp.int32, device=counts.device)
        launch(summarize, len(counts) - 1, [starts], [summary], str(counts.device))
        total, overflow = summary.numpy().tolist()
    if overflow:
        raise InvalidResolution(f"{noun}: more than 32 bits can number; take larger cells")
    return starts, total


def compact(flags: DeviceArray) -> DeviceArray:
    """Return the indices at which int32 `flags` (n + 1), the last of which is 0, are 1."""
    if flags.device.is_cpu:
        return _indices(np.flatnonzero(flags.numpy()))
    starts, total = exclusive_scan(flags, "flags")
    indices: DeviceArray = wp.empty(total, dtype=wp.int32, device=flags.device)
    launch(gather, len(flags) - 1, [starts], [indices], str(flags.device))
    return indices


def where_negative(numbers: DeviceArray, *, negative: bool = True) -> DeviceArray:
    """Return the indices at which int32 `numbers` (n) are negative, or at which they are not."""
    if numbers.device.is_cpu:
        return _indices(np.flatnonzero((numbers.numpy() < 0) == negative))
    flags: DeviceArray = wp.zeros(len(numbers) + 1, dtype=wp.int32, device=numbers.device)
    launch(flag_sign, len(numbers), [numbers, negative], [flags], str(numbers.device))
    return compact(flags)


def _indices(found: NDArray[np.intp]) -> DeviceArray:
    return array_on("cpu", found.astype(np.int32), wp.int32)


def arange(count: int, device: str) -> DeviceArray:
    """Return 0, 1, …, count − 1."""
    numbers: DeviceArray = wp.empty(count, dtype=wp.int32, device=device)
    launch(enumerate_indices, count, [], [numbers], device)
    return numbers
