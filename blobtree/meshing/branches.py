"""Smooth branches of a field: what it would be if sharp operators went on choosing as they do elsewhere.

A union, an intersection and a difference follow one operand here and another one there; where they change
over, the field has a kink. Taken alone either choice is a smooth field. `branch_at` reads a tape at a point q
while it chooses as at another point r, the reference, so it continues the branch that is active at r beyond
the kink: what a solver needs in order to find where two or three branches meet.
"""

from typing import Any

import warp as wp

from blobtree.formulas.operators import DIFFERENCE, INTERSECTION, OPERATORS, UNION
from blobtree.kernel_options import KERNEL_OPTIONS
from blobtree.tapes.dispatch import closest, partials, stride, warp_forward, warp_pullback
from blobtree.tapes.readings import gradient_combine, gradient_leaf, gradient_unstretch, to_local, value_leaf
from blobtree.tapes.tape import (
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

wp.set_module_options(KERNEL_OPTIONS)

BLENDED = 0
LEFT = 1
RIGHT = 2
NEITHER = 3

UNION_CODE = wp.constant(OPERATORS.index(UNION))
INTERSECTION_CODE = wp.constant(OPERATORS.index(INTERSECTION))
DIFFERENCE_CODE = wp.constant(OPERATORS.index(DIFFERENCE))
"""The operators that choose; every other one, and every one of a user's, counts as smooth."""

LABELS = wp.constant(8388593)
"""A prime below 2²³: labels are kept among float32 numbers, which count exactly up to there."""

Branch: Any = wp.types.vector(length=6, dtype=wp.float32)
"""(field at r, label of the branch that is active there, and at q of that branch: value, ∂x, ∂y, ∂z)."""

_Branches = wp.types.matrix(shape=(REGISTERS, 6), dtype=wp.float32)
_Places = wp.types.matrix(shape=(WARP_REGISTERS, 3), dtype=wp.float32)


@wp.func
def larger_taken(a: wp.float32, b: wp.float32) -> wp.int32:
    """The operand that a union follows."""
    if a >= b:
        return LEFT
    return RIGHT


@wp.func
def smaller_taken(a: wp.float32, b: wp.float32) -> wp.int32:
    """The operand that an intersection follows."""
    if a <= b:
        return LEFT
    return RIGHT


@wp.func
def cut_taken(a: wp.float32, b: wp.float32) -> wp.int32:
    """Whether a difference follows its solid, the complement of its tool, or is cut away altogether."""
    top = wp.max(a, 1.0)
    remains = top - b * (2.0 * top - 1.0)
    if a < remains or b <= 0.0:
        return LEFT
    if remains <= 0.0:
        return NEITHER
    return RIGHT


@wp.func
def complement(a: wp.vec4, b: wp.vec4) -> wp.vec4:
    """What a difference is that follows its tool: smooth where a passes 1, for b is ½ on the surface."""
    if a[0] <= 1.0:
        return wp.vec4(1.0 - b[0], -b[1], -b[2], -b[3])
    c = a * (1.0 - 2.0 * b[0]) + b * (1.0 - 2.0 * a[0])
    return wp.vec4(a[0] - b[0] * (2.0 * a[0] - 1.0), c[1], c[2], c[3])


@wp.func
def side_taken(operator: wp.int32, a: wp.float32, b: wp.float32) -> wp.int32:
    """LEFT, RIGHT, NEITHER, or BLENDED of any operator."""
    if operator == UNION_CODE:
        return larger_taken(a, b)
    if operator == INTERSECTION_CODE:
        return smaller_taken(a, b)
    if operator == DIFFERENCE_CODE:
        return cut_taken(a, b)
    return BLENDED


@wp.func
def chooses(operator: wp.int32) -> wp.bool:
    """Whether an operator has kinks."""
    return side_taken(operator, 0.0, 0.0) != BLENDED


@wp.func
def right_result(operator: wp.int32, a: wp.vec4, b: wp.vec4) -> wp.vec4:
    """(value, gradient) of any operator that follows its right operand."""
    if operator == DIFFERENCE_CODE:
        return complement(a, b)
    return b


@wp.func
def mixed_label(label: wp.int32, more: wp.int32) -> wp.int32:
    """A label that depends on both."""
    return (label * 31 + more + 7) % LABELS


@wp.func
def label_of(side: wp.int32, a: Branch, b: Branch) -> wp.int32:
    """Label of a combination: that of the operand that it follows, or of both where it blends two branches.

    What is not followed leaves no trace, so equal labels in one tape mean one smooth function.
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
    """(value, gradient) at q."""
    return wp.vec4(branch[2], branch[3], branch[4], branch[5])


@wp.func
def make_branch(value: wp.float32, label: wp.int32, f: wp.vec4) -> Branch:
    """A branch of its parts."""
    return Branch(value, float(label), f[0], f[1], f[2], f[3])


@wp.func
def branch_combine(operator: wp.int32, a: Branch, b: Branch, parameter: wp.float32) -> Branch:
    """The operator at the reference chooses; at q the choice is carried out."""
    side = side_taken(operator, a[0], b[0])
    value = partials(operator, a[0], b[0], parameter)[0]
    f = field_of(a)
    if side == RIGHT:
        f = right_result(operator, field_of(a), field_of(b))
    elif side == NEITHER:
        f = wp.vec4()
    elif side == BLENDED:
        f = gradient_combine(operator, field_of(a), field_of(b), 0.0, parameter)
    return make_branch(value, label_of(side, a, b), f)


@wp.func
def branch_leaf(
    q: wp.vec3, r: wp.vec3, kind: wp.int32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> Branch:
    """A primitive is smooth: its value at the reference, and value and gradient at q."""
    f = gradient_leaf(q, wp.vec3(), 0.0, 0.0, closest(kind, q, tape, at), 0.0, wp.vec4())
    value = value_leaf(r, wp.vec3(), 0.0, 0.0, closest(kind, r, tape, at), 0.0, wp.vec4())
    return make_branch(value, 0, f)


@wp.func
def branch_at(q: wp.vec3, r: wp.vec3, tape: wp.array(dtype=wp.vec4), span: wp.vec2i) -> Branch:
    """The branch that is active at r, read at q: the loop of `interpreter` over two places at once."""
    accumulator = Branch()
    registers = _Branches()
    place = q
    reference = r
    places = _Places()
    references = _Places()
    at = span[0]
    while at < span[1]:
        header = tape[at]
        code = int(header[0])
        operator = int(header[1])
        count = int(header[2])
        parameter = header[3]
        at += 1
        if code >= STRETCHED:
            kind = code - STRETCHED
            for _i in range(count):
                leaf = branch_leaf(
                    to_local(place, tape, at), to_local(reference, tape, at), kind, tape, at + PREFIX
                )
                f = gradient_unstretch(field_of(leaf), tape, at)
                leaf = make_branch(leaf[0], 0, f)
                accumulator = branch_combine(operator, accumulator, leaf, parameter)
                at += PREFIX + stride(kind)
        elif code >= 0:
            for _i in range(count):
                leaf = branch_leaf(place, reference, code, tape, at)
                accumulator = branch_combine(operator, accumulator, leaf, parameter)
                at += stride(code)
        elif code == PUSH:
            registers[count] = accumulator
            accumulator = Branch()
        elif code == POP:
            accumulator = branch_combine(operator, registers[count], accumulator, parameter)
        elif code == POP_SWAPPED:
            accumulator = branch_combine(operator, accumulator, registers[count], parameter)
        elif code == WARP:
            p = tape[at + 3]
            places[count] = place
            references[count] = reference
            place = warp_forward(operator, to_local(place, tape, at), p)
            reference = warp_forward(operator, to_local(reference, tape, at), p)
            at += PREFIX
        elif code == UNWARP:
            p = tape[at + 3]
            place = places[count]
            reference = references[count]
            inner = wp.vec3(accumulator[3], accumulator[4], accumulator[5])
            g = warp_pullback(operator, to_local(place, tape, at), inner, p)
            f = gradient_unstretch(wp.vec4(accumulator[2], g[0], g[1], g[2]), tape, at)
            accumulator = make_branch(accumulator[0], int(accumulator[1]), f)
            at += PREFIX
    return accumulator


@wp.func
def has_choice(tape: wp.array(dtype=wp.vec4), span: wp.vec2i) -> wp.bool:
    """Whether a tape has an operator with kinks."""
    at = span[0]
    found = bool(False)
    while at < span[1] and not found:
        header = tape[at]
        code = int(header[0])
        operator = int(header[1])
        at += 1
        if code >= STRETCHED:
            at += int(header[2]) * (PREFIX + stride(code - STRETCHED))
            found = chooses(operator)
        elif code >= 0:
            at += int(header[2]) * stride(code)
            found = chooses(operator)
        elif code <= WARP:
            at += PREFIX
        elif code != PUSH:
            found = chooses(operator)
    return found
