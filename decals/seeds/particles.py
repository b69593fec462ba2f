"""Warp kernels of particle repulsion on surfaces.

Particles repel each other by a soft power law of their distance, and by a stiff spring where they come too
close (Witkin and Heckbert 1994 started the family). The soft law alone spreads them evenly and leaves
pairs too close at each flaw of the tiling, a steep one does the reverse; together they do both. In the end
each also wants the ring of its six nearest to be as wide as everybody's is on average.
Each kernel thread owns one particle and adds up its neighbours in the order of the grid, so that the
result does not depend on scheduling.
"""

# mypy: disable-error-code="call-overload"
# (Warp declares no arithmetic of vectors)

import warp as wp

from decals.seeds.rim_kernels import mirrored

wp.set_module_options({"enable_backward": False})

Six = wp.types.vector(6, wp.float32)
"""Distances to the six nearest, ascending."""

CLOSEST = 0.6
"""Distances below this many spacings act like it: coincident particles part at once, not by inches."""

ON_WALL = 0.25
"""Images of neighbours nearer to the wall than so many spacings count less: one on it is its own image."""

ODD = 0.3
"""A ring that differs from the mean one by so many spacings is one of a tip or a thin part, and let be."""

ISOTROPY = 0.1
"""Share of the trace added to the curvature of the energy, so that no direction is without any."""


