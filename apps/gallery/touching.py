"""Figure 8 of the paper: overlapping decals push each other until they touch; the black rims stay."""

from collections.abc import Sequence

import numpy as np

from decals.model import Decals
from decals.scenes.scene import Scene

from .panels import Panel, decal, main
from .stage import plane, rings, straight_down

_GOLD, _TEAL, _RUST = (214, 156, 64), (78, 150, 150), (176, 84, 60)


def panels() -> Sequence[Panel]:
    """Let two decals, then seven of different sizes, push each other."""
    images = tuple(rings(color) for color in (_GOLD, _TEAL, _RUST))
    up = (0, 0, 1)
    pair = Decals.concatenate([decal((-0.33, 0, 0), up, 0.6), decal((0.36, 0.1, 0), up, 0.5, image=1)])
    angles = np.arange(6) * np.pi / 3
    ring = [
        decal((0.62 * np.cos(a), 0.62 * np.sin(a), 0), up, 0.32 + 0.05 * (i % 3), image=1 + i % 2)
        for i, a in enumerate(angles)
    ]
    seven = Decals.concatenate([decal((0, 0, 0), up, 0.45), *ring])
    return [
        Panel(Scene(objects=(plane(),), camera=straight_down(), images=images, decals=decals))
        for decals in (pair, seven)
    ]


if __name__ == "__main__":
    main(panels)
