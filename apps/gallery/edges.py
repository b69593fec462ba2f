"""Edges, holes and bumps
======================

Figure 4 of the paper: one decal over the corner of a cube, over a hole in a plate, and over rolling
bumps.
"""

from collections.abc import Sequence

from decals import MeshObject, Scene
from decals.apps.gallery.helpers import (
    CLAY,
    Panel,
    bumps,
    camera_at,
    checker_image,
    cube,
    main,
    plate,
    single_decal,
)


def panels() -> Sequence[Panel]:
    """Put the same checkerboard on the corner of a cube, a plate with a hole, and rolling bumps."""
    third = 3**-0.5
    corner = Scene(
        objects=(MeshObject("cube", *cube(), color=CLAY),),
        camera=camera_at((3.0, 2.6, 2.4)),
        images=(checker_image(),),
        decals=single_decal((0.8, 0.8, 0.8), (third, third, third), 0.75, tangent=(-1, 1, 0)),
    )
    above = camera_at((1.2, -2.8, 3.2))
    hole = Scene(
        objects=(MeshObject("plate", *plate(), color=CLAY),),
        camera=above,
        images=(checker_image(),),
        decals=single_decal((0, 0, 0.15), (0, 0, 1), 0.8),
    )
    rolling = Scene(
        objects=(MeshObject("bumps", *bumps(), color=CLAY),),
        camera=above,
        images=(checker_image(),),
        decals=single_decal((0, 0, 0.12), (0, 0, 1), 0.8),
    )
    return Panel(corner), Panel(hole), Panel(rolling)


if __name__ == "__main__":
    main(panels)
