"""Warp kernels that make the relays of the walked mapping.

A straightest geodesic (Polthier and Schmies 1998) goes straight through a triangle, and across an edge as on
the two triangles unfolded into a plane. Positions are relative to the centre of the decal, which keeps the
digits of float32.
"""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.mapping import tangent_coordinates, unroll
from decals.field.walk import (
    CELLS,
    CELLS_ALONG,
    LISTED,
    NOWHERE,
    OTHER_WAY,
    RELAY,
    SIDE,
    SPACING,
    relay_place,
)
from decals.record import xyz

wp.set_module_options({"enable_backward": False})

MAX_TRIANGLES = 20000
"""Triangles of a walk, at most."""
OUTER = 1.3
"""Distance in the image, in visible radii, to which relays are made; corners of the grid lie farther out."""
LARGEST_TURN = 0.3
"""Angle between a walk and its neighbours, at most, from which its stretch is measured."""
NARROW = 0.2
"""Angle to closer neighbours, over the first one, by which walks past a focus are found."""
EVEN = 2.0
"""Stretch, or its inverse, up to which a walk between two neighbours is not tested for a focus."""
FOCUS = 0.1
"""Stretch below which the end of a walk counts as past a focus."""
SAME_FACE = 0.9
"""Cosine between the normals of two walks' ends from which they count as ends on one smooth surface."""
SAME_WAY = 0.95
"""Cosine between the direction of a walk and that expected by its neighbour, on one side of corners."""
ONE_STEP = 0.3
"""Difference of a relay's place from that expected by its neighbour, over the step, at most."""
ONE_PLACE = 1.5
"""Distance, in spacings, to which another walk leads to the same place."""
OTHER_WALK = 0.7
"""Distance in the image, in spacings, from which two walks are different."""
BEYOND_CUT = 1.3
"""Distance from the cut, in spacings, from which relays of longer walks are dropped."""
ONE_FACE = 0.8
"""Cosine between the normals of relays from which a cell lists one of them."""
NEAR, REACH = 0.35, 0.55
"""Distances from the middle of a cell to which relays are listed: half a diagonal, and 1 or FAR spacings.

Those beyond NEAR are listed where there are no others.
"""
BEND = 0.3
"""Error of a place that a relay sees, over its distance, at most."""
LEAST_STRETCH, MOST_STRETCH = 0.2, 5.0


@wp.struct
class WalkedMesh:
    """Triangles and their neighbours; the twins are those of `decals.surfaces.topology.edge_twins`."""

    vertices: wp.array(dtype=wp.vec3)
    corners: wp.array(dtype=wp.int32)
    normals: wp.array(dtype=wp.vec3)
    twins: wp.array(dtype=wp.int32)


@wp.struct
class WalkStart:
    """Centre and radius of a decal, the point of a face where its walks begin, and two axes in the face.

    `place` is that of the point in the image. Walks are compared from the place `origin`.
    """

    centre: wp.vec3
    radius: wp.float32
    point: wp.vec3
    face: wp.int32
    u: wp.vec3
    v: wp.vec3
    place: wp.vec2
    origin: wp.vec2


@wp.func
def walk(start: WalkStart, angle: wp.float32, length: wp.float32, mesh: WalkedMesh):
    """Return end, direction and face of a straightest geodesic; face −1 if it ends at a border."""
    p = start.point
    face = start.face
    ahead = wp.cos(angle) * start.u + wp.sin(angle) * start.v
    left = wp.float32(length)
    entry = wp.int32(-1)
    for _triangle in range(MAX_TRIANGLES):
        nearest = wp.float32(1.0e38)
        side = wp.int32(-1)
        for k in range(3):
            if k != entry:
                a = mesh.vertices[mesh.corners[3 * face + k]] - start.centre
                b = mesh.vertices[mesh.corners[3 * face + (k + 1) % 3]] - start.centre
                outward = wp.cross(b - a, mesh.normals[face])
                slope = wp.dot(ahead, outward)
                if slope > 0.0:
                    distance = wp.max(wp.dot(a - p, outward) / slope, 0.0)
                    if distance < nearest:
                        nearest = distance
                        side = k
        if side < 0:
            break
        if nearest >= left:
            return p + left * ahead, ahead, face
        left -= nearest
        twin = mesh.twins[3 * face + side]
        if twin < 0:
            break
        face = twin // 3
        entry = twin - 3 * face
        a = mesh.vertices[mesh.corners[3 * face + entry]] - start.centre
        b = mesh.vertices[mesh.corners[3 * face + (entry + 1) % 3]] - start.centre
        edge = wp.normalize(b - a)
        p = a + wp.dot(p + nearest * ahead - a, edge) * edge
        along = wp.clamp(wp.dot(ahead, edge), -1.0, 1.0)
        ahead = along * edge + wp.sqrt(1.0 - along * along) * wp.cross(mesh.normals[face], edge)
    return p, ahead, -1


