"""The field of decals: the owner of a surface point, the draw order, and how neighbours push an image.

The public names are listed in `__init__.pyi` and are loaded at first use.
"""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
