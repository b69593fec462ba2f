"""Pictures of scenes through OpenGL.

`render` makes one picture. `Renderer` is the thing to keep where many pictures of a scene are wanted.
"""

from decals.field.contact import Contact
from decals.field.mapping import Mapping
from decals.render.canvas import Buffers
from decals.render.context import Context
from decals.render.drawables import register
from decals.render.mesh import MeshDrawable
from decals.render.renderer import Renderer
from decals.render.resolve import STUDIO, TRANSPARENT, Background
from decals.render.scene_like import SceneLike
from decals.render.shortcuts import render, render_buffers
from decals.render.targets import Size
from decals.render.tree import TreeDrawable
from decals.scenes.scene import MeshObject, TreeObject

register(MeshObject, MeshDrawable, MeshDrawable.ahead)
register(TreeObject, TreeDrawable, TreeDrawable.ahead)

__all__ = [
    "STUDIO",
    "TRANSPARENT",
    "Background",
    "Buffers",
    "Contact",
    "Context",
    "Mapping",
    "Renderer",
    "SceneLike",
    "Size",
    "register",
    "render",
    "render_buffers",
]
