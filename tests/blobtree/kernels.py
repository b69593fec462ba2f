"""Warp functions of custom kinds: skeletons, operators and falloffs."""

import warp as wp


@wp.func
def across(n: wp.vec3) -> wp.vec3:
    """Some unit vector across a unit vector."""
    if wp.abs(n[0]) < 0.6:
        return wp.normalize(wp.cross(n, wp.vec3(1.0, 0.0, 0.0)))
    return wp.normalize(wp.cross(n, wp.vec3(0.0, 1.0, 0.0)))


@wp.func
def ring(q: wp.vec3, center: wp.vec3, axis: wp.vec3, size: wp.float32) -> wp.vec3:
    """A circle of radius `size` around `axis`."""
    n = wp.normalize(axis)
    w = q - center
    flat = w - n * wp.dot(w, n)
    if wp.length(flat) <= 1e-6 * wp.length(w):
        flat = across(n)
    return center + wp.normalize(flat) * size


@wp.func
def bar(q: wp.vec3, half: wp.float32) -> wp.vec3:
    return wp.vec3(wp.clamp(q[0], -half, half), 0.0, 0.0)


@wp.func
def brick(q: wp.vec3, middle: wp.vec3, sides: wp.vec3) -> wp.vec3:
    """A solid box."""
    c = wp.vec3(q[0], q[1], q[2])
    for i in range(3):
        half = 0.5 * wp.abs(sides[i])
        c[i] = wp.clamp(q[i], middle[i] - half, middle[i] + half)
    return c


@wp.func
def closest_between(q: wp.vec3, a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """The closest point on a straight line from a to b, of any length."""
    way = b - a
    length = wp.length(way)
    if length <= 0.0:
        return a
    unit = way / length
    return a + unit * wp.clamp(wp.dot(q - a, unit), 0.0, length)


@wp.func
def path(q: wp.vec3, a: wp.vec3, b: wp.vec3, c: wp.vec3) -> wp.vec3:
    """Two straight lines, from a to b and from b to c."""
    first = closest_between(q, a, b)
    second = closest_between(q, b, c)
    return wp.where(wp.length(q - first) <= wp.length(q - second), first, second)


@wp.func
def soft(a: wp.float32, b: wp.float32, hardness: wp.float32) -> wp.vec3:
    """A hyperbolic blend: 0 is the union, 4 the sum."""
    larger = wp.max(a, b)
    if larger <= 0.0:
        return wp.vec3(0.0, 1.0, 0.0)
    x = a / larger
    y = b / larger
    root = wp.sqrt((x - y) * (x - y) + hardness * x * y)
    if root <= 0.0:
        return wp.vec3(a, 1.0, 0.0)
    return wp.vec3(
        0.5 * (a + b + larger * root),
        0.5 + 0.5 * (x - y + 0.5 * hardness * y) / root,
        0.5 + 0.5 * (y - x + 0.5 * hardness * x) / root,
    )


@wp.func
def soft_alone(a: wp.float32, b: wp.float32, hardness: wp.float32) -> wp.float32:
    """The same without its derivatives, and without a thought of 0 / 0."""
    larger = wp.max(a, b)
    x = a / larger
    y = b / larger
    return 0.5 * (a + b + larger * wp.sqrt((x - y) * (x - y) + hardness * x * y))


@wp.func
def carve(a: wp.float32, b: wp.float32) -> wp.vec3:
    """A difference with soft walls."""
    rest = wp.max(1.0 - b, 0.0)
    return wp.vec3(a * rest * rest, rest * rest, -2.0 * a * rest)


@wp.func
def carve_steepest(max_a: wp.float32, max_b: wp.float32) -> wp.vec2:
    """The tool's partial derivative grows with the solid."""
    return wp.vec2(1.0, 2.0 * max_a)


@wp.func
def shared(a: wp.float32, b: wp.float32) -> wp.vec3:
    """The harmonic mean."""
    total = a + b
    if total <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    x = a / total
    y = b / total
    return wp.vec3(2.0 * a * y, 2.0 * y * y, 2.0 * x * x)


@wp.func
def mean(a: wp.float32, b: wp.float32) -> wp.vec3:
    """Half of each; where one operand is absent it is neither the other nor 0."""
    return wp.vec3(0.5 * (a + b), 0.5, 0.5)


@wp.func
def swell(a: wp.float32, b: wp.float32) -> wp.vec3:
    """A Ricci blend of exponent 2."""
    larger = wp.max(a, b)
    if larger <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    x = a / larger
    y = b / larger
    root = wp.sqrt(x * x + y * y)
    return wp.vec3(larger * root, x / root, y / root)


@wp.func
def stew(
    a: wp.float32,
    b: wp.float32,
    left: wp.float32,
    right: wp.float32,
    both: wp.float32,
    less_left: wp.float32,
    less_right: wp.float32,
) -> wp.vec3:
    """F = left·a + right·b + both·a b / (1 + less_left·a + less_right·b); a texel holds four."""
    base = 1.0 + less_left * a + less_right * b
    by_a = both * b * (1.0 + less_right * b) / (base * base)
    by_b = both * a * (1.0 + less_left * a) / (base * base)
    return wp.vec3(left * a + right * b + both * a * b / base, left + by_a, right + by_b)


@wp.func
def stew_steepest(
    max_a: wp.float32,
    max_b: wp.float32,
    left: wp.float32,
    right: wp.float32,
    both: wp.float32,
    less_left: wp.float32,
    less_right: wp.float32,
) -> wp.vec2:
    """Bounds on the partial derivatives, whose fractions are at most the other operand."""
    return wp.vec2(left + both * max_b, right + both * max_a)


@wp.func
def staircase(d: wp.float32) -> wp.float32:
    """A falloff with three steep parts."""
    return 1.0 - d + wp.sin(18.849556 * d) / 18.849556


@wp.func
def staircase_slope(d: wp.float32) -> wp.float32:
    """Its derivative."""
    return wp.cos(18.849556 * d) - 1.0


@wp.func
def tent(d: wp.float32) -> wp.float32:
    """A straight line."""
    return 1.0 - d


@wp.func
def tent_slope(d: wp.float32) -> wp.float32:
    """Its derivative."""
    return -1.0


@wp.func
def rising(d: wp.float32) -> wp.float32:
    """Not a falloff: it rises."""
    return 1.0 - d + 0.5 * wp.sin(12.566371 * d)


@wp.func
def short(d: wp.float32) -> wp.float32:
    """Not a falloff: it ends at a half."""
    return 1.0 - 0.5 * d


@wp.func
def vector(d: wp.vec3) -> wp.float32:
    """Not a function of a distance."""
    return d[0]
