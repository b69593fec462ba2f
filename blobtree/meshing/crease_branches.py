"""Smooth branches of a field: its continuation beyond the kinks of sharp operators.

A union, an intersection and a difference follow one operand at some points and another one elsewhere. Where
they change over, the field has a kink. For a fixed choice of operands the field is smooth. `branch_at`
evaluates a tape at a point q with the choices that it makes at another point r, the reference. So it
continues the branch that is active at r beyond the kink, as a solver needs to find where two or three
branches meet.
"""

from typing import Any

import warp as wp

from blobtree.kernels import KERNEL_OPTIONS
from blobtree.tape.codes import (
    FIELD,
    OPERATORS,
    POP,
    POP_SWAPPED,
    PREFIX,
    PUSH,
    REGISTERS,
    STRETCHED,
    UNWARP,
    WARP,
    WARP_REGISTERS,
)
from blobtree.tape.dispatch import (
    closest,
    direct_stride,
    has_sheets,
    kind_sheet_at,
    kind_sheet_value_gradient,
    partials,
    stride,
    warp_forward,
    warp_pullback,
)
from blobtree.tape.evaluators import (
    direct_value_gradient,
    gradient_combine,
    gradient_leaf,
    gradient_pullback_affine,
    profile_slope,
    profile_value,
    profiled_gradient_leaf,
    profiled_value_leaf,
    to_local,
    value_leaf,
)
from blobtree.texels import Texels

wp.set_module_options(KERNEL_OPTIONS)

BLENDED = 0
LEFT = 1
RIGHT = 2
NEITHER = 3

UNION_CODE = wp.constant(OPERATORS.index("union"))
INTERSECTION_CODE = wp.constant(OPERATORS.index("intersection"))
DIFFERENCE_CODE = wp.constant(OPERATORS.index("difference"))
"""The operators that choose; all others, custom ones included, are taken to be smooth."""

LABEL_MODULUS = wp.constant(8388593)
"""A prime below 2²³: labels are stored as float32 numbers, which are exact up to there."""

Branch: Any = wp.types.vector(length=6, dtype=wp.float32)
"""(field at r, label of the branch that is active there, then value, ∂x, ∂y, ∂z of that branch at q)."""

_Branches = wp.types.matrix(shape=(REGISTERS, 6), dtype=wp.float32)
_Points = wp.types.matrix(shape=(WARP_REGISTERS, 3), dtype=wp.float32)


@wp.func
def union_side(a: wp.float32, b: wp.float32) -> wp.int32:
    """Return the operand that a union follows."""
    if a >= b:
        return LEFT
    return RIGHT


@wp.func
def intersection_side(a: wp.float32, b: wp.float32) -> wp.int32:
    """Return the operand that an intersection follows."""
    if a <= b:
        return LEFT
    return RIGHT


@wp.func
def difference_side(a: wp.float32, b: wp.float32) -> wp.int32:
    """Return LEFT if a difference follows its solid, RIGHT for its tool's complement, NEITHER if it is 0."""
    top = wp.max(a, 1.0)
    remains = top - b * (2.0 * top - 1.0)
    if a < remains or b <= 0.0:
        return LEFT
    if remains <= 0.0:
        return NEITHER
    return RIGHT


@wp.func
def complement(a: wp.vec4, b: wp.vec4) -> wp.vec4:
    """Return (value, gradient) of a difference that follows its tool.

    It is smooth where a passes 1, because b is ½ on the surface.
    """
    if a[0] <= 1.0:
        return wp.vec4(1.0 - b[0], -b[1], -b[2], -b[3])
    c = a * (1.0 - 2.0 * b[0]) + b * (1.0 - 2.0 * a[0])
    return wp.vec4(a[0] - b[0] * (2.0 * a[0] - 1.0), c[1], c[2], c[3])


@wp.func
def side_of(operator: wp.int32, a: wp.float32, b: wp.float32) -> wp.int32:
    """Return the side that an operator follows: LEFT, RIGHT, NEITHER or BLENDED."""
    if operator == UNION_CODE:
        return union_side(a, b)
    if operator == INTERSECTION_CODE:
        return intersection_side(a, b)
    if operator == DIFFERENCE_CODE:
        return difference_side(a, b)
    return BLENDED


