"""Definitions that `define_skeleton` or `define_operator` refuses."""

import warp as wp


def no_types(q, center):  # type: ignore[no-untyped-def]
    return center


def no_return(q: wp.vec3):  # type: ignore[no-untyped-def]
    return q


def returns_a_number(q: wp.vec3) -> wp.float32:
    return q[0]


def takes_text(q: wp.vec3, label: str) -> wp.vec3:
    return q


def takes_a_radius(q: wp.vec3, radius: wp.float32) -> wp.vec3:
    return q * 0.0


def takes_a_scale(q: wp.vec3, scale: wp.float32) -> wp.vec3:
    return q * 0.0


def no_place(size: wp.float32) -> wp.vec3:
    return wp.vec3(size, 0.0, 0.0)


def no_arguments() -> wp.vec3:
    return wp.vec3(0.0, 0.0, 0.0)


def makes_a_list(q: wp.vec3) -> wp.vec3:
    parts = [q[0], q[1]]
    return wp.vec3(parts[0], parts[1], 0.0)


def mixes_types(q: wp.vec3) -> wp.vec3:
    x = q[0] * 2
    return wp.vec3(x, 0.0, 0.0)


def calls_python(q: wp.vec3) -> wp.vec3:
    return sorted(q)


@wp.func
def turns_in_circles(q: wp.vec3) -> wp.vec3:
    return turns_in_circles(q)


def spelled_in_greek(q: wp.vec3, λ: wp.float32) -> wp.vec3:
    return q * 0.0


def not_on_it(q: wp.vec3) -> wp.vec3:
    return q * 0.5


def not_the_closest(q: wp.vec3) -> wp.vec3:
    if q[1] > 0.5:
        return wp.vec3(-1.0, 1.0, 0.0)
    return wp.vec3(1.0, 0.0, 0.0)


def nowhere_in_the_middle(q: wp.vec3) -> wp.vec3:
    return q / wp.length(q)


def single_precision_is_not_enough(q: wp.vec3) -> wp.vec3:
    far = wp.vec3(1.0e6, 0.0, 0.0)
    return (q + far) * 0.0 + wp.vec3(((q[0] + 1.0e7) - 1.0e7) - q[0], 0.0, 0.0)


def changes_a_constant(q: wp.vec3) -> wp.vec3:
    x = 0.0
    for _i in range(40):
        x += 0.1
    return wp.vec3(x, 0.0, 0.0)


@wp.func
def changes_one_below(q: wp.vec3) -> wp.vec3:
    x = -1.0
    while x < q[0]:
        x = x + 1.0
    return wp.vec3(x, 0.0, 0.0)


def calls_what_changes_a_constant(q: wp.vec3) -> wp.vec3:
    return changes_one_below(q) * 0.0


def off_at_the_axis(q: wp.vec3, size: wp.float32) -> wp.vec3:
    flat = wp.vec3(q[0], q[1], 0.0)
    return wp.normalize(flat) * size


def never_ends(q: wp.vec3) -> wp.vec3:
    while True:
        q = q * 0.5
    return q


def counts_too_far(q: wp.vec3) -> wp.vec3:
    for _i in range(2000000000):
        q = q * 1.0
    return q


def negative(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(a - b, 1.0, -1.0)


def never_empty(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(a + b + 0.1, 1.0, 1.0)


def wrong_partials(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(a + b, 1.0, 0.5)


def jumps(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(0.25 * wp.floor(4.0 * (a + b)), 0.0, 0.0)


def vanishes_in_single_precision(a: wp.float32, b: wp.float32) -> wp.vec3:
    f = wp.sqrt(a * a + b * b)
    return wp.vec3(f, a / f, b / f)


def takes_a_vector(a: wp.float32, b: wp.vec2) -> wp.vec3:
    return wp.vec3(a, 1.0, 0.0)


def plus(a: wp.float32, b: wp.float32) -> wp.vec3:
    return wp.vec3(a + b, 1.0, 1.0)


def one_number(a: wp.float32, b: wp.float32) -> wp.float32:
    return 1.0


def another_bound(a: wp.float32) -> wp.vec2:
    return wp.vec2(1.0, 1.0)


@wp.func
def names_text(q: wp.vec3) -> wp.vec3:
    text = "a"
    return q * text


def calls_what_names_text(q: wp.vec3) -> wp.vec3:
    return names_text(q)


def has_a_matrix(q: wp.vec3, size: wp.mat33) -> wp.vec3:
    return size * q


def chains_comparisons(q: wp.vec3) -> wp.vec3:
    if 0.0 < q[0] < 1.0:
        return q * 0.0
    return q


def miscounts(q: wp.vec3) -> wp.vec3:
    return chains_comparisons_of(q, 1)


@wp.func
def chains_comparisons_of(q: wp.vec3, x: wp.float32) -> wp.vec3:
    return q * x


def endless_line(q: wp.vec3, axis: wp.vec3) -> wp.vec3:
    n = wp.normalize(axis)
    return n * wp.dot(q, n)


def everywhere_below(q: wp.vec3) -> wp.vec3:
    return wp.vec3(q[0], q[1], wp.min(q[2], 1.0))


def half_a_line(q: wp.vec3) -> wp.vec3:
    return wp.vec3(0.0, wp.max(q[1], 0.0), 0.0)
