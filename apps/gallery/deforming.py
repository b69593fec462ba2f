"""Decals on a surface that deforms: particles are carried along, and a few steps a frame even them out."""

from collections.abc import Sequence

from blobtree import Node, Point, Segment
from decals.coat.laying import lay
from decals.model import Decals
from decals.scenes.scene import DecalImage, Scene, TreeObject
from decals.seeds.relaxation import Relaxation
from decals.surfaces.implicit import ImplicitSurface

from .panels import Panel, main
from .stage import CLAY, looking

COUNT = 260
FRAMES, EVERY = 19, 6
"""Frames of the motion, of which every so much is shown."""

STEPS = 4
"""Steps of relaxation in each frame."""


def body(time: float) -> Node:
    """Make an arm that lifts and grows out of a ball, from time 0 to 1."""
    wrist = (0.55 + 0.75 * time, -0.35 + 1.0 * time, 0.0)
    ball = Point((-0.45, -0.2, 0.0), radius=0.75, color=CLAY)
    return ball + Segment((-0.1, -0.2, 0.0), wrist, radius=0.3, color=CLAY)


def panels() -> Sequence[Panel]:
    """Show the same decals at four times."""
    relaxation = Relaxation([ImplicitSurface(body(0.0))], count=COUNT, seed=3)
    relaxation.run()
    shown = []
    for frame in range(FRAMES):
        tree = body(frame / (FRAMES - 1))
        if frame:
            relaxation.deform([ImplicitSurface(tree)])
            for _ in range(STEPS):
                relaxation.step()
        if frame % EVERY == 0:
            shown.append(_picture(tree, lay(relaxation, direction=(0.3, 1.0, 0.0), images=2)))
    return shown


def _picture(tree: Node, decals: Decals) -> Panel:
    """Show the arm as it is now."""
    scene = Scene(
        objects=(TreeObject("arm", tree),),
        camera=looking((0.2, 0.4, 6.0), target=(0.2, -0.05, 0.0), up=(0.0, 1.0, 0.0)),
        images=tuple(DecalImage.load(name) for name in ("scale#3f7d4c", "scale#8fae4e")),
        decals=decals,
    )
    return Panel(scene)


if __name__ == "__main__":
    main(panels)
