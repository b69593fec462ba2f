"""Typed functions whose derivatives are tested: all built-in functions, control flow, registers."""

# mypy: disable-error-code="attr-defined, call-arg, call-overload, name-defined"
# mypy: disable-error-code="no-untyped-call, no-untyped-def, misc, operator"

from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})

FACTOR = 1.5
_Rows = wp.types.matrix(shape=(3, 4), dtype=wp.float32)
_Numbers = wp.types.vector(length=5, dtype=wp.float32)


@wp.func
def real_functions(x: wp.float32, y: wp.float32) -> wp.float32:
    positive = wp.abs(x) + 0.3
    small = wp.clamp(0.4 * x, -0.9, 0.9)
    r = wp.sqrt(positive) + wp.exp(-x) * wp.log(positive) - wp.pow(positive, y) / (y * y + 1.0)
    r += wp.sin(x) * wp.cos(y) + wp.tan(0.3 * x) + wp.asin(small) - wp.acos(small * small)
    r *= wp.atan(x * y) + wp.atan2(x, y + 3.0) + wp.lerp(x, y, x * y)
    r -= wp.where(x > y, x * x, y) + wp.min(x, y * y) * wp.max(x * y, 0.1)
    r += (x * y) % 0.7 + x % positive
    return r / positive + wp.floor(x) + wp.ceil(y) + wp.trunc(x) + wp.sign(y) + float(int(x))


@wp.func
def more_functions(x: wp.float32, y: wp.float32) -> wp.float32:
    positive = wp.abs(y) + 0.4
    r = wp.sinh(x) + wp.cosh(0.7 * y) * wp.tanh(x * y) + wp.log2(positive) - wp.log10(positive + 1.0)
    r += wp.cbrt(x) + wp.cbrt(-positive) + wp.degrees(0.01 * x) + wp.radians(x * y) + wp.frac(y)
    return r + wp.round(x) * wp.rint(y) + wp.step(x)


@wp.func
def vectors(v: wp.vec3, w: wp.vec3, s: wp.float32) -> wp.vec3:
    a = wp.cross(v, w) + wp.cw_mul(v, w) - wp.cw_div(v, w + wp.vec3(4.0, 5.0, 6.0)) * s
    b = wp.normalize(v) * wp.dot(v, w) + wp.vec3(wp.length(w), wp.length_sq(v), s)
    b[1] = s * b[0]
    b[2] += a.x
    c = wp.max(a, b) - wp.min(v, w) + wp.abs(w) / (1.0 + s * s)
    d = wp.where(s > 0.0, a, wp.vec3(1.0, 2.0, 3.0)) + wp.lerp(v, w, s) - wp.clamp(v, w, a)
    return s * (c + d) - -v


@wp.func
def four(v: wp.vec4, u: wp.vec2) -> wp.vec4:
    return wp.vec4(u[0], u.y, v.w, v[1]) * wp.dot(v, v) + wp.vec4(u[0] * 2.0) - wp.vec4()


@wp.func
def loops(x: wp.float32, v: wp.vec3, turns: wp.int32) -> wp.float32:
    total = float(0.0)
    previous = float(1.0)
    for i in range(turns):
        if i == 5:
            continue
        total += previous * x / float(i + 1)  # `previous` varies only from the second turn on
        previous = x * total if i % 2 == 0 else v[i % 3]
        if total > 50.0:
            break
    n = int(0)
    while n < 3 and total < 10.0:
        total = total * 1.5 + x
        n += 1
    for axis in range(3):
        total += v[axis] * v[axis]
    if total > 2.0:
        total -= x
    elif total > 1.0:
        total = 2.0
    else:
        pass
    return total * FACTOR


@wp.func
def pair(x: wp.float32, n: wp.int32) -> tuple[wp.float32, wp.vec3, wp.int32]:
    return x * x, wp.vec3(x, 1.0, float(n)), n + 1


@wp.func
def unpacking(x: wp.float32, y: wp.float32) -> wp.float32:
    a, v, n = pair(x * y, 2)
    b, w, m = pair(0.5, n)
    return a * v[0] + b * w[2] * y + float(m)


@wp.func
def steps(x: wp.float32) -> wp.float32:
    if x > 0.0:
        return 1.0
    return float(int(x))


@wp.func
def calls(x: wp.float32, v: wp.vec3) -> wp.vec3:
    flat = vectors(wp.vec3(1.0, 2.0, 3.0), v, 2.0)
    return vectors(flat, v * x, loops(x, v, 4)) * steps(x) + flat * loops(0.5, v, 3)


@wp.func
def fetches(tape: wp.array(dtype=wp.vec4), at: wp.int32, q: wp.vec3) -> wp.float32:
    texel = tape[at + int(tape[0][3])]
    total = wp.dot(tape[at], texel) * q[0] + tape[at + 1][2]
    for i in range(3):
        total += tape[i][i] * texel[i] * q[i]
    return total


def make_registers(evaluate: Any, kind: Any) -> Any:
    """Return a function closed over another and over a type, with registers that are assigned by index."""

    @wp.func
    def run(q: wp.vec4, turns: wp.int32) -> kind:
        rows = _Rows()
        numbers = _Numbers()
        point = q
        for i in range(turns):
            slot = i % 3
            rows[slot] = point
            numbers[slot] = evaluate(point[0], wp.vec3(point[1], point[2], 1.0), 2)
            point = rows[slot] * 0.5 + rows[(i + 1) % 3] * numbers[slot]
            point[1] += numbers[0]
        return point * numbers[0] + rows[1]

    return run


registers = make_registers(loops, wp.vec4)


@wp.func
def calls_the_unknown(x: wp.float32) -> wp.float32:
    return wp.erf(x) + x


@wp.func
def raises_to_a_power(x: wp.float32) -> wp.float32:
    return x**2.0


@wp.func
def multiplies_lists(x: wp.float32) -> wp.float32:
    return sum([x, x])


@wp.func
def counts(n: wp.int32) -> wp.int32:
    return n + 1


@wp.func
def inner(u: wp.float32, v: wp.float32) -> wp.float32:
    """Return a function of two numbers."""
    return wp.exp(u) * v


@wp.func
def counted(x: wp.float32, y: wp.float32) -> wp.float32:
    """Call a function of both parameters once."""
    return wp.exp(inner(x, y))


@wp.func
def halved(x: wp.float32) -> wp.float32:
    return 0.5 * x


@wp.func
def doubled(x: wp.float32) -> wp.float32:
    return 2.0 * x


def sine_of(inner: Any) -> Any:
    @wp.func
    def sine(x: wp.float32) -> wp.float32:
        return wp.sin(inner(x))

    return sine
