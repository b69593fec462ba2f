"""Decals that touch
=================

Figure 8 of the paper: decals that would overlap push each other until they touch. The black rims stay
visible.
"""

from collections.abc import Sequence

import numpy as np

from decals import Contact, Decals, Scene
from decals.apps.gallery.helpers import Panel, camera_above, main, plane, ring_image, single_decal

_GOLD, _TEAL, _RUST = (214, 156, 64), (78, 150, 150), (176, 84, 60)


def panels() -> Sequence[Panel]:
    """Draw two decals, then seven of different sizes."""
    images = tuple(ring_image(color) for color in (_GOLD, _TEAL, _RUST))
    up = (0, 0, 1)
    pair = Decals.concatenate(
        [single_decal((-0.33, 0, 0), up, 0.6), single_decal((0.36, 0.1, 0), up, 0.5, image=1)]
    )
    angles = np.arange(6) * np.pi / 3
    ring = [
        single_decal((0.62 * np.cos(a), 0.62 * np.sin(a), 0), up, 0.32 + 0.05 * (i % 3), image=1 + i % 2)
        for i, a in enumerate(angles)
    ]
    seven = Decals.concatenate([single_decal((0, 0, 0), up, 0.45), *ring])
    return [
        Panel(
            Scene(objects=(plane(),), camera=camera_above(), images=images, decals=group),
            contact=Contact.PRODUCT,
        )
        for group in (pair, seven)
    ]


if __name__ == "__main__":
    main(panels)
