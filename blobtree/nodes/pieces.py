"""Leaves that stand for several shapes."""

from collections.abc import Iterable
from typing import Any

import warp as wp

from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_RIGHT
from blobtree.declare.formula import formula
from blobtree.nodes.node import Node
from blobtree.nodes.operator import Operator
from blobtree.nodes.primitives import PROFILE, Leaf, Profile
from blobtree.nodes.tree import (
    Macro,
    Union,
    extremum_slope,
    intersection_interval,
    intersection_partials,
)

wp.set_module_options({"enable_backward": False})


class Pieces(Profile, Macro, Leaf):
    """A leaf that stands for several, whose field is a falloff of the distance from all of them."""

    def united(self, pieces: Iterable[Node]) -> Node:
        """Return the pieces as one shape: the strongest of their fields at each point."""
        kind = _Deepest if self.signed else Union
        return kind(tuple(pieces))

    @property
    def shared(self) -> dict[str, Any]:
        """The keywords of all pieces."""
        return shared_of(self)


def shared_of(leaf: Leaf) -> dict[str, Any]:
    """Return the keywords that all leaves have, by name."""
    return {name: getattr(leaf, name) for name in (*PROFILE, "color", "attributes")}


class _Deepest(Operator):
    """Union of operands with negative weights, whose fields are 0 or less: F = min fᵢ."""

    tag = "deepest"
    like = "blend"
    monotone = associative = _signed = True
    slope = formula(extremum_slope)
    interval = formula(intersection_interval)

    @formula
    def partials(a: wp.float32, b: wp.float32) -> wp.vec3:
        """F = min(a, b)."""
        return intersection_partials(a, b)

    @formula
    def keeps(a: wp.vec2, b: wp.vec2) -> wp.int32:
        """Return the dependence of a minimum: on one operand where that one is always the smaller."""
        if a[1] <= b[0]:
            return KEEP_LEFT
        if b[1] <= a[0]:
            return KEEP_RIGHT
        return KEEP_BOTH
