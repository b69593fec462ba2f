"""One decal on two models
=======================

Figure 5 of the paper: a decal covers a mesh and an implicit surface at once.
"""

from collections.abc import Sequence

from blobtree import Point, Ricci
from decals import DecalImage, MeshObject, Scene, TreeObject
from decals.apps.gallery.helpers import Panel, camera_at, main, single_decal
from decals.apps.models.shapes import rounded_box

SAND, BLUE = (0.80, 0.73, 0.62), (0.42, 0.58, 0.72)


def scene(fov: float = 36.0) -> Scene:
    """Make a box of triangles, a blob of two points that penetrates it, and one decal across both.

    The decal belongs to neither object: each point of both surfaces evaluates the same field.
    """
    vertices, faces = rounded_box((-0.85, 0.0, 0.0), half=(1.15, 1.05, 0.95), rounding=0.25)
    balls = (
        Point((0.42, 0.0, -0.52), radius=1.50, color=BLUE),
        Point((1.95, 0.85, -0.50), radius=0.70, color=BLUE),
    )
    return Scene(
        objects=(
            MeshObject("box", vertices, faces, color=SAND),
            TreeObject("blob", Ricci(balls, exponent=2.0)),
        ),
        camera=camera_at((1.3, 1.4, 8.2), (0.30, 0.10, 0.0), up=(0.0, 1.0, 0.0), fov=fov),
        decals=single_decal((0.05, 0.05, 0.95), (0.0, 0.0, 1.0), 0.72),
        images=(DecalImage.load("eye"),),
    )


def panels() -> Sequence[Panel]:
    """Draw the scene."""
    return (Panel(scene()),)


if __name__ == "__main__":
    main(panels)
