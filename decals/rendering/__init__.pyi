from .context import Context
from .drawable import Drawable, register
from .environment import Environment
from .lights import Light, Lighting
from .options import STUDIO, TRANSPARENT, Background, Drawing, RenderOptions, SceneLike, Size
from .picture import Buffers, Picture
from .renderer import Renderer
from .viewpoint import Projection, Viewpoint

__all__ = [
    "STUDIO",
    "TRANSPARENT",
    "Background",
    "Buffers",
    "Context",
    "Drawable",
    "Drawing",
    "Environment",
    "Light",
    "Lighting",
    "Picture",
    "Projection",
    "RenderOptions",
    "Renderer",
    "SceneLike",
    "Size",
    "Viewpoint",
    "register",
]
