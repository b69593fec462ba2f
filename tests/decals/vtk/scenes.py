"""Scenes and comparisons for the tests inside VTK."""

from functools import cache

import numpy as np
import pyvista as pv

from blobtree import Point, Segment
from decals import Camera, DecalImage, MeshObject, Scene, TreeObject, scatter
from decals.scenes.objects import as_object
from tests.decals.shapes import torus

TREE = Segment((-0.8, 0, 0), (0.5, 0, 0), radius=0.4, color=(0.8, 0.2, 0.1)) + Point(
    (0.7, 0.3, 0.2), radius=0.45
)


@cache
def both() -> Scene:
    """A BlobTree and a mesh that touch, covered with decals."""
    ring = torus(0.7, 0.3, shift=(0.2, -0.4, -0.4))
    objects = TreeObject("blob", TREE), MeshObject("ring", ring.vertices, ring.faces)
    scene = Scene(objects=objects, camera=Camera((0, 0, 1)), images=(DecalImage.load("scale"),))
    camera = Camera.framing(scene.bounds, direction=(0.4, -0.9, 0.7), up=(0, 0, 1))
    return scene.replace(camera=camera, decals=scatter([item.surface for item in objects], count=120, seed=3))


def mesh_object(name: str, mesh: pv.DataSet) -> MeshObject:
    """Return a dataset as an object of a scene."""
    item = as_object(mesh, name)
    assert isinstance(item, MeshObject)
    return item


def shot(plotter: pv.Plotter) -> np.ndarray:
    """The picture in a plotter's window, ``int[h, w, 3]``."""
    plotter.render()
    return np.asarray(plotter.screenshot(None, return_img=True))[..., :3].astype(int)
