"""Layers, tints and opacity: tiles below, translucent plain decals in the middle, rivets on top."""

from collections.abc import Sequence

import numpy as np

from decals.model import PLAIN, Decals, Interaction
from decals.scenes.scene import DecalImage, Scene

from .panels import Panel, main
from .stage import plane, straight_down


def panels() -> Sequence[Panel]:
    """Lay three layers over each other."""
    below = _lattice(6, 0.36, z_turn=0.0)
    middle = _lattice(2, 1.0, z_turn=0.4).replace(
        radii=np.full(4, 0.46, np.float32),
        images=np.full(4, PLAIN, np.int32),
        layers=np.full(4, 1, np.int32),
        tints=np.array([[0.8, 0.2, 0.15], [0.2, 0.5, 0.8], [0.9, 0.75, 0.2], [0.3, 0.65, 0.3]], np.float32),
        opacities=np.array([0.4, 0.6, 0.8, 1.0], np.float32),
    )
    top = _lattice(3, 0.62, z_turn=0.0).replace(
        radii=np.full(9, 0.1, np.float32),
        images=np.ones(9, np.int32),
        layers=np.full(9, 2, np.int32),
        interactions=np.full(9, Interaction.OVERLAP, np.int32),
    )
    scene = Scene(
        objects=(plane(),),
        camera=straight_down(),
        images=(DecalImage.load("tile#d9d2c2"), DecalImage.load("rivet")),
        decals=Decals.concatenate([below, middle, top]),
    )
    return (Panel(scene),)


def _lattice(side: int, step: float, *, z_turn: float) -> Decals:
    """Decals on a square lattice."""
    line = (np.arange(side) - (side - 1) / 2) * step
    x, y = (part.reshape(-1) for part in np.meshgrid(line, line, indexing="xy"))
    count = side * side
    return Decals(
        positions=np.column_stack([x, y, np.zeros(count)]).astype(np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (count, 1)),
        tangents=np.tile(np.array([np.cos(z_turn), np.sin(z_turn), 0], np.float32), (count, 1)),
        radii=np.full(count, 0.72 * step, np.float32),
    )


if __name__ == "__main__":
    main(panels)
