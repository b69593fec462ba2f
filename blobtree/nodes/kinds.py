"""All built-in kinds: the import of each file that defines some fills the registries."""

from blobtree.declare.registry import NODE_KINDS
from blobtree.formulas import falloffs
from blobtree.nodes import (
    blends,
    contact,
    convolution,
    curves,
    deformations,
    fields,
    flats,
    primitives,
    solids,
    volumes,
)

__all__ = [
    "NODE_KINDS",
    "blends",
    "contact",
    "convolution",
    "curves",
    "deformations",
    "falloffs",
    "fields",
    "flats",
    "primitives",
    "solids",
    "volumes",
]
