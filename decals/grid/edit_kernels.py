"""Taking one decal out of the index's lists and putting it in: a single thread, a few microseconds."""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from decals.field.stack import end_of_lower
from decals.grid.cells import (
    EMPTY,
    cell_key,
    cells_across,
    cells_in,
    first_slot,
    lowest_cell,
    neighbour,
    power_of_two,
    touches,
)
from decals.records import RECORD, rank_of, xyz

wp.set_module_options({"enable_backward": False})

FIRST_ROOM = 4
"""Places of a new list; a list that is full moves to the end with twice its places."""

IDS_END = wp.constant(0)
CELLS = wp.constant(1)
TOUCHED = wp.constant(2)
FITS = wp.constant(3)


@wp.func
def slot_of(key: wp.vec3i, table: wp.array(dtype=wp.vec4i), mask: wp.int32) -> wp.int32:
    """Slot that holds a key, or the empty one where it would go."""
    slot = first_slot(key, mask)
    entry = table[slot]
    while entry[0] >= 0 and (entry[0] != key[0] or entry[1] != key[1] or entry[2] != key[2]):
        slot = (slot + 1) & mask
        entry = table[slot]
    return slot


@wp.func
def room_needed(
    slot: wp.int32,
    table: wp.array(dtype=wp.vec4i),
    rooms: wp.array(dtype=wp.int32),
    ids: wp.array(dtype=wp.int32),
) -> wp.int32:
    """Places at the end of all lists that one more decal in this cell takes."""
    if table[slot][0] == EMPTY:
        return 1 + FIRST_ROOM
    count = ids[table[slot][3]]
    if count < rooms[slot]:
        return 0
    return 1 + 2 * count


@wp.kernel
def take_out(
    decal: wp.int32,
    exponent: wp.int32,
    level: wp.int32,
    decals: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    ids: wp.array(dtype=wp.int32),
    state: wp.array(dtype=wp.int32),
    ranges: wp.array(dtype=wp.vec2i),
):
    """Remove a decal, which the records still show, from its lists; ranges of ids that changed."""
    ball = decals[RECORD * decal]
    position = xyz(ball)
    width = power_of_two(exponent)
    corner = lowest_cell(position, ball[3], width)
    across = cells_across(position, ball[3], width)
    mask = table.shape[0] - 1
    touched = wp.int32(0)
    for number in range(cells_in(across)):
        cell = neighbour(corner, across, number)
        if touches(position, ball[3], cell, width):
            head = table[slot_of(cell_key(cell, level), table, mask)][3]
            end = head + 1 + ids[head]
            place = end_of_lower(wp.vec2i(head + 1, end), rank_of(decal, decals), decal, decals, ids)
            for j in range(place, end - 1):
                ids[j] = ids[j + 1]
            ids[head] = ids[head] - 1
            ranges[touched] = wp.vec2i(head, end)
            touched += 1
    state[TOUCHED] = touched


@wp.kernel
def put_in(
    decal: wp.int32,
    exponent: wp.int32,
    level: wp.int32,
    decals: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=wp.vec4i),
    rooms: wp.array(dtype=wp.int32),
    ids: wp.array(dtype=wp.int32),
    state: wp.array(dtype=wp.int32),
    ranges: wp.array(dtype=wp.vec2i),
    slots: wp.array(dtype=wp.int32),
):
    """Put a decal, which the records show, into its lists, if all of that fits; what changed."""
    ball = decals[RECORD * decal]
    position = xyz(ball)
    width = power_of_two(exponent)
    corner = lowest_cell(position, ball[3], width)
    across = cells_across(position, ball[3], width)
    mask = table.shape[0] - 1
    needed = wp.int32(0)
    for number in range(cells_in(across)):
        cell = neighbour(corner, across, number)
        if touches(position, ball[3], cell, width):
            needed += room_needed(slot_of(cell_key(cell, level), table, mask), table, rooms, ids)
    state[TOUCHED] = 0
    state[FITS] = 1
    if state[IDS_END] + needed > ids.shape[0] or 4 * (state[CELLS] + cells_in(across)) > 3 * table.shape[0]:
        state[FITS] = 0
        return
    touched = wp.int32(0)
    for number in range(cells_in(across)):
        cell = neighbour(corner, across, number)
        if touches(position, ball[3], cell, width):
            key = cell_key(cell, level)
            slot = slot_of(key, table, mask)
            taken = room_needed(slot, table, rooms, ids)
            if taken > 0:
                head = state[IDS_END]
                if table[slot][0] == EMPTY:
                    ids[head] = 0
                    state[CELLS] = state[CELLS] + 1
                else:
                    old = table[slot][3]
                    for j in range(ids[old] + 1):
                        ids[head + j] = ids[old + j]
                table[slot] = wp.vec4i(key[0], key[1], key[2], head)
                rooms[slot] = taken - 1
                state[IDS_END] = head + taken
            head = table[slot][3]
            end = head + 1 + ids[head]
            place = end_of_lower(wp.vec2i(head + 1, end), rank_of(decal, decals), decal, decals, ids)
            for back in range(end - place):
                ids[end - back] = ids[end - back - 1]
            ids[place] = decal
            ids[head] = ids[head] + 1
            ranges[touched] = wp.vec2i(head, end + 1)
            slots[touched] = wp.where(taken > 0, slot, -1)
            touched += 1
    state[TOUCHED] = touched
