"""All built-in kinds: the import of each file fills the registries."""

from blobtree.declare.registry import NODE_KINDS
from blobtree.lazy import if_present
from blobtree.nodes import primitives, tree

with if_present():
    import blobtree.formulas.falloffs
    import blobtree.nodes.blends
    import blobtree.nodes.contact
    import blobtree.nodes.convolution
    import blobtree.nodes.curves
    import blobtree.nodes.deformations
    import blobtree.nodes.expressions
    import blobtree.nodes.fields
    import blobtree.nodes.flats
    import blobtree.nodes.profiles
    import blobtree.nodes.repeats
    import blobtree.nodes.rounds
    import blobtree.nodes.sharp
    import blobtree.nodes.solids
    import blobtree.nodes.sweeps
    import blobtree.nodes.volumes  # noqa: F401

__all__ = ["NODE_KINDS", "primitives", "tree"]
