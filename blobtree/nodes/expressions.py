"""Solids by expressions in x, y and z, such as programs of libfive, Fidget and MPR.

An expression is a tree of parts, see `clauses`, which a union or an intersection joins. So blocks of cells,
rays and edits prune what min and max make idle there. A part is a direct field: a short program on the tape
that `part_row` interprets for values with gradients, and `part_range` for intervals with slopes.

A part ends at the box of the expression: its distance is the larger one of its value and the box's distance.
"""

from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.field import DISTANCES, RESULTS
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.errors import InvalidNode
from blobtree.formulas.falloff import RIM
from blobtree.lazy import Lazy
from blobtree.nodes.clauses import CODE_BITS, CODES, REGISTERS, ClauseTexts, joints, parsed, part_texels
from blobtree.nodes.node import Node
from blobtree.nodes.operator import Operator
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.primitives import Box
from blobtree.nodes.sharp import SharpSolid, relative_distance
from blobtree.nodes.tree import Intersection, extremum_slope, union_keeps, union_partials
from blobtree.nodes.volumes import box_distance
from blobtree.texels import Texels
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

HUGE = wp.constant(1e18)
"""Largest value, slope and partial derivative of a clause: products of two stay within float32."""

TINY = wp.constant(1e-18)
"""Smallest divisor."""

STEP_MARGIN = wp.constant(4e-7)
"""Relative widening of the range of each clause, for the rounding of values in float32."""

LOWEST_BITS = (1 << CODE_BITS) - 1
"""Those of the code of an operation."""

HALF_TURN = 3.14159265358979

MEAN_SHARE = 0.25
"""Length to which widths are relative, over the shortest side of the box."""

Registers = wp.types.vector(length=REGISTERS, dtype=wp.float32)

(
    COPY, NEG, ABS, SQUARE, SQRT, RECIP, SIN, COS, TAN, ASIN, ACOS, ATAN, EXP, LN, FLOOR, CEIL, ROUND,
    ADD, SUB, MUL, DIV, MIN, MAX, HYPOT, ATAN2, MOD, COMPARE, POW, NTH_ROOT,
) = CODES.values()  # fmt: skip


@wp.func
def held(x: wp.float32) -> wp.float32:
    """Return x within the range of values."""
    return wp.clamp(x, -HUGE, HUGE)


@wp.func
def divisor(x: wp.float32) -> wp.float32:
    """Return x, away from 0."""
    if x < 0.0:
        return wp.min(x, -TINY)
    return wp.max(x, TINY)


@wp.func
def remainder_of(a: wp.float32, b: wp.float32) -> wp.float32:
    """Return a − |b| ⌊a / |b|⌋, from 0 to |b|."""
    size = wp.max(wp.abs(b), TINY)
    return a - size * wp.floor(a / size)


@wp.func
def real_power(a: wp.float32, b: wp.float32) -> wp.float32:
    """Return aᵇ, of 0 in place of a number below 0."""
    if a <= 0.0:
        return wp.where(b < 0.0, HUGE, 0.0)
    return held(wp.pow(a, b))


@wp.func
def real_root(a: wp.float32, n: wp.float32) -> wp.float32:
    """Return the n-th root of a, which is odd for an odd n; an even one of a number below 0 is 0."""
    root = real_power(wp.abs(a), 1.0 / divisor(n))
    if a >= 0.0:
        return root
    if wp.abs(remainder_of(n, 2.0) - 1.0) < 0.5:
        return -root
    return 0.0


@wp.func
def unary_row(code: wp.int32, a: wp.float32) -> wp.vec2:
    """Return an operation of a, and its derivative."""
    if code == SQUARE:
        return wp.vec2(a * a, 2.0 * a)
    if code == NEG:
        return wp.vec2(-a, -1.0)
    if code == SQRT:
        root = wp.sqrt(wp.max(a, 0.0))
        return wp.vec2(root, 0.5 / divisor(root))
    if code == ABS:
        return wp.vec2(wp.abs(a), wp.where(a < 0.0, -1.0, 1.0))
    if code == RECIP:
        r = 1.0 / divisor(a)
        return wp.vec2(r, -r * r)
    if code == SIN:
        return wp.vec2(wp.sin(a), wp.cos(a))
    if code == COS:
        return wp.vec2(wp.cos(a), -wp.sin(a))
    if code == TAN:
        t = held(wp.sin(a) / divisor(wp.cos(a)))
        return wp.vec2(t, 1.0 + t * t)
    if code == ASIN:
        c = wp.clamp(a, -1.0, 1.0)
        return wp.vec2(wp.asin(c), 1.0 / divisor(wp.sqrt(1.0 - c * c)))
    if code == ACOS:
        c = wp.clamp(a, -1.0, 1.0)
        return wp.vec2(wp.acos(c), -1.0 / divisor(wp.sqrt(1.0 - c * c)))
    if code == ATAN:
        return wp.vec2(wp.atan(a), 1.0 / (1.0 + a * a))
    if code == EXP:
        e = wp.exp(wp.min(a, 41.0))
        return wp.vec2(e, e)
    if code == LN:
        return wp.vec2(wp.log(wp.max(a, TINY)), 1.0 / wp.max(a, TINY))
    if code == FLOOR:
        return wp.vec2(wp.floor(a), 0.0)
    if code == CEIL:
        return wp.vec2(wp.ceil(a), 0.0)
    if code == ROUND:
        return wp.vec2(wp.round(a), 0.0)
    return wp.vec2(a, 1.0)


