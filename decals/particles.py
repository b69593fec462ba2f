"""Warp kernels of particle repulsion on surfaces.

Particles repel each other by a power law of their distance, the sharper the later in the relaxation
(Witkin and Heckbert 1994 started the family; the steep power law packed best of those that were measured
here). Each kernel thread owns one particle and adds up its neighbours in the order of the grid,
so that the result does not depend on scheduling.
"""

# mypy: disable-error-code="call-overload"
# (Warp declares no arithmetic of vectors)

import warp as wp

wp.set_module_options({"enable_backward": False})

CLOSEST = 0.6
"""Distances below this many spacings act like it: coincident particles part at once, not by inches."""

ISOTROPY = 0.1
"""Share of the trace added to the curvature of the energy, so that no direction is without any."""


@wp.func
def facing_weight(cosine: wp.float32, facing_limit: wp.float32) -> wp.float32:
    """How far two particles are neighbours: 1 on one side of a wall, 0 on its two sides, smooth between."""
    t = wp.clamp(0.5 + 2.0 * (cosine - facing_limit), 0.0, 1.0)
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


@wp.kernel
def repel(
    grid: wp.uint64,
    positions: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    spacing: wp.float32,
    cutoff: wp.float32,
    exponent: wp.float32,
    facing_limit: wp.float32,
    damping: wp.float32,
    longest: wp.float32,
    moves: wp.array(dtype=wp.vec3),
    energies: wp.array(dtype=wp.float32),
) -> None:
    """One damped Newton step of each particle in its tangent plane, against its neighbours at rest.

    The energy of a pair at distance x, in spacings, is x^-p, shifted so that value and slope vanish
    at the cutoff. Curvature across the line of a pair is left out: it is negative.
    """
    i = wp.tid()
    p = positions[i]
    n = normals[i]
    u = some_tangent(n)
    v = wp.cross(n, u)
    fx = float(0.0)
    fy = float(0.0)
    hxx = float(0.0)
    hxy = float(0.0)
    hyy = float(0.0)
    energy = float(0.0)
    rim_value = wp.pow(cutoff, -exponent)
    rim_slope = exponent * rim_value / cutoff
    query = wp.hash_grid_query(grid, p, cutoff * spacing)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        if j != i:
            offset = p - positions[j]
            if wp.length_sq(offset) < cutoff * cutoff * spacing * spacing:
                weight = facing_weight(wp.dot(n, normals[j]), facing_limit)
                if weight > 0.0:
                    away = apart(offset, i, j, u, CLOSEST * spacing) / spacing
                    x = wp.length(away)
                    value = wp.pow(x, -exponent)
                    slope = exponent * value / x
                    curve = (exponent + 1.0) * slope / x
                    ax = wp.dot(away, u) / x
                    ay = wp.dot(away, v) / x
                    push = weight * (slope - rim_slope)
                    fx += push * ax
                    fy += push * ay
                    hxx += weight * curve * ax * ax
                    hxy += weight * curve * ax * ay
                    hyy += weight * curve * ay * ay
                    energy += weight * (value - rim_value + rim_slope * (x - cutoff))
    energies[i] = energy
    extra = ISOTROPY * (hxx + hyy)
    hxx += extra
    hyy += extra
    determinant = hxx * hyy - hxy * hxy
    move = wp.vec3(0.0, 0.0, 0.0)
    if determinant > 0.0:
        dx = (hyy * fx - hxy * fy) / determinant
        dy = (hxx * fy - hxy * fx) / determinant
        move = (dx * u + dy * v) * (damping * spacing)
        size = wp.length(move)
        if size > longest * spacing:
            move = move * (longest * spacing / size)
    moves[i] = move
