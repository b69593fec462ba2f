"""Pages: scenes as HTML files that show them in any browser and let their decals be moved."""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
