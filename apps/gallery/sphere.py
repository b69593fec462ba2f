"""A decal on a plane and on a sphere
==================================

Figure 3 of the paper: one image on a flat surface, and on an implicit sphere.
"""

from collections.abc import Sequence

from blobtree import Point
from decals import DecalImage, Scene, TreeObject
from decals.apps.gallery.helpers import CLAY, Panel, camera_above, camera_at, main, plane, single_decal


def panels() -> Sequence[Panel]:
    """Put one decal on a plane and on an implicit sphere."""
    images = (DecalImage.load("eye"),)
    flat = Scene(
        objects=(plane(),),
        camera=camera_above(),
        images=images,
        decals=single_decal((0, 0, 0), (0, 0, 1), 0.8),
    )
    ball = TreeObject("ball", Point((0, 0, 0), radius=0.95, color=CLAY))
    curved = Scene(
        objects=(ball,),
        camera=camera_at((1.6, 1.2, 4.2), up=(0, 1, 0)),
        images=images,
        decals=single_decal((0, 0, 0.95), (0, 0, 1), 0.8),
    )
    return Panel(flat), Panel(curved)


if __name__ == "__main__":
    main(panels)
