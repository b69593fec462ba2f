"""Typed functions of custom warps, right ones and wrong ones."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def sway(q: wp.vec3, width: wp.float32, rate: wp.float32) -> wp.vec3:
    """Cross-sections that swing along x."""
    return wp.vec3(q[0] - width * wp.sin(rate * q[2]), q[1], q[2])


@wp.func
def sway_stretch(width: wp.float32, rate: wp.float32) -> wp.float32:
    return 1.0 + wp.abs(width * rate)


@wp.func
def sway_pullback(q: wp.vec3, g: wp.vec3, width: wp.float32, rate: wp.float32) -> wp.vec3:
    return wp.vec3(g[0], g[1], g[2] - width * rate * wp.cos(rate * q[2]) * g[0])


@wp.func
def swirl(q: wp.vec3, axis: wp.vec3, turns: wp.int32) -> wp.vec3:
    """Turn about z by an angle that falls with the distance from a point of the axis."""
    w = q - axis
    angle = 0.2 * float(turns) * wp.exp(-wp.dot(w, w))
    c = wp.cos(angle)
    s = wp.sin(angle)
    return wp.vec3(c * q[0] + s * q[1], c * q[1] - s * q[0], q[2])


@wp.func
def swirl_stretch(q: wp.vec3, reach: wp.float32, axis: wp.vec3, turns: wp.int32) -> wp.float32:
    return 1.0 + 0.2 * wp.abs(float(turns)) * 0.86 * (wp.length(q) + reach)


@wp.func
def flat(q: wp.vec3) -> wp.vec3:
    return wp.vec3(q[0], q[1], 0.0)


@wp.func
def folded(q: wp.vec3) -> wp.vec3:
    return wp.vec3(q[0], q[1], q[2] * q[2])


@wp.func
def torn(q: wp.vec3) -> wp.vec3:
    if q[0] > 0.0:
        return q + wp.vec3(1.0, 0.0, 0.0)
    return q


@wp.func
def broken(q: wp.vec3) -> wp.vec3:
    return q / (q[0] - q[0])


@wp.func
def wrong_pullback(q: wp.vec3, g: wp.vec3, width: wp.float32, rate: wp.float32) -> wp.vec3:
    return g