@wp.func
def chooses(operator: wp.int32) -> wp.bool:
    """Return True if an operator has kinks."""
    return side_of(operator, 0.0, 0.0) != BLENDED


@wp.func
def right_result(operator: wp.int32, a: wp.vec4, b: wp.vec4) -> wp.vec4:
    """Return (value, gradient) of an operator that follows its right operand."""
    if operator == DIFFERENCE_CODE:
        return complement(a, b)
    return b


@wp.func
def mixed_label(label: wp.int32, more: wp.int32) -> wp.int32:
    """Return a label that depends on both."""
    return (label * 31 + more + 7) % LABEL_MODULUS


@wp.func
def label_of(side: wp.int32, a: Branch, b: Branch) -> wp.int32:
    """Return the label of a combination, from the operand that it follows or from both if it blends them.

    Operands that are not followed do not enter, so equal labels in one tape mean one smooth function.
    """
    label_a = int(a[1])
    label_b = int(b[1])
    if side == LEFT:
        return mixed_label(label_a, LEFT)
    if side == RIGHT:
        return mixed_label(label_b, RIGHT)
    if side == NEITHER:
        return NEITHER
    if b[0] <= 0.0 or label_b == 0:
        return label_a
    if a[0] <= 0.0 or label_a == 0:
        return label_b
    return mixed_label(mixed_label(label_a, 3), label_b)


@wp.func
def field_of(branch: Branch) -> wp.vec4:
    """Return (value, gradient) of a branch at q."""
    return wp.vec4(branch[2], branch[3], branch[4], branch[5])


@wp.func
def make_branch(value: wp.float32, label: wp.int32, f: wp.vec4) -> Branch:
    """Return a branch from its field at r, its label and its (value, gradient) at q."""
    return Branch(value, float(label), f[0], f[1], f[2], f[3])


@wp.func
def branch_combine(operator: wp.int32, a: Branch, b: Branch, parameter: wp.float32, tape: Texels) -> Branch:
    """Return the operator's result at q, with the choice that the operator makes at the reference."""
    side = side_of(operator, a[0], b[0])
    value = partials(operator, a[0], b[0], parameter, tape)[0]
    f = field_of(a)
    if side == RIGHT:
        f = right_result(operator, field_of(a), field_of(b))
    elif side == NEITHER:
        f = wp.vec4()
    elif side == BLENDED:
        f = gradient_combine(operator, field_of(a), field_of(b), 0.0, parameter, tape)
    return make_branch(value, label_of(side, a, b), f)


@wp.func
def branch_leaf(q: wp.vec3, r: wp.vec3, kind: wp.int32, tape: Texels, at: wp.int32) -> Branch:
    """Return the branch of a primitive, which is smooth."""
    f = gradient_leaf(q, closest(kind, q, tape, at), wp.vec4(), wp.vec4(), 0.0)
    value = value_leaf(r, closest(kind, r, tape, at), wp.vec4(), wp.vec4(), 0.0)
    return make_branch(value, 0, f)


@wp.func
def stretched_branch(q: wp.vec3, r: wp.vec3, kind: wp.int32, tape: Texels, at: wp.int32) -> Branch:
    """Return the branch of a primitive with a map, and maybe a profile, at tape[at]."""
    profile = tape[at + 3]
    point = to_local(q, tape, at)
    reference = to_local(r, tape, at)
    if profile[2] == 0.0:
        plain = branch_leaf(point, reference, kind, tape, at + PREFIX)
        return make_branch(plain[0], 0, gradient_pullback_affine(field_of(plain), tape, at))
    c = closest(kind, point, tape, at + PREFIX)
    f = profiled_gradient_leaf(point, c, wp.vec4(), wp.vec4(), 0.0, profile)
    c = closest(kind, reference, tape, at + PREFIX)
    value = profiled_value_leaf(reference, c, wp.vec4(), wp.vec4(), 0.0, profile)
    return make_branch(value, 0, gradient_pullback_affine(f, tape, at))


