from . import (
    editing,
    errors,
    experiments,
    field,
    hosts,
    images,
    index,
    pages,
    rendering,
    scattering,
    scenes,
    surfaces,
    vtk,
    window,
)
from ._version import __version__
from .baking.bake import bake
from .baking.displace import displace
from .baking.export import export
from .errors import ImplicitDecalsError
from .field.batch import evaluate_batch
from .field.evaluate import evaluate
from .field.law import define_contact
from .field.mapping import ImageMapping
from .field.rules import ContactLaw
from .hosts.shader import shader
from .identity import content_hash
from .images import load_image
from .model import NO_IMAGE, Decals, Interaction
from .pages.page import save_html
from .record import Contact
from .scattering.relaxation import Relaxation
from .scattering.scatter import scatter
from .scattering.sizing import Sizing
from .scenes.animation import animate, turntable
from .scenes.area_gradient import AreaGradient, area_gradient
from .scenes.camera import Camera
from .scenes.cover import cover
from .scenes.figure import save_figure
from .scenes.files import load_model, load_scene, save_scene
from .scenes.material import DecalMaterial
from .scenes.measure import measure
from .scenes.objects import MeshObject, TreeObject
from .scenes.outlines import LineKind, SurfaceLine, outlines
from .scenes.pose import pose, skin
from .scenes.render import render, render_batch
from .scenes.reproduction import reproduce
from .scenes.scene import DecalImage, Scene
from .scenes.tables import from_table, load_table, save_table, to_arrow, to_pandas
from .vtk import show
from .window import edit

__all__ = [
    "NO_IMAGE",
    "AreaGradient",
    "Camera",
    "Contact",
    "ContactLaw",
    "DecalImage",
    "DecalMaterial",
    "Decals",
    "ImageMapping",
    "ImplicitDecalsError",
    "Interaction",
    "LineKind",
    "MeshObject",
    "Relaxation",
    "Scene",
    "Sizing",
    "SurfaceLine",
    "TreeObject",
    "__version__",
    "animate",
    "area_gradient",
    "bake",
    "content_hash",
    "cover",
    "define_contact",
    "displace",
    "edit",
    "editing",
    "errors",
    "evaluate",
    "evaluate_batch",
    "experiments",
    "export",
    "field",
    "from_table",
    "hosts",
    "images",
    "index",
    "load_image",
    "load_model",
    "load_scene",
    "load_table",
    "measure",
    "outlines",
    "pages",
    "pose",
    "render",
    "render_batch",
    "rendering",
    "reproduce",
    "save_figure",
    "save_html",
    "save_scene",
    "save_table",
    "scatter",
    "scattering",
    "scenes",
    "shader",
    "show",
    "skin",
    "surfaces",
    "to_arrow",
    "to_pandas",
    "turntable",
    "vtk",
    "window",
]
