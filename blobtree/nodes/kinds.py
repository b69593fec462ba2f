"""All built-in classes of nodes: the import of each file that defines some fills `NODE_KINDS`."""

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
from blobtree.nodes.tree import NODE_KINDS

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