@wp.func
def sheet_value_gradient(kind: wp.int32, sheet: wp.int32, q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (value, gradient) of a distance's field on one smooth piece of its surface, beyond its edges."""
    profile = tape[at - 1]
    u = kind_sheet_value_gradient(kind, q, sheet, tape, at)
    rate = profile_slope(u[0], profile)
    return wp.vec4(profile_value(u[0], profile), rate * u[1], rate * u[2], rate * u[3]) * profile[3]


@wp.func
def direct_branch(q: wp.vec3, r: wp.vec3, kind: wp.int32, tape: Texels, at: wp.int32) -> Branch:
    """Return the branch of a direct field with a map at tape[at]: the piece of its surface near r."""
    point = to_local(q, tape, at)
    reference = to_local(r, tape, at)
    value = direct_value_gradient(kind, reference, tape, at + PREFIX)[0]
    sheet = kind_sheet_at(kind, reference, tape, at + PREFIX)
    if sheet == 0:
        f = direct_value_gradient(kind, point, tape, at + PREFIX)
        return make_branch(value, 0, gradient_pullback_affine(f, tape, at))
    f = sheet_value_gradient(kind, sheet, point, tape, at + PREFIX)
    return make_branch(value, sheet, gradient_pullback_affine(f, tape, at))


@wp.func
def branch_at(q: wp.vec3, r: wp.vec3, tape: Texels, span: wp.vec2i) -> Branch:
    """Return the branch active at r, evaluated at q: the loop of `interpreter` over two points at once."""
    accumulator = Branch()
    registers = _Branches()
    point = q
    reference = r
    points = _Points()
    references = _Points()
    at = span[0]
    while at < span[1]:
        header = tape[at]
        code = int(header[0])
        operator = int(header[1])
        count = int(header[2])
        parameter = header[3]
        at += 1
        if code >= FIELD:
            kind = code - FIELD
            for _i in range(count):
                leaf = direct_branch(point, reference, kind, tape, at)
                accumulator = branch_combine(operator, accumulator, leaf, parameter, tape)
                at += PREFIX + direct_stride(kind)
        elif code >= STRETCHED:
            kind = code - STRETCHED
            for _i in range(count):
                leaf = stretched_branch(point, reference, kind, tape, at)
                accumulator = branch_combine(operator, accumulator, leaf, parameter, tape)
                at += PREFIX + stride(kind)
        elif code >= 0:
            for _i in range(count):
                leaf = branch_leaf(point, reference, code, tape, at)
                accumulator = branch_combine(operator, accumulator, leaf, parameter, tape)
                at += stride(code)
        elif code == PUSH:
            registers[count] = accumulator
            accumulator = Branch()
        elif code == POP:
            accumulator = branch_combine(operator, registers[count], accumulator, parameter, tape)
        elif code == POP_SWAPPED:
            accumulator = branch_combine(operator, accumulator, registers[count], parameter, tape)
        elif code == WARP:
            points[count] = point
            references[count] = reference
            point = warp_forward(operator, to_local(point, tape, at), tape, at + 3)
            reference = warp_forward(operator, to_local(reference, tape, at), tape, at + 3)
            at += PREFIX + int(header[3])
        elif code == UNWARP:
            point = points[count]
            reference = references[count]
            inner = wp.vec3(accumulator[3], accumulator[4], accumulator[5])
            g = warp_pullback(operator, to_local(point, tape, at), inner, tape, at + 3)
            f = gradient_pullback_affine(wp.vec4(accumulator[2], g[0], g[1], g[2]), tape, at)
            accumulator = make_branch(accumulator[0], int(accumulator[1]), f)
            at += PREFIX + int(header[3])
    return accumulator


@wp.func
def has_choice(tape: Texels, span: wp.vec2i) -> wp.bool:
    """Return True if a tape has an operator with kinks, or a solid with edges."""
    at = span[0]
    kinked = bool(False)
    while at < span[1] and not kinked:
        header = tape[at]
        code = int(header[0])
        operator = int(header[1])
        at += 1
        if code >= FIELD:
            at += int(header[2]) * (PREFIX + direct_stride(code - FIELD))
            kinked = chooses(operator) or has_sheets(code - FIELD)
        elif code >= STRETCHED:
            at += int(header[2]) * (PREFIX + stride(code - STRETCHED))
            kinked = chooses(operator)
        elif code >= 0:
            at += int(header[2]) * stride(code)
            kinked = chooses(operator)
        elif code <= WARP:
            at += PREFIX + int(header[3])
        elif code != PUSH:
            kinked = chooses(operator)
    return kinked