@wp.func
def side_stretch(
    start: WalkStart,
    angle: wp.float32,
    turn: wp.float32,
    length: wp.float32,
    end: wp.vec3,
    ahead: wp.vec3,
    normal: wp.vec3,
    mesh: WalkedMesh,
):
    """Return the stretch between the ends of a walk and of a turned one; MOST_STRETCH without such an end.

    The end must lie on the same face, and the turned walk must arrive there in the direction expected. Past a
    focus, where walks have crossed, the stretch is negative. A walk past a focus is not the shortest one.
    """
    beside, turned, other = walk(start, angle + turn, length, mesh)
    if other < 0:
        return MOST_STRETCH
    across = wp.cross(normal, ahead)
    if wp.dot(mesh.normals[other], normal) <= SAME_FACE:
        return MOST_STRETCH
    if wp.dot(turned, wp.cos(turn) * ahead + wp.sin(turn) * across) <= SAME_WAY:
        return MOST_STRETCH
    return wp.dot(beside - end, across) / (length * wp.sin(turn))


@wp.kernel
def place_relays(starts: wp.array(dtype=WalkStart), mesh: WalkedMesh, texels: wp.array(dtype=wp.vec4)):
    """Write the grids of relays: places, gradients of the image coordinates there, and states."""
    i = wp.tid()
    start = starts[i // (SIDE * SIDE)]
    number = i % (SIDE * SIDE)
    place = relay_place(number % SIDE, number // SIDE) - start.place
    length = wp.length(place)
    texels[RELAY * i] = wp.vec4(NOWHERE, NOWHERE, NOWHERE, 0.0)
    if length > OUTER or start.face < 0:
        return
    angle = wp.float32(0.0)
    if length > 0.0:
        angle = wp.atan2(place[1], place[0])
    end, ahead, face = walk(start, angle, length * start.radius, mesh)
    if face < 0:
        return
    normal = mesh.normals[face]
    across = wp.cross(normal, ahead)
    stretch = wp.float32(1.0)
    total = wp.float32(0.0)
    count = wp.float32(0.0)
    least = wp.float32(MOST_STRETCH)
    if length > 0.0:
        turn = wp.min(0.5 * SPACING / length, LARGEST_TURN)
        for side in range(2):
            seen = side_stretch(
                start, angle, float(1 - 2 * side) * turn, length * start.radius, end, ahead, normal, mesh
            )
            least = wp.min(least, seen)
            if seen > LEAST_STRETCH and seen < MOST_STRETCH:
                total += seen
                count += 1.0
        if count > 0.0:
            stretch = total / count
        if count == 0.0 or stretch > EVEN or least * EVEN < 1.0:
            for side in range(2):
                close = float(1 - 2 * side) * NARROW * turn
                seen = side_stretch(start, angle, close, length * start.radius, end, ahead, normal, mesh)
                if seen <= FOCUS:
                    return
    cosine = wp.cos(angle)
    sine = wp.sin(angle)
    along_x = cosine * ahead - sine / stretch * across
    along_y = sine * ahead + cosine / stretch * across
    end = end / start.radius
    texels[RELAY * i] = wp.vec4(end[0], end[1], end[2], normal[0])
    texels[RELAY * i + 1] = wp.vec4(along_x[0], along_x[1], along_x[2], normal[1])
    texels[RELAY * i + 2] = wp.vec4(along_y[0], along_y[1], along_y[2], normal[2])


@wp.func
def is_lost(i: wp.int32, texels: wp.array(dtype=wp.vec4)) -> wp.bool:
    """Return True for a relay that is not there."""
    return texels[RELAY * i][0] == NOWHERE


@wp.func
def relay_normal(i: wp.int32, texels: wp.array(dtype=wp.vec4)) -> wp.vec3:
    """Return the normal at a relay."""
    return wp.vec3(texels[RELAY * i][3], texels[RELAY * i + 1][3], texels[RELAY * i + 2][3])


@wp.func
def seen_from(i: wp.int32, point: wp.vec3, texels: wp.array(dtype=wp.vec4)) -> wp.vec2:
    """Return the place of a point in the image, as a relay sees it."""
    number = i % (SIDE * SIDE)
    offset = point - xyz(texels[RELAY * i])
    seen = wp.vec2(wp.dot(xyz(texels[RELAY * i + 1]), offset), wp.dot(xyz(texels[RELAY * i + 2]), offset))
    return relay_place(number % SIDE, number // SIDE) + seen


@wp.func
def relay_step(i: wp.int32, side: wp.int32, step: wp.vec3, normal: wp.vec3, texels: wp.array(dtype=wp.vec4)):
    """Return how far a relay's place changes along one axis of the grid, per unit of the image.

    It is half the way between its neighbours, `side` relays before and behind. `step` is that of its own
    walk, for relays at a border of the grid or of a face.
    """
    number = i % (SIDE * SIDE) // side % SIDE
    if number == 0 or number == SIDE - 1:
        return step
    ends = wp.vec3(0.0, 0.0, 0.0)
    for k in range(2):
        sign = 1 - 2 * k
        beyond = i + sign * side
        offset = float(sign) * (xyz(texels[RELAY * beyond]) - xyz(texels[RELAY * i]))
        expected = SPACING * step
        if wp.length(offset - expected) > ONE_STEP * wp.length(expected):
            return step
        if wp.dot(relay_normal(beyond, texels), normal) < SAME_FACE:
            return step
        ends += offset
    ends = ends / (2.0 * SPACING)
    return ends - wp.dot(ends, normal) * normal


@wp.kernel
def smooth_relays(texels: wp.array(dtype=wp.vec4), smoothed: wp.array(dtype=wp.vec4)):
    """Write relays with gradients that lead from neighbour to neighbour, so that facets do not show."""
    i = wp.tid()
    along_x = xyz(texels[RELAY * i + 1])
    along_y = xyz(texels[RELAY * i + 2])
    normal = relay_normal(i, texels)
    if not is_lost(i, texels):
        size = wp.dot(wp.cross(along_x, along_y), normal)
        x = relay_step(i, 1, wp.cross(along_y, normal) / size, normal, texels)
        y = relay_step(i, SIDE, wp.cross(normal, along_x) / size, normal, texels)
        area = wp.dot(wp.cross(x, y), normal)
        if area > LEAST_STRETCH * wp.length(x) * wp.length(y):
            along_x = wp.cross(y, normal) / area
            along_y = wp.cross(normal, x) / area
    smoothed[RELAY * i] = texels[RELAY * i]
    smoothed[RELAY * i + 1] = wp.vec4(along_x[0], along_x[1], along_x[2], normal[1])
    smoothed[RELAY * i + 2] = wp.vec4(along_y[0], along_y[1], along_y[2], normal[2])


@wp.kernel
def compare_relays(
    normals: wp.array(dtype=wp.vec3),
    tangents: wp.array(dtype=wp.vec3),
    texels: wp.array(dtype=wp.vec4),
    errors: wp.array(dtype=wp.float32),
):
    """Write how far the corrected mapping draws from each relay's own place; −1 for lost ones."""
    i = wp.tid()
    grid = i // (SIDE * SIDE)
    number = i % (SIDE * SIDE)
    place = relay_place(number % SIDE, number // SIDE)
    errors[i] = -1.0
    if not is_lost(i, texels) and wp.length(place) <= 1.0:
        n_q = relay_normal(i, texels)
        arc = unroll(xyz(texels[RELAY * i]), normals[grid], n_q)
        drawn = tangent_coordinates(xyz(arc), normals[grid], tangents[grid])
        drawn = arc[3] / wp.max(wp.length(drawn), 1.0e-12) * drawn
        errors[i] = wp.length(drawn - place)


@wp.func
def arrival(i: wp.int32, ahead: wp.vec2, texels: wp.array(dtype=wp.vec4)) -> wp.vec3:
    """Return the direction on the surface at a relay of a direction in the image, times a stretch."""
    return ahead[0] * xyz(texels[RELAY * i + 1]) + ahead[1] * xyz(texels[RELAY * i + 2])


@wp.kernel
def find_longer(
    starts: wp.array(dtype=WalkStart), texels: wp.array(dtype=wp.vec4), longer: wp.array(dtype=wp.int32)
):
    """Write 1 for relays to which another walk is shorter, unless they are close to the cut.

    The difference of both lengths grows with the distance from the cut, by the difference of the directions
    in which the walks arrive.
    """
    i = wp.tid()
    if is_lost(i, texels):
        return
    grid = SIDE * SIDE * (i // (SIDE * SIDE))
    origin = starts[i // (SIDE * SIDE)].origin
    number = i % (SIDE * SIDE)
    own = relay_place(number % SIDE, number // SIDE) - origin
    end = xyz(texels[RELAY * i])
    for j in range(grid, grid + SIDE * SIDE):
        if wp.length(end - xyz(texels[RELAY * j])) < ONE_PLACE * SPACING:
            if wp.dot(relay_normal(i, texels), relay_normal(j, texels)) > SAME_FACE:
                seen = seen_from(j, end, texels) - origin
                if wp.length(seen - own) > OTHER_WALK * SPACING:
                    ahead = arrival(i, wp.normalize(own), texels)
                    turned = wp.length(ahead - arrival(j, wp.normalize(seen), texels))
                    if wp.length(own) - wp.length(seen) > BEYOND_CUT * SPACING * turned:
                        longer[i] = 1
                        return


@wp.func
def is_listed(
    j: wp.int32,
    i: wp.int32,
    count: wp.int32,
    lists: wp.array2d(dtype=wp.int32),
    texels: wp.array(dtype=wp.vec4),
):
    """Return True if a relay listed for cell i sees relay j in its place; True if one sees it elsewhere."""
    elsewhere = wp.bool(False)
    number = j % (SIDE * SIDE)
    for m in range(count):
        other = j - number + lists[i, m]
        if wp.dot(relay_normal(j, texels), relay_normal(other, texels)) > ONE_FACE:
            end = xyz(texels[RELAY * j])
            error = wp.length(seen_from(other, end, texels) - relay_place(number % SIDE, number // SIDE))
            if error < OTHER_WAY * SPACING + BEND * wp.length(end - xyz(texels[RELAY * other])):
                return True, False
            elsewhere = True
    return False, elsewhere


@wp.kernel
def list_relays(
    texels: wp.array(dtype=wp.vec4),
    lists: wp.array2d(dtype=wp.int32),
    two_ways: wp.array(dtype=wp.int32),
):
    """Write the relays of each cell: the nearest on each face by each way. Two ways are marked with 1."""
    i = wp.tid()
    grid = SIDE * SIDE * (i // CELLS)
    cell = i % CELLS
    x = float(cell % CELLS_ALONG) + 0.5
    y = float(cell // CELLS_ALONG % CELLS_ALONG) + 0.5
    z = float(cell // (CELLS_ALONG * CELLS_ALONG)) + 0.5
    middle = 2.0 / float(CELLS_ALONG) * wp.vec3(x, y, z) - wp.vec3(1.0, 1.0, 1.0)
    reach = wp.float32(REACH)
    for k in range(LISTED):
        found = wp.int32(-1)
        least = wp.float32(reach)
        for j in range(grid, grid + SIDE * SIDE):
            distance = wp.length(middle - xyz(texels[RELAY * j]))
            if distance < least:
                listed, _elsewhere = is_listed(j, i, k, lists, texels)
                if not listed:
                    least = distance
                    found = j
        if found < 0:
            break
        _listed, elsewhere = is_listed(found, i, k, lists, texels)
        if elsewhere:
            two_ways[i] = 1
        lists[i, k] = found - grid
        if least < NEAR:
            reach = NEAR
