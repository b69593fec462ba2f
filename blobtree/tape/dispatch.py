"""Dispatch by a code on the tape: functions that call the functions of one row of a table.

A row's function may declare fewer parameters than its dispatch: it gets the first ones. So operators without
several parameters do not take the tape. `decals/rendering/tree.py` writes the same dispatch in GLSL, over the
kinds in use alone.
"""

import warp as wp

from blobtree.formulas.falloff import FALLOFFS
from blobtree.formulas.fields import FIELDS
from blobtree.formulas.operators import OPERATORS
from blobtree.formulas.skeletons import SKELETONS
from blobtree.formulas.warps import WARPS
from blobtree.kernels import KERNEL_OPTIONS
from blobtree.transpile.specialize import unrolled

wp.set_module_options(KERNEL_OPTIONS)


@unrolled
def closest(kind: wp.int32, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """Return the closest point of a skeleton, and its influence there."""
    result = wp.vec4()
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = wp.static(SKELETONS[code].closest)(q, tape, at)
    return result


@unrolled
def min_influence(kind: wp.int32, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.float32:
    """Return the smallest influence on a skeleton."""
    result = float(0.0)
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = wp.static(SKELETONS[code].min_influence)(tape, at)
    return result


@unrolled
def stride(kind: wp.int32) -> wp.int32:
    """Return the number of texels of a primitive: its parameters and its colour."""
    result = int(0)
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = wp.static(SKELETONS[code].parameters + 1)
    return result


@unrolled
def is_convex(kind: wp.int32) -> wp.bool:
    """Return `Skeleton.convex`."""
    result = bool(False)
    for code in range(wp.static(len(SKELETONS))):
        if kind == code:
            result = bool(wp.static(SKELETONS[code].convex))
    return result


@unrolled
def kind_value_gradient(kind: wp.int32, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """Return `FieldKind.value_gradient`."""
    result = wp.vec4()
    for code in range(wp.static(len(FIELDS))):
        if kind == code:
            result = wp.static(FIELDS[code].value_gradient)(q, tape, at)
    return result


@unrolled
def kind_bounds(
    kind: wp.int32, center: wp.vec3, radius: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec3:
    """Return `FieldKind.bounds`."""
    result = wp.vec3()
    for code in range(wp.static(len(FIELDS))):
        if kind == code:
            result = wp.static(FIELDS[code].bounds)(center, radius, tape, at)
    return result


@unrolled
def is_distance(kind: wp.int32) -> wp.bool:
    """Return `FieldKind.distance`."""
    result = bool(False)
    for code in range(wp.static(len(FIELDS))):
        if kind == code:
            result = bool(wp.static(FIELDS[code].distance))
    return result


@unrolled
def is_windowed(kind: wp.int32) -> wp.bool:
    """Return `FieldKind.windowed`."""
    result = bool(False)
    for code in range(wp.static(len(FIELDS))):
        if kind == code:
            result = bool(wp.static(FIELDS[code].windowed))
    return result


@unrolled
def direct_stride(kind: wp.int32) -> wp.int32:
    """Return the number of texels of a direct field behind its map: its parameters and its colour."""
    result = int(0)
    for code in range(wp.static(len(FIELDS))):
        if kind == code:
            result = wp.static(FIELDS[code].parameters + 1)
    return result


@unrolled
def is_monotone(operator: wp.int32) -> wp.bool:
    """Return `Operator.monotone`."""
    result = bool(False)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = bool(wp.static(OPERATORS[code].monotone))
    return result


@unrolled
def paints(operator: wp.int32) -> wp.bool:
    """Return `Operator.paints`."""
    result = bool(True)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = bool(wp.static(OPERATORS[code].paints))
    return result


@unrolled
def partials(
    operator: wp.int32, a: wp.float32, b: wp.float32, parameter: wp.float32, tape: wp.array(dtype=wp.vec4)
) -> wp.vec3:
    """Return the value and the partial derivatives of an operator."""
    result = wp.vec3()
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].partials)(a, b, parameter, tape)
    return result


@unrolled
def slope(
    operator: wp.int32,
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
    tape: wp.array(dtype=wp.vec4),
) -> wp.float32:
    """Return the slope bound of an operator."""
    result = float(0.0)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].slope)(slope_a, slope_b, max_a, max_b, parameter, tape)
    return result


