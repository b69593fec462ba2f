"""The scene of the demo's third picture: one large decal that a mesh and an implicit surface share."""

import numpy as np

from blobtree import Point, Ricci
from decals.model import Decals
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage, MeshObject, Scene, TreeObject

from .shapes import rounded_box

_RADIUS = 0.72
_SAND, _BLUE = (0.80, 0.73, 0.62), (0.42, 0.58, 0.72)


def spanning() -> Scene:
    """Make the scene: a box of triangles, a blob of two points grown into it, and an eye across both.

    The decal belongs to neither; each point of both surfaces asks the same field (the paper's figure 5).
    """
    vertices, faces = rounded_box((-0.85, 0.0, 0.0), half=(1.15, 1.05, 0.95), rounding=0.25)
    box = MeshObject("box", vertices, faces, color=_SAND)
    balls = (
        Point((0.42, 0.0, -0.52), radius=1.50, color=_BLUE),
        Point((1.95, 0.85, -0.50), radius=0.70, color=_BLUE),
    )
    blob = TreeObject("blob", Ricci(balls, exponent=2.0))
    eye = Decals(
        positions=np.array([[0.05, 0.05, 0.95]], np.float32),
        normals=np.array([[0.0, 0.0, 1.0]], np.float32),
        tangents=np.array([[1.0, 0.0, 0.0]], np.float32),
        radii=np.array([_RADIUS], np.float32),
    )
    camera = Camera(position=(1.3, 1.4, 8.2), target=(0.30, 0.10, 0.0), fov=27.0)
    return Scene(objects=(box, blob), camera=camera, decals=eye, images=(DecalImage.load("eye"),))
