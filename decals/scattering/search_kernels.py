"""Warp kernels of searches among particles, and the structs that all kernels of scattering share."""

# mypy: disable-error-code="call-overload"
# (Warp declares no arithmetic of vectors)

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS

wp.set_module_options(KERNEL_OPTIONS)

SHEETS_BEGIN, SHEETS_END = 0.15, 0.3
"""Product of the sines between the line of two points and their tangent planes, one above and one below, from
which two points of different sheets count less as neighbours, and from which they are none."""

LEAST_PRODUCT = 0.02
"""Product of the heights of two points over their tangent planes, in squared spacings, up to which they are
neighbours in any case: those next to the line where two sheets cross."""

MIN_SQUARE = 1.0e-37

Six = wp.types.vector(6, wp.float32)
"""Distances to the six nearest particles, ascending."""

DIRECTIONS = 24
"""Directions of the tangent plane in which a cell is measured, at equal angles."""

Lengths = wp.types.vector(DIRECTIONS, wp.float32)
"""Distances from a particle to the border of its cell, in these directions."""

Partners = wp.types.vector(DIRECTIONS, wp.int32)
"""Particles on the other side of the border, −1 for none."""


@wp.struct
class Particles:
    """Oriented points on surfaces, and the spacing that the density asks for at each."""

    positions: wp.array(dtype=wp.vec3)
    normals: wp.array(dtype=wp.vec3)
    """Unit normals of the surfaces at the positions."""
    sizes: wp.array(dtype=wp.float32)
    """Spacings, in model units."""
    sheets: wp.array(dtype=wp.int32)
    """Numbers of the sheets of the surfaces, −1 for small ones; empty where there is one sheet."""


@wp.struct
class MirrorPlanes:
    """Planes at open boundaries, `per_point` for each of some points; a zero normal stands for no plane."""

    per_point: wp.int32
    """Planes of each point; 0 where no surface has a boundary, and the arrays are empty then."""
    points: wp.array(dtype=wp.vec3)
    """A point of each plane."""
    normals: wp.array(dtype=wp.vec3)
    """Unit normals, toward the surface."""


@wp.struct
class NeighborSearch:
    """A hash grid over particles, and the rule that makes two of them neighbours."""

    grid: wp.uint64
    reach: wp.float32
    """Largest distance of neighbours, in the mean of their two spacings."""
    widening: wp.float32
    """Factor of the radius that the grid is searched with, above 1 where spacings vary."""
    facing_limit: wp.float32
    """Least cosine of two normals that face the same way."""


