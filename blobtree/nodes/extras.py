"""What extends a node: the base from which it has its methods; those of the core alone are in `Model`."""

from blobtree.nodes.questions import Questions as NodeMethods

__all__ = ["NodeMethods"]
