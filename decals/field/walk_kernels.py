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
from decals.field.walk import DOUBLE, LOST, RELAY, RELAYS, SIDE, SINGLE, SPACING, relay_place
from decals.record import xyz

wp.set_module_options({"enable_backward": False})

MAX_TRIANGLES = 20000
"""Triangles of a walk, at most."""
OUTER = 1.3
"""Distance in the image, in visible radii, to which relays are made; corners of the grid lie farther out."""
LARGEST_TURN = 0.3
"""Angle between a walk and its neighbours, at most, from which its stretch is measured."""
SAME_FACE = 0.9
"""Cosine between the normals of two walks' ends from which they count as ends on one smooth surface."""
ONE_PLACE = 2.5
"""Distance, in spacings, to which another walk leads to the same place."""
OTHER_WALK = 0.7
"""Distance in the image, in spacings, from which two walks are different."""
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
    """Centre and radius of a decal, the point of a face where its walks begin, and two axes in the face."""

    centre: wp.vec3
    radius: wp.float32
    point: wp.vec3
    face: wp.int32
    u: wp.vec3
    v: wp.vec3


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


@wp.kernel
def place_relays(starts: wp.array(dtype=WalkStart), mesh: WalkedMesh, texels: wp.array(dtype=wp.vec4)):
    """Write the grids of relays: places, gradients of the image coordinates there, and states."""
    i = wp.tid()
    start = starts[i // (SIDE * SIDE)]
    number = i % (SIDE * SIDE)
    place = relay_place(number % SIDE, number // SIDE)
    length = wp.length(place)
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
    if length > 0.0:
        turn = wp.min(0.5 * SPACING / length, LARGEST_TURN)
        for side in range(2):
            sign = float(1 - 2 * side)
            beside, _ahead, other = walk(start, angle + sign * turn, length * start.radius, mesh)
            if other >= 0:
                if wp.dot(mesh.normals[other], normal) > SAME_FACE:
                    seen = sign * wp.dot(beside - end, across) / (length * start.radius * wp.sin(turn))
                    if seen > LEAST_STRETCH and seen < MOST_STRETCH:
                        total += seen
                        count += 1.0
    if count > 0.0:
        stretch = total / count
    cosine = wp.cos(angle)
    sine = wp.sin(angle)
    along_x = cosine * ahead - sine / stretch * across
    along_y = sine * ahead + cosine / stretch * across
    end = end / start.radius
    texels[RELAY * i] = wp.vec4(end[0], end[1], end[2], 0.0)
    texels[RELAY * i + 1] = wp.vec4(along_x[0], along_x[1], along_x[2], 0.0)
    texels[RELAY * i + 2] = wp.vec4(along_y[0], along_y[1], along_y[2], SINGLE)


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
        texel = RELAY * (i + sign * side)
        beyond = texels[texel + 2]
        offset = float(sign) * (xyz(texels[texel]) - xyz(texels[RELAY * i]))
        turned = wp.cross(xyz(texels[texel + 1]), xyz(beyond))
        apart = wp.length(offset) / (SPACING * wp.length(step))
        if (
            beyond[3] == LOST
            or apart < 0.5
            or apart > 2.0
            or wp.dot(turned, normal) < SAME_FACE * wp.length(turned)
        ):
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
    state = texels[RELAY * i + 2][3]
    if state != LOST:
        cross = wp.cross(along_x, along_y)
        size = wp.length(cross)
        normal = cross / size
        x = relay_step(i, 1, wp.cross(along_y, normal) / size, normal, texels)
        y = relay_step(i, SIDE, wp.cross(normal, along_x) / size, normal, texels)
        area = wp.dot(wp.cross(x, y), normal)
        if area > LEAST_STRETCH * wp.length(x) * wp.length(y):
            along_x = wp.cross(y, normal) / area
            along_y = wp.cross(normal, x) / area
    smoothed[RELAY * i] = texels[RELAY * i]
    smoothed[RELAY * i + 1] = wp.vec4(along_x[0], along_x[1], along_x[2], 0.0)
    smoothed[RELAY * i + 2] = wp.vec4(along_y[0], along_y[1], along_y[2], state)


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
    if texels[RELAY * i + 2][3] != LOST and wp.length(place) <= 1.0:
        n_q = wp.normalize(wp.cross(xyz(texels[RELAY * i + 1]), xyz(texels[RELAY * i + 2])))
        arc = unroll(xyz(texels[RELAY * i]), normals[grid], n_q)
        drawn = tangent_coordinates(xyz(arc), normals[grid], tangents[grid])
        drawn = arc[3] / wp.max(wp.length(drawn), 1.0e-12) * drawn
        errors[i] = wp.length(drawn - place)


@wp.kernel
def join_relays(texels: wp.array(dtype=wp.vec4)):
    """Write the image coordinates of other walks to the same place, for relays where there are any."""
    i = wp.tid()
    last = texels[RELAY * i + 2]
    if last[3] == LOST:
        return
    grid = RELAYS * (i // (SIDE * SIDE))
    number = i % (SIDE * SIDE)
    own = relay_place(number % SIDE, number // SIDE)
    end = xyz(texels[RELAY * i])
    normal = wp.normalize(wp.cross(xyz(texels[RELAY * i + 1]), xyz(last)))
    least = wp.float32(ONE_PLACE * SPACING)
    for other in range(SIDE * SIDE):
        texel = grid + RELAY * other
        offset = end - xyz(texels[texel])
        distance = wp.length(offset)
        if distance < least and texels[texel + 2][3] != LOST:
            along_x = xyz(texels[texel + 1])
            along_y = xyz(texels[texel + 2])
            if wp.dot(wp.normalize(wp.cross(along_x, along_y)), normal) > SAME_FACE:
                seen = relay_place(other % SIDE, other // SIDE)
                seen += wp.vec2(wp.dot(along_x, offset), wp.dot(along_y, offset))
                if wp.length(seen - own) > OTHER_WALK * SPACING:
                    least = distance
                    texels[RELAY * i] = wp.vec4(end[0], end[1], end[2], seen[0])
                    first = xyz(texels[RELAY * i + 1])
                    texels[RELAY * i + 1] = wp.vec4(first[0], first[1], first[2], seen[1])
                    texels[RELAY * i + 2] = wp.vec4(last[0], last[1], last[2], DOUBLE)
