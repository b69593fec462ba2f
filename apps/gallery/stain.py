"""A stain on four objects
=======================

Figure 5 of the paper: one decal covers a box, a pipe, a ball and the ground. It belongs to none of them.
"""

from collections.abc import Sequence

from blobtree import Point, Segment
from decals import DecalImage, MeshObject, Scene, TreeObject
from decals.apps.gallery.helpers import Panel, camera_at, main, plane, single_decal
from decals.apps.models.shapes import rounded_box

SAND, BLUE, GREEN = (0.80, 0.73, 0.62), (0.42, 0.58, 0.72), (0.55, 0.62, 0.44)


def panels() -> Sequence[Panel]:
    """Throw a spatter at the place where three objects stand together."""
    vertices, faces = rounded_box((-0.55, 0.25, 0.35), half=(0.45, 0.45, 0.35), rounding=0.06)
    scene = Scene(
        objects=(
            plane(1.6),
            MeshObject("box", vertices, faces, color=SAND),
            TreeObject("ball", Point((0.55, 0.2, 0.42), radius=0.42, color=BLUE)),
            TreeObject("pipe", Segment((-0.9, -0.55, 0.16), (1.0, -0.35, 0.16), radius=0.16, color=GREEN)),
        ),
        camera=camera_at((0.35, -4.1, 3.3), (0.0, 0.0, 0.25), fov=27.0),
        images=(DecalImage.load("spatter"),),
        decals=single_decal((-0.1, -0.2, 0.32), (0.0, -0.5, 0.87), 0.9),
    )
    return (Panel(scene),)


if __name__ == "__main__":
    main(panels)
