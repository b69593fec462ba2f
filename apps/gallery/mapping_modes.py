"""Mapping modes on an implicit finger: chord (the paper's projection) and normal-corrected (the default)."""

from collections.abc import Sequence

from blobtree import Segment
from decals.field.mapping import Mapping
from decals.scenes.scene import Scene, TreeObject

from .panels import Panel, decal, main
from .stage import CLAY, checker, looking


def panels() -> Sequence[Panel]:
    """Lay a large checkerboard over an implicit finger in each mode."""
    finger = TreeObject("finger", Segment((-1.2, 0, 0), (0.35, 0, 0), radius=0.5, color=CLAY))
    scene = Scene(
        objects=(finger,),
        camera=looking((3.1, -2.0, 2.6), target=(0.2, 0, 0.05)),
        images=(checker(10),),
        decals=decal((0.62, 0, 0.42), (0.55, 0, 0.83), 0.75, tangent=(0.83, 0, -0.55)),
    )
    return [Panel(scene, mapping=mode) for mode in Mapping]


if __name__ == "__main__":
    main(panels)
