"""A dragon
========

Figure 13 of the paper: scales that push each other, eyes and teeth that overlap them, and a tongue and a ball
of plain coloured decals.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decals import (
    NO_IMAGE,
    Contact,
    DecalImage,
    Decals,
    Interaction,
    MeshObject,
    Scene,
    TreeObject,
    scatter,
)
from decals.apps.gallery.helpers import Panel, camera_at, main, sample_camera
from decals.apps.models.samples import sample

COUNT = 2000
UP = (0.0, 1.0, 0.0)
_EYES = np.array([[-0.61, 0.672, 0.088], [-0.798, 0.62, -0.257]], np.float32)
_TEETH = np.array([[-0.956, 0.347, 0.221], [-1.057, 0.347, -0.009], [-0.97, 0.497, 0.229]], np.float32)
"""Points on the dragon, which is 2.7 units long."""
_TONGUE = np.array([[-1.05, 0.35, 0.1], [-0.95, 0.35, 0.1], [-0.85, 0.35, 0.1], [-0.75, 0.35, 0.1]])
_TONGUE_WIDTH = 0.075
_BALL, _BALL_RADIUS = np.array([[-0.70, -0.80, 0.46]]), 0.16
_IVORY, _RED, _GOLD = (0.93, 0.90, 0.80), (0.78, 0.25, 0.24), (0.86, 0.66, 0.22)


def panels() -> Sequence[Panel]:
    """Cover the dragon with scales, and draw all of it, its head from both sides, and the ball."""
    dragon = sample("dragon")
    scales = scatter(dragon.surface, count=COUNT, direction=(1.0, -0.4, 0.0), images=2)
    scene = Scene(
        objects=(dragon,),
        camera=sample_camera("dragon"),
        images=tuple(DecalImage.load(name) for name in ("scale#3f7d4c", "scale#5b9a4a", "eye")),
        decals=Decals.concatenate(
            [
                _colored(scales),
                _over(dragon, _EYES, 0.045, image=2),
                _over(dragon, _TEETH, 0.035, image=NO_IMAGE),
            ]
        ),
    )
    views = (
        camera_at((-1.25, 1.1, 2.3), (-0.82, 0.5, 0.1), up=UP, fov=22.0),
        camera_at((-1.6, 0.9, -2.0), (-0.82, 0.5, 0.0), up=UP, fov=24.0),
        camera_at((-2.4, -0.4, 1.4), (-0.75, -0.7, 0.3), up=UP, fov=20.0),
    )
    scenes = [scene, *(scene.replace(camera=view) for view in views)]
    return [Panel(one, contact=Contact.PRODUCT) for one in scenes]


def _colored(scales: Decals) -> Decals:
    """Return the scales, those along the tongue plain red, those on the ball plain gold."""
    on_tongue = (_distances(scales, _TONGUE) < _TONGUE_WIDTH) & (scales.normals[:, 1] > 0.3)
    on_ball = _distances(scales, _BALL) < _BALL_RADIUS
    tints = np.select([on_tongue[:, None], on_ball[:, None]], [_RED, _GOLD], 1.0)
    return scales.replace(
        images=np.where(on_tongue | on_ball, NO_IMAGE, scales.images).astype(np.int32),
        tints=tints.astype(np.float32),
    )


def _distances(decals: Decals, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each decal from the nearest of some points."""
    result: NDArray[np.float64] = np.linalg.norm(decals.positions[:, None] - points, axis=2).min(axis=1)
    return result


def _over(item: MeshObject | TreeObject, points: NDArray[np.float32], radius: float, *, image: int) -> Decals:
    """Return decals at the nearest points of a surface, above the scales."""
    positions, normals = item.surface.project(points)
    return Decals(
        positions,
        normals,
        tangents=np.cross([0.0, 1.0, 0.0], normals),
        radii=radius,
        images=image,
        interactions=Interaction.OVERLAP,
        tints=_IVORY if image == NO_IMAGE else None,
    )


if __name__ == "__main__":
    main(panels)
