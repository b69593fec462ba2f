"""Walked mapping: image coordinates from a log map of the surface around each decal.

It is for edges, corners and large decals. `decals.field.walks` walks from the centre of a decal along
straightest geodesics and leaves a grid of *relays*: surface points whose image coordinates are known, with
the gradients of these coordinates. A pixel walks from relay to relay towards its own point (`walk_from`), and
takes the mean of the places that the four relays around it see (`between_relays`). From each relay the
corrected mapping leads on, so a relay is exact on its own face, and of third order on curved surface. Relays
across an edge, with another normal, do not count where others do.

Behind a corner two walks lead to one point. Relays know the image coordinates of the other walk, and the
shorter one is drawn. All lengths are in visible radii.
"""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.mapping import unroll
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
"""Texels of a relay: (point, x of the other walk), (gradient of x, y of the other walk), (gradient of y,
state)."""
GRID = RELAY * SIDE * SIDE
"""Texels of a grid."""
LOST, SINGLE, DOUBLE = 0.0, 1.0, 2.0
"""States of a relay: its walk ended at a border; no other walk leads to its point; another one does."""
STEPS = 4
"""Steps from relay to relay."""
TURN = 0.005
"""Smallest difference of normals, 1 − cosine, that counts against a relay."""
DOUBT = 0.15
"""Squared distance in the image, in spacings, from which a relay counts less than the one that led there."""
MIN_SHARE = 1.0e-4
OTHER_FACE = 0.3
"""Mean 1 − cosine of normals from which relays lie on another face than the point."""
AGREEMENT = 0.1
"""Squared distance that counts as much as a right angle between normals, in `nearest_relay`."""
FAR = 3.0
"""Mean distance of a point from its relays, in spacings, from which only the corrected mapping is drawn."""


@wp.func
def relay_number(at: wp.vec2) -> wp.vec2i:
    """Return column and row of the relay nearest to a place in the image."""
    middle = float(RELAYS_PER_RADIUS)
    column = wp.clamp(wp.floor(at[0] / SPACING + 0.5), -middle, middle)
    row = wp.clamp(wp.floor(at[1] / SPACING + 0.5), -middle, middle)
    return wp.vec2i(int(column) + RELAYS_PER_RADIUS, int(row) + RELAYS_PER_RADIUS)


@wp.func
def relay_place(column: wp.int32, row: wp.int32) -> wp.vec2:
    """Return the place of a relay in the image, in visible radii from its centre."""
    return SPACING * wp.vec2(float(column - RELAYS_PER_RADIUS), float(row - RELAYS_PER_RADIUS))


@wp.func
def from_relay(
    column: wp.int32, row: wp.int32, first: wp.int32, w: wp.vec3, n_q: wp.vec3, index: IndexedDecals
) -> wp.vec4:
    """Return the place (x, y) of a point at w as a relay sees it, its distance, and the turn of the normal.

    The turn is 1 − cosine, and −1 for a relay that is lost.
    """
    texel = first + RELAY * (SIDE * row + column)
    along_x = xyz(index.walks[texel + 1])
    last = index.walks[texel + 2]
    along_y = xyz(last)
    if last[3] == LOST:
        return wp.vec4(0.0, 0.0, 0.0, -1.0)
    offset = w - xyz(index.walks[texel])
    normal = wp.normalize(wp.cross(along_x, along_y))
    arc = xyz(unroll(offset, normal, n_q))
    place = relay_place(column, row) + wp.vec2(wp.dot(along_x, arc), wp.dot(along_y, arc))
    return wp.vec4(place[0], place[1], wp.length(offset), wp.max(1.0 - wp.dot(normal, n_q), 0.0))


@wp.func
def walk_from(start: wp.vec2, first: wp.int32, w: wp.vec3, n_q: wp.vec3, index: IndexedDecals) -> wp.vec2:
    """Return where a walk from relay to relay ends, for a point at w from the centre."""
    at = start
    for _step in range(STEPS):
        relay = relay_number(at)
        seen = from_relay(relay[0], relay[1], first, w, n_q, index)
        if seen[3] >= 0.0:
            at = wp.vec2(seen[0], seen[1])
    return at


