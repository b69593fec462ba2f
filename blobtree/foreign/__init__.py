"""Trees of other programs: libfive, Fidget and MPR, Lipschitz Pruning, three-js-blobtree."""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
