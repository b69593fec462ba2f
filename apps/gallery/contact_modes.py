"""Contact modes
=============

From the left: PRODUCT (equation 5 of the paper, repaired), MIN (only the strongest push counts), RADIAL
(scales rays) and ELASTIC (compresses them at the contact line; both never fold).
"""

from collections.abc import Sequence

import numpy as np

from decals import Contact, Scene
from decals.apps.gallery.helpers import Panel, camera_above, checker_image, flat_decals, main, plane


def panels() -> Sequence[Panel]:
    """Draw seven checkerboards that push each other, once in each mode."""
    return [Panel(cluster(0.42), contact=mode) for mode in Contact]


def cluster(radius: float) -> Scene:
    """Make seven equal decals, six of them around the first."""
    angles = np.arange(6) * np.pi / 3 + 0.2
    around = 0.56 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    decals = flat_decals(np.concatenate([np.zeros((1, 3)), around]), radius)
    return Scene(objects=(plane(),), camera=camera_above(), images=(checker_image(6),), decals=decals)


if __name__ == "__main__":
    main(panels)