@wp.func
def facing_weight(cosine: wp.float32, facing_limit: wp.float32) -> wp.float32:
    """How far two particles are neighbours: 1 above the facing limit, falling to 0 below it."""
    t = wp.clamp(1.0 + 4.0 * (cosine - facing_limit), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


@wp.func
def some_tangent(normal: wp.vec3) -> wp.vec3:
    """Any unit vector at right angles to the unit normal, the same for the same normal."""
    axis = wp.vec3(1.0, 0.0, 0.0)
    if wp.abs(normal[0]) > 0.6:
        axis = wp.vec3(0.0, 1.0, 0.0)
    return wp.normalize(axis - normal * wp.dot(axis, normal))


@wp.func
def apart(offset: wp.vec3, i: wp.int32, j: wp.int32, tangent: wp.vec3, closest: wp.float32) -> wp.vec3:
    """Offset of two particles, of at least the closest distance; coincident ones part by their numbers."""
    if wp.length_sq(offset) > 1.0e-12 * closest * closest:
        return offset * wp.max(1.0, closest / wp.length(offset))
    if i < j:
        return tangent * closest
    return -tangent * closest


@wp.func
def shown_beyond(q: wp.vec3, own: wp.bool, point: wp.vec3, normal: wp.vec3, depth: wp.float32) -> wp.float32:
    """What an image counts: one's own fully, a neighbour's from 0 on the wall to 1 at a depth before it."""
    if own:
        return wp.length_sq(normal)
    return wp.clamp(wp.dot(q - point, normal) / depth, 0.0, 1.0)


@wp.func
def nearest_six(six: Six, distance: wp.float32) -> Six:
    """Put one more distance among the six nearest."""
    x = float(distance)
    if x < six[5]:
        for k in range(6):
            farther = wp.max(six[k], x)
            six[k] = wp.min(six[k], x)
            x = farther
    return six


@wp.func
def mean_of_six(six: Six) -> wp.float32:
    """Mean distance of a ring."""
    return (six[0] + six[1] + six[2] + six[3] + six[4] + six[5]) / 6.0


@wp.func
def ring_pull(lack: wp.float32) -> wp.float32:
    """Slope of `ring_cost`: it grows with what a ring lacks, and fades away where that is a lot."""
    fair = wp.max(1.0 - lack * lack / (ODD * ODD), 0.0)
    return lack * fair * fair


@wp.func
def ring_cost(lack: wp.float32) -> wp.float32:
    """Half the square of what a ring lacks, to first order; a constant from `ODD` on (Tukey's biweight)."""
    fair = wp.max(1.0 - lack * lack / (ODD * ODD), 0.0)
    return ODD * ODD / 6.0 * (1.0 - fair * fair * fair)


@wp.kernel
def list_neighbours(
    first: wp.int32,
    grid: wp.uint64,
    positions: wp.array(dtype=wp.vec3),
    guides: wp.array(dtype=wp.vec3),
    sizes: wp.array(dtype=wp.float32),
    reach: wp.float32,
    widening: wp.float32,
    facing_limit: wp.float32,
    room: wp.int32,
    counts: wp.array(dtype=wp.int32),
    neighbours: wp.array(dtype=wp.int32),
    weights: wp.array(dtype=wp.float32),
) -> None:
    """Neighbours of each particle on its side of a wall, as many as have room, in the grid's order."""
    i = first + wp.tid()
    p = positions[i]
    n = guides[i]
    size = sizes[i]
    count = int(0)
    j = int(0)
    query = wp.hash_grid_query(grid, p, reach * widening * size)
    while wp.hash_grid_query_next(query, j):
        if j != i and count < room:
            limit = reach * 0.5 * (size + sizes[j])
            if wp.length_sq(p - positions[j]) < limit * limit:
                weight = facing_weight(wp.dot(n, guides[j]), facing_limit)
                if weight > 0.0:
                    neighbours[i * room + count] = j
                    weights[i * room + count] = weight
                    count += 1
    counts[i] = count


@wp.kernel
def measure_rings(
    first: wp.int32,
    positions: wp.array(dtype=wp.vec3),
    sizes: wp.array(dtype=wp.float32),
    room: wp.int32,
    counts: wp.array(dtype=wp.int32),
    neighbours: wp.array(dtype=wp.int32),
    weights: wp.array(dtype=wp.float32),
    farthest: wp.float32,
    walls: wp.int32,
    wall_points: wp.array(dtype=wp.vec3),
    wall_normals: wp.array(dtype=wp.vec3),
    rings: wp.array(dtype=wp.float32),
    rims: wp.array(dtype=wp.float32),
) -> None:
    """Mean distance of each particle to its six nearest, and the distance of the sixth, in spacings.

    Those count that face it fully, and so do images beyond walls. Who is missing counts as if at the farthest
    distance.
    """
    i = first + wp.tid()
    p = positions[i]
    six = Six(farthest, farthest, farthest, farthest, farthest, farthest)
    for k in range(counts[i] + 1):
        j = int(i)
        listed = float(1.0)
        if k < counts[i]:
            j = neighbours[i * room + k]
            listed = weights[i * room + k]
        pair = 0.5 * (sizes[i] + sizes[j])
        if j != i and listed >= 1.0:
            six = nearest_six(six, wp.length(p - positions[j]) / pair)
        for w in range(walls * i, walls * (i + 1)):
            q = positions[j]
            shown = shown_beyond(q, j == i, wall_points[w], wall_normals[w], ON_WALL * sizes[i])
            if listed * shown >= 1.0:
                six = nearest_six(six, wp.length(p - mirrored(q, wall_points[w], wall_normals[w])) / pair)
    rings[i] = mean_of_six(six)
    rims[i] = six[5]


@wp.kernel
def repel(
    first: wp.int32,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    sizes: wp.array(dtype=wp.float32),
    room: wp.int32,
    counts: wp.array(dtype=wp.int32),
    neighbours: wp.array(dtype=wp.int32),
    weights: wp.array(dtype=wp.float32),
    cutoff: wp.float32,
    exponent: wp.float32,
    core: wp.float32,
    stiffness: wp.float32,
    evening: wp.float32,
    rings: wp.array(dtype=wp.float32),
    rims: wp.array(dtype=wp.float32),
    total: wp.array(dtype=wp.float32),
    damping: wp.float32,
    longest: wp.float32,
    walls: wp.int32,
    wall_points: wp.array(dtype=wp.vec3),
    wall_normals: wp.array(dtype=wp.vec3),
    moves: wp.array(dtype=wp.vec3),
    energies: wp.array(dtype=wp.float32),
    works: wp.array(dtype=wp.float64),
) -> None:
    """One damped Newton step of each particle in its tangent plane, against its neighbours at rest.

    The energy of a pair at distance x, in its own spacing, is x^-p, shifted so that value and slope vanish
    at the cutoff, and a spring of the given stiffness within the core; below `CLOSEST` it goes on along its
    tangent. A pair's part of the total energy is that times its spacing squared, so that pressure is the
    same where spacings differ: `works` are halves of it. `energies` leave the square out, and rings: they
    tell who is crowded. Curvature across the line of a pair is left out: it is negative.

    Beyond each wall lie the images of the neighbours, and of the particle itself: of that pair half the
    energy counts, and it parts by twice the move.

    A particle whose ring is wider or narrower than the mean one, `total` over the count, adds `ring_cost` of
    the difference, times `evening` and its spacing squared.
    """
    i = first + wp.tid()
    p = positions[i]
    u = some_tangent(normals[i])
    v = wp.cross(normals[i], u)
    size = sizes[i]
    fx = float(0.0)
    fy = float(0.0)
    hxx = float(0.0)
    hxy = float(0.0)
    hyy = float(0.0)
    energy = float(0.0)
    work = wp.float64(0.0)
    rim_value = wp.pow(cutoff, -exponent)
    rim_slope = exponent * rim_value / cutoff
    mean = total[0] / wp.float32(positions.shape[0])
    for k in range(counts[i] + 1):
        j = int(i)
        listed = float(1.0)
        if k < counts[i]:
            j = neighbours[i * room + k]
            listed = weights[i * room + k]
        pair = 0.5 * (size + sizes[j])
        for image in range(walls + 1):
            q = positions[j]
            weight = float(listed)
            lone = wp.vec3(u)
            bends = float(1.0)
            if image > 0:
                w = walls * i + image - 1
                lone = wall_normals[w]
                weight *= shown_beyond(q, j == i, wall_points[w], lone, ON_WALL * size)
                q = mirrored(q, wall_points[w], lone)
                if j == i:
                    bends = 2.0
            elif j == i:
                weight = 0.0
            offset = p - q
            if weight > 0.0 and wp.length_sq(offset) < cutoff * cutoff * pair * pair:
                away = apart(offset, i, j, lone, CLOSEST * pair) / pair
                if j == i:
                    away = apart(offset, 0, 1, lone, CLOSEST * pair) / pair
                x = wp.length(away)
                value = wp.pow(x, -exponent)
                slope = exponent * value / x
                curve = (exponent + 1.0) * slope / x
                overlap = wp.max(core - x, 0.0)
                if overlap > 0.0:
                    curve += stiffness
                ax = wp.dot(away, u) / x
                ay = wp.dot(away, v) / x
                push = weight * (pair / size) * (slope - rim_slope + stiffness * overlap)
                bend = weight * curve
                # a sixth of how far they are apart belongs to either ring
                if evening > 0.0 and weight >= 1.0:
                    distance = wp.length(offset) / pair
                    if distance <= rims[i]:
                        push += evening / 6.0 * ring_pull(mean - rings[i]) * size / pair
                    if distance <= rims[j]:
                        lever = sizes[j] / pair
                        push += evening / 6.0 * ring_pull(mean - rings[j]) * lever * sizes[j] / size
                        bend += evening / 36.0 * lever * lever
                bend *= bends
                fx += push * ax
                fy += push * ay
                hxx += bend * ax * ax
                hxy += bend * ax * ay
                hyy += bend * ay * ay
                part = value - rim_value + rim_slope * (x - cutoff) + 0.5 * stiffness * overlap * overlap
                nearer = wp.max(x - wp.length(offset) / pair, 0.0)
                part = weight * (part + nearer * (slope - rim_slope + stiffness * overlap))
                energy += part
                work += wp.float64(0.5 * pair * pair * part)
    work += wp.float64(size * size * evening * ring_cost(mean - rings[i]))
    energies[i] = energy
    works[i] = work
    extra = ISOTROPY * (hxx + hyy)
    hxx += extra
    hyy += extra
    determinant = hxx * hyy - hxy * hxy
    move = wp.vec3(0.0, 0.0, 0.0)
    if determinant > 0.0:
        dx = (hyy * fx - hxy * fy) / determinant
        dy = (hxx * fy - hxy * fx) / determinant
        move = (dx * u + dy * v) * (damping * size)
        length = wp.length(move)
        if length > longest * size:
            move = move * (longest * size / length)
    moves[i] = move
