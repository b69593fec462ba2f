"""Walked mapping: image coordinates from a log map of the surface around each decal.

It is for edges, corners and large decals. `decals.field.walks` walks from the centre of a decal along
straightest geodesics and leaves a grid of *relays*: surface points whose image coordinates are known, with
the gradients of these coordinates and the normal. A table of cells of space lists relays for each cell, one
for each face and each way around a corner. A pixel looks up its cell, finds with these relays about where it
lies in the image, and takes the mean of the places that the four relays there see (`between_relays`). If the
closest of them sees the pixel elsewhere, the mean is taken once more, around that place. A relay is exact on
its own face, and of third order on curved surface. Relays across an edge, with another normal, do not count
where others do.

Behind a corner two walks lead to one point, and the shorter one is drawn. Relays at the ends of longer walks
are dropped, but for those close to the cut, where both are equally long. All lengths are in visible radii.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.index.lookup import IndexedDecals
from decals.record import xyz

wp.set_module_options({"enable_backward": False})

RELAYS_PER_RADIUS = 10
"""Relays from the centre of a grid to its side."""
SIDE = 2 * RELAYS_PER_RADIUS + 1
"""Relays along a side of a grid."""
SPACING = 1.1 / 10.0
"""Distance of neighbouring relays in the image."""
RELAY = 3
"""Texels of a relay: (point, x of the normal), (gradient of x, y of the normal), (gradient of y, z of the
normal)."""
RELAYS = RELAY * SIDE * SIDE
"""Texels of the relays of a grid."""
CELLS_ALONG = 8
"""Cells of the table along each side of the cube around the decal."""
CELLS = CELLS_ALONG * CELLS_ALONG * CELLS_ALONG
GRID = RELAYS + CELLS + 1
"""Texels of a grid: the relays, the cells, and the place in the image from which walks are compared."""
LISTED = 8
"""Relays in the list of a cell, at most; two in each number, a + 512 b, plus TWO_WAYS in the first one."""
NONE = 511
"""Number after the last relay of a list."""
TWO_WAYS = 512 * 512
"""Marks the first number of cells to which two walks lead."""
NOWHERE = 1.0e6
"""Coordinates of relays that are not there: their walks ended at a border, or were longer than others."""
TURN = 0.005
"""Smallest difference of normals, 1 − cosine, that counts against a relay."""
DOUBT = 0.02
"""Squared distance in the image, in spacings, from which a relay counts less than the one that led there."""
MIN_SHARE = 1.0e-4
LISTED_SHARE = 0.002
"""Share of the listed relay beside the four around a point."""
AGREEMENT = 1.0
"""Squared distance that counts as much as a right angle between normals."""
STEPS = 2
"""Times, at most, that the place of a point is taken from the relays around it."""
FAR = 3.0
"""Mean distance of a point from its relays, in spacings, from which only the corrected mapping is drawn."""
OTHER_WAY = 0.15
"""Distance in the image, in spacings, from which two places of a point are those of different walks."""


@wp.func
def relay_place(column: wp.int32, row: wp.int32) -> wp.vec2:
    """Return the place of a relay in the image, in visible radii from its centre."""
    return SPACING * wp.vec2(float(column - RELAYS_PER_RADIUS), float(row - RELAYS_PER_RADIUS))


@wp.func
def cell_of(w: wp.vec3) -> wp.int32:
    """Return the number of the cell of the table in which a point at w lies, or of the nearest one."""
    last = float(CELLS_ALONG) - 1.0
    x = wp.clamp(wp.floor(0.5 * float(CELLS_ALONG) * (w[0] + 1.0)), 0.0, last)
    y = wp.clamp(wp.floor(0.5 * float(CELLS_ALONG) * (w[1] + 1.0)), 0.0, last)
    z = wp.clamp(wp.floor(0.5 * float(CELLS_ALONG) * (w[2] + 1.0)), 0.0, last)
    return int(x) + CELLS_ALONG * (int(y) + CELLS_ALONG * int(z))


@wp.func
def from_relay(
    column: wp.int32, row: wp.int32, first: wp.int32, w: wp.vec3, n_q: wp.vec3, index: IndexedDecals
) -> wp.vec4:
    """Return the place (x, y) of a point at w as a relay sees it, its distance, and the turn of the normal.

    The turn is 1 − cosine. The distance of a relay that is not there is about NOWHERE.
    """
    texel = first + RELAY * (SIDE * row + column)
    point = index.walks[texel]
    along_x = index.walks[texel + 1]
    along_y = index.walks[texel + 2]
    offset = w - xyz(point)
    place = relay_place(column, row) + wp.vec2(wp.dot(xyz(along_x), offset), wp.dot(xyz(along_y), offset))
    cosine = wp.dot(wp.vec3(point[3], along_x[3], along_y[3]), n_q)
    return wp.vec4(place[0], place[1], wp.length(offset), wp.max(1.0 - cosine, 0.0))


@wp.func
def remoteness(seen: wp.vec4) -> wp.float32:
    """Return the squared distance of a relay from a point, and what its normal adds."""
    return seen[2] * seen[2] + AGREEMENT * seen[3]


@wp.func
def between_places(a: wp.vec4, b: wp.vec4) -> wp.float32:
    """Return the distance between the places at which two relays see a point."""
    return wp.length(wp.vec2(a[0] - b[0], a[1] - b[1]))


@wp.func
def between_relays(
    listed: wp.vec4, first: wp.int32, w: wp.vec3, n_q: wp.vec3, index: IndexedDecals
) -> tuple[wp.vec4, wp.vec4]:
    """Return the place of a point as the four relays around it see it, their mean distance and turn.

    `listed` is what a relay of the cell sees, from which this begins. It counts where the others lie on other
    faces. The second result is what the closest of these five relays sees.
    """
    at = wp.vec2(listed[0], listed[1])
    limit = float(RELAYS_PER_RADIUS) - 1.0
    cell = wp.vec2(
        wp.clamp(wp.floor(at[0] / SPACING), -limit - 1.0, limit),
        wp.clamp(wp.floor(at[1] / SPACING), -limit - 1.0, limit),
    )
    share = wp.vec2(
        wp.clamp(at[0] / SPACING - cell[0], MIN_SHARE, 1.0 - MIN_SHARE),
        wp.clamp(at[1] / SPACING - cell[1], MIN_SHARE, 1.0 - MIN_SHARE),
    )
    column = int(cell[0]) + RELAYS_PER_RADIUS
    row = int(cell[1]) + RELAYS_PER_RADIUS
    doubt = DOUBT * (TURN + listed[3])
    total = LISTED_SHARE / (doubt * doubt)
    weighted = total * listed
    closest = listed
    least = remoteness(listed)
    for corner in range(4):
        right = corner & 1
        up = corner >> 1
        seen = from_relay(column + right, row + up, first, w, n_q, index)
        aside = wp.vec2(seen[0] - at[0], seen[1] - at[1]) / SPACING
        doubt = (DOUBT + wp.dot(aside, aside)) * (TURN + seen[3])
        weight = wp.abs(float(1 - right) - share[0]) * wp.abs(float(1 - up) - share[1]) / (doubt * doubt)
        if seen[2] < 0.5 * NOWHERE:
            weighted += weight * seen
            total += weight
        if remoteness(seen) < least:
            closest = seen
            least = remoteness(seen)
    return weighted / total, closest


@wp.func
def detour(seen: wp.vec4, origin: wp.vec2) -> wp.float32:
    """Return the length of a walk from the origin; relays that are far or of another face make it longer.

    Such relays draw the walk too short, by their distance times the turn at most.
    """
    excess = wp.max(seen[2] - (FAR - 1.0) * SPACING, 0.0)
    return wp.length(wp.vec2(seen[0], seen[1]) - origin) + seen[2] * seen[3] + excess


@wp.func
def walked_place(owner: wp.int32, w: wp.vec3, n_q: wp.vec3, guess: wp.vec2, index: IndexedDecals) -> wp.vec3:
    """Return the place (x, y) of a point at w in the image of its owner, and how far it counts, 0 to 1.

    `guess` is its place in the corrected mapping. It counts alone far from all relays, and for decals without
    any, which are those that the corrected mapping draws correctly.
    """
    head = index.walks[owner]
    if head[0] < 0.0:
        return wp.vec3(guess[0], guess[1], 0.0)
    first = int(head[1]) + GRID * int(head[0])
    listed = index.walks[first + RELAYS + cell_of(w)]
    pair = int(listed[0])
    ways = 1 + (pair >> 18)
    at = wp.vec4(0.0, 0.0, 0.0, 0.0)
    other = wp.vec4(0.0, 0.0, 0.0, 0.0)
    least = wp.float32(NOWHERE)
    second = wp.float32(NOWHERE)
    for k in range(LISTED):
        number = pair & NONE
        if number == NONE:
            break
        row = int((float(number) + 0.5) / float(SIDE))
        seen = from_relay(number - SIDE * row, row, first, w, n_q, index)
        cost = remoteness(seen)
        apart = between_places(seen, at) > OTHER_WAY * SPACING
        if cost < least:
            if apart:
                other = at
                second = least
            at = seen
            least = cost
        else:
            if apart and cost < second:
                other = seen
                second = cost
        pair = pair >> 9
        if (k & 1) == 1:
            listed = wp.vec4(listed[1], listed[2], listed[3], float(TWO_WAYS - 1))
            pair = int(listed[0])
    if least == NOWHERE:
        return wp.vec3(guess[0], guess[1], 0.0)
    if second == NOWHERE:
        ways = 1
    last = index.walks[first + GRID - 1]
    origin = wp.vec2(last[0], last[1])
    found = at
    shortest = wp.float32(NOWHERE)
    for _way in range(ways):
        begun = at
        seen = at
        for _step in range(STEPS):
            seen, closest = between_relays(at, first, w, n_q, index)
            moved = between_places(closest, at)
            if moved < OTHER_WAY * SPACING or (ways == 2 and moved > between_places(closest, other)):
                break
            at = closest
        length = detour(seen, origin)
        if length < shortest:
            shortest = length
            found = seen
        at = other
        other = begun
    return wp.vec3(found[0], found[1], wp.clamp(FAR - found[2] / SPACING, 0.0, 1.0))
