"""The falloff of the core, which primitives have unless they name another."""

import warp as wp

from blobtree.declare.falloff import Falloff
from blobtree.declare.formula import formula
from blobtree.formulas.falloff import RIM, STEEPEST_DISTANCE, STEEPEST_SLOPE, falloff, falloff_steepness

wp.set_module_options({"enable_backward": False})


class Wyvill(Falloff):
    """(1 − d²)³ (eq. 2 of the Implicit Decals paper); kernels of trees with this one alone take d²."""

    numbers = RIM, STEEPEST_DISTANCE, STEEPEST_SLOPE

    @formula
    def value(distance: wp.float32) -> wp.float32:
        """Return g(d) = (1 − d²)³, 0 ≤ d ≤ 1."""
        return falloff(distance * distance)

    @formula
    def slope(distance: wp.float32) -> wp.float32:
        """Return g'(d) = −6 d (1 − d²)²."""
        return -falloff_steepness(distance)


WYVILL = Wyvill()

FALLOFFS: tuple[Falloff, ...] = (WYVILL,)
"""The falloffs of the core; the index of one here is its code on the tape."""
