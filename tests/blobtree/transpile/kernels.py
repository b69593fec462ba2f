"""Warp functions and kernels of the tests of this folder."""

# mypy: disable-error-code="call-overload"

from types import FunctionType
from typing import Any

import warp as wp

from blobtree.nodes import tree
from blobtree.transpile.specialize import RowChoice

wp.set_module_options({"enable_backward": False})

NEGATIVE = wp.constant(wp.uint32(-257))


@wp.func
def whole_numbers(x: wp.float32, y: wp.float32) -> wp.float32:
    i = int(x * 10.0)
    j = int(y * 10.0)
    k = i / 3 + (i - 7) % 5 - j / 4
    k /= 2
    k -= j % 3
    return float(k)


@wp.func
def added_to_a_copy(q: wp.vec3, d: wp.vec3) -> wp.vec3:
    moved = q
    moved += d
    return wp.cross(moved, q)


@wp.func
def real_numbers(x: wp.float32, y: wp.float32) -> wp.float32:
    r = x % 0.7 + wp.floor(y) + wp.ceil(x) + wp.trunc(y) + wp.sign(x) * wp.abs(y)
    r += wp.pow(wp.abs(x) + 0.1, y) + wp.exp(-x) + wp.log(wp.abs(y) + 1.0) + wp.sqrt(wp.abs(x))
    r += wp.sin(x) + wp.cos(y) + wp.tan(0.3 * x) + wp.atan2(x, y) + wp.atan(x)
    r %= 3.0
    r += wp.acos(wp.clamp(x, -1.0, 1.0)) + wp.asin(wp.clamp(y, -1.0, 1.0)) + wp.lerp(x, y, 0.3)
    return wp.where(x > y, r, wp.min(r, 2.0) + wp.max(r, wp.float32(1)))


@wp.func
def more_real_numbers(x: wp.float32, y: wp.float32) -> wp.float32:
    r = wp.sinh(x) + wp.cosh(y) * wp.tanh(0.5 * x) + wp.tanh(40.0 * y) + wp.cbrt(x) + wp.cbrt(0.0)
    r += wp.log2(wp.abs(x) + 1.0) + wp.log10(wp.abs(y) + 1.0) + wp.degrees(x) - wp.radians(y)
    return r + wp.frac(3.0 * x) + wp.round(3.0 * y) + wp.rint(5.0 * x) + wp.round(-2.5) + wp.step(x)


@wp.func
def unsigned(x: wp.float32, y: wp.float32) -> wp.float32:
    h = wp.uint32(-5) ^ wp.uint32(int(100.0 * x))
    h = (h >> wp.uint32(3)) & NEGATIVE
    return float(int(h % wp.uint32(1000))) + float(wp.int32(wp.uint32(-7)))


@wp.func
def vectors(x: wp.float32, y: wp.float32) -> wp.float32:
    a = wp.vec3(x, y, x - y)
    b = wp.vec3(1.0, 2.0, 3.0)
    b[1] = y
    c = wp.cross(a, b) + wp.cw_mul(a, b) - wp.cw_div(a, wp.vec3(2.0, 3.0, 4.0)) * 2.0
    zero = wp.normalize(wp.vec3())
    flat = wp.vec2(c[0], c.y) / 2.0
    whole = wp.vec3i(1, 2, 3)
    four = wp.vec4(x, y, x, y)
    total = wp.dot(a, b) + wp.length(c) + wp.length_sq(flat) + wp.dot(wp.normalize(four), four)
    return total + zero[0] + float(whole[2])


@wp.func
def loops(x: wp.float32, y: wp.float32) -> wp.float32:
    total = float(0.0)
    for i in range(10):
        if i == 3:
            continue
        if float(i) > 4.0 + y:
            break
        total += x / float(i + 1)
    n = int(0)
    while n < 5 and not total > 100.0:
        total = total * 1.5 if n > 2 else total + 1.0
        n += 1
    return total


@wp.func
def reciprocal(x: wp.float32) -> wp.float32:
    zero = float(0.0)
    return 1.0 / (x + zero)


def of_two_rows(prototype: FunctionType) -> Any:
    """Write the body of a choice between a sum and a union."""
    choice = RowChoice(prototype, "operators", "partials")
    return choice.over((tree.Sum.operator, tree.Union.operator), prototype.__module__)


@of_two_rows
def chosen(
    code: wp.int32, a: wp.float32, b: wp.float32, parameter: wp.float32, unused: wp.float32
) -> wp.vec3:
    """What a row's operator makes of two numbers."""
    raise NotImplementedError


@wp.kernel
def choose(out: wp.array(dtype=wp.float32)) -> None:
    i = wp.tid()
    out[i] = chosen(i, 3.0, 4.0, 0.0, 0.0)[0]
