"""Warp functions of custom fields, valid and invalid ones."""

import warp as wp


@wp.func
def bump(squared: wp.float32) -> wp.float32:
    return 1.0 / (1.0 + squared)


@wp.func
def lump(q: wp.vec3, middle: wp.vec3, breadth: wp.float32) -> wp.float32:
    """A Cauchy field, whose gradient is derived."""
    w = (q - middle) / breadth
    return bump(wp.dot(w, w))


@wp.func
def lump_slope(middle: wp.vec3, breadth: wp.float32) -> wp.float32:
    """The largest slope of 1 / (1 + r²) is √27 / 8."""
    return 0.6496 / breadth


@wp.func
def waves(q: wp.vec3, rate: wp.float32) -> wp.vec4:
    """Waves along x and y, with their gradient."""
    x = rate * q[0]
    y = rate * q[1]
    return wp.vec4(
        0.5 + 0.25 * (wp.sin(x) + wp.cos(y)), 0.25 * rate * wp.cos(x), -0.25 * rate * wp.sin(y), 0.0
    )


@wp.func
def waves_slope(center: wp.vec3, radius: wp.float32, rate: wp.float32) -> wp.float32:
    return 0.3536 * wp.abs(rate)


@wp.func
def waves_interval(center: wp.vec3, radius: wp.float32, rate: wp.float32) -> wp.vec2:
    middle = 0.5 + 0.25 * (wp.sin(rate * center[0]) + wp.cos(rate * center[1]))
    change = 0.3536 * wp.abs(rate) * radius
    return wp.vec2(wp.max(middle - change, 0.0), wp.min(middle + change, 1.0))


@wp.func
def narrow_interval(center: wp.vec3, radius: wp.float32, rate: wp.float32) -> wp.vec2:
    return wp.vec2(0.4, 0.6)


@wp.func
def of_other_parameters(height: wp.vec3) -> wp.float32:
    return 1.0


@wp.func
def negative(q: wp.vec3) -> wp.float32:
    return q[0]


@wp.func
def jumping(q: wp.vec3) -> wp.float32:
    if q[0] > 0.0:
        return 1.0
    return 0.0


@wp.func
def not_finite(q: wp.vec3) -> wp.float32:
    return 1.0 / wp.max(q[0], 0.0)


@wp.func
def wrong_gradient(q: wp.vec3) -> wp.vec4:
    return wp.vec4(0.5 + 0.5 * wp.sin(q[0]), 1.0, 0.0, 0.0)


@wp.func
def returns_a_point(q: wp.vec3) -> wp.vec3:
    return q


@wp.func
def takes_no_point(rate: wp.float32) -> wp.float32:
    return rate


@wp.func
def takes_a_size(q: wp.vec3, size: wp.vec3) -> wp.float32:
    return size[0]


@wp.func
def imprecise(q: wp.vec3) -> wp.float32:
    return wp.abs(wp.sin(1.0e6 * q[0]))


@wp.func
def makes_a_list(q: wp.vec3) -> wp.float32:
    return [1.0, 2.0][0]


@wp.func
def divides_by_zero(q: wp.vec3) -> wp.float32:
    return 1.0 / float(int(0.0 * q[0]))


@wp.func
def hill(q: wp.vec3) -> wp.float32:
    """A Cauchy field without an end."""
    return bump(wp.dot(q, q))
