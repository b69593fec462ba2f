"""Image mappings
==============

A checkerboard on an implicit finger: chord (the paper's projection) and corrected (the default), which
unrolls the surface. The same over the corner of a cube (compare figure 4): corrected, and walked, the log map
of the surface. Walked around the corner itself and around the tip of a cone, where the image has a cut below.
"""

from collections.abc import Sequence
from dataclasses import replace

import pyvista as pv

from blobtree import Segment
from decals import ImageMapping, MeshObject, Scene, TreeObject
from decals.apps.gallery.helpers import CLAY, Panel, camera_at, checker_image, main, single_decal


def panels() -> Sequence[Panel]:
    """Draw a large checkerboard on a finger and over a corner, in two mappings each, and around two tips."""
    finger = TreeObject("finger", Segment((-1.2, 0, 0), (0.35, 0, 0), radius=0.5, color=CLAY))
    round_scene = Scene(
        objects=(finger,),
        camera=camera_at((3.1, -2.0, 2.6), target=(0.2, 0, 0.05)),
        images=(checker_image(10),),
        decals=single_decal((0.62, 0, 0.42), (0.55, 0, 0.83), 0.75, tangent=(0.83, 0, -0.55)),
    )
    block = pv.Cube().triangulate()
    cube = MeshObject("cube", block.points, block.regular_faces, color=CLAY)
    sharp_scene = Scene(
        objects=(cube,),
        camera=camera_at((2.0, 1.7, 1.8), target=(0.1, 0.1, 0.1)),
        images=(checker_image(10),),
        decals=single_decal((0.3, 0.3, 0.5), (0, 0, 1), 0.6),
    )
    around_corner = replace(
        sharp_scene, decals=single_decal((0.5, 0.5, 0.5), (1, 1, 1), 0.7, tangent=(-1, 1, 0))
    )
    peak = pv.Cone(direction=(0, 0, 1), height=1.0, radius=0.8, resolution=96).triangulate().clean()
    cone = MeshObject("cone", peak.points, peak.regular_faces, color=CLAY)
    around_tip = replace(
        sharp_scene, objects=(cone,), decals=single_decal((0, 0, 0.5), (0, 0, 1), 0.8, tangent=(-1, 1, 0))
    )
    return [
        Panel(round_scene, mapping=ImageMapping.CHORD),
        Panel(round_scene),
        Panel(sharp_scene),
        *(Panel(scene, mapping=ImageMapping.WALKED) for scene in (sharp_scene, around_corner, around_tip)),
    ]


if __name__ == "__main__":
    main(panels)
