"""All built-in kinds, and the bases of users' kinds: the import of each file fills the registries."""

from typing import Any

from blobtree.declare.registry import NODE_KINDS
from blobtree.lazy import if_present
from blobtree.nodes import primitives, tree
from blobtree.nodes.operator import Operator

BASES: dict[str, type[Any]] = {"custom_operator": Operator, "own operator": Operator}
"""Bases of users' kinds by their tags in files, those of older files too."""

with if_present():
    import blobtree.formulas.falloffs
    import blobtree.nodes.blends
    import blobtree.nodes.contact
    import blobtree.nodes.convolution
    import blobtree.nodes.curves
    import blobtree.nodes.deformations
    import blobtree.nodes.fields
    import blobtree.nodes.flats
    import blobtree.nodes.solids
    import blobtree.nodes.volumes  # noqa: F401
with if_present():
    from blobtree.nodes.fields import BoxedField, FieldPrimitive

    BASES |= {"custom_field": BoxedField, "custom_free_field": FieldPrimitive}

__all__ = ["BASES", "NODE_KINDS", "primitives", "tree"]
