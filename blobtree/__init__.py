"""Skeletal implicit modelling: trees of primitives whose fields blend, evaluated through Warp.

The pipeline: tree → program → tape → value, gradient, colour → rays (`tracing`) and triangles (`meshing`).
The public names are listed in `__init__.pyi` and are loaded at first use, so `import blobtree` is cheap.
"""

import warnings
from importlib import import_module
from typing import Any

from blobtree.declare.registry import register_kinds
from blobtree.lazy import attach_stub

_load, __dir__, __all__ = attach_stub(__name__, __file__)

_MOVED = {
    "custom": """
        CustomCombination CustomField CustomPrimitive CustomWarp define_falloff define_field define_operator
        define_skeleton define_warp
        """,
    "errors": """
        Cancelled InvalidDefinition InvalidDevice InvalidFile InvalidNode InvalidPoints InvalidResolution
        MissingFile MissingPackage NoGraphics UnknownKind UntranslatableFunction UnusableCache UnusableFile
        """,
    "sampling": "FieldGrid SignedDistances",
    "tracing": "BatchHits Hits",
}
"""Names that stood here in former versions, by the modules in which they stand now."""


def __getattr__(name: str) -> Any:
    for part, names in _MOVED.items():
        if name in names.split():
            module = f"{__name__}.{part}"
            warnings.warn(f"blobtree.{name} is now {module}.{name}", DeprecationWarning, stacklevel=2)
            return getattr(import_module(module), name)
    return _load(name)


register_kinds(
    lambda: [import_module("blobtree.nodes.primitives"), import_module("blobtree.nodes.tree")],
    lambda: import_module("blobtree.nodes.kinds"),
)