@wp.func
def between_relays(at: wp.vec2, first: wp.int32, w: wp.vec3, n_q: wp.vec3, index: IndexedDecals) -> wp.vec4:
    """Return the place of a point as the four relays around `at` see it, their mean distance and turn."""
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
    weighted = wp.vec4(0.0, 0.0, 0.0, 0.0)
    total = wp.float32(0.0)
    for corner in range(4):
        right = corner & 1
        up = corner >> 1
        seen = from_relay(column + right, row + up, first, w, n_q, index)
        aside = wp.vec2(seen[0] - at[0], seen[1] - at[1]) / SPACING
        doubt = (DOUBT + wp.dot(aside, aside)) * (TURN + seen[3])
        weight = wp.abs(float(1 - right) - share[0]) * wp.abs(float(1 - up) - share[1]) / (doubt * doubt)
        if seen[3] >= 0.0:
            weighted += weight * seen
            total += weight
    if total <= 0.0:
        return wp.vec4(at[0], at[1], FAR * SPACING, 1.0)
    return weighted / total


@wp.func
def nearest_relay(first: wp.int32, w: wp.vec3, n_q: wp.vec3, index: IndexedDecals) -> wp.vec2:
    """Return the place of the relay nearest to a point at w, among those whose normal agrees best."""
    found = wp.vec2(0.0, 0.0)
    least = wp.float32(1.0e30)
    for row in range(SIDE):
        for column in range(SIDE):
            texel = first + RELAY * (SIDE * row + column)
            last = index.walks[texel + 2]
            if last[3] != LOST:
                normal = wp.normalize(wp.cross(xyz(index.walks[texel + 1]), xyz(last)))
                offset = w - xyz(index.walks[texel])
                distance = wp.dot(offset, offset) + AGREEMENT * (1.0 - wp.dot(normal, n_q))
                if distance < least:
                    least = distance
                    found = relay_place(column, row)
    return found


@wp.func
def nearness(distance: wp.float32) -> wp.float32:
    """Return the share of the walked mapping at a mean distance from relays: 1 among them, 0 from FAR on."""
    return wp.clamp(FAR - distance / SPACING, 0.0, 1.0)


@wp.func
def walked_place(owner: wp.int32, w: wp.vec3, n_q: wp.vec3, guess: wp.vec2, index: IndexedDecals) -> wp.vec3:
    """Return the place (x, y) of a point at w in the image of its owner, and how far it counts, 0 to 1.

    `guess` is its place in the corrected mapping. It also counts alone for decals without relays, which are
    those that the corrected mapping draws correctly.
    """
    head = index.walks[owner]
    if head[0] < 0.0:
        return wp.vec3(guess[0], guess[1], 0.0)
    first = int(head[1]) + GRID * int(head[0])
    at = walk_from(guess, first, w, n_q, index)
    found = between_relays(at, first, w, n_q, index)
    if nearness(found[2]) < 1.0 or found[3] > OTHER_FACE:
        nearest = walk_from(nearest_relay(first, w, n_q, index), first, w, n_q, index)
        second = between_relays(nearest, first, w, n_q, index)
        if second[2] + SPACING * second[3] < found[2] + SPACING * found[3]:
            at = nearest
            found = second
    relay = relay_number(at)
    texel = first + RELAY * (SIDE * relay[1] + relay[0])
    if index.walks[texel + 2][3] == DOUBLE:
        other = wp.vec2(index.walks[texel][3], index.walks[texel + 1][3])
        second = between_relays(walk_from(other, first, w, n_q, index), first, w, n_q, index)
        shorter = wp.length(wp.vec2(second[0], second[1])) < wp.length(wp.vec2(found[0], found[1]))
        if shorter and nearness(second[2]) == 1.0 and second[3] < found[3] + TURN:
            found = second
    return wp.vec3(found[0], found[1], nearness(found[2]))
