"""Figure 3 of the paper: a decal, and the same decal on a sphere."""

from collections.abc import Sequence

from blobtree import Point
from decals.scenes.scene import DecalImage, Scene, TreeObject

from .panels import Panel, decal, main
from .stage import CLAY, looking, plane, straight_down


def panels() -> Sequence[Panel]:
    """Lay one decal on a plane and on an implicit sphere."""
    images = (DecalImage.load("eye"),)
    flat = Scene(
        objects=(plane(),), camera=straight_down(), images=images, decals=decal((0, 0, 0), (0, 0, 1), 0.8)
    )
    ball = TreeObject("ball", Point((0, 0, 0), radius=0.95, color=CLAY))
    round_ = Scene(
        objects=(ball,),
        camera=looking((1.6, 1.2, 4.2), up=(0, 1, 0)),
        images=images,
        decals=decal((0, 0, 0.95), (0, 0, 1), 0.8),
    )
    return Panel(flat), Panel(round_)


if __name__ == "__main__":
    main(panels)
