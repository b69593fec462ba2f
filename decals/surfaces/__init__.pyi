from .convert import Model, as_surface
from .implicit import ImplicitSurface
from .mesh import MeshSurface
from .mesh_file import read_mesh
from .surface import Surface

__all__ = [
    "ImplicitSurface",
    "MeshSurface",
    "Model",
    "Surface",
    "as_surface",
    "read_mesh",
]
