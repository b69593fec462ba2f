"""Layers, tints and opacity
=========================

Tiles in the lowest layer, translucent plain decals in the middle, rivets on top.
"""

from collections.abc import Sequence

import numpy as np

from decals import NO_IMAGE, DecalImage, Decals, Interaction, Scene
from decals.apps.gallery.helpers import Panel, camera_above, flat_decals, main, plane


def panels() -> Sequence[Panel]:
    """Combine the decals of three layers."""
    below = _lattice(6, 0.36, angle=0.0)
    middle = _lattice(2, 1.0, angle=0.4).replace(
        radii=np.full(4, 0.46, np.float32),
        images=np.full(4, NO_IMAGE, np.int32),
        layers=np.full(4, 1, np.int32),
        tints=np.array([[0.8, 0.2, 0.15], [0.2, 0.5, 0.8], [0.9, 0.75, 0.2], [0.3, 0.65, 0.3]], np.float32),
        opacities=np.array([0.4, 0.6, 0.8, 1.0], np.float32),
    )
    top = _lattice(3, 0.62, angle=0.0).replace(
        radii=np.full(9, 0.1, np.float32),
        images=np.ones(9, np.int32),
        layers=np.full(9, 2, np.int32),
        interactions=np.full(9, Interaction.OVERLAP, np.int32),
    )
    scene = Scene(
        objects=(plane(),),
        camera=camera_above(),
        images=(DecalImage.load("tile#d9d2c2"), DecalImage.load("rivet")),
        decals=Decals.concatenate([below, middle, top]),
    )
    return (Panel(scene),)


def _lattice(side: int, step: float, *, angle: float) -> Decals:
    """Return decals on a square lattice, their images turned by an angle."""
    coordinates = (np.arange(side) - (side - 1) / 2) * step
    x, y = (part.reshape(-1) for part in np.meshgrid(coordinates, coordinates, indexing="xy"))
    positions = np.column_stack([x, y, np.zeros(side * side)])
    return flat_decals(positions, 0.72 * step, tangent=(np.cos(angle), np.sin(angle), 0))


if __name__ == "__main__":
    main(panels)
