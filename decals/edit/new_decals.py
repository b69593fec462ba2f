"""What a decal is like that hands put somewhere."""

import numpy as np

from decals.coat.orientation import tangents
from decals.edit.document import Document
from decals.model import PLAIN, Decals
from decals.scenes.scene import bounds_of
from decals.surfaces.surface import Floats

SMALL = 0.05
"""Radius of the very first decal, in diagonals of the scene."""


def decal_at(document: Document, position: Floats, normal: Floats, model: int | None) -> Decals:
    """Give a decal like one of the document's, or of the usual size, at ``float32[3]`` with a unit normal."""
    places = position[None], normal[None]
    if model is not None:
        like = document.decals[model]
        return like.replace(
            positions=places[0], normals=places[1], tangents=tangents(*places, like.tangents[0], 0)
        )
    radii = document.decals.column("radii")
    low, high = bounds_of(document.objects)
    radius = float(np.median(radii)) if len(radii) else SMALL * float(np.linalg.norm(high - low))
    return Decals(
        *places,
        tangents(*places, (1.0, 0.0, 0.0), 0),
        np.array([radius], np.float32),
        images=np.array([0 if document.images else PLAIN]),
    )
