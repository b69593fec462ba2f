"""Typed functions that the rows of custom operators share: pruning of operands, and rounding."""

import warp as wp

from blobtree.formulas.operators import KEEP_BOTH, KEEP_LEFT, KEEP_NONE

wp.set_module_options({"enable_backward": False})

ROUNDING = 4e-6
"""Relative widening of a range, for the rounding errors of a user's formula."""


@wp.func
def intersection_like_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Keep nothing where an operand is absent."""
    if a[1] <= 0.0 or b[1] <= 0.0:
        return KEEP_NONE
    return KEEP_BOTH


@wp.func
def difference_like_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Keep nothing where the first operand is absent, and the first alone where the second is."""
    if a[1] <= 0.0:
        return KEEP_NONE
    if b[1] <= 0.0:
        return KEEP_LEFT
    return KEEP_BOTH


@wp.func
def unclaimed_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Keep nothing where both operands are absent, and both elsewhere."""
    if a[1] <= 0.0 and b[1] <= 0.0:
        return KEEP_NONE
    return KEEP_BOTH


@wp.func
def widened_range(smallest: wp.float32, largest: wp.float32) -> wp.vec2:
    """Return a range widened for rounding, never below 0."""
    return wp.vec2(wp.max(smallest - ROUNDING * (1.0 + smallest), 0.0), largest + ROUNDING * (1.0 + largest))
