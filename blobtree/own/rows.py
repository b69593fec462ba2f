"""Typed functions that the rows of own operators share: which operands a cell may forget, and rounding."""

import warp as wp

from blobtree.formulas.operators import KEEP_BOTH, KEEP_LEFT, KEEP_NONE

wp.set_module_options({"enable_backward": False})

ROUNDING = 4e-6
"""By how much, relative to itself, a range is widened for what rounding does to a user's formula."""


@wp.func
def intersection_like_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Nothing is left where an operand is absent."""
    if a[1] <= 0.0 or b[1] <= 0.0:
        return KEEP_NONE
    return KEEP_BOTH


@wp.func
def difference_like_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Nothing is left where the first operand is absent, and it alone where the second is."""
    if a[1] <= 0.0:
        return KEEP_NONE
    if b[1] <= 0.0:
        return KEEP_LEFT
    return KEEP_BOTH


@wp.func
def unclaimed_choice(a: wp.vec2, b: wp.vec2) -> wp.int32:
    """Nothing is known but that two absent operands make nothing."""
    if a[1] <= 0.0 and b[1] <= 0.0:
        return KEEP_NONE
    return KEEP_BOTH


@wp.func
def widened_range(smallest: wp.float32, largest: wp.float32) -> wp.vec2:
    """A range with room for rounding, never below 0."""
    return wp.vec2(wp.max(smallest - ROUNDING * (1.0 + smallest), 0.0), largest + ROUNDING * (1.0 + largest))
