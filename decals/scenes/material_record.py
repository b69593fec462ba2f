"""Materials as a scene file has them: maps as embedded pictures, or as the names of files."""

from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct

from decals.errors import ImplicitDecalsError, InvalidImage, InvalidScene
from decals.images.load import embedded_image, image_pixels, is_embedded
from decals.images.texels import Pixels
from decals.scenes.material import MAP_NAMES, DecalMaterial
from decals.scenes.scene import DecalImage

PICTURES = tuple(name for name in MAP_NAMES if name != "height")
"""Maps that are pictures; heights are numbers."""


class MaterialRecord(Struct, forbid_unknown_fields=True, omit_defaults=True):
    """A material; all maps but the base colour may be left out. Heights are little-endian float32 rows."""

    name: str
    pixels: str
    normal: str | None = None
    roughness: str | None = None
    metallic: str | None = None
    occlusion: str | None = None
    emission: str | None = None
    height: bytes | None = None
    relief: float = 0.0


def material_record(material: DecalMaterial) -> MaterialRecord:
    """Describe a material, with all maps in it."""
    maps = {name: embedded_image(_rgba(getattr(material, name))) for name in PICTURES}
    heights = None if material.height is None else material.height.astype("<f4").tobytes()
    return MaterialRecord(material.source, **maps, height=heights, relief=material.relief)


def material_of(record: MaterialRecord, folder: Path) -> DecalImage:
    """Make a material that was described; without maps, an image.

    Raises
    ------
    InvalidImage
        If a picture is missing or broken.
    InvalidScene
        If the material cannot be otherwise.
    """
    try:
        maps: dict[str, Any] = {
            name: image_pixels(source, folder=folder, name=name)
            for name in PICTURES
            if (source := getattr(record, name)) is not None
        }
        if record.height is not None:
            height, width = maps["pixels"].shape[:2]
            maps["height"] = np.frombuffer(record.height, "<f4").reshape(height, width).astype(np.float32)
        if [*maps] == ["pixels"] and not record.relief:
            return DecalImage(record.name, **maps)
        return DecalMaterial(record.name, **maps, relief=record.relief)
    except InvalidImage as error:
        raise InvalidImage(f"image {record.name!r}: {error}") from error
    except ImplicitDecalsError as error:
        raise InvalidScene(f"material {record.name!r}: {error}") from error
    except ValueError as error:
        raise InvalidScene(f"material {record.name!r}: expected a height for each pixel ({error})") from error


def sources_of(image: str | MaterialRecord) -> list[str]:
    """Return the files that an image of a scene names."""
    given = [image] if isinstance(image, str) else [getattr(image, name) for name in PICTURES]
    return [source for source in given if source is not None and not is_embedded(source)]


def _rgba(levels: Pixels) -> Pixels:
    """Return a map of one, three or four channels as a picture."""
    if levels.ndim == 3 and levels.shape[2] == 4:
        return levels
    colors = levels if levels.ndim == 3 else np.repeat(levels[..., None], 3, axis=2)
    return np.dstack([colors, np.full(levels.shape[:2], 255, np.uint8)])
