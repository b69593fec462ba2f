"""Contact modes, from the left: paper (equation 5, repaired), smooth (the strongest push alone), radial."""

from collections.abc import Sequence

import numpy as np

from decals.field.contact import Contact
from decals.model import Decals
from decals.scenes.scene import Scene

from .panels import Panel, main
from .stage import checker, plane, straight_down


def panels() -> Sequence[Panel]:
    """Push seven checkerboards together in every mode."""
    return [Panel(crowd(0.42), contact=mode) for mode in Contact]


def crowd(radius: float) -> Scene:
    """Seven equal decals, six of them around the first."""
    angles = np.arange(6) * np.pi / 3 + 0.2
    around = 0.56 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    positions = np.concatenate([np.zeros((1, 3)), around]).astype(np.float32)
    count = len(positions)
    decals = Decals(
        positions=positions,
        normals=np.tile(np.array([0, 0, 1], np.float32), (count, 1)),
        tangents=np.tile(np.array([1, 0, 0], np.float32), (count, 1)),
        radii=np.full(count, radius, np.float32),
    )
    return Scene(objects=(plane(),), camera=straight_down(), images=(checker(6),), decals=decals)


if __name__ == "__main__":
    main(panels)
