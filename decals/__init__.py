"""Decals as implicit fields: images that touch, push and deform each other on any surface.

Pictures are drawn by `decals.render`. The names here are loaded when they are first asked for, so a part that
needs little, such as `decals.errors`, costs little.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .camera import Camera
    from .choosing import ImageChoice
    from .contact import Contact
    from .cover import cover
    from .creases import Creases
    from .edit import EditSession
    from .editor import DecalEditor
    from .errors import (
        DecalsError,
        InvalidDecals,
        InvalidEdit,
        InvalidImage,
        InvalidMesh,
        InvalidPoints,
        InvalidScene,
        InvalidSeeding,
        NoGraphics,
        TooMuchData,
    )
    from .evaluate import Samples, evaluate
    from .fields import gradient_of
    from .images import BUILTIN_IMAGES, generate_image, load_image
    from .implicit_surface import ImplicitSurface
    from .index import DecalIndex
    from .jitter import Jitter
    from .laying import lay
    from .mapping import Mapping
    from .mesh_file import read_mesh
    from .mesh_surface import MeshSurface
    from .model import Decals, Interaction
    from .orientation import Orientation
    from .painted_image import PaintedImage
    from .projections import Cylindrical, Planar, Spherical, TextureCoordinates
    from .relaxation import Relaxation
    from .remeshing import remeshed_points
    from .scene import DecalImage, MeshObject, Scene, TreeObject, bounds_of
    from .scene_file import load_scene, save_scene
    from .seeding import seed
    from .sizing import Sizing
    from .surface import Surface
    from .vertex_density import vertex_density
    from .vtk import show
    from .window import EditWindow, view

__all__ = [
    "BUILTIN_IMAGES",
    "Camera",
    "Contact",
    "Creases",
    "Cylindrical",
    "DecalEditor",
    "DecalImage",
    "DecalIndex",
    "Decals",
    "DecalsError",
    "EditSession",
    "EditWindow",
    "ImageChoice",
    "ImplicitSurface",
    "Interaction",
    "InvalidDecals",
    "InvalidEdit",
    "InvalidImage",
    "InvalidMesh",
    "InvalidPoints",
    "InvalidScene",
    "InvalidSeeding",
    "Jitter",
    "Mapping",
    "MeshObject",
    "MeshSurface",
    "NoGraphics",
    "Orientation",
    "PaintedImage",
    "Planar",
    "Relaxation",
    "Samples",
    "Scene",
    "Sizing",
    "Spherical",
    "Surface",
    "TextureCoordinates",
    "TooMuchData",
    "TreeObject",
    "bounds_of",
    "cover",
    "evaluate",
    "generate_image",
    "gradient_of",
    "lay",
    "load_image",
    "load_scene",
    "read_mesh",
    "remeshed_points",
    "save_scene",
    "seed",
    "show",
    "vertex_density",
    "view",
]

_HOMES = {
    "camera": ("Camera",),
    "choosing": ("ImageChoice",),
    "contact": ("Contact",),
    "cover": ("cover",),
    "edit": ("EditSession",),
    "creases": ("Creases",),
    "editor": ("DecalEditor",),
    "errors": (
        "DecalsError",
        "InvalidDecals",
        "InvalidEdit",
        "InvalidImage",
        "InvalidMesh",
        "InvalidPoints",
        "InvalidScene",
        "InvalidSeeding",
        "NoGraphics",
        "TooMuchData",
    ),
    "evaluate": ("Samples", "evaluate"),
    "fields": ("gradient_of",),
    "images": ("BUILTIN_IMAGES", "generate_image", "load_image"),
    "implicit_surface": ("ImplicitSurface",),
    "index": ("DecalIndex",),
    "jitter": ("Jitter",),
    "laying": ("lay",),
    "mapping": ("Mapping",),
    "mesh_file": ("read_mesh",),
    "mesh_surface": ("MeshSurface",),
    "model": ("Decals", "Interaction"),
    "orientation": ("Orientation",),
    "painted_image": ("PaintedImage",),
    "projections": ("Cylindrical", "Planar", "Spherical", "TextureCoordinates"),
    "relaxation": ("Relaxation",),
    "remeshing": ("remeshed_points",),
    "scene": ("DecalImage", "MeshObject", "Scene", "TreeObject", "bounds_of"),
    "scene_file": ("load_scene", "save_scene"),
    "seeding": ("seed",),
    "sizing": ("Sizing",),
    "surface": ("Surface",),
    "vertex_density": ("vertex_density",),
    "vtk": ("show",),
    "window": ("EditWindow", "view"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME_OF[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
