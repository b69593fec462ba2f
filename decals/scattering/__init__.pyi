from .appearance import ImageChoice
from .copies import on_copies
from .creases import Creases
from .density import PaintedImage, region_mask, vertex_density
from .image_projections import Cylindrical, Planar, Spherical, TextureCoordinates
from .jitter import Jitter
from .orientation import Orientation, gradient_of
from .remesh import remeshed_points
from .seen import seen_from_outside
from .zones import Zone, Zones

__all__ = [
    "Creases",
    "Cylindrical",
    "ImageChoice",
    "Jitter",
    "Orientation",
    "PaintedImage",
    "Planar",
    "Spherical",
    "TextureCoordinates",
    "Zone",
    "Zones",
    "gradient_of",
    "on_copies",
    "region_mask",
    "remeshed_points",
    "seen_from_outside",
    "vertex_density",
]
