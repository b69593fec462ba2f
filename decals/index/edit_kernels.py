"""Warp kernels that insert a decal, find decals nested with it, and remove it."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from decals.index.decal_cells import (
    EMPTY,
    cell_key,
    cell_of_block,
    cells_across,
    cells_in,
    first_slot,
    lowest_cell,
    power_of_two,
    touches,
)
from decals.index.lookup import IndexedDecals, are_nested_contact, end_of_lower
from decals.record import RECORD, rank_of, xyz

wp.set_module_options(KERNEL_OPTIONS)

INITIAL_ROOM = 4
"""Room of a new list, in decals. A full list moves to the end, with twice the room."""

MOST_CELLS_ACROSS = 16
"""Most cells along an axis that are searched for decals nested with one."""

IDS_END = wp.constant(0)
CELLS = wp.constant(1)
TOUCHED = wp.constant(2)
FITS = wp.constant(3)
NESTED = wp.constant(4)
STATES = 5
"""Numbers of a state: the end of all lists, the cells, and the cells, fit and nesting of the last change."""

DECAL = wp.constant(0)
EXPONENT = wp.constant(1)
LEVEL = wp.constant(2)
SEARCHED = wp.constant(3)
REQUESTS = 4
"""Numbers of a request: a decal, its level, and how many levels are searched for nested decals."""

NOT_NESTED = wp.constant(0)
IS_NESTED = wp.constant(1)
UNKNOWN = wp.constant(2)


@wp.func
def slot_of(key: wp.vec3i, index: IndexedDecals) -> wp.int32:
    """Return the slot that holds a key, or the empty slot for it."""
    slot = first_slot(key, index.mask)
    entry = index.table[slot]
    while entry[0] >= 0 and (entry[0] != key[0] or entry[1] != key[1] or entry[2] != key[2]):
        slot = (slot + 1) & index.mask
        entry = index.table[slot]
    return slot


@wp.func
def room_needed(
    slot: wp.int32,
    index: IndexedDecals,
    rooms: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Return the number of ids that another decal in this cell needs at the end of all lists."""
    if index.table[slot][0] == EMPTY:
        return 1 + INITIAL_ROOM
    count = index.ids[index.table[slot][3]]
    if count < rooms[slot]:
        return 0
    return 1 + 2 * count


@wp.func
def nested_with(decal: wp.int32, level_count: wp.int32, index: IndexedDecals) -> wp.int32:
    """Return IS_NESTED if a contact decal is nested with a listed one, UNKNOWN if it reaches too many cells.

    By `find_nested`, the larger of two nested decals reaches the centre of the smaller one. A cell that the
    decal reaches therefore lists the other: it holds the centre of one of them.
    """
    found = wp.int32(NOT_NESTED)
    ball = index.records[RECORD * decal]
    position = xyz(ball)
    for level in range(level_count):
        width = wp.float64(index.levels[level][1])
        corner = lowest_cell(position, ball[3], width)
        across = cells_across(position, ball[3], width)
        if wp.max(wp.max(across[0], across[1]), across[2]) > MOST_CELLS_ACROSS:
            found = UNKNOWN
        else:
            for number in range(cells_in(across)):
                slot = slot_of(cell_key(cell_of_block(corner, across, number), level), index)
                if index.table[slot][0] != EMPTY:
                    head = index.table[slot][3]
                    for j in range(index.ids[head]):
                        if are_nested_contact(decal, index.ids[head + 1 + j], index.records):
                            return IS_NESTED
    return found


@wp.kernel
def remove_decal(
    request: wp.array(dtype=wp.int32),
    index: IndexedDecals,
    state: wp.array(dtype=wp.int32),
    ranges: wp.array(dtype=wp.vec2i),
):
    """Remove a decal with an unchanged record from its lists; write the ranges of ids that changed."""
    decal = request[DECAL]
    exponent = request[EXPONENT]
    level = request[LEVEL]
    ball = index.records[RECORD * decal]
    position = xyz(ball)
    width = power_of_two(exponent)
    corner = lowest_cell(position, ball[3], width)
    across = cells_across(position, ball[3], width)
    touched = wp.int32(0)
    for number in range(cells_in(across)):
        cell = cell_of_block(corner, across, number)
        if touches(position, ball[3], cell, width):
            head = index.table[slot_of(cell_key(cell, level), index)][3]
            end = head + 1 + index.ids[head]
            position_in_list = end_of_lower(
                wp.vec2i(head + 1, end), rank_of(decal, index.records), decal, index
            )
            for j in range(position_in_list, end - 1):
                index.ids[j] = index.ids[j + 1]
            index.ids[head] = index.ids[head] - 1
            ranges[touched] = wp.vec2i(head, end)
            touched += 1
    state[TOUCHED] = touched


@wp.kernel
def insert_decal(
    request: wp.array(dtype=wp.int32),
    index: IndexedDecals,
    rooms: wp.array(dtype=wp.int32),
    state: wp.array(dtype=wp.int32),
    ranges: wp.array(dtype=wp.vec2i),
    slots: wp.array(dtype=wp.int32),
):
    """Insert a decal with its record into its lists, if all fit; write what changed, and if it is nested."""
    decal = request[DECAL]
    exponent = request[EXPONENT]
    level = request[LEVEL]
    ball = index.records[RECORD * decal]
    position = xyz(ball)
    width = power_of_two(exponent)
    corner = lowest_cell(position, ball[3], width)
    across = cells_across(position, ball[3], width)
    needed = wp.int32(0)
    for number in range(cells_in(across)):
        cell = cell_of_block(corner, across, number)
        if touches(position, ball[3], cell, width):
            needed += room_needed(slot_of(cell_key(cell, level), index), index, rooms)
    state[TOUCHED] = 0
    state[FITS] = 1
    if state[IDS_END] + needed > index.ids.shape[0] or 4 * (state[CELLS] + cells_in(across)) > 3 * (
        index.mask + 1
    ):
        state[FITS] = 0
        return
    touched = wp.int32(0)
    for number in range(cells_in(across)):
        cell = cell_of_block(corner, across, number)
        if touches(position, ball[3], cell, width):
            key = cell_key(cell, level)
            slot = slot_of(key, index)
            taken = room_needed(slot, index, rooms)
            if taken > 0:
                head = state[IDS_END]
                if index.table[slot][0] == EMPTY:
                    index.ids[head] = 0
                    state[CELLS] = state[CELLS] + 1
                else:
                    old = index.table[slot][3]
                    for j in range(index.ids[old] + 1):
                        index.ids[head + j] = index.ids[old + j]
                index.table[slot] = wp.vec4i(key[0], key[1], key[2], head)
                rooms[slot] = taken - 1
                state[IDS_END] = head + taken
            head = index.table[slot][3]
            end = head + 1 + index.ids[head]
            position_in_list = end_of_lower(
                wp.vec2i(head + 1, end), rank_of(decal, index.records), decal, index
            )
            for back in range(end - position_in_list):
                index.ids[end - back] = index.ids[end - back - 1]
            index.ids[position_in_list] = decal
            index.ids[head] = index.ids[head] + 1
            ranges[touched] = wp.vec2i(head, end + 1)
            slots[touched] = wp.where(taken > 0, slot, -1)
            touched += 1
    state[TOUCHED] = touched
    state[NESTED] = nested_with(decal, request[SEARCHED], index)
