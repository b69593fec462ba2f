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
RELAYS = RELAY * SIDE * SIDE
"""Texels of the relays of a grid."""
BLOCK = 3
"""Relays along a side of a block."""
BLOCKS_ALONG = SIDE // BLOCK
BLOCKS = BLOCKS_ALONG * BLOCKS_ALONG
"""Blocks of a grid. A texel behind the relays holds the ball around those of a block: middle and radius."""
GRID = RELAYS + BLOCKS
"""Texels of a grid."""
LOST, SINGLE, DOUBLE = 0.0, 1.0, 2.0
"""States of a relay: its walk ended at a border; no other walk leads to its point; another one does."""
STEPS = 4
"""Steps from relay to relay, at most."""
FROM_GUESS, FROM_NEAREST, FROM_OTHER = 0, 1, 2
"""Where walks of a pixel begin: in the corrected mapping, at a near relay, where another walk leads."""
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
    last = wp.int32(-1)
    for _step in range(STEPS):
        relay = relay_number(at)
        number = SIDE * relay[1] + relay[0]
        if number == last:
            break
        last = number
        seen = from_relay(relay[0], relay[1], first, w, n_q, index)
        if seen[3] < 0.0:
            break
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
    """Return the place of the relay nearest to a point at w, among those whose normal agrees best.

    Blocks whose balls are farther than the best relay are left out. The block in the nearest ball is first.
    """
    begin = wp.int32(0)
    least = wp.float32(1.0e30)
    for block in range(BLOCKS):
        ball = index.walks[first + RELAYS + block]
        farthest = wp.length(w - xyz(ball)) + ball[3]
        if farthest < least:
            least = farthest
            begin = block
    found = wp.vec2(0.0, 0.0)
    least = wp.float32(1.0e30)
    for turn in range(BLOCKS):
        block = (begin + turn) % BLOCKS
        ball = index.walks[first + RELAYS + block]
        gap = wp.max(wp.length(w - xyz(ball)) - ball[3], 0.0)
        if gap * gap < least:
            row = BLOCK * int((float(block) + 0.5) / float(BLOCKS_ALONG))
            column = BLOCK * (block % BLOCKS_ALONG)
            for k in range(BLOCK * BLOCK):
                up = int((float(k) + 0.5) / float(BLOCK))
                right = k - BLOCK * up
                texel = first + RELAY * (SIDE * (row + up) + column + right)
                offset = w - xyz(index.walks[texel])
                distance = wp.dot(offset, offset)
                if distance < least:
                    last = index.walks[texel + 2]
                    normal = wp.normalize(wp.cross(xyz(index.walks[texel + 1]), xyz(last)))
                    distance += AGREEMENT * (1.0 - wp.dot(normal, n_q))
                    if distance < least and last[3] != LOST:
                        least = distance
                        found = relay_place(column + right, row + up)
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
    start = guess
    at = guess
    found = wp.vec4(guess[0], guess[1], FAR * SPACING, 1.0)
    begun = wp.int32(FROM_GUESS)
    for _walk in range(3):  # one loop: calls are inlined, and three of them would take many registers
        end = walk_from(start, first, w, n_q, index)
        seen = between_relays(end, first, w, n_q, index)
        better = begun == FROM_GUESS
        if begun == FROM_NEAREST:
            better = seen[2] + SPACING * seen[3] < found[2] + SPACING * found[3]
        if begun == FROM_OTHER:
            shorter = wp.length(wp.vec2(seen[0], seen[1])) < wp.length(wp.vec2(found[0], found[1]))
            better = shorter and nearness(seen[2]) == 1.0 and seen[3] < found[3] + TURN
        if better:
            at = end
            found = seen
        if begun == FROM_OTHER:
            break
        if begun == FROM_GUESS and (nearness(found[2]) < 1.0 or found[3] > OTHER_FACE):
            begun = FROM_NEAREST
            start = nearest_relay(first, w, n_q, index)
        else:
            relay = relay_number(at)
            texel = first + RELAY * (SIDE * relay[1] + relay[0])
            if index.walks[texel + 2][3] != DOUBLE:
                break
            begun = FROM_OTHER
            start = wp.vec2(index.walks[texel][3], index.walks[texel + 1][3])
    return wp.vec3(found[0], found[1], nearness(found[2]))
