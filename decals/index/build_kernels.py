"""Warp kernels that build the index in parallel, in the order in which `build` launches them."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.index.decal_cells import (
    EMPTY,
    EXPONENT_OF_ONE,
    EXPONENTS,
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

SET_STEP = 7919
"""Slots between equal keys of two sets in the temporary table, a prime."""


@wp.kernel
def number_decals(
    ranks: wp.array(dtype=wp.int32), keys: wp.array(dtype=wp.int32), order: wp.array(dtype=wp.int32)
):
    """Write the keys and values of the sort into draw order."""
    i = wp.tid()
    keys[i] = ranks[i]
    order[i] = i


@wp.kernel
def number_sets(
    order: wp.array(dtype=wp.int32), sets: wp.array(dtype=wp.int32), keys: wp.array(dtype=wp.int32)
):
    """Write the keys of the second sort, by the set of each decal."""
    i = wp.tid()
    keys[i] = sets[order[i]]


@wp.kernel
def measure_decals(
    positions: wp.array(dtype=wp.vec3),
    influence: wp.array(dtype=wp.float32),
    ranks: wp.array(dtype=wp.int32),
    order: wp.array(dtype=wp.int32),
    sets: wp.array(dtype=wp.int32),
    parities: wp.array(dtype=wp.int32),
    floors: wp.array(dtype=wp.int32),
    exponents: wp.array(dtype=wp.int32),
    counts: wp.array(dtype=wp.int32),
    lowest: wp.array(dtype=wp.int32),
    highest: wp.array(dtype=wp.int32),
):
    """Write exponent and number of the cells of each decal in draw order, and the ranks of each exponent."""
    i = wp.tid()
    decal = order[i]
    owner = sets[decal]
    exponent = cell_exponent(positions[decal], influence[decal], parities[owner], floors[owner])
    width = power_of_two(exponent)
    corner = lowest_cell(positions[decal], influence[decal], width)
    across = cells_across(positions[decal], influence[decal], width)
    count = wp.int32(0)
    for number in range(cells_in(across)):
        if touches(positions[decal], influence[decal], cell_of_block(corner, across, number), width):
            count += 1
    exponents[i] = exponent
    counts[i] = count
    wp.atomic_min(lowest, owner * EXPONENTS + exponent + EXPONENT_OF_ONE, ranks[decal])
    wp.atomic_max(highest, owner * EXPONENTS + exponent + EXPONENT_OF_ONE, ranks[decal])


@wp.kernel
def list_cells(
    positions: wp.array(dtype=wp.vec3),
    influence: wp.array(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    sets: wp.array(dtype=wp.int32),
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
    level = level_of[sets[decal] * EXPONENTS + exponents[i] + EXPONENT_OF_ONE]
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
    owners: wp.array(dtype=wp.int32),
    sets: wp.array(dtype=wp.int32),
    several: wp.bool,
    mask: wp.int32,
    claims: wp.array(dtype=wp.int32),
    slots: wp.array(dtype=wp.int32),
    sizes: wp.array(dtype=wp.int32),
):
    """Claim one slot of a temporary table for all equal keys of one set, and count them."""
    i = wp.tid()
    key = keys[i]
    owner = wp.int32(0)
    if several:
        owner = sets[owners[i]]
    slot = (first_slot(key, mask) + owner * SET_STEP) & mask
    searching = wp.bool(True)
    while searching:
        holder = wp.atomic_cas(claims, slot, EMPTY, i)
        if holder == EMPTY:
            searching = False
        elif keys[holder][0] == key[0] and keys[holder][1] == key[1] and keys[holder][2] == key[2]:
            searching = several
            if several:
                searching = sets[owners[holder]] != owner
        if searching:
            slot = (slot + 1) & mask
    slots[i] = slot
    wp.atomic_add(sizes, slot, 1)


@wp.kernel
def mark_used(
    claims: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    sets: wp.array(dtype=wp.int32),
    several: wp.bool,
    used: wp.array(dtype=wp.int32),
    holders: wp.array(dtype=wp.int32),
    cells: wp.array(dtype=wp.int32),
):
    """Write 1 for each slot that holds a cell; of several sets, also write its set and count their cells."""
    i = wp.tid()
    if claims[i] == EMPTY:
        return
    used[i] = 1
    if several:
        holders[i] = sets[owners[claims[i]]]
        wp.atomic_add(cells, holders[i], 1)


@wp.kernel
def write_lists(
    slots: wp.array(dtype=wp.int32),
    owners: wp.array(dtype=wp.int32),
    sizes: wp.array(dtype=wp.int32),
    numbers: wp.array(dtype=wp.int32),
    sets: wp.array(dtype=wp.int32),
    several: wp.bool,
    starts: wp.array(dtype=wp.int32),
    heads: wp.array(dtype=wp.int32),
    ids: wp.array(dtype=wp.int32),
):
    """Write lists, each after its length, from decals sorted by slot, and where each list begins.

    The decals of a set are counted from its first one.
    """
    i = wp.tid()
    slot = slots[i]
    before = numbers[slot]  # cells up to and including this one
    ids[i + before] = owners[i]
    if several:
        ids[i + before] = owners[i] - starts[sets[owners[i]]]
    if i == 0 or slots[wp.max(i - 1, 0)] != slot:
        ids[i + before - 1] = sizes[slot]
        heads[slot] = i + before - 1


@wp.kernel
def fill_table(
    claims: wp.array(dtype=wp.int32),
    keys: wp.array(dtype=wp.vec3i),
    holders: wp.array(dtype=wp.int32),
    heads: wp.array(dtype=wp.int32),
    tables: wp.array(dtype=wp.int32),
    taken: wp.array(dtype=wp.int32),
    table: wp.array(dtype=wp.vec4i),
):
    """Insert every cell into the table of its set, at the first free slot from its own on.

    The tables lie one after the other; `tables` holds the first slot of each, and the end.
    """
    i = wp.tid()
    if claims[i] == EMPTY:
        return
    key = keys[claims[i]]
    owner = wp.int32(0)
    if holders.shape[0] > 0:
        owner = holders[i]
    begin = tables[owner]
    mask = tables[owner + 1] - begin - 1
    slot = first_slot(key, mask)
    while wp.atomic_cas(taken, begin + slot, 0, 1) != 0:
        slot = (slot + 1) & mask
    table[begin + slot] = wp.vec4i(key[0], key[1], key[2], heads[i])
