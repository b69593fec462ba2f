"""Typed functions as plain Python: what they return is what Warp computes."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest
import warp as wp

from blobtree.transpile.builtins import BUILTINS
from blobtree.transpile.python import plain_python, vector
from tests.blobtree import custom_kinds
from tests.blobtree.transpile.warp_functions import call, typed_functions

wp.set_module_options({"enable_backward": False})

COUNT = 200


@wp.func
def whole_numbers(x: wp.float32, y: wp.float32) -> wp.float32:
    i = int(x * 10.0)
    j = int(y * 10.0)
    k = i / 3 + (i - 7) % 5 - j / 4
    k /= 2
    k -= j % 3
    return float(k)


@wp.func
def real_numbers(x: wp.float32, y: wp.float32) -> wp.float32:
    r = x % 0.7 + wp.floor(y) + wp.ceil(x) + wp.trunc(y) + wp.sign(x) * wp.abs(y)
    r += wp.pow(wp.abs(x) + 0.1, y) + wp.exp(-x) + wp.log(wp.abs(y) + 1.0) + wp.sqrt(wp.abs(x))
    r += wp.sin(x) + wp.cos(y) + wp.tan(0.3 * x) + wp.atan2(x, y) + wp.atan(x)
    r %= 3.0
    r += wp.acos(wp.clamp(x, -1.0, 1.0)) + wp.asin(wp.clamp(y, -1.0, 1.0)) + wp.lerp(x, y, 0.3)
    return wp.where(x > y, r, wp.min(r, 2.0) + wp.max(r, wp.float32(1)))


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


FUNCTIONS = [
    *(f for f in typed_functions(import_module(__name__))),
    *(
        f
        for name in ("falloff", "operators")
        for f in typed_functions(import_module(f"blobtree.formulas.{name}"))
    ),
    *(f for f in typed_functions(custom_kinds)),
]
INTERVALS = ("range", "choice")


@pytest.mark.parametrize("typed", FUNCTIONS, ids=lambda typed: typed.name)
def test_a_function_is_the_same_in_plain_python(typed: Any) -> None:
    rng = np.random.default_rng(3)
    spread = 0.0 if typed.function.func.__module__.startswith("blobtree") else -1.5
    arguments = {}
    for name, hint in typed.parameters.items():
        size = getattr(hint, "_length_", 1)
        numbers = rng.uniform(spread, 1.5, (COUNT, size)) + (1.0 if name == "exponent" else 0.0)
        numbers = np.sort(numbers, axis=1) if typed.name.endswith(INTERVALS) else numbers
        arguments[name] = numbers.astype(np.float32) if size > 1 else numbers[:, 0].astype(np.float32)
    expected = call(typed.function, **arguments).reshape(COUNT, -1)
    for precision, tolerance in ((np.float64, 2e-5), (np.float32, 1e-4)):
        plain = plain_python(typed.function.func, precision)
        for row in range(COUNT):
            values = [
                vector(*value[row], precision=precision) if value.ndim == 2 else precision(value[row])
                for value in arguments.values()
            ]
            with np.errstate(all="ignore"):
                seen = np.ravel(np.asarray(plain(*values), np.float64))
            np.testing.assert_allclose(seen, expected[row], rtol=tolerance, atol=tolerance)


def test_every_word_that_shaders_share_is_known() -> None:
    stand_in = plain_python(real_numbers.func).__globals__["wp"]
    for name in BUILTINS:
        assert getattr(stand_in, name) is not getattr(wp, name), name


def test_dividing_by_nothing_is_no_exception() -> None:
    with np.errstate(all="ignore"):
        assert plain_python(reciprocal.func)(np.float64(0.0)) == np.inf


@wp.func
def reciprocal(x: wp.float32) -> wp.float32:
    zero = float(0.0)
    return 1.0 / (x + zero)
