"""Fields of signed distances: d < 0 inside, 0 on the surface, d > 0 outside.

f = g(t) with t = RIM + d / s, at least 0. It is ½ on the surface, 0 from d = (1 − RIM) s outward, and 1 from
−RIM s inward. For a ball of radius RIM · s that is the field of a `Point` of this radius.
"""

import warp as wp

from blobtree.formulas.falloff import RIM, falloff, falloff_derivative, falloff_steepest

wp.set_module_options({"enable_backward": False})


@wp.func
def distance_field(d: wp.vec4, rate: wp.float32) -> wp.vec4:
    """Return (f, ∇f) from (d, ∇d), with rate = 1 / s."""
    t = wp.max(RIM + d[0] * rate, 0.0)
    slope = 2.0 * t * falloff_derivative(t * t) * rate
    return wp.vec4(falloff(t * t), slope * d[1], slope * d[2], slope * d[3])


@wp.func
def distance_field_bounds(low: wp.float32, high: wp.float32, slope: wp.float32, rate: wp.float32) -> wp.vec3:
    """Return (smallest, largest, steepest) f for distances from `low` to `high` that change by `slope`."""
    nearest = wp.max(RIM + low * rate, 0.0)
    farthest = wp.max(RIM + high * rate, 0.0)
    return wp.vec3(
        falloff(farthest * farthest),
        falloff(nearest * nearest),
        slope * rate * falloff_steepest(nearest, farthest),
    )


@wp.func
def box_distance(x: wp.vec3, half: wp.vec3) -> wp.vec4:
    """Return (d, ∇d) of a box, seen from its middle (Quilez, Distance functions)."""
    a = wp.abs(x[0]) - half[0]
    b = wp.abs(x[1]) - half[1]
    c = wp.abs(x[2]) - half[2]
    sx = wp.where(x[0] < 0.0, -1.0, 1.0)
    sy = wp.where(x[1] < 0.0, -1.0, 1.0)
    sz = wp.where(x[2] < 0.0, -1.0, 1.0)
    beyond = wp.vec3(wp.max(a, 0.0), wp.max(b, 0.0), wp.max(c, 0.0))
    length = wp.length(beyond)
    if length > 0.0:
        return wp.vec4(length, sx * beyond[0] / length, sy * beyond[1] / length, sz * beyond[2] / length)
    if a >= b and a >= c:
        return wp.vec4(a, sx, 0.0, 0.0)
    if b >= c:
        return wp.vec4(b, 0.0, sy, 0.0)
    return wp.vec4(c, 0.0, 0.0, sz)
