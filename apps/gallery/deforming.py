"""A surface that deforms
======================

Particles move with a deforming surface, and a few relaxation steps per frame keep their distances even.
"""

from collections.abc import Sequence

from blobtree import Node, Point, Segment
from decals import DecalImage, Decals, Relaxation, Scene, TreeObject
from decals.apps.gallery.helpers import CLAY, Panel, camera_at, main
from decals.surfaces import ImplicitSurface

COUNT = 260
FRAMES, INTERVAL = 19, 6
"""Frames of the motion, and the interval of those that are drawn."""

STEPS = 4
"""Relaxation steps in each frame."""


def body(time: float) -> Node:
    """Return the model at a time from 0 to 1: a ball with an arm that lifts and grows."""
    wrist = (0.55 + 0.75 * time, -0.35 + 1.0 * time, 0.0)
    ball = Point((-0.45, -0.2, 0.0), radius=0.75, color=CLAY)
    return ball + Segment((-0.1, -0.2, 0.0), wrist, radius=0.3, color=CLAY)


def panels() -> Sequence[Panel]:
    """Draw the same decals at four times."""
    relaxation = Relaxation([ImplicitSurface(body(0.0))], count=COUNT, seed=3)
    relaxation.run()
    drawn = []
    for frame in range(FRAMES):
        tree = body(frame / (FRAMES - 1))
        if frame:
            relaxation.deform([ImplicitSurface(tree)])
            for _ in range(STEPS):
                relaxation.step()
        if frame % INTERVAL == 0:
            drawn.append(_panel(tree, relaxation.to_decals(direction=(0.3, 1.0, 0.0), images=2)))
    return drawn


def _panel(tree: Node, decals: Decals) -> Panel:
    """Return the scene of one frame."""
    scene = Scene(
        objects=(TreeObject("arm", tree),),
        camera=camera_at((0.2, 0.4, 6.0), target=(0.2, -0.05, 0.0), up=(0.0, 1.0, 0.0)),
        images=tuple(DecalImage.load(name) for name in ("scale#3f7d4c", "scale#8fae4e")),
        decals=decals,
    )
    return Panel(scene)


if __name__ == "__main__":
    main(panels)
