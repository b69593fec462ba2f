"""Kernels that find blocks with the same pruned tape, bit for bit, and copy each different tape once."""

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)

HASH_FACTOR = wp.constant(wp.uint64(0x9E3779B97F4A7C15))
"""2^64 over the golden ratio: products with it differ in their high bits."""

HASH_SHIFT = wp.constant(wp.uint64(29))


@wp.kernel
def hash_tapes(
    first: wp.int32,
    spans: wp.array(dtype=wp.vec2i),
    bits: wp.array(dtype=wp.vec4i),
    hashes: wp.array(dtype=wp.uint64),
) -> None:
    """Write a hash of the tape of each block; `bits` are the tapes read as integers."""
    i = first + wp.tid()
    span = spans[i]
    result = wp.uint64(span[1] - span[0])
    for k in range(span[0], span[1]):
        texel = bits[k]
        for number in range(4):
            result = (result ^ wp.uint64(wp.uint32(texel[number]))) * HASH_FACTOR
            result = result ^ (result >> HASH_SHIFT)
    hashes[i] = result


@wp.kernel
def match_tapes(
    first: wp.int32,
    spans: wp.array(dtype=wp.vec2i),
    bits: wp.array(dtype=wp.vec4i),
    owners: wp.array(dtype=wp.int32),
) -> None:
    """Make each block its own owner whose tape differs from that of its owner."""
    i = first + wp.tid()
    span = spans[i]
    other = spans[owners[i]]
    if span[0] == other[0]:
        return
    if span[1] - span[0] != other[1] - other[0]:
        owners[i] = i
        return
    for k in range(span[1] - span[0]):
        same = bits[span[0] + k] == bits[other[0] + k]
        if not same:
            owners[i] = i
            return


@wp.kernel
def copy_tapes(
    first: wp.int32,
    blocks: wp.array(dtype=wp.int32),
    spans: wp.array(dtype=wp.vec2i),
    starts: wp.array(dtype=wp.int32),
    tape: wp.array(dtype=wp.vec4),
    out: wp.array(dtype=wp.vec4),
) -> None:
    """Copy the tapes of some blocks, each behind a texel with its length, one after the other."""
    i = first + wp.tid()
    span = spans[blocks[i]]
    start = starts[i]
    for k in range(span[1] - span[0] + 1):
        out[start + k] = tape[span[0] - 1 + k]
