"""A model in three poses
======================

A tube with tiles, at rest and bent twice. Decals lie on the rest pose and stretch with the surface. At the
right they keep their shape instead: they meet anew in the bent pose.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blobtree import Segment, polygonize
from decals import DecalImage, MeshObject, Scene, pose, scatter, skin
from decals.apps.gallery.helpers import CLAY, Panel, camera_at, main

COUNT = 160
ANGLES = (0.6, 1.35)
"""Bends of the second and third pose, in radians."""


def panels() -> Sequence[Panel]:
    """Draw the rest pose, two bends, and the second bend with rigid decals."""
    shape = polygonize(Segment((-0.9, 0.0, 0.0), (0.9, 0.0, 0.0), radius=0.42), cell_size=0.05)
    tube = MeshObject("tube", shape.vertices, shape.faces, color=CLAY)
    rest = Scene(
        objects=(tube,),
        camera=camera_at((0.4, -5.2, 2.2), (-0.05, 0.0, 0.4), fov=29.0),
        images=(DecalImage.load("tile#2f7f95"), DecalImage.load("tile#c9a227")),
        decals=scatter(tube.surface, count=COUNT, images=2),
    )
    bends = [{"tube": bent(tube.vertices, angle)} for angle in ANGLES]
    stretched = [pose(rest, bend) for bend in bends]
    return [Panel(rest), *map(Panel, stretched), Panel(pose(rest, bends[-1], rigid=True))]


def bent(vertices: NDArray[np.float32], angle: float) -> NDArray[np.float64]:
    """Return vertices moved by two joints: the right half turns about the y axis."""
    share = np.clip(vertices[:, 0] / 1.2 + 0.5, 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    turn = np.eye(4)
    turn[0, [0, 2]] = np.cos(angle), -np.sin(angle)
    turn[2, [0, 2]] = np.sin(angle), np.cos(angle)
    return skin(vertices, np.column_stack([1.0 - share, share]), [np.eye(4), turn])


if __name__ == "__main__":
    main(panels)
