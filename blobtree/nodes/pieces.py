"""Leaves that stand for several shapes."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from blobtree.formulas.operators import DEEPEST
from blobtree.nodes.node import Node
from blobtree.nodes.operator import Operator
from blobtree.nodes.primitives import PROFILE, Leaf, Profile
from blobtree.nodes.tree import Macro, Union


class Pieces(Profile, Macro, Leaf):
    """A leaf that stands for several, whose field is a falloff of the distance from all of them."""

    def united(self, pieces: Iterable[Node]) -> Node:
        """Return the pieces as one shape: the strongest of their fields at each point."""
        kind = Deepest if self.signed else Union
        return kind(tuple(pieces))

    @property
    def shared(self) -> dict[str, Any]:
        """The keywords of all pieces."""
        return {name: getattr(self, name) for name in (*PROFILE, "color", "attributes")}


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Deepest(Operator):
    """Union of operands with negative weights, F = min fᵢ."""

    operator = DEEPEST