@wp.func
def sheet_weight(points: Particles, i: wp.int32, particles: Particles, j: wp.int32) -> wp.float32:
    """Return the weight of two neighbours by their sheets: 0 over each other or across a wall, else 1.

    One lies above the tangent plane of the other then, which lies below its own.
    """
    if points.sheets.shape[0] == 0:
        return 1.0
    own = points.sheets[i]
    other = particles.sheets[j]
    if own == other or own < 0 or other < 0:
        return 1.0
    offset = particles.positions[j] - points.positions[i]
    product = wp.dot(offset, points.normals[i]) * wp.dot(offset, particles.normals[j])
    share = (product - LEAST_PRODUCT * points.sizes[i] * particles.sizes[j]) / wp.max(
        wp.length_sq(offset), MIN_SQUARE
    )
    t = wp.clamp((SHEETS_END - share) / (SHEETS_END - SHEETS_BEGIN), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


@wp.func
def are_neighbors(
    points: Particles, i: wp.int32, particles: Particles, j: wp.int32, search: NeighborSearch
) -> wp.bool:
    """Return True for two near points that face the same way, on one sheet."""
    if wp.dot(points.normals[i], particles.normals[j]) <= search.facing_limit:
        return False
    return sheet_weight(points, i, particles, j) > 0.0


@wp.func
def mirrored(q: wp.vec3, point: wp.vec3, normal: wp.vec3) -> wp.vec3:
    """Return the image of a point behind a plane; a point behind the plane is its own image."""
    return q - 2.0 * wp.max(wp.dot(q - point, normal), 0.0) * normal


@wp.func
def any_tangent(normal: wp.vec3) -> wp.vec3:
    """Return a unit vector at right angles to the unit normal, the same for the same normal."""
    axis = wp.vec3(1.0, 0.0, 0.0)
    if wp.abs(normal[0]) > 0.6:
        axis = wp.vec3(0.0, 1.0, 0.0)
    return wp.normalize(axis - normal * wp.dot(axis, normal))


@wp.func
def insert_distance(six: Six, distance: wp.float32) -> Six:
    """Return the six smallest of six ascending distances and one more."""
    x = float(distance)
    if x < six[5]:
        for k in range(6):
            farther = wp.max(six[k], x)
            six[k] = wp.min(six[k], x)
            x = farther
    return six


@wp.func
def mean_distance(six: Six) -> wp.float32:
    """Return the mean of six distances."""
    return (six[0] + six[1] + six[2] + six[3] + six[4] + six[5]) / 6.0


@wp.struct
class Candidates:
    """Positions that particles may move to, the same number for each particle."""

    per_particle: wp.int32
    positions: wp.array(dtype=wp.vec3)
    normals: wp.array(dtype=wp.vec3)
    forbidden: wp.array(dtype=wp.int32)
    """1 where no particle may lie."""
    nearest: wp.array(dtype=wp.float32)
    """Distance of each to the nearest particle, in spacings."""
    rings: wp.array(dtype=wp.float32)
    """Mean distance of each to the six nearest particles, in spacings."""


@wp.struct
class ChoiceRule:
    """Rule for the best candidate; distances are in spacings."""

    min_gain: wp.float32
    """Least ratio of the nearest distance after a move to that before."""
    close: wp.float32
    """Nearest distance that is large enough."""
    ideal_ring: wp.float32
    """Mean distance to the six nearest in a perfect tiling."""


@wp.kernel
def nearest_distances(
    first: wp.int32,
    search: NeighborSearch,
    particles: Particles,
    enough: wp.float32,
    own: wp.array(dtype=wp.int32),
    points: Particles,
    mirrors: MirrorPlanes,
    nearest: wp.array(dtype=wp.float32),
) -> None:
    """Measure the distance of each point to the nearest particle that faces the same way, in spacings.

    At most the reach of the search. A point's own particle does not count, and its own image behind a mirror
    plane does. The search ends at the first distance below `enough`.
    """
    k = first + wp.tid()
    p = points.positions[k]
    size = points.sizes[k]
    least = float(search.reach)
    for w in range(mirrors.per_point * k, mirrors.per_point * (k + 1)):
        if wp.length_sq(mirrors.normals[w]) > 0.0:
            image = mirrored(p, mirrors.points[w], mirrors.normals[w])
            least = wp.min(least, wp.length(p - image) / size)
    j = int(0)
    query = wp.hash_grid_query(search.grid, p, search.reach * search.widening * size)
    while least > enough and wp.hash_grid_query_next(query, j):
        if j != own[k]:
            x = wp.length(p - particles.positions[j]) / (0.5 * (size + particles.sizes[j]))
            if x < least and are_neighbors(points, k, particles, j, search):
                least = x
    nearest[k] = least


@wp.kernel
def nearest_particles(
    first: wp.int32,
    search: NeighborSearch,
    particles: Particles,
    points: Particles,
    distances: wp.array(dtype=wp.float32),
    owners: wp.array(dtype=wp.int32),
) -> None:
    """Find the particle nearest to each point that faces the same way, and its distance in model units.

    The reach of the search is in model units too. Without such a particle the owner is -1.
    """
    k = first + wp.tid()
    p = points.positions[k]
    n = points.normals[k]
    least = float(search.reach * search.reach)
    owner = int(-1)
    j = int(0)
    query = wp.hash_grid_query(search.grid, p, search.reach)
    while wp.hash_grid_query_next(query, j):
        square = wp.length_sq(p - particles.positions[j])
        if square < least and wp.dot(n, particles.normals[j]) > search.facing_limit:
            least = square
            owner = j
    distances[k] = wp.sqrt(least)
    owners[k] = owner


@wp.kernel
def measure_cells(
    first: wp.int32,
    search: NeighborSearch,
    particles: Particles,
    rows: wp.array(dtype=wp.int32),
    radii: wp.array(dtype=wp.float32),
    outlines: wp.array(dtype=wp.vec3),
) -> None:
    """Measure the Voronoi cells of some particles in their tangent planes.

    A neighbour at the offset d bounds the cell at d · d / (2 d · u) in the direction u. Where two neighbours
    bound the cell in directions side by side, the corner between them is taken; it lies outside where a third
    neighbour cuts it off. Cells end at half the reach of the search.

    Parameters
    ----------
    rows
        The particles.
    radii
        Their distance from the farthest point of their cell, in model units.
    outlines
        Points on the border of each cell, `DIRECTIONS` of them; not written if the array is empty.
    """
    k = first + wp.tid()
    i = rows[k]
    p = particles.positions[i]
    n = particles.normals[i]
    u = any_tangent(n)
    v = wp.cross(n, u)
    angle = 2.0 * wp.pi / wp.float32(DIRECTIONS)
    limit = 0.5 * search.reach
    lengths = Lengths()
    partners = Partners()
    for d in range(DIRECTIONS):
        lengths[d] = limit
        partners[d] = -1
    j = int(0)
    query = wp.hash_grid_query(search.grid, p, search.reach)
    while wp.hash_grid_query_next(query, j):
        offset = particles.positions[j] - p
        square = wp.length_sq(offset)
        facing = wp.dot(n, particles.normals[j]) > search.facing_limit
        if facing and j != i and square < search.reach * search.reach:
            x = wp.dot(offset, u)
            y = wp.dot(offset, v)
            for d in range(DIRECTIONS):
                along = x * wp.cos(angle * wp.float32(d)) + y * wp.sin(angle * wp.float32(d))
                if 2.0 * along * lengths[d] > square:
                    lengths[d] = 0.5 * square / along
                    partners[d] = j
    radius = float(0.0)
    for d in range(DIRECTIONS):
        x = lengths[d] * wp.cos(angle * wp.float32(d))
        y = lengths[d] * wp.sin(angle * wp.float32(d))
        one = partners[d]
        other = partners[(d + 1) % DIRECTIONS]
        if one != other and one >= 0 and other >= 0:
            a = particles.positions[one] - p
            b = particles.positions[other] - p
            det = wp.dot(a, u) * wp.dot(b, v) - wp.dot(a, v) * wp.dot(b, u)
            if wp.abs(det) > 1.0e-3 * wp.length(a) * wp.length(b):
                corner_x = 0.5 * (wp.length_sq(a) * wp.dot(b, v) - wp.length_sq(b) * wp.dot(a, v)) / det
                corner_y = 0.5 * (wp.length_sq(b) * wp.dot(a, u) - wp.length_sq(a) * wp.dot(b, u)) / det
                if corner_x * corner_x + corner_y * corner_y < limit * limit:
                    x = corner_x
                    y = corner_y
        radius = wp.max(radius, wp.sqrt(x * x + y * y))
        if outlines.shape[0] > 0:
            outlines[k * DIRECTIONS + d] = p + x * u + y * v
    radii[k] = radius


@wp.kernel
def mark_near(
    first: wp.int32,
    search: NeighborSearch,
    particles: Particles,
    points: wp.array(dtype=wp.vec3),
    flags: wp.array(dtype=wp.int32),
) -> None:
    """Write 1 for the particles within the reach of the search around points."""
    p = points[first + wp.tid()]
    j = int(0)
    query = wp.hash_grid_query(search.grid, p, search.reach)
    while wp.hash_grid_query_next(query, j):
        if wp.length_sq(p - particles.positions[j]) < search.reach * search.reach:
            flags[j] = 1


@wp.kernel
def ring_distances(
    first: wp.int32,
    search: NeighborSearch,
    particles: Particles,
    own: wp.array(dtype=wp.int32),
    points: Particles,
    mirrors: MirrorPlanes,
    nearest: wp.array(dtype=wp.float32),
    rings: wp.array(dtype=wp.float32),
) -> None:
    """Measure the distance of each point to the nearest particle, and the mean distance to the six nearest.

    As `nearest_distances`, but images of the neighbours count as well. Each distance is at most the reach.
    """
    k = first + wp.tid()
    p = points.positions[k]
    size = points.sizes[k]
    reach = search.reach
    six = Six(reach, reach, reach, reach, reach, reach)
    for w in range(mirrors.per_point * k, mirrors.per_point * (k + 1)):
        if wp.length_sq(mirrors.normals[w]) > 0.0:
            image = mirrored(p, mirrors.points[w], mirrors.normals[w])
            six = insert_distance(six, wp.length(p - image) / size)
    j = int(0)
    query = wp.hash_grid_query(search.grid, p, reach * search.widening * size)
    while wp.hash_grid_query_next(query, j):
        if j != own[k]:
            q = particles.positions[j]
            pair_size = 0.5 * (size + particles.sizes[j])
            x = wp.length(p - q) / pair_size
            if x < six[5] and are_neighbors(points, k, particles, j, search):
                six = insert_distance(six, x)
                for w in range(mirrors.per_point * k, mirrors.per_point * (k + 1)):
                    if wp.dot(q - mirrors.points[w], mirrors.normals[w]) > 0.0:
                        image = mirrored(q, mirrors.points[w], mirrors.normals[w])
                        six = insert_distance(six, wp.length(p - image) / pair_size)
    nearest[k] = six[0]
    rings[k] = mean_distance(six)


@wp.kernel
def mark_local_maxima(
    first: wp.int32,
    grid: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    values: wp.array(dtype=wp.float32),
    radii: wp.array(dtype=wp.float32),
    flags: wp.array(dtype=wp.int32),
) -> None:
    """Write 1 where no other point within a point's radius has a larger value; of equals the first wins."""
    i = first + wp.tid()
    value = values[i]
    radius = radii[i]
    flag = int(1)
    j = int(0)
    query = wp.hash_grid_query(grid, points[i], radius)
    while flag == 1 and wp.hash_grid_query_next(query, j):
        higher = values[j] > value or (values[j] == value and j < i)
        if higher and wp.length(points[i] - points[j]) < radius:
            flag = 0
    flags[i] = flag


@wp.kernel
def sample_around(
    first: wp.int32,
    seed: wp.int32,
    per_center: wp.int32,
    log_shortest: wp.float32,
    log_longest: wp.float32,
    centers: wp.array(dtype=wp.vec3),
    center_sizes: wp.array(dtype=wp.float32),
    points: wp.array(dtype=wp.vec3),
    reaches: wp.array(dtype=wp.float32),
) -> None:
    """Sample random points around each centre, their distances uniform on a logarithmic scale."""
    k = first + wp.tid()
    i = k / per_center
    state = wp.rand_init(seed, k)
    direction = wp.vec3(wp.randn(state), wp.randn(state), wp.randn(state))
    length = center_sizes[i] * wp.exp(wp.randf(state, log_shortest, log_longest))
    points[k] = centers[i] + wp.normalize(direction) * length
    reaches[k] = 1.01 * length + 1.0e-4 * center_sizes[i]


@wp.kernel
def move_to_best(
    first: wp.int32,
    rule: ChoiceRule,
    rows: wp.array(dtype=wp.int32),
    current_nearest: wp.array(dtype=wp.float32),
    candidates: Candidates,
    particles: Particles,
    moved: wp.array(dtype=wp.int32),
) -> None:
    """Move each particle to the best allowed candidate, and write 1 for those that moved.

    The best candidate has the largest nearest distance. Of several beyond `close` it is the one whose ring
    is nearest to the ideal one.
    """
    m = first + wp.tid()
    least = float(rule.min_gain * current_nearest[m])
    deviation = float(1.0e30)
    choice = int(-1)
    for t in range(candidates.per_particle):
        k = m * candidates.per_particle + t
        if candidates.forbidden[k] == 0 and candidates.nearest[k] >= least:
            uneven = wp.abs(candidates.rings[k] - rule.ideal_ring)
            if least < rule.close or uneven < deviation:
                choice = k
                deviation = uneven
                least = wp.min(candidates.nearest[k], rule.close)
    moved[m] = 0
    if choice >= 0:
        particles.positions[rows[m]] = candidates.positions[choice]
        particles.normals[rows[m]] = candidates.normals[choice]
        moved[m] = 1
