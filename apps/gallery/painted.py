"""Density from an image
=====================

An image projected onto the model sets the density of decals: small decals where it is white, large ones
where it is black.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blobtree import Point, Segment
from decals import DecalImage, Scene, TreeObject, scatter
from decals.apps.gallery.helpers import CLAY, Panel, camera_at, main, ring_image
from decals.scattering import PaintedImage, Planar
from decals.surfaces import ImplicitSurface

COUNT = 1600
EDGE = 128


def spiral() -> NDArray[np.float64]:
    """Paint a white spiral on black, ``float64[h, w]``."""
    y, x = np.indices((EDGE, EDGE)) / (EDGE - 1.0) - 0.5
    turns = 2.4 * np.hypot(x, y) - np.arctan2(y, x) / (2.0 * np.pi)
    grey: NDArray[np.float64] = np.clip(0.5 + 3.0 * np.sin(2.0 * np.pi * turns), 0.0, 1.0)
    return grey


def panels() -> Sequence[Panel]:
    """Draw the particles as dots, then the decals."""
    tree = Point((0.0, 0.0, 0.0), radius=1.0, color=CLAY) + Segment(
        (-0.9, -0.7, 0.0), (0.9, -0.7, 0.0), radius=0.4, color=CLAY
    )
    surface = ImplicitSurface(tree)
    density = PaintedImage(spiral(), Planar.over(surface, "z")).density(black=1.0, white=6.0)
    decals = scatter(surface, count=COUNT, density=density)
    dots = decals.replace(radii=0.3 * decals.radii)
    return [
        Panel(
            Scene(
                objects=(TreeObject("body", tree),),
                camera=camera_at((0.0, 0.0, 6.0), target=(0.0, -0.1, 0.0), up=(0.0, 1.0, 0.0)),
                images=images,
                decals=marks,
            )
        )
        for marks, images in (
            (dots, (ring_image((60, 60, 70)),)),
            (decals, (DecalImage.load("scale#7a5fa8"),)),
        )
    ]


if __name__ == "__main__":
    main(panels)
