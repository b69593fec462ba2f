from .base_color import BaseColor, BaseTexture, Wrap, linear_colors
from .convert import Model, as_surface
from .implicit import ImplicitSurface
from .mesh import MeshSurface
from .mesh_check import MeshCheck, check_mesh
from .mesh_file import read_mesh
from .surface import Surface

__all__ = [
    "BaseColor",
    "BaseTexture",
    "ImplicitSurface",
    "MeshCheck",
    "MeshSurface",
    "Model",
    "Surface",
    "Wrap",
    "as_surface",
    "check_mesh",
    "linear_colors",
    "read_mesh",
]
