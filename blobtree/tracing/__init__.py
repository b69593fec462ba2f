"""Rays through sparse cells, with a proven step bound."""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
