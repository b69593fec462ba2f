"""Custom kinds of nodes and falloffs, each defined by one typed function: short forms of classes."""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
