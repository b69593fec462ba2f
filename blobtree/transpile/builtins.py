"""GLSL of Warp's types, casts and built-in functions."""

from collections.abc import Callable
from typing import NamedTuple

import warp as wp


class Expression(NamedTuple):
    """GLSL of an expression, with its type."""

    code: str
    type: str


PAIR = "mat2x4"
"""GLSL type of a vector of eight floats: it has no such vector, but two of four."""

REGISTERS = "float[32]"
"""GLSL type of a vector of 32 floats, whose elements any number may index."""

_TYPES: dict[object, str] = {
    float: "float",
    int: "int",
    bool: "bool",
    wp.float32: "float",
    wp.int32: "int",
    wp.uint32: "uint",
    wp.bool: "bool",
    wp.vec2: "vec2",
    wp.vec3: "vec3",
    wp.vec4: "vec4",
    wp.vec2i: "ivec2",
    wp.vec3i: "ivec3",
    wp.vec4i: "ivec4",
    wp.types.vector(length=8, dtype=wp.float32): PAIR,
    wp.types.vector(length=32, dtype=wp.float32): REGISTERS,
}
_ARRAYS: dict[object, str] = {wp.vec4: "sampler2D", wp.int32: "isampler2D", wp.vec4i: "ivec4_sampler"}

CASTS = {"float": "float", "int": "int", "bool": "bool"}

RESERVED_WORDS = frozenset(
    """
    active attribute buffer cast centroid class common const default discard do double enum extern external
    filter fixed flat goto half highp image in inline inout input interface invariant layout long lowp mat2
    mat3 mat4 mediump namespace noinline noise noperspective out output packed partition patch precision
    public resource row_major sample sampler2D shared short sizeof smooth static struct subroutine superp
    switch template texture this true typedef uniform union unsigned using varying void volatile
    abs acos all any asin atan ceil clamp cos cross degrees distance dot exp floor fract inverse length log
    matrixCompMult max min mix mod normalize not pow radians reflect refract round sign sin smoothstep sqrt
    step tan transpose trunc
    """.split()  # noqa: SIM905  (a list of words reads best as words)
)
"""Names that no variable may have in GLSL: words of the language, and functions that it would hide."""

HELPERS = """\
vec2 wp_normalize(vec2 v) { float l = length(v); return l > 0.0 ? v / l : vec2(0.0); }
vec3 wp_normalize(vec3 v) { float l = length(v); return l > 0.0 ? v / l : vec3(0.0); }
vec4 wp_normalize(vec4 v) { float l = length(v); return l > 0.0 ? v / l : vec4(0.0); }
float wp_atan2(float y, float x) {
    float small = min(abs(x), abs(y));
    float large = max(abs(x), abs(y));
    bool upper = small > 0.41421356 * large;
    float t = large > 0.0 ? (upper ? (small - large) / (small + large) : small / large) : 0.0;
    float z = t * t;
    float series = ((0.0805374449538 * z - 0.138776856032) * z + 0.199777106478) * z - 0.333329491539;
    float angle = series * z * t + t;
    angle += upper ? 0.785398163397 : 0.0;
    angle = abs(y) > abs(x) ? 1.57079632679 - angle : angle;
    angle = x < 0.0 ? 3.14159265359 - angle : angle;
    return y < 0.0 ? -angle : angle;
}
float wp_round(float x) { float t = trunc(x); return abs(x - t) >= 0.5 ? t + sign(x) : t; }
float wp_cbrt(float x) {
    float r = pow(abs(x), 0.33333334);
    r -= r > 0.0 ? (r - abs(x) / (r * r)) / 3.0 : 0.0;
    return x < 0.0 ? -r : r;
}
float wp_tanh(float x) {
    float z = x * x;
    float series = (((0.0218694885 * z - 0.0539682540) * z + 0.133333333) * z - 0.333333333) * z * x + x;
    float e = exp(-2.0 * abs(x));
    float far = (1.0 - e) / (1.0 + e);
    return z < 0.0625 ? series : (x < 0.0 ? -far : far);
}
float wp_sinh(float x) {
    float z = x * x;
    float series = (((2.75573192e-6 * z + 1.98412698e-4) * z + 8.33333333e-3) * z + 0.166666667) * z * x + x;
    float e = exp(0.5 * abs(x));
    float far = 0.5 * e * e - 0.5 / (e * e);
    return z < 1.0 ? series : (x < 0.0 ? -far : far);
}
float wp_cosh(float x) { float e = exp(0.5 * abs(x)); return 0.5 * e * e + 0.5 / (e * e); }
#define ivec4_sampler isampler2D

"""
"""GLSL above every library.

Warp normalises the zero vector to zero, where `normalize` of GLSL is undefined. GLSL's own functions of
angles have errors of 1e-6 and more in drivers (4096 units in the last place are allowed), so all of them use
a polynomial here (Moshier 1989, Cephes, atanf), whose error is 2e-7. Hyperbolic functions are series near 0,
where their exponentials cancel, and stay finite as long as float32 holds their result. Textures of integers
have one type in GLSL and two names here, because their elements are an int or an ivec4.
"""