@wp.func
def clause_row(code: wp.int32, a: wp.float32, b: wp.float32) -> wp.vec3:
    """Return an operation of a and b, and its partial derivatives."""
    if code < ADD:
        row = unary_row(code, a)
        return wp.vec3(row[0], row[1], 0.0)
    if code == ADD:
        return wp.vec3(a + b, 1.0, 1.0)
    if code == SUB:
        return wp.vec3(a - b, 1.0, -1.0)
    if code == MUL:
        return wp.vec3(a * b, b, a)
    if code == HYPOT:
        h = wp.length(wp.vec2(a, b))
        return wp.vec3(h, a / divisor(h), b / divisor(h))
    if code == MIN:
        if a <= b:
            return wp.vec3(a, 1.0, 0.0)
        return wp.vec3(b, 0.0, 1.0)
    if code == MAX:
        if a >= b:
            return wp.vec3(a, 1.0, 0.0)
        return wp.vec3(b, 0.0, 1.0)
    if code == DIV:
        r = 1.0 / divisor(b)
        return wp.vec3(held(a * r), r, -held(a * r) * r)
    if code == ATAN2:
        squared = divisor(a * a + b * b)
        return wp.vec3(wp.atan2(a, b), b / squared, -a / squared)
    if code == MOD:
        return wp.vec3(remainder_of(a, b), 1.0, 0.0)
    if code == COMPARE:
        return wp.vec3(wp.where(a < b, -1.0, wp.where(a > b, 1.0, 0.0)), 0.0, 0.0)
    if code == POW:
        p = real_power(a, b)
        return wp.vec3(p, b * held(p / divisor(a)), p * wp.log(wp.max(a, TINY)))
    root = real_root(a, b)
    return wp.vec3(root, held(root / divisor(a)) / divisor(b), 0.0)


@wp.func
def part_row(q: wp.vec3, tape: Texels, first: wp.int32, count: wp.int32) -> wp.vec4:
    """Return (v, ∇v) of the program of a part at q."""
    v = Registers()
    x = Registers()
    y = Registers()
    z = Registers()
    v[0] = q[0]
    v[1] = q[1]
    v[2] = q[2]
    x[0] = 1.0
    y[1] = 1.0
    z[2] = 1.0
    out = int(0)
    for i in range(count):
        texel = tape[first + i]
        out = int(texel[0]) >> CODE_BITS
        a = float(texel[3])
        b = float(texel[3])
        by_a = wp.vec3()
        by_b = wp.vec3()
        j = int(texel[1])
        if j >= 0:
            a = v[j]
            by_a = wp.vec3(x[j], y[j], z[j])
        k = int(texel[2])
        if k >= 0:
            b = v[k]
            by_b = wp.vec3(x[k], y[k], z[k])
        row = clause_row(int(texel[0]) & LOWEST_BITS, a, b)
        g = by_a * held(row[1]) + by_b * held(row[2])
        v[out] = held(row[0])
        x[out] = held(g[0])
        y[out] = held(g[1])
        z[out] = held(g[2])
    return wp.vec4(v[out], x[out], y[out], z[out])


@wp.func
def part_value(q: wp.vec3, tape: Texels, first: wp.int32, count: wp.int32) -> wp.float32:
    """Return v of the program of a part at q: the same number as `part_row`."""
    v = Registers()
    v[0] = q[0]
    v[1] = q[1]
    v[2] = q[2]
    out = int(0)
    for i in range(count):
        texel = tape[first + i]
        out = int(texel[0]) >> CODE_BITS
        a = float(texel[3])
        b = float(texel[3])
        j = int(texel[1])
        if j >= 0:
            a = v[j]
        k = int(texel[2])
        if k >= 0:
            b = v[k]
        v[out] = held(clause_row(int(texel[0]) & LOWEST_BITS, a, b)[0])
    return v[out]


