"""All built-in classes of nodes: the import of each file that defines some fills `NODE_KINDS`."""

from blobtree.declare.registry import NODE_KINDS
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
    "fields",
    "flats",
    "primitives",
    "solids",
    "volumes",
]
