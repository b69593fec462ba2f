"""Warp kernels that look around: how near the nearest particle is, and who stands out among those around."""

# mypy: disable-error-code="call-overload"
# (Warp declares no arithmetic of vectors)

import warp as wp

from decals.seeds.particles import Six, mean_of_six, nearest_six
from decals.seeds.rim_kernels import mirrored

wp.set_module_options({"enable_backward": False})


@wp.kernel
def nearest_facing(
    first: wp.int32,
    grid: wp.uint64,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    sizes: wp.array(dtype=wp.float32),
    facing_limit: wp.float32,
    reach: wp.float32,
    widening: wp.float32,
    enough: wp.float32,
    own: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3),
    point_normals: wp.array(dtype=wp.vec3),
    point_sizes: wp.array(dtype=wp.float32),
    walls: wp.int32,
    wall_points: wp.array(dtype=wp.vec3),
    wall_normals: wp.array(dtype=wp.vec3),
    nearness: wp.array(dtype=wp.float32),
) -> None:
    """Distance of each point to the nearest particle that faces it, other than its own, in their spacing.

    At most `reach`. Who is nearer to some particle than `enough` is not looked at any further. A point's own
    image beyond a rim is a particle, too.
    """
    k = first + wp.tid()
    p = points[k]
    n = point_normals[k]
    size = point_sizes[k]
    least = float(reach)
    for w in range(walls * k, walls * (k + 1)):
        if wp.length_sq(wall_normals[w]) > 0.0:
            least = wp.min(least, wp.length(p - mirrored(p, wall_points[w], wall_normals[w])) / size)
    j = int(0)
    query = wp.hash_grid_query(grid, p, reach * widening * size)
    while least > enough and wp.hash_grid_query_next(query, j):
        if j != own[k]:
            x = wp.length(p - positions[j]) / (0.5 * (size + sizes[j]))
            if x < least and wp.dot(n, normals[j]) > facing_limit:
                least = x
    nearness[k] = least


@wp.kernel
def rings_around(
    first: wp.int32,
    grid: wp.uint64,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    sizes: wp.array(dtype=wp.float32),
    facing_limit: wp.float32,
    reach: wp.float32,
    widening: wp.float32,
    own: wp.array(dtype=wp.int32),
    points: wp.array(dtype=wp.vec3),
    point_normals: wp.array(dtype=wp.vec3),
    point_sizes: wp.array(dtype=wp.float32),
    walls: wp.int32,
    wall_points: wp.array(dtype=wp.vec3),
    wall_normals: wp.array(dtype=wp.vec3),
    nearness: wp.array(dtype=wp.float32),
    rings: wp.array(dtype=wp.float32),
) -> None:
    """Distance of each point to the nearest particle that faces it, and the mean of the six nearest.

    In their spacing and each at most `reach`; a point's own particle does not count. Images beyond a rim do,
    the point's own too.
    """
    k = first + wp.tid()
    p = points[k]
    n = point_normals[k]
    size = point_sizes[k]
    six = Six(reach, reach, reach, reach, reach, reach)
    for w in range(walls * k, walls * (k + 1)):
        if wp.length_sq(wall_normals[w]) > 0.0:
            six = nearest_six(six, wp.length(p - mirrored(p, wall_points[w], wall_normals[w])) / size)
    j = int(0)
    query = wp.hash_grid_query(grid, p, reach * widening * size)
    while wp.hash_grid_query_next(query, j):
        if j != own[k]:
            q = positions[j]
            pair = 0.5 * (size + sizes[j])
            x = wp.length(p - q) / pair
            if x < six[5] and wp.dot(n, normals[j]) > facing_limit:
                six = nearest_six(six, x)
                for w in range(walls * k, walls * (k + 1)):
                    if wp.dot(q - wall_points[w], wall_normals[w]) > 0.0:
                        image = mirrored(q, wall_points[w], wall_normals[w])
                        six = nearest_six(six, wp.length(p - image) / pair)
    nearness[k] = six[0]
    rings[k] = mean_of_six(six)


@wp.kernel
def peaks(
    first: wp.int32,
    grid: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    values: wp.array(dtype=wp.float32),
    radii: wp.array(dtype=wp.float32),
    flags: wp.array(dtype=wp.int32),
) -> None:
    """1 where no other point within a point's radius has a larger value; of equals the first wins."""
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
def places_around(
    first: wp.int32,
    seed: wp.int32,
    tries: wp.int32,
    shortest: wp.float32,
    longest: wp.float32,
    centers: wp.array(dtype=wp.vec3),
    center_sizes: wp.array(dtype=wp.float32),
    places: wp.array(dtype=wp.vec3),
    reaches: wp.array(dtype=wp.float32),
) -> None:
    """Random places around each centre, at all scales between two lengths given as logarithms."""
    k = first + wp.tid()
    i = k / tries
    state = wp.rand_init(seed, k)
    way = wp.vec3(wp.randn(state), wp.randn(state), wp.randn(state))
    length = center_sizes[i] * wp.exp(wp.randf(state, shortest, longest))
    places[k] = centers[i] + wp.normalize(way) * length
    reaches[k] = 1.01 * length + 1.0e-4 * center_sizes[i]


@wp.kernel
def choose_best(
    first: wp.int32,
    tries: wp.int32,
    gain: wp.float32,
    close: wp.float32,
    ring: wp.float32,
    rows: wp.array(dtype=wp.int32),
    present: wp.array(dtype=wp.float32),
    places: wp.array(dtype=wp.vec3),
    place_normals: wp.array(dtype=wp.vec3),
    forbidden: wp.array(dtype=wp.int32),
    nearness: wp.array(dtype=wp.float32),
    rings: wp.array(dtype=wp.float32),
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    went: wp.array(dtype=wp.int32),
) -> None:
    """Move each particle to the best allowed of its places, if that is so much lonelier; 1 who went.

    The best is the loneliest, or if several are not close to anybody that whose ring is most like `ring`.
    """
    m = first + wp.tid()
    least = float(gain * present[m])
    fault = float(1.0e30)
    choice = int(-1)
    for t in range(tries):
        k = m * tries + t
        if forbidden[k] == 0 and nearness[k] >= least:
            uneven = wp.abs(rings[k] - ring)
            if least < close or uneven < fault:
                choice = k
                fault = uneven
                least = wp.min(nearness[k], close)
    went[m] = 0
    if choice >= 0:
        positions[rows[m]] = places[choice]
        normals[rows[m]] = place_normals[choice]
        went[m] = 1