@wp.func
def scaled_range(low: wp.float32, high: wp.float32, slope: wp.float32, rate: wp.float32) -> wp.vec3:
    """Return a range whose slope is at most `rate` times that of the operand, which may be constant."""
    return wp.vec3(low, high, wp.where(slope > 0.0, wp.min(slope * rate, HUGE), 0.0))


@wp.func
def step_range(low: wp.float32, high: wp.float32, slope: wp.float32) -> wp.vec3:
    """Return a range of a function that jumps between `low` and `high`."""
    return scaled_range(low, high, slope, wp.where(low < high, HUGE, 0.0))


@wp.func
def least_size(a: wp.vec3) -> wp.float32:
    """Return the least |a|."""
    return wp.max(wp.max(a[0], -a[1]), 0.0)


@wp.func
def largest_size(a: wp.vec3) -> wp.float32:
    """Return the largest |a|."""
    return wp.max(-a[0], a[1])


@wp.func
def sine_range(low: wp.float32, high: wp.float32, slope: wp.float32) -> wp.vec3:
    """Return the range of a sine."""
    top = 0.5 * HALF_TURN + 2.0 * HALF_TURN * wp.ceil((low - 0.5 * HALF_TURN) / (2.0 * HALF_TURN) - 1e-3)
    bottom = -0.5 * HALF_TURN + 2.0 * HALF_TURN * wp.ceil((low + 0.5 * HALF_TURN) / (2.0 * HALF_TURN) - 1e-3)
    least = wp.where(bottom <= high + 1e-2, -1.0, wp.min(wp.sin(low), wp.sin(high)))
    most = wp.where(top <= high + 1e-2, 1.0, wp.max(wp.sin(low), wp.sin(high)))
    if largest_size(wp.vec3(low, high, 0.0)) > 1e4:
        return wp.vec3(-1.0, 1.0, slope)
    return wp.vec3(least, most, slope)


@wp.func
def unary_range(code: wp.int32, a: wp.vec3) -> wp.vec3:
    """Return (smallest value, largest value, slope) of an operation of a range."""
    low = a[0]
    high = a[1]
    if code == SQUARE:
        return scaled_range(
            least_size(a) * least_size(a), largest_size(a) * largest_size(a), a[2], 2.0 * largest_size(a)
        )
    if code == NEG:
        return wp.vec3(-high, -low, a[2])
    if code == SQRT:
        root = wp.sqrt(wp.max(low, 0.0))
        return scaled_range(root, wp.sqrt(wp.max(high, 0.0)), a[2], 0.5 / divisor(root))
    if code == ABS:
        return wp.vec3(least_size(a), largest_size(a), a[2])
    if code == RECIP:
        near = least_size(a)
        if near <= 0.0:
            return scaled_range(-HUGE, HUGE, a[2], HUGE)
        return scaled_range(
            1.0 / divisor(high), 1.0 / divisor(low), a[2], 1.0 / divisor(near) / divisor(near)
        )
    if code == SIN:
        return sine_range(low, high, a[2])
    if code == COS:
        return sine_range(low + 0.5 * HALF_TURN, high + 0.5 * HALF_TURN, a[2])
    if code == TAN:
        turn = wp.floor(low / HALF_TURN + 0.5 - 1e-3)
        if turn != wp.floor(high / HALF_TURN + 0.5 + 1e-3) or largest_size(a) > 1e4:
            return scaled_range(-HUGE, HUGE, a[2], HUGE)
        t = wp.vec3(wp.tan(low), wp.tan(high), 0.0)
        return scaled_range(t[0], t[1], a[2], 1.0 + largest_size(t) * largest_size(t))
    if code == ASIN or code == ACOS:  # noqa: SIM109
        far = wp.min(largest_size(a), 1.0)
        rate = 1.0 / divisor(wp.sqrt(1.0 - far * far))
        if code == ASIN:
            return scaled_range(
                wp.asin(wp.clamp(low, -1.0, 1.0)), wp.asin(wp.clamp(high, -1.0, 1.0)), a[2], rate
            )
        return scaled_range(wp.acos(wp.clamp(high, -1.0, 1.0)), wp.acos(wp.clamp(low, -1.0, 1.0)), a[2], rate)
    if code == ATAN:
        return scaled_range(wp.atan(low), wp.atan(high), a[2], 1.0 / (1.0 + least_size(a) * least_size(a)))
    if code == EXP:
        most = wp.exp(wp.min(high, 41.0))
        return scaled_range(wp.exp(wp.min(low, 41.0)), most, a[2], most)
    if code == LN:
        return scaled_range(
            wp.log(wp.max(low, TINY)), wp.log(wp.max(high, TINY)), a[2], 1.0 / wp.max(low, TINY)
        )
    if code == FLOOR:
        return step_range(wp.floor(low), wp.floor(high), a[2])
    if code == CEIL:
        return step_range(wp.ceil(low), wp.ceil(high), a[2])
    if code == ROUND:
        return step_range(wp.round(low), wp.round(high), a[2])
    return a


