from .base_color import BaseColor, BaseTexture, Wrap, linear_colors
from .convert import Model, as_surface
from .implicit import ImplicitSurface
from .mesh import MeshSurface
from .mesh_file import read_mesh
from .surface import Surface

__all__ = [
    "BaseColor",
    "BaseTexture",
    "ImplicitSurface",
    "MeshSurface",
    "Model",
    "Surface",
    "Wrap",
    "as_surface",
    "linear_colors",
    "read_mesh",
]
