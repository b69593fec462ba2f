"""Surfaces under decals: meshes and implicit surfaces under one protocol, on any device, and their files.

The public names are listed in `__init__.pyi` and are loaded at first use.
"""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
