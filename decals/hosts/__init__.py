"""Decals for other programs: as a shader, with its textures and uniforms."""

from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
