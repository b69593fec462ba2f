"""The base class from which a node has all its methods; `Model` has the methods of the core alone."""

from blobtree.nodes.questions import Questions as NodeMethods

__all__ = ["NodeMethods"]