@wp.func
def product_range(a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return (smallest value, largest value, slope) of a product."""
    low = wp.min(wp.min(a[0] * b[0], a[0] * b[1]), wp.min(a[1] * b[0], a[1] * b[1]))
    high = wp.max(wp.max(a[0] * b[0], a[0] * b[1]), wp.max(a[1] * b[0], a[1] * b[1]))
    return wp.vec3(low, high, wp.min(largest_size(a) * b[2] + largest_size(b) * a[2], HUGE))


@wp.func
def power_range(a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return (smallest value, largest value, slope) of a power: the extremes lie at corners."""
    c0 = real_power(a[0], b[0])
    c1 = real_power(a[0], b[1])
    c2 = real_power(a[1], b[0])
    c3 = real_power(a[1], b[1])
    low = wp.min(wp.min(c0, c1), wp.min(c2, c3))
    high = wp.max(wp.max(c0, c1), wp.max(c2, c3))
    if a[0] <= 0.0 or b[2] > 0.0:
        return scaled_range(low, high, a[2] + b[2], HUGE)
    rate = wp.abs(b[0]) * wp.max(real_power(a[0], b[0] - 1.0), real_power(a[1], b[0] - 1.0))
    return scaled_range(low, high, a[2], rate)


@wp.func
def root_range(a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return (smallest value, largest value, slope) of a root; any value if b varies, or at a pole."""
    if b[0] < b[1] or (b[0] < 0.0 and least_size(a) <= 0.0):
        return scaled_range(-HUGE, HUGE, a[2] + b[2], HUGE)
    c0 = real_root(a[0], b[0])
    c1 = real_root(a[1], b[0])
    rate = wp.max(wp.abs(held(c0 / divisor(a[0]))), wp.abs(held(c1 / divisor(a[1])))) / wp.abs(divisor(b[0]))
    return scaled_range(wp.min(c0, c1), wp.max(c0, c1), a[2], wp.where(least_size(a) > 0.0, rate, HUGE))


@wp.func
def angle_range(a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return (smallest value, largest value, slope) of atan2(a, b), which jumps where a = 0 and b < 0."""
    slope = a[2] + b[2]
    if a[0] <= 0.0 and a[1] >= 0.0 and b[0] <= 0.0:
        return scaled_range(-HALF_TURN, HALF_TURN, slope, HUGE)
    c0 = wp.atan2(a[0], b[0])
    c1 = wp.atan2(a[0], b[1])
    c2 = wp.atan2(a[1], b[0])
    c3 = wp.atan2(a[1], b[1])
    low = wp.min(wp.min(c0, c1), wp.min(c2, c3))
    high = wp.max(wp.max(c0, c1), wp.max(c2, c3))
    return scaled_range(low, high, slope, 1.0 / divisor(wp.length(wp.vec2(least_size(a), least_size(b)))))


@wp.func
def clause_range(code: wp.int32, a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return (smallest value, largest value, slope) of an operation of two such ranges."""
    if code < ADD:
        return unary_range(code, a)
    if code == ADD:
        return a + b
    if code == SUB:
        return wp.vec3(a[0] - b[1], a[1] - b[0], a[2] + b[2])
    if code == MUL:
        return product_range(a, b)
    if code == HYPOT:
        least = wp.length(wp.vec2(least_size(a), least_size(b)))
        most = wp.length(wp.vec2(largest_size(a), largest_size(b)))
        return wp.vec3(least, most, wp.length(wp.vec2(a[2], b[2])))
    if code == MIN:
        return wp.vec3(wp.min(a[0], b[0]), wp.min(a[1], b[1]), wp.max(a[2], b[2]))
    if code == MAX:
        return wp.vec3(wp.max(a[0], b[0]), wp.max(a[1], b[1]), wp.max(a[2], b[2]))
    if code == DIV:
        return product_range(a, unary_range(RECIP, b))
    if code == ATAN2:
        return angle_range(a, b)
    if code == MOD:
        size = largest_size(b)
        turn = wp.floor(a[0] / divisor(size) - STEP_MARGIN)
        if b[2] > 0.0 or turn != wp.floor(a[1] / divisor(size) + STEP_MARGIN):
            return scaled_range(0.0, size, a[2] + b[2], HUGE)
        return wp.vec3(remainder_of(a[0], size), remainder_of(a[1], size), a[2])
    if code == COMPARE:
        low = wp.where(a[0] > b[1], 1.0, wp.where(a[0] == b[1], 0.0, -1.0))
        high = wp.where(a[1] < b[0], -1.0, wp.where(a[1] == b[0], 0.0, 1.0))
        return step_range(low, high, a[2] + b[2])
    if code == POW:
        return power_range(a, b)
    return root_range(a, b)


@wp.func
def part_range(center: wp.vec3, half: wp.vec3, tape: Texels, first: wp.int32, count: wp.int32) -> wp.vec3:
    """Return (smallest v, largest v, largest |∇v|) of the program of a part over the box center ± half."""
    low = Registers()
    high = Registers()
    slope = Registers()
    for axis in range(3):
        low[axis] = center[axis] - half[axis]
        high[axis] = center[axis] + half[axis]
        slope[axis] = 1.0
    out = int(0)
    for i in range(count):
        texel = tape[first + i]
        out = int(texel[0]) >> CODE_BITS
        a = wp.vec3(texel[3], texel[3], 0.0)
        b = wp.vec3(texel[3], texel[3], 0.0)
        j = int(texel[1])
        if j >= 0:
            a = wp.vec3(low[j], high[j], slope[j])
        k = int(texel[2])
        if k >= 0:
            b = wp.vec3(low[k], high[k], slope[k])
        row = clause_range(int(texel[0]) & LOWEST_BITS, a, b)
        margin = STEP_MARGIN * wp.max(wp.abs(row[0]), wp.abs(row[1]))
        low[out] = held(row[0] - margin)
        high[out] = held(row[1] + margin)
        slope[out] = wp.min(row[2] * (1.0 + STEP_MARGIN), HUGE)
    return wp.vec3(low[out], high[out], slope[out])


@wp.func
def product_of_ranges(a: wp.vec2, b: wp.vec2) -> wp.vec2:
    """Return (smallest, largest) of a product."""
    low = wp.min(wp.min(a[0] * b[0], a[0] * b[1]), wp.min(a[1] * b[0], a[1] * b[1]))
    high = wp.max(wp.max(a[0] * b[0], a[0] * b[1]), wp.max(a[1] * b[0], a[1] * b[1]))
    margin = STEP_MARGIN * wp.max(wp.abs(low), wp.abs(high))
    return wp.vec2(held(low - margin), held(high + margin))


@wp.func
def norm_rate(a: wp.vec4, b: wp.vec4) -> wp.vec2:
    """Return the range of ∂h/∂a = a / h, h = √(a² + b²), which rises with a."""
    near = least_size(wp.vec3(b[0], b[1], 0.0))
    far = largest_size(wp.vec3(b[0], b[1], 0.0))
    low = a[0] / divisor(wp.length(wp.vec2(a[0], wp.where(a[0] < 0.0, near, far))))
    high = a[1] / divisor(wp.length(wp.vec2(a[1], wp.where(a[1] < 0.0, far, near))))
    return wp.vec2(low, high)


@wp.func
def unary_rate(code: wp.int32, a: wp.vec3, slope: wp.float32) -> wp.vec2:
    """Return the range of the derivative of an operation over a range; `slope` bounds its size."""
    low = a[0]
    high = a[1]
    near = least_size(a)
    far = largest_size(a)
    if code == COPY:
        return wp.vec2(1.0, 1.0)
    if code == NEG:
        return wp.vec2(-1.0, -1.0)
    if code == SQUARE:
        return wp.vec2(2.0 * low, 2.0 * high)
    if code == ABS:
        return wp.vec2(wp.where(low >= 0.0, 1.0, -1.0), wp.where(high <= 0.0, -1.0, 1.0))
    if code == SQRT:
        return wp.vec2(wp.where(low > 0.0, 0.5 / divisor(wp.sqrt(wp.max(high, 0.0))), 0.0), slope)
    if code == RECIP and near > 0.0:
        return wp.vec2(-slope, held(-1.0 / divisor(far) / divisor(far)))
    if code == EXP and high <= 41.0:
        return wp.vec2(wp.exp(low), slope)
    if code == LN and low >= TINY:
        return wp.vec2(1.0 / high, slope)
    if code == ATAN:
        return wp.vec2(1.0 / (1.0 + far * far), slope)
    if code == SIN:
        row = sine_range(low + 0.5 * HALF_TURN, high + 0.5 * HALF_TURN, 0.0)
        return wp.vec2(row[0], row[1])
    if code == COS:
        row = sine_range(low + HALF_TURN, high + HALF_TURN, 0.0)
        return wp.vec2(row[0], row[1])
    if code == ASIN or code == EXP or code == LN or code == TAN or code >= FLOOR:  # noqa: SIM109
        return wp.vec2(0.0, slope)
    if code == ACOS:
        return wp.vec2(-slope, 0.0)
    return wp.vec2(-slope, slope)


@wp.func
def rate_of_unary(code: wp.int32, a: wp.vec4) -> wp.vec4:
    """Return `clause_along` of an operation of one operand."""
    whole = unary_range(code, wp.vec3(a[0], a[1], 1.0))
    rate = product_of_ranges(unary_rate(code, wp.vec3(a[0], a[1], 0.0), whole[2]), wp.vec2(a[2], a[3]))
    return wp.vec4(whole[0], whole[1], rate[0], rate[1])


@wp.func
def product_along(a: wp.vec4, b: wp.vec4) -> wp.vec4:
    """Return `clause_along` of a product."""
    value = product_of_ranges(wp.vec2(a[0], a[1]), wp.vec2(b[0], b[1]))
    by_a = product_of_ranges(wp.vec2(b[0], b[1]), wp.vec2(a[2], a[3]))
    by_b = product_of_ranges(wp.vec2(a[0], a[1]), wp.vec2(b[2], b[3]))
    return wp.vec4(value[0], value[1], by_a[0] + by_b[0], by_a[1] + by_b[1])


@wp.func
def larger_along(a: wp.vec4, b: wp.vec4) -> wp.vec4:
    """Return `clause_along` of the larger operand."""
    if a[0] > b[1]:
        return a
    if b[0] > a[1]:
        return b
    return wp.vec4(wp.max(a[0], b[0]), wp.max(a[1], b[1]), wp.min(a[2], b[2]), wp.max(a[3], b[3]))


@wp.func
def opposite_along(a: wp.vec4) -> wp.vec4:
    """Return `clause_along` of −a."""
    return wp.vec4(-a[1], -a[0], -a[3], -a[2])


@wp.func
def clause_along(code: wp.int32, a: wp.vec4, b: wp.vec4) -> wp.vec4:
    """Return (smallest value, largest value, least rate, greatest rate) of an operation along a line.

    The rate is the change of a value on the way.
    """
    if code < ADD:
        return rate_of_unary(code, a)
    if code == ADD:
        return a + b
    if code == SUB:
        return a + opposite_along(b)
    if code == MUL:
        return product_along(a, b)
    if code == DIV:
        return product_along(a, rate_of_unary(RECIP, b))
    if code == MAX:
        return larger_along(a, b)
    if code == MIN:
        return opposite_along(larger_along(opposite_along(a), opposite_along(b)))
    steepest_a = wp.max(-a[2], a[3])
    steepest_b = wp.max(-b[2], b[3])
    whole = clause_range(code, wp.vec3(a[0], a[1], steepest_a), wp.vec3(b[0], b[1], steepest_b))
    rate = wp.vec2(-whole[2], whole[2])
    if code == HYPOT:
        by_a = product_of_ranges(norm_rate(a, b), wp.vec2(a[2], a[3]))
        by_b = product_of_ranges(norm_rate(b, a), wp.vec2(b[2], b[3]))
        rate = wp.vec2(by_a[0] + by_b[0], by_a[1] + by_b[1])
    return wp.vec4(whole[0], whole[1], rate[0], rate[1])


@wp.func
def part_along(
    q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, first: wp.int32, count: wp.int32
) -> wp.vec4:
    """Return `clause_along` of the program of a part on the way from q along `direction` up to `reach`."""
    low = Registers()
    high = Registers()
    least = Registers()
    greatest = Registers()
    for axis in range(3):
        way = direction[axis] * reach
        low[axis] = q[axis] + wp.min(way, 0.0)
        high[axis] = q[axis] + wp.max(way, 0.0)
        margin = STEP_MARGIN * wp.max(wp.abs(low[axis]), wp.abs(high[axis]))
        low[axis] -= margin
        high[axis] += margin
        least[axis] = direction[axis]
        greatest[axis] = direction[axis]
    out = int(0)
    for i in range(count):
        texel = tape[first + i]
        out = int(texel[0]) >> CODE_BITS
        a = wp.vec4(texel[3], texel[3], 0.0, 0.0)
        b = wp.vec4(texel[3], texel[3], 0.0, 0.0)
        j = int(texel[1])
        if j >= 0:
            a = wp.vec4(low[j], high[j], least[j], greatest[j])
        k = int(texel[2])
        if k >= 0:
            b = wp.vec4(low[k], high[k], least[k], greatest[k])
        row = clause_along(int(texel[0]) & LOWEST_BITS, a, b)
        margin = STEP_MARGIN * wp.max(wp.abs(row[0]), wp.abs(row[1]))
        low[out] = held(row[0] - margin)
        high[out] = held(row[1] + margin)
        margin = STEP_MARGIN * wp.max(wp.abs(row[2]), wp.abs(row[3]))
        least[out] = held(row[2] - margin)
        greatest[out] = held(row[3] + margin)
    return wp.vec4(low[out], high[out], least[out], greatest[out])


@wp.func
def box_along(x: wp.vec3, direction: wp.vec3, reach: wp.float32, half: wp.vec3) -> wp.vec4:
    """Return (smallest d, largest d, least rate, greatest rate) of a box along a line from x.

    The distance is a convex function on a line: it is largest at an end, and its rate only grows.
    """
    start = box_distance(x, half)
    end = box_distance(x + direction * reach, half)
    speed = wp.length(direction)
    least = wp.dot(wp.vec3(start[1], start[2], start[3]), direction) - STEP_MARGIN * speed
    greatest = wp.dot(wp.vec3(end[1], end[2], end[3]), direction) + STEP_MARGIN * speed
    low = wp.max(start[0] + wp.min(least, 0.0) * reach, end[0] - wp.max(greatest, 0.0) * reach)
    margin = STEP_MARGIN * (wp.length(x) + speed * reach)
    return wp.vec4(low - margin, wp.max(start[0], end[0]) + margin, least, greatest)


@wp.func
def part_value_gradient(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of a part; tape[at] = (program, clauses, offset, mean), then middle and half lengths."""
    head = tape[at]
    middle = tape[at + 1]
    half = tape[at + 2]
    d = part_row(q, tape, int(head[0]), int(head[1]))
    end = box_distance(q - wp.vec3(middle[0], middle[1], middle[2]), wp.vec3(half[0], half[1], half[2]))
    if end[0] > d[0]:
        return relative_distance(end, head[2], head[3])
    return relative_distance(d, head[2], head[3])


@wp.func
def part_distance_at(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.float32:
    """Return u of a part."""
    head = tape[at]
    middle = tape[at + 1]
    half = tape[at + 2]
    d = part_value(q, tape, int(head[0]), int(head[1]))
    end = box_distance(q - wp.vec3(middle[0], middle[1], middle[2]), wp.vec3(half[0], half[1], half[2]))[0]
    return RIM + (wp.max(end, d) - head[2]) * (RIM / head[3])


@wp.func
def part_distance_along(
    q: wp.vec3, direction: wp.vec3, reach: wp.float32, tape: Texels, at: wp.int32
) -> wp.vec4:
    """Return (smallest u, largest u, least du/dt, greatest du/dt) of a part along a line from q."""
    head = tape[at]
    middle = tape[at + 1]
    half = tape[at + 2]
    d = part_along(q, direction, reach, tape, int(head[0]), int(head[1]))
    x = q - wp.vec3(middle[0], middle[1], middle[2])
    d = larger_along(d, box_along(x, direction, reach, wp.vec3(half[0], half[1], half[2])))
    rate = RIM / head[3]
    return wp.vec4(RIM + (d[0] - head[2]) * rate, RIM + (d[1] - head[2]) * rate, d[2] * rate, d[3] * rate)


@wp.func
def part_bounds_in(center: wp.vec3, extent: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return (smallest u, largest u, largest |∇u|) of a part over the box center ± extent."""
    head = tape[at]
    middle = tape[at + 1]
    half = tape[at + 2]
    d = part_range(center, extent, tape, int(head[0]), int(head[1]))
    near = wp.vec3()
    far = wp.vec3()
    for axis in range(3):
        away = wp.abs(center[axis] - middle[axis])
        near[axis] = wp.max(away - extent[axis], 0.0)
        far[axis] = away + extent[axis]
    size = wp.vec3(half[0], half[1], half[2])
    margin = STEP_MARGIN * wp.length(far)
    smallest = box_distance(near, size)[0] - margin
    largest = box_distance(far, size)[0] + margin
    rate = RIM / head[3]
    slope = wp.where(smallest > d[1], 1.0, wp.max(d[2], 1.0))
    low = wp.max(d[0], smallest) - head[2]
    high = wp.max(d[1], largest) - head[2]
    return wp.vec3(RIM + low * rate, RIM + high * rate, slope * rate)


@wp.func
def part_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball."""
    return part_bounds_in(center, wp.vec3(radius, radius, radius), tape, at)


@wp.func
def part_distance_within(center: wp.vec3, extent: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec2:
    """Return (smallest u, largest u) of a part over the box center ± extent."""
    bounds = part_bounds_in(center, extent, tape, at)
    return wp.vec2(bounds[0], bounds[1])


class _ExpressionPart(SharpSolid):
    """A part of an expression within a box."""

    tag = "expression_part"
    in_library = False
    texels_read = 3
    value_gradient = formula(part_value_gradient)
    bounds = formula(part_bounds)
    distance_at = formula(part_distance_at)
    distance_along = formula(part_distance_along)
    distance_within = formula(part_distance_within)
    formula_results = RESULTS | DISTANCES

    program: Annotated[
        tuple[float, ...], Parameter(Quantity.FACTORS, "texels of the clauses, one after the other")
    ]
    center: Vector = par.point("middle of the box")
    size: Vector = par.extents("lengths of the box along x, y and z")

    @property
    def data(self) -> Float64Array:
        """The program."""
        return np.array(self.program)

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of the boxes."""
        return Box.hull(
            {name: np.array([getattr(leaf, name) for leaf in leaves]) for name in ("center", "size")}
        )

    @classmethod
    def packed_fields(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the numbers that the formulas read; the index of the program is filled in later."""
        rows = [
            [0.0, len(leaf.program) / 4.0, leaf.offset, leaf.mean,
             *leaf.center, 0.0, *np.multiply(0.5, leaf.size), 0.0]
            for leaf in leaves
        ]  # fmt: skip
        return np.array(rows, np.float64).reshape(len(rows), 3, 4)


class _Shallowest(Operator):
    """Intersection of operands with negative weights, whose fields are 0 or less: F = max fᵢ."""

    tag = "shallowest"
    like = "intersection"
    monotone = associative = _signed = True
    in_library = False
    slope = formula(extremum_slope)
    keeps = formula(union_keeps)
    partials = formula(union_partials)

    @formula
    def interval(a: wp.vec2, b: wp.vec2) -> wp.vec2:
        """F is monotone in both operands."""
        return wp.max(a, b)


class Expression(Pieces):
    """A solid by an expression in x, y and z, whose value is below 0 inside; it ends at a box.

    A clause is ``name operation operands``, and the last one is the value. Operations are those of libfive
    and Fidget: `var-x`, `var-y`, `var-z`, `const`; `neg`, `abs`, `square`, `sqrt`, `recip`, `sin`, `cos`,
    `tan`, `asin`, `acos`, `atan`, `exp`, `ln`, `floor`, `ceil`, `round`; `add`, `sub`, `mul`, `div`, `min`,
    `max`, `hypot`, `atan2`, `mod`, `compare`, `pow`, `nth-root`. A root or logarithm of a number below 0 is
    that of 0. Widths and offsets are lengths where the value is a distance. A width grows with the shortest
    side of the box.

    Raises
    ------
    InvalidNode
        A clause has an unknown operation or names no earlier clause, or parts between min and max need too
        many values at once.

    Examples
    --------
    >>> from blobtree import Expression
    >>> text = ["x var-x", "y var-y", "r hypot x y", "one const 1", "tube sub r one"]
    >>> tube = Expression(text, (0, 0, 0), (4, 4, 2))
    >>> tube([[1, 0, 0], [0, 0, 1], [0, 0, 0.9]]).astype(float).round(3).tolist()
    [0.5, 0.5, 0.654]
    """

    file_tag = "expression"

    clauses: ClauseTexts
    center: Vector = par.point("middle of the box")
    size: Vector = par.extents("lengths of the box along x, y and z, above 0")

    def __post_init__(self) -> None:
        super().__post_init__()
        if min(self.size) <= 0.0:
            raise InvalidNode(f"size: expected three numbers above 0, got {self.size!r}")
        self.expanded  # noqa: B018  (raises the errors of the clauses)

    @Lazy
    def expanded(self) -> Node:
        """Return the tree of parts."""
        rows = parsed(self.clauses)
        root, found = joints(rows)
        common = _Shallowest if self.signed else Intersection
        keywords = {**self.shared, "mean": MEAN_SHARE * min(self.size)}

        @cache
        def part(value: Any) -> Node:
            try:
                program = tuple(number for texel in part_texels(rows, value) for number in texel)
            except ValueError as error:
                raise InvalidNode(f"clauses: {error}") from None
            return _ExpressionPart(program, self.center, self.size, **keywords)

        nodes: dict[Any, Node] = {}
        for value, joint in found.items():
            operands = [nodes[operand] if operand in nodes else part(operand) for operand in joint.operands]
            nodes[value] = self.united(operands) if joint.operation == "min" else common(tuple(operands))
        return nodes[root] if root in nodes else part(root)
