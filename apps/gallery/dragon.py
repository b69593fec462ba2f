"""Figure 13 of the paper: a dragon of scales, with eyes that overlap them and plain coloured decals."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decals.coat.seeding import seed
from decals.model import PLAIN, Decals, Interaction
from decals.scenes.camera import Camera
from decals.scenes.scene import DecalImage, Scene, SceneObject

from ..models.samples import axes_of, sample
from ..views import frame, parse_view
from .panels import Panel, main

COUNT = 2000
_EYE = np.array([[-0.61, 0.672, 0.088]], np.float32)
_TEETH = np.array([[-0.956, 0.347, 0.221], [-1.057, 0.347, -0.009], [-0.97, 0.497, 0.229]], np.float32)
"""Places on the dragon, which is 2.7 long."""
_TONGUE = np.array([[-1.05, 0.35, 0.1], [-0.95, 0.35, 0.1], [-0.85, 0.35, 0.1], [-0.75, 0.35, 0.1]])
_TONGUE_REACH = 0.075
_IVORY, _RED = (0.93, 0.90, 0.80), (0.78, 0.25, 0.24)


def panels() -> Sequence[Panel]:
    """Cover the dragon, and look at all of it and at its head."""
    item = sample("dragon")
    scales = seed(item.surface, count=COUNT, direction=(1.0, -0.4, 0.0), images=2)
    scene = Scene(
        objects=(item,),
        camera=frame([item], parse_view(None, axes_of("dragon")), (1, 1)),
        images=tuple(DecalImage.load(name) for name in ("scale#3f7d4c", "scale#5b9a4a", "eye")),
        decals=Decals.concatenate(
            [_with_tongue(scales), _over(item, _EYE, 0.045, image=2), _over(item, _TEETH, 0.035, image=PLAIN)]
        ),
    )
    head = Camera(position=(-1.25, 1.1, 2.3), target=(-0.82, 0.5, 0.1), up=(0.0, 1.0, 0.0), fov=22.0)
    return Panel(scene), Panel(scene.replace(camera=head))


def _with_tongue(scales: Decals) -> Decals:
    """Make the scales along the tongue plain red."""
    apart = np.linalg.norm(scales.positions[:, None] - _TONGUE, axis=2).min(axis=1)
    red = (apart < _TONGUE_REACH) & (scales.normals[:, 1] > 0.3)
    return scales.replace(
        images=np.where(red, PLAIN, scales.images).astype(np.int32),
        tints=np.where(red[:, None], _RED, 1.0).astype(np.float32),
    )


def _over(item: SceneObject, places: NDArray[np.float32], radius: float, *, image: int) -> Decals:
    """Lay decals over the scales."""
    positions, normals = item.surface.project(places)
    count = len(positions)
    return Decals(
        positions=positions,
        normals=normals,
        tangents=np.cross([0.0, 1.0, 0.0], normals),
        radii=np.full(count, radius, np.float32),
        images=np.full(count, image, np.int32),
        interactions=np.full(count, Interaction.OVERLAP, np.int32),
        tints=np.tile(np.array(_IVORY if image == PLAIN else (1, 1, 1), np.float32), (count, 1)),
    )


if __name__ == "__main__":
    main(panels)
