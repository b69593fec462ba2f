"""Counting and choosing on a device: prefix sums, so that nothing but totals comes back to the host."""

from typing import Any

import warp as wp

from blobtree.errors import InvalidResolution
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.launch import launch

wp.set_module_options(KERNEL_OPTIONS)

Array = Any
"""A Warp array; what it holds is said by the name."""


@wp.kernel
def _summarise(first: wp.int32, starts: wp.array(dtype=wp.int32), summary: wp.array(dtype=wp.int32)) -> None:
    """(the last start, 1 where a sum has left the range of 32 bits)."""
    i = first + wp.tid()
    if starts[i + 1] < starts[i]:
        summary[1] = 1
    if i + 2 == starts.shape[0]:
        summary[0] = starts[i + 1]


@wp.kernel
def _gather(first: wp.int32, starts: wp.array(dtype=wp.int32), chosen: wp.array(dtype=wp.int32)) -> None:
    """The indices at which the sum rises."""
    i = first + wp.tid()
    if starts[i + 1] > starts[i]:
        chosen[starts[i]] = i


@wp.kernel
def _flag_sign(
    first: wp.int32, numbers: wp.array(dtype=wp.int32), negative: wp.bool, flags: wp.array(dtype=wp.int32)
) -> None:
    """1 where a number is negative, or where it is not."""
    i = first + wp.tid()
    if (numbers[i] < 0) == negative:
        flags[i] = 1


@wp.kernel
def _enumerate(first: wp.int32, numbers: wp.array(dtype=wp.int32)) -> None:
    i = first + wp.tid()
    numbers[i] = i


def starts_of(counts: Array, what: str) -> tuple[Array, int]:
    """Where each share begins, and the total, of int32 `counts` (n + 1), the last of which is 0.

    Raises
    ------
    InvalidResolution
        The total of `what` cannot be numbered in 32 bits.
    """
    starts = wp.empty_like(counts)
    wp.utils.array_scan(counts, starts, inclusive=False)
    summary: Array = wp.zeros(2, dtype=wp.int32, device=counts.device)
    launch(_summarise, len(counts) - 1, [starts], [summary], str(counts.device))
    total, overflow = summary.numpy().tolist()
    if overflow:
        raise InvalidResolution(f"{what}: too many to be numbered in 32 bits; take larger cells")
    return starts, total


def chosen(flags: Array) -> Array:
    """Indices at which int32 `flags` (n + 1), the last of which is 0, are 1."""
    starts, total = starts_of(flags, "flags")
    indices: Array = wp.empty(total, dtype=wp.int32, device=flags.device)
    launch(_gather, len(flags) - 1, [starts], [indices], str(flags.device))
    return indices


def where_negative(numbers: Array, *, negative: bool = True) -> Array:
    """Indices at which int32 `numbers` (n) are negative, or at which they are not."""
    flags: Array = wp.zeros(len(numbers) + 1, dtype=wp.int32, device=numbers.device)
    launch(_flag_sign, len(numbers), [numbers, negative], [flags], str(numbers.device))
    return chosen(flags)


def everything(count: int, device: str) -> Array:
    """0, 1, …, count − 1."""
    numbers: Array = wp.empty(count, dtype=wp.int32, device=device)
    launch(_enumerate, count, [], [numbers], device)
    return numbers