def type_name(hint: object) -> str | None:
    """Return the GLSL type of a Warp annotation, or None if GLSL has no such type."""
    if isinstance(hint, wp.array):
        return _ARRAYS.get(hint.dtype)
    try:
        return _TYPES.get(hint)
    except TypeError:  # unhashable, so not one of these types
        return None


def _same(name: str) -> Callable[..., Expression]:
    """Return the emitter of a function of this name whose result has the type of its first argument."""

    def emit(*arguments: Expression) -> Expression:
        return Expression(f"{name}({', '.join(a.code for a in arguments)})", arguments[0].type)

    return emit


def _scalar(name: str) -> Callable[..., Expression]:
    """Return the emitter of a function of this name whose result is a float."""

    def emit(*arguments: Expression) -> Expression:
        return Expression(f"{name}({', '.join(a.code for a in arguments)})", "float")

    return emit


def _template(pattern: str, result: str | None = None) -> Callable[..., Expression]:
    """Return the emitter of a function that is spelled otherwise in GLSL."""

    def emit(*arguments: Expression) -> Expression:
        code = pattern.format(*(argument.code for argument in arguments))
        return Expression(code, result or arguments[0].type)

    return emit


BUILTINS: dict[str, Callable[..., Expression]] = {
    **{name: _same(name) for name in ("abs", "ceil", "clamp", "cross", "exp", "floor", "log", "max", "min")},
    **{name: _same(name) for name in ("cos", "degrees", "log2", "pow", "radians", "sin", "sqrt", "tan")},
    **{name: _same(f"wp_{name}") for name in ("cbrt", "cosh", "round", "sinh", "tanh")},
    "trunc": _same("trunc"),
    "rint": _same("roundEven"),
    "frac": _template("({0} - trunc({0}))"),
    "log10": _template("(log({0}) * 0.4342944819)"),
    "step": _template("({0} < 0.0 ? 1.0 : 0.0)"),
    **{name: _scalar(name) for name in ("dot", "length")},
    "acos": _template("wp_atan2(sqrt((1.0 - {0}) * (1.0 + {0})), {0})"),
    "asin": _template("wp_atan2({0}, sqrt((1.0 - {0}) * (1.0 + {0})))"),
    "atan": _template("wp_atan2({0}, 1.0)"),
    "atan2": _same("wp_atan2"),
    "lerp": _same("mix"),
    "normalize": _same("wp_normalize"),
    "length_sq": _template("dot({0}, {0})", "float"),
    "cw_mul": _template("({0} * {1})"),
    "cw_div": _template("({0} / {1})"),
    "sign": _template("({0} < 0.0 ? -1.0 : 1.0)"),
    "where": lambda condition, chosen, other: Expression(
        f"({condition.code} ? {chosen.code} : {other.code})", chosen.type
    ),
    "float32": _template("float({0})", "float"),
    "int32": _template("int({0})", "int"),
    "uint32": _template("uint({0})", "uint"),
}
