"""Gradient noise (Perlin 2002, Improving noise), as smooth random numbers between −1.04 and 1.04.

Each point of the unit lattice has one of twelve directions, chosen by a hash of whole numbers. The noise
blends the linear functions along these directions, so it is 0 on the lattice. It repeats after 289 units.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

PERIOD = 289

LARGEST_NOISE = 1.0364
"""Largest value for any choice of directions, found by maximising over a cell."""

STEEPEST_NOISE = 3.75
"""Largest slope for any choice of directions, which the middle of a cell has along an axis."""

MEAN_NOISE_SLOPE = 1.18
"""Mean slope where the noise is 0, over many directions; between 0.4 and 1.9 at nine points of ten."""


@wp.func
def scrambled(number: wp.int32) -> wp.int32:
    """Return another number from 0 to 288, each once (McEwan, Sheets, Gustavson & Richardson 2012)."""
    return ((34 * number + 10) * number) % PERIOD


@wp.func
def wrapped(number: wp.int32) -> wp.int32:
    """Return a whole number modulo 289, from 0."""
    return (number % PERIOD + PERIOD) % PERIOD


@wp.func
def lattice_direction(hashed: wp.int32) -> wp.vec3:
    """Return one of the twelve directions to the middles of a cube's edges, of length √2."""
    choice = hashed % 12
    u = 1.0 - 2.0 * float(choice & 1)
    v = 1.0 - float(choice & 2)
    if choice < 4:
        return wp.vec3(0.0, u, v)
    if choice < 8:
        return wp.vec3(u, 0.0, v)
    return wp.vec3(u, v, 0.0)


@wp.func
def end_weight(t: wp.float32, upper: wp.bool) -> wp.vec2:
    """Return the weight of an end of [0, 1] at t, and its derivative; 6t⁵ − 15t⁴ + 10t³ for the upper."""
    s = t * t * t * (t * (6.0 * t - 15.0) + 10.0)
    rate = 30.0 * t * t * (1.0 - t) * (1.0 - t)
    if upper:
        return wp.vec2(s, rate)
    return wp.vec2(1.0 - s, -rate)


@wp.func
def gradient_noise(q: wp.vec3, seed: wp.int32) -> wp.vec4:
    """Return (noise, its gradient) at q."""
    base = wp.vec3(wp.floor(q[0]), wp.floor(q[1]), wp.floor(q[2]))
    t = q - base
    value = float(0.0)
    slope = wp.vec3(0.0, 0.0, 0.0)
    for corner in range(8):
        i = corner & 1
        j = (corner >> 1) & 1
        k = (corner >> 2) & 1
        hashed = scrambled(wrapped(int(base[0]) + i + seed))
        hashed = scrambled(wrapped(hashed + int(base[1]) + j))
        hashed = scrambled(wrapped(hashed + int(base[2]) + k))
        g = lattice_direction(hashed)
        height = wp.dot(g, t - wp.vec3(float(i), float(j), float(k)))
        x = end_weight(t[0], i == 1)
        y = end_weight(t[1], j == 1)
        z = end_weight(t[2], k == 1)
        weight = x[0] * y[0] * z[0]
        value += weight * height
        slope += g * weight
        slope += wp.vec3(x[1] * y[0] * z[0], x[0] * y[1] * z[0], x[0] * y[0] * z[1]) * height
    return wp.vec4(value, slope[0], slope[1], slope[2])
