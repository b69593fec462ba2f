"""What decals do to each other: contact (they jostle), overlap (whole, above), independent (whole, below)."""

from collections.abc import Sequence

import numpy as np

from decals.model import Decals, Interaction
from decals.scenes.scene import Scene

from .panels import Panel, decal, main
from .stage import plane, rings, straight_down

COLORS = ((214, 156, 64), (78, 150, 150), (176, 84, 60))


def panels() -> Sequence[Panel]:
    """Lay the same three decals; the middle one contacts, overlaps, or is independent."""
    images = tuple(rings(color) for color in COLORS)
    places = ((-0.5, -0.15, 0), (0, 0.18, 0), (0.5, -0.15, 0))
    three = Decals.concatenate(
        [decal(place, (0, 0, 1), 0.46, image=number) for number, place in enumerate(places)]
    )
    made = []
    for kind in (Interaction.CONTACT, Interaction.OVERLAP, Interaction.INDEPENDENT):
        kinds = np.array([Interaction.CONTACT, kind, Interaction.CONTACT], np.int32)
        decals = three.replace(interactions=kinds)
        made.append(Panel(Scene(objects=(plane(),), camera=straight_down(), images=images, decals=decals)))
    return made


if __name__ == "__main__":
    main(panels)
