from .falloff import define_falloff
from .field import CustomField, define_field
from .operator import CustomCombination, define_operator
from .skeleton import CustomPrimitive, define_skeleton
from .warp import CustomWarp, define_warp

__all__ = [
    "CustomCombination",
    "CustomField",
    "CustomPrimitive",
    "CustomWarp",
    "define_falloff",
    "define_field",
    "define_operator",
    "define_skeleton",
    "define_warp",
]
