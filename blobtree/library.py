"""All kinds of nodes by their names: `blobtree.library.Torus` is `blobtree.Torus`.

They are listed in `library.pyi`, and are loaded at first use.

>>> from blobtree import library
>>> "Torus" in library.__all__, "polygonize" in library.__all__
(True, False)
"""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub("blobtree", __file__)
