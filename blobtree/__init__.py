"""Skeletal implicit modelling: trees of primitives whose fields blend, evaluated through Warp.

The pipeline: tree → program → tape → value, gradient, colour → rays (`tracing`) and triangles (`meshing`).
The public names are listed in `__init__.pyi` and are loaded at first use, so `import blobtree` is cheap.
"""

from importlib import import_module

from blobtree.declare.registry import register_kinds
from blobtree.lazy import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)

register_kinds(
    lambda: [import_module("blobtree.nodes.primitives"), import_module("blobtree.nodes.tree")],
    lambda: import_module("blobtree.nodes.kinds"),
)
