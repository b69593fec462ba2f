"""Decals as implicit fields: images that touch, push and deform each other on any surface.

Pictures are drawn by `decals.render`. The names here are loaded when they are first asked for, so a part that
needs little, such as `decals.errors`, costs little.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .coat.choosing import ImageChoice
    from .coat.fields import gradient_of
    from .coat.jitter import Jitter
    from .coat.laying import lay
    from .coat.orientation import Orientation
    from .coat.seeding import seed
    from .coat.sizing import Sizing
    from .edit import EditSession
    from .errors import (
        DecalsError,
        InvalidDecals,
        InvalidDevice,
        InvalidEdit,
        InvalidImage,
        InvalidMesh,
        InvalidPoints,
        InvalidScene,
        InvalidSeeding,
        NoGraphics,
        TooMuchData,
    )
    from .field.contact import Contact
    from .field.evaluate import Samples, evaluate
    from .field.mapping import Mapping
    from .grid.editor import DecalEditor
    from .grid.index import DecalIndex
    from .images import BUILTIN_IMAGES, generate_image, load_image
    from .model import Decals, Interaction
    from .scenes.camera import Camera
    from .scenes.cover import cover
    from .scenes.mesh_file import read_mesh
    from .scenes.scene import DecalImage, MeshObject, Scene, TreeObject, bounds_of
    from .scenes.scene_file import load_scene, save_scene
    from .seeds.creases import Creases
    from .seeds.painted_image import PaintedImage
    from .seeds.projections import Cylindrical, Planar, Spherical, TextureCoordinates
    from .seeds.relaxation import Relaxation
    from .seeds.remeshing import remeshed_points
    from .seeds.vertex_density import region_mask, vertex_density
    from .surfaces.implicit import ImplicitSurface
    from .surfaces.mesh import MeshSurface
    from .surfaces.surface import Surface
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
    "InvalidDevice",
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
    "region_mask",
    "remeshed_points",
    "save_scene",
    "seed",
    "show",
    "vertex_density",
    "view",
]

_HOMES = {
    "scenes.camera": ("Camera",),
    "coat.choosing": ("ImageChoice",),
    "field.contact": ("Contact",),
    "scenes.cover": ("cover",),
    "edit": ("EditSession",),
    "seeds.creases": ("Creases",),
    "grid.editor": ("DecalEditor",),
    "errors": (
        "DecalsError",
        "InvalidDecals",
        "InvalidDevice",
        "InvalidEdit",
        "InvalidImage",
        "InvalidMesh",
        "InvalidPoints",
        "InvalidScene",
        "InvalidSeeding",
        "NoGraphics",
        "TooMuchData",
    ),
    "field.evaluate": ("Samples", "evaluate"),
    "coat.fields": ("gradient_of",),
    "images": ("BUILTIN_IMAGES", "generate_image", "load_image"),
    "surfaces.implicit": ("ImplicitSurface",),
    "grid.index": ("DecalIndex",),
    "coat.jitter": ("Jitter",),
    "coat.laying": ("lay",),
    "field.mapping": ("Mapping",),
    "scenes.mesh_file": ("read_mesh",),
    "surfaces.mesh": ("MeshSurface",),
    "model": ("Decals", "Interaction"),
    "coat.orientation": ("Orientation",),
    "seeds.painted_image": ("PaintedImage",),
    "seeds.projections": ("Cylindrical", "Planar", "Spherical", "TextureCoordinates"),
    "seeds.relaxation": ("Relaxation",),
    "seeds.remeshing": ("remeshed_points",),
    "scenes.scene": ("DecalImage", "MeshObject", "Scene", "TreeObject", "bounds_of"),
    "scenes.scene_file": ("load_scene", "save_scene"),
    "coat.seeding": ("seed",),
    "coat.sizing": ("Sizing",),
    "surfaces.surface": ("Surface",),
    "seeds.vertex_density": ("region_mask", "vertex_density"),
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
