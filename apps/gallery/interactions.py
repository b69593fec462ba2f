"""Interactions
============

The three interactions of a decal: PUSH (neighbours deform each other), OVERLAP (whole, above its
neighbours) and INDEPENDENT (whole, below its neighbours).
"""

from collections.abc import Sequence

import numpy as np

from decals import Decals, Interaction, Scene
from decals.apps.gallery.helpers import Panel, camera_above, main, plane, ring_image, single_decal

COLORS = ((214, 156, 64), (78, 150, 150), (176, 84, 60))


def panels() -> Sequence[Panel]:
    """Draw three decals, the middle one in each of the interactions."""
    images = tuple(ring_image(color) for color in COLORS)
    positions = ((-0.5, -0.15, 0), (0, 0.18, 0), (0.5, -0.15, 0))
    three = Decals.concatenate(
        [single_decal(position, (0, 0, 1), 0.46, image=number) for number, position in enumerate(positions)]
    )
    panels = []
    for interaction in (Interaction.PUSH, Interaction.OVERLAP, Interaction.INDEPENDENT):
        interactions = np.array([Interaction.PUSH, interaction, Interaction.PUSH], np.int32)
        decals = three.replace(interactions=interactions)
        panels.append(Panel(Scene(objects=(plane(),), camera=camera_above(), images=images, decals=decals)))
    return panels


if __name__ == "__main__":
    main(panels)
