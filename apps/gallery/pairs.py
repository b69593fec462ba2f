"""Two decals
==========

Figures 6 and 7 of the paper: the balls of two fields are apart, overlap, reach into the other image, and the
images overlap. Only then does contact deform them. The graph shows F over both fields, where the first is the
higher one and at least ½. The red line is the contact line.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blobtree import RIM
from decals import NO_IMAGE, Contact, Decals, Interaction, MeshObject, Scene, TreeObject, evaluate
from decals.apps.gallery.field import BLUE, line
from decals.apps.gallery.helpers import (
    CLAY,
    Panel,
    camera_above,
    camera_at,
    flat_decals,
    main,
    plane,
    ring_image,
)

INFLUENCE = 0.6
DISTANCES = (1.3, 1.05, 0.72, 0.4)
"""Distances of the two centres in the four situations."""

RED = (0.84, 0.16, 0.14)
_CORNERS = 41
_SPACING = 2.2
"""Distance of pairs of decals that do not act on each other, in radii of influence."""


def panels() -> Sequence[Panel]:
    """Draw the four situations, and the graph of F."""
    situations = [_situation(distance) for distance in DISTANCES]
    return [Panel(scene, contact=Contact.PRODUCT) for scene in (*situations, _graph())]


def _situation(distance: float) -> Scene:
    """Return two decals over the balls of their fields."""
    centers = [(-distance / 2, 0, 0), (distance / 2, 0, 0)]
    balls = flat_decals(centers, INFLUENCE).replace(
        images=[NO_IMAGE] * 2,
        tints=[BLUE] * 2,
        opacities=[0.45] * 2,
        interactions=[Interaction.INDEPENDENT] * 2,
    )
    images = flat_decals(centers, RIM * INFLUENCE).replace(layers=[1] * 2)
    return Scene(
        objects=(plane(1.4),),
        camera=camera_above(5.2),
        images=(ring_image(),),
        decals=Decals.concatenate([balls, images]),
    )


def contact_field(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return F of points where two decals have these fields: one pair of decals for each point."""
    count = first.size
    side = int(np.ceil(np.sqrt(count)))
    points = _SPACING * np.column_stack([np.arange(count) % side, np.arange(count) // side, np.zeros(count)])
    away = [np.sqrt(1.0 - np.cbrt(f.reshape(-1))) for f in (first, second)]
    steps = [np.outer(distance, (sign, 0.0, 0.0)) for distance, sign in zip(away, (1.0, -1.0), strict=True)]
    decals = flat_decals(np.concatenate([points + step for step in steps]), RIM)
    normals = np.tile((0.0, 0.0, 1.0), (count, 1))
    return evaluate(decals, points, normals, contact=Contact.PRODUCT).field.reshape(first.shape)


def _graph() -> Scene:
    """Return the surface F(f₀, f₁) over ½ ≤ f₀ < 1, f₁ ≤ f₀."""
    first, share = np.meshgrid(np.linspace(0.5001, 0.999, _CORNERS), np.linspace(0.0, 1.0, _CORNERS))
    second = first * share
    corners = np.stack([first, second, contact_field(first, second)], axis=-1).reshape(-1, 3)
    a = (np.arange(_CORNERS - 1)[:, None] * _CORNERS + np.arange(_CORNERS - 1)).reshape(-1)
    b, c, d = a + 1, a + _CORNERS + 1, a + _CORNERS
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    axes = [
        line([(0.5, 0.0, 0.5), end], radius=0.006)
        for end in ((1.05, 0, 0.5), (0.5, 1.05, 0.5), (0.5, 0, 1.05))
    ]
    contact = line([(0.5, 0.5, 0.5), (1.0, 1.0, 0.5)], RED, radius=0.008)
    return Scene(
        objects=(
            MeshObject("F", corners, faces, color=CLAY),
            *(TreeObject(f"line {number}", part) for number, part in enumerate((*axes, contact))),
        ),
        camera=camera_at((-0.3, 2.5, 2.5), (0.78, 0.42, 0.62), fov=27.0),
    )


if __name__ == "__main__":
    main(panels)
