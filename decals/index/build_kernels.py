"""Warp kernels that build the index in parallel, in the order in which `build` launches them."""

# ruff: noqa: SIM114  (Warp evaluates both sides of `or`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.index.decal_cells import (
    EMPTY,
    EXPONENT_OF_ONE,
    cell_exponent,
    cell_key,
    cell_of_block,
    cells_across,
    cells_in,
    first_slot,
    lowest_cell,
    power_of_two,
    touches,
)

wp.set_module_options(KERNEL_OPTIONS)


@wp.kernel
def number_decals(
    ranks: wp.array(dtype=wp.int32), keys: wp.array(dtype=wp.int32), order: wp.array(dtype=wp.int32)
):
    """Write the keys and values of the sort into draw order."""
    i = wp.tid()
    keys[i] = ranks[i]
    order[i] = i


@wp.kernel
def measure_decals(
    positions: wp.array(dtype=wp.vec3),
    influence: wp.array(dtype=wp.float32),
    ranks: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
    parity: wp.int32,
    floor: wp.int32,
    exponents: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    lowest: wp.array(dtype=wp.int32),
    highest: wp.array(dtype=wp.int32),
):
    """Write exponent and number of the cells of each decal in draw order, and the ranks of each exponent."""
    i = wp.tid()
    decal = order[i]
    exponent = cell_exponent(positions[decal], influence[decal], parity, floor)
    width = power_of_two(exponent)
    corner = lowest_cell(positions[decal], influence[decal], width)
    across = cells_across(positions[decal], influence[decal], width)
    count = wp.int32(0)
    for number in range(cells_in(across)):
        if touches(positions[decal], influence[decal], cell_of_block(corner, across, number), width):
            count += 1
    exponents[i] = exponent
    counts[i] = count
    wp.atomic_min(lowest, exponent + EXPONENT_OF_ONE, ranks[decal])
    wp.atomic_max(highest, exponent + EXPONENT_OF_ONE, ranks[decal])


@wp.kernel
def list_cells(
    positions: wp.array(dtype=wp.vec3),
    influence: wp.array(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    exponents: wp.array(dtype=wp.int32),
    level_of: wp.array(dtype=wp.int32),
    ends: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    keys: wp.array(dtype=wp.vec3i),
    owners: wp.array(dtype=wp.int32),
):
    """Write the keys of all cells that the balls touch, with the decal of each, in draw order."""
    i = wp.tid()
    decal = order[i]
    level = level_of[exponents[i] + EXPONENT_OF_ONE]
    width = power_of_two(exponents[i])
    corner = lowest_cell(positions[decal], influence[decal], width)
    across = cells_across(positions[decal], influence[decal], width)
    slot = ends[i] - counts[i]
    for number in range(cells_in(across)):
        cell = cell_of_block(corner, across, number)
        if touches(positions[decal], influence[decal], cell, width):
            keys[slot] = cell_key(cell, level)
            owners[slot] = decal
            slot += 1


@wp.kernel
def claim_slots(
    keys: wp.array(dtype=wp.vec3i),
    mask: wp.int32,
    claims: wp.array(dtype=wp.int32),
    slots: wp.array(dtype=wp.int32),
    sizes: wp.array(dtype=wp.int32),
):
    """Claim one slot of a temporary table for all equal keys, and count them."""
    i = wp.tid()
    key = keys[i]
    slot = first_slot(key, mask)
    searching = wp.bool(True)
    while searching:
        holder = wp.atomic_cas(claims, slot, EMPTY, i)
        if holder == EMPTY:
            searching = False
        elif keys[holder][0] == key[0] and keys[holder][1] == key[1] and keys[holder][2] == key[2]:
            searching = False
        else:
            slot = (slot + 1) & mask
    slots[i] = slot
    wp.atomic_add(sizes, slot, 1)


@wp.kernel
def mark_used(sizes: wp.array(dtype=wp.int32), used: wp.array(dtype=wp.int32)):
    """Write 1 for each slot that holds a cell."""
    i = wp.tid()
    used[i] = wp.where(sizes[i] > 0, 1, 0)


@wp.kernel
def write_lists(
    slots: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    sizes: wp.array(dtype=wp.int32),
    numbers: wp.array(dtype=wp.int32),
    heads: wp.array(dtype=wp.int32),
    ids: wp.array(dtype=wp.int32),
):
    """Write lists, each after its length, from decals sorted by slot, and where each list begins."""
    i = wp.tid()
    slot = slots[i]
    before = numbers[slot]  # cells up to and including this one
    ids[i + before] = owners[i]
    if i == 0 or slots[wp.max(i - 1, 0)] != slot:
        ids[i + before - 1] = sizes[slot]
        heads[slot] = i + before - 1


@wp.kernel
def fill_table(
    claims: wp.array(dtype=wp.int32),
    keys: wp.array(dtype=wp.vec3i),
    heads: wp.array(dtype=wp.int32),
    mask: wp.int32,
    taken: wp.array(dtype=wp.int32),
    table: wp.array(dtype=wp.vec4i),
):
    """Insert every cell into the final table, at the first free slot from its own on."""
    i = wp.tid()
    if claims[i] == EMPTY:
        return
    key = keys[claims[i]]
    slot = first_slot(key, mask)
    while wp.atomic_cas(taken, slot, 0, 1) != 0:
        slot = (slot + 1) & mask
    table[slot] = wp.vec4i(key[0], key[1], key[2], heads[i])