@unrolled
def reads_gradients(operator: wp.int32) -> wp.bool:
    """Return `Operator.gradients`."""
    result = bool(False)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = bool(wp.static(OPERATORS[code].gradients))
    return result


@unrolled
def directed_partials(
    operator: wp.int32,
    a: wp.float32,
    b: wp.float32,
    parameter: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    direction_a: wp.vec3,
    direction_b: wp.vec3,
) -> wp.vec3:
    """Do the same as `partials`, also for operators that read gradients."""
    result = wp.vec3()
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].partials)(a, b, parameter, tape, direction_a, direction_b)
    return result


@unrolled
def directed_slope(
    operator: wp.int32,
    slope_a: wp.float32,
    slope_b: wp.float32,
    max_a: wp.float32,
    max_b: wp.float32,
    parameter: wp.float32,
    tape: wp.array(dtype=wp.vec4),
    turn: wp.float32,
) -> wp.float32:
    """Do the same as `slope`, also for operators that read gradients."""
    result = float(0.0)
    for code in range(wp.static(len(OPERATORS))):
        if operator == code:
            result = wp.static(OPERATORS[code].slope)(slope_a, slope_b, max_a, max_b, parameter, tape, turn)
    return result


@unrolled
def warp_forward(kind: wp.int32, q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec3:
    """Return T(q) of a warp, whose parameters begin at tape[at]."""
    result = wp.vec3()
    for code in range(wp.static(len(WARPS))):
        if kind == code:
            result = wp.static(WARPS[code].forward)(q, tape, at)
    return result


@unrolled
def warp_pullback(
    kind: wp.int32, q: wp.vec3, g: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec3:
    """Return Jᵀ g of a warp."""
    result = wp.vec3()
    for code in range(wp.static(len(WARPS))):
        if kind == code:
            result = wp.static(WARPS[code].pullback)(q, g, tape, at)
    return result


@unrolled
def warp_stretch(
    kind: wp.int32, q: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.float32:
    """Return a bound on ‖J‖ of a warp over a ball."""
    result = float(1.0)
    for code in range(wp.static(len(WARPS))):
        if kind == code:
            result = wp.static(WARPS[code].stretch)(q, reach, tape, at)
    return result


@unrolled
def warp_extent(
    kind: wp.int32, q: wp.vec3, half: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec3:
    """Return half the size of a box about T(q) that holds the image of the box q ± half."""
    result = wp.vec3()
    for code in range(wp.static(len(WARPS))):
        if kind == code:
            result = wp.static(WARPS[code].extent)(q, half, tape, at)
    return result


@unrolled
def falloff_value(kind: wp.int32, distance: wp.float32) -> wp.float32:
    """Return g(d) of a falloff, 0 ≤ d ≤ 1."""
    result = float(0.0)
    for code in range(wp.static(len(FALLOFFS))):
        if kind == code:
            result = wp.static(FALLOFFS[code].value)(distance)
    return result


@unrolled
def falloff_slope(kind: wp.int32, distance: wp.float32) -> wp.float32:
    """Return g'(d) of a falloff, 0 ≤ d ≤ 1."""
    result = float(0.0)
    for code in range(wp.static(len(FALLOFFS))):
        if kind == code:
            result = wp.static(FALLOFFS[code].slope)(distance)
    return result


@unrolled
def falloff_numbers(kind: wp.int32) -> wp.vec3:
    """Return `Falloff.rim`, `Falloff.steepest_distance` and `Falloff.steepest_slope`."""
    result = wp.vec3()
    for code in range(wp.static(len(FALLOFFS))):
        if kind == code:
            result = wp.vec3(
                wp.static(FALLOFFS[code].rim),
                wp.static(FALLOFFS[code].steepest_distance),
                wp.static(FALLOFFS[code].steepest_slope),
            )
    return result
