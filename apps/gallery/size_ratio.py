"""Decals of unlike size
=====================

A large decal among small ones, in the contact modes PRODUCT, MIN, RADIAL and ELASTIC.
"""

from collections.abc import Sequence

import numpy as np

from decals import Contact, Scene
from decals.apps.gallery.helpers import Panel, camera_above, checker_image, flat_decals, main, plane


def panels() -> Sequence[Panel]:
    """Put small decals around the rim of a large one, in each contact mode."""
    angles = np.arange(9) * (2 * np.pi / 9)
    around = (
        np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) * (0.45 + 0.04 * np.arange(9))[:, None]
    )
    radii = [0.85, *(0.10 + 0.012 * np.arange(9))]
    decals = flat_decals(np.concatenate([np.zeros((1, 3)), around]), radii)
    scene = Scene(objects=(plane(),), camera=camera_above(), images=(checker_image(10),), decals=decals)
    return [Panel(scene, contact=mode) for mode in Contact]


if __name__ == "__main__":
    main(panels)
