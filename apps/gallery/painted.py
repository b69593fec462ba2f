"""A painted image says how densely decals lie: small ones where it is white, large ones where it is black."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blobtree import Point, Segment
from decals.coat.seeding import seed
from decals.scenes.scene import DecalImage, Scene, TreeObject
from decals.seeds.painted_image import PaintedImage
from decals.seeds.projections import Planar
from decals.surfaces.implicit import ImplicitSurface

from .panels import Panel, main
from .stage import CLAY, looking, rings

COUNT = 1600
PIXELS = 128


def spiral() -> NDArray[np.float64]:
    """Paint a white spiral on black, ``float64[h, w]``."""
    y, x = np.indices((PIXELS, PIXELS)) / (PIXELS - 1.0) - 0.5
    turns = 2.4 * np.hypot(x, y) - np.arctan2(y, x) / (2.0 * np.pi)
    grey: NDArray[np.float64] = np.clip(0.5 + 3.0 * np.sin(2.0 * np.pi * turns), 0.0, 1.0)
    return grey


def panels() -> Sequence[Panel]:
    """Show the seeds as dots, then the decals."""
    tree = Point((0.0, 0.0, 0.0), radius=1.0, color=CLAY) + Segment(
        (-0.9, -0.7, 0.0), (0.9, -0.7, 0.0), radius=0.4, color=CLAY
    )
    surface = ImplicitSurface(tree)
    density = PaintedImage(spiral(), Planar.over(surface, "z")).density(black=1.0, white=6.0)
    decals = seed(surface, count=COUNT, density=density)
    dots = decals.replace(radii=0.3 * decals.radii)
    return [
        Panel(
            Scene(
                objects=(TreeObject("body", tree),),
                camera=looking((0.0, 0.0, 6.0), target=(0.0, -0.1, 0.0), up=(0.0, 1.0, 0.0)),
                images=images,
                decals=lying,
            )
        )
        for lying, images in ((dots, (rings((60, 60, 70)),)), (decals, (DecalImage.load("scale#7a5fa8"),)))
    ]


if __name__ == "__main__":
    main(panels)
