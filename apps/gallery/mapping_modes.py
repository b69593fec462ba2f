"""Image mappings
==============

A checkerboard on an implicit finger, in the two image mappings: chord (the paper's projection) and
corrected (the default), which unrolls the surface.
"""

from collections.abc import Sequence

from blobtree import Segment
from decals import ImageMapping, Scene, TreeObject
from decals.apps.gallery.helpers import CLAY, Panel, camera_at, checker_image, main, single_decal


def panels() -> Sequence[Panel]:
    """Draw a large checkerboard on an implicit finger, once in each mapping."""
    finger = TreeObject("finger", Segment((-1.2, 0, 0), (0.35, 0, 0), radius=0.5, color=CLAY))
    scene = Scene(
        objects=(finger,),
        camera=camera_at((3.1, -2.0, 2.6), target=(0.2, 0, 0.05)),
        images=(checker_image(10),),
        decals=single_decal((0.62, 0, 0.42), (0.55, 0, 0.83), 0.75, tangent=(0.83, 0, -0.55)),
    )
    return [Panel(scene, mapping=mode) for mode in ImageMapping]


if __name__ == "__main__":
    main(panels)
