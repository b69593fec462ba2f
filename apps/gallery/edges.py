"""Figure 4 of the paper: one decal over sharp edges, over a hole in the geometry, and over bumps."""

from collections.abc import Sequence

from decals.scenes.scene import MeshObject, Scene

from .panels import Panel, decal, main
from .stage import CLAY, box, bumps, checker, looking, plate


def panels() -> Sequence[Panel]:
    """Lay the same checkerboard on a cube's corner, a plate with a hole, and rolling bumps."""
    third = 3**-0.5
    corner = Scene(
        objects=(MeshObject("cube", *box(), color=CLAY),),
        camera=looking((3.0, 2.6, 2.4)),
        images=(checker(),),
        decals=decal((0.66, 0.66, 0.66), (third, third, third), 0.75, tangent=(-1, 1, 0)),
    )
    above = looking((1.2, -2.8, 3.2))
    hole = Scene(
        objects=(MeshObject("plate", *plate(), color=CLAY),),
        camera=above,
        images=(checker(),),
        decals=decal((0, 0, 0.15), (0, 0, 1), 0.8),
    )
    rolling = Scene(
        objects=(MeshObject("bumps", *bumps(), color=CLAY),),
        camera=above,
        images=(checker(),),
        decals=decal((0, 0, 0.12), (0, 0, 1), 0.8),
    )
    return Panel(corner), Panel(hole), Panel(rolling)


if __name__ == "__main__":
    main(panels)
