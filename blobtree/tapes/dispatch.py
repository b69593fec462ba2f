"""Choosing by a code on the tape: functions that call the right row of a table.

`decals/render/tape_shader.py` makes the same choices in GLSL, among the kinds in use alone.
"""

import warp as wp

from blobtree.formulas.operators import OPERATORS
from blobtree.formulas.skeletons import SKELETONS
from blobtree.formulas.warps import WARPS
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.typed.unroll import unrolled

wp.set_module_options(KERNEL_OPTIONS)


@unrolled
def closest(kind: wp.int32, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """Closest point and influence of a skeleton of any kind."""
    result = wp.vec4()
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = wp.static(SKELETONS[code].closest)(q, tape, at)
    return result


@unrolled
def slimmest(kind: wp.int32, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.float32:
    """Smallest influence on a skeleton of any kind."""
    result = float(0.0)
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = wp.static(SKELETONS[code].slimmest)(tape, at)
    return result


@unrolled
def stride(kind: wp.int32) -> wp.int32:
    """Texels of a primitive of any kind: its parameters and its colour."""
    result = int(0)
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = wp.static(SKELETONS[code].parameters + 1)
    return result


@unrolled
def convex(kind: wp.int32) -> wp.bool:
    """Whether a skeleton of this kind is `Skeleton.convex`."""
    result = bool(False)
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = bool(wp.static(SKELETONS[code].convex))
    return result


@unrolled
def rises(operator: wp.int32) -> wp.bool:
    """Whether an operator is `Operator.rises`."""
    result = bool(False)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = bool(wp.static(OPERATORS[code].rises))
    return result


@unrolled
def partials(operator: wp.int32, a: wp.float32, b: wp.float32, parameter: wp.float32) -> wp.vec3:
    """Value and partial derivatives of any operator."""
    result = wp.vec3()
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].partials)(a, b, parameter)
    return result


@unrolled
def slope(
    operator: wp.int32,
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
) -> wp.float32:
    """Bound on the slope of any operator."""
    result = float(0.0)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].slope)(slope_a, slope_b, max_a, max_b, parameter)
    return result


@unrolled
def warp_forward(kind: wp.int32, q: wp.vec3, p: wp.vec4) -> wp.vec3:
    """T(q) of any warp."""
    result = wp.vec3()
    for code in range(wp.static(len(WARPS))):
        if kind == code:
            result = wp.static(WARPS[code].forward)(q, p)
    return result


@unrolled
def warp_pullback(kind: wp.int32, q: wp.vec3, g: wp.vec3, p: wp.vec4) -> wp.vec3:
    """Jᵀ g of any warp."""
    result = wp.vec3()
    for code in range(wp.static(len(WARPS))):
        if kind == code:
            result = wp.static(WARPS[code].pullback)(q, g, p)
    return result


@unrolled
def warp_stretch(kind: wp.int32, q: wp.vec3, reach: wp.float32, p: wp.vec4) -> wp.float32:
    """Bound on ‖J‖ of any warp over a ball."""
    result = float(1.0)
    for code in range(wp.static(len(WARPS))):
        if kind == code:
            result = wp.static(WARPS[code].stretch)(q, reach, p)
    return result
