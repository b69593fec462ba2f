"""Zones of the command line: ``WHERE:KEY=VALUE,…``."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from blobtree.files import is_file
from decals.apps.models.loading import load_model
from decals.errors import ImplicitDecalsError, InvalidInput
from decals.scattering import PaintedImage, Planar, Zone, Zones
from decals.scenes.objects import SceneObject, TreeObject
from decals.surfaces.convert import TREE_SUFFIXES


def _images(text: str) -> list[int]:
    return [int(number) for number in text.split("+")]


VALUES: dict[str, tuple[str, Callable[[str], Any]]] = {
    "density": ("density", float),
    "spacing": ("spacing", float),
    "factor": ("factor", float),
    "images": ("images", _images),
    "along": ("direction", str),
}
"""Fields of `Zone` by their keys, and what reads their values."""


def parse_zones(
    texts: Sequence[str],
    border_width: float,
    objects: Sequence[SceneObject],
    *,
    axis: str,
    images: int,
    trust: bool,
) -> Zones:
    """Return the zones on objects that texts describe; pictures are projected along an axis.

    Raises
    ------
    InvalidInput
        If a text cannot be read, or names an image that is not among the first ones.
    """
    zones = [_zone(text, objects, axis, trust) for text in texts]
    for text, zone in zip(texts, zones, strict=True):
        if zone.images is not None and max(np.ravel(zone.images)) >= images:
            raise InvalidInput(f"--zone {text}: there are {images} images, from 0 on; raise --images")
    return Zones(*zones, border_width=border_width)


def _zone(text: str, objects: Sequence[SceneObject], axis: str, trust: bool) -> Zone:
    """Return the zone that a text describes."""
    where, _, options = text.rpartition(":")
    if "=" not in options:
        where, options = text, ""
    values: dict[str, Any] = {}
    unread = dict(VALUES)
    for item in options.split(",") if options else ():
        key, _, value = item.partition("=")
        try:
            field, read = unread.pop(key)
            values[field] = read(value)
        except (KeyError, ValueError) as error:
            keys = ", ".join(VALUES)
            raise InvalidInput(
                f"--zone {text}: expected WHERE:KEY=VALUE,… with keys among {keys}, each once, got {item!r}"
            ) from error
    try:
        return Zone(_where(where, objects, axis, trust), **values)
    except ImplicitDecalsError as error:
        raise InvalidInput(f"--zone {text}: {error}") from error


def _where(text: str, objects: Sequence[SceneObject], axis: str, trust: bool) -> Any:
    """Return where a zone is: everywhere, in the solid of a file, on a painted image, or at a name."""
    path = Path(text)
    if text == "*":
        return lambda points: np.ones(len(points), np.bool_)
    if not is_file(path):
        return text
    if path.suffix.lower() not in TREE_SUFFIXES:
        return PaintedImage(path, Planar.over([item.surface for item in objects], axis))
    solid = load_model(text, trust=trust)
    if not isinstance(solid, TreeObject):
        raise InvalidInput(f"expected a BlobTree for the inside of its solid, got {text!r}")
    return solid.tree.translate(np.subtract(solid.origin, objects[0].origin))
