"""Kernels of `scan`."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def summarize(first: wp.int32, starts: wp.array(dtype=wp.int32), summary: wp.array(dtype=wp.int32)) -> None:
    """Write (the last start, 1 if a sum exceeds 32 bits)."""
    i = first + wp.tid()
    if starts[i + 1] < starts[i]:
        summary[1] = 1
    if i + 2 == starts.shape[0]:
        summary[0] = starts[i + 1]


@wp.kernel
def gather(first: wp.int32, starts: wp.array(dtype=wp.int32), indices: wp.array(dtype=wp.int32)) -> None:
    """Write the indices at which the sum rises."""
    i = first + wp.tid()
    if starts[i + 1] > starts[i]:
        indices[starts[i]] = i


@wp.kernel
def flag_sign(
    first: wp.int32, numbers: wp.array(dtype=wp.int32), negative: wp.bool, flags: wp.array(dtype=wp.int32)
) -> None:
    """Flag the numbers that are negative, or those that are not."""
    i = first + wp.tid()
    if (numbers[i] < 0) == negative:
        flags[i] = 1


@wp.kernel
def enumerate_indices(first: wp.int32, numbers: wp.array(dtype=wp.int32)) -> None:
    """Write 0, 1, 2, …."""
    i = first + wp.tid()
    numbers[i] = i
