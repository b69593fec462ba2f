"""A dragon
========

Figure 13 of the paper: scales that push each other, an eye and teeth that overlap them, and a tongue of
plain coloured decals.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decals import NO_IMAGE, Camera, DecalImage, Decals, Interaction, MeshObject, Scene, TreeObject, scatter
from decals.apps.gallery.helpers import Panel, main, sample, sample_camera

COUNT = 2000
_EYE = np.array([[-0.61, 0.672, 0.088]], np.float32)
_TEETH = np.array([[-0.956, 0.347, 0.221], [-1.057, 0.347, -0.009], [-0.97, 0.497, 0.229]], np.float32)
"""Points on the dragon, which is 2.7 units long."""
_TONGUE = np.array([[-1.05, 0.35, 0.1], [-0.95, 0.35, 0.1], [-0.85, 0.35, 0.1], [-0.75, 0.35, 0.1]])
_TONGUE_WIDTH = 0.075
_IVORY, _RED = (0.93, 0.90, 0.80), (0.78, 0.25, 0.24)


def panels() -> Sequence[Panel]:
    """Cover the dragon with scales, and draw all of it and its head."""
    dragon = sample("dragon")
    scales = scatter(dragon.surface, count=COUNT, direction=(1.0, -0.4, 0.0), images=2)
    scene = Scene(
        objects=(dragon,),
        camera=sample_camera("dragon"),
        images=tuple(DecalImage.load(name) for name in ("scale#3f7d4c", "scale#5b9a4a", "eye")),
        decals=Decals.concatenate(
            [
                _with_tongue(scales),
                _over(dragon, _EYE, 0.045, image=2),
                _over(dragon, _TEETH, 0.035, image=NO_IMAGE),
            ]
        ),
    )
    head = Camera(position=(-1.25, 1.1, 2.3), target=(-0.82, 0.5, 0.1), up=(0.0, 1.0, 0.0), fov=22.0)
    return Panel(scene), Panel(scene.replace(camera=head))


def _with_tongue(scales: Decals) -> Decals:
    """Return the scales, those along the tongue plain red."""
    distances = np.linalg.norm(scales.positions[:, None] - _TONGUE, axis=2).min(axis=1)
    red = (distances < _TONGUE_WIDTH) & (scales.normals[:, 1] > 0.3)
    return scales.replace(
        images=np.where(red, NO_IMAGE, scales.images).astype(np.int32),
        tints=np.where(red[:, None], _RED, 1.0).astype(np.float32),
    )


def _over(item: MeshObject | TreeObject, points: NDArray[np.float32], radius: float, *, image: int) -> Decals:
    """Return decals at the nearest points of a surface, above the scales."""
    positions, normals = item.surface.project(points)
    count = len(positions)
    return Decals(
        positions=positions,
        normals=normals,
        tangents=np.cross([0.0, 1.0, 0.0], normals),
        radii=np.full(count, radius, np.float32),
        images=np.full(count, image, np.int32),
        interactions=np.full(count, Interaction.OVERLAP, np.int32),
        tints=np.tile(np.array(_IVORY if image == NO_IMAGE else (1, 1, 1), np.float32), (count, 1)),
    )


if __name__ == "__main__":
    main(panels)
