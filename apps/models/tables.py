"""The option ``--table``: decals of a table for models, or in place of those of a saved scene."""

import colorsys
from collections.abc import Sequence
from pathlib import Path

from decals import DecalImage, Scene, load_table
from decals.apps.models.samples import axes_of
from decals.apps.views import frame, parse_view
from decals.errors import InvalidInput
from decals.scenes.objects import SceneObject

ASPECT = (4, 3)
"""Width and height of the picture that the camera of a written scene fits, in any unit."""

GOLDEN_RATIO = 0.618034


def with_table(
    loaded: Sequence[SceneObject] | Scene,
    table: Path,
    model: str,
    *,
    images: Sequence[str] | None = None,
    trust: bool = False,
) -> Scene:
    """Return a scene of models, or a saved one, with the decals of a table.

    Parameters
    ----------
    loaded
        The models or the scene.
    table
        The file of the table, see `decals.load_table`.
    model
        Name of the first model, whose upward axis counts.
    images
        Images of the decals. Default: those of the table, else those of the scene, else scales.
    trust
        See `decals.load_table`.

    Raises
    ------
    InvalidInput
        No objects, or fewer images than decals refer to.
    """
    objects = tuple(loaded.objects if isinstance(loaded, Scene) else loaded)
    if not objects:
        raise InvalidInput(f"expected a scene with objects for the table, {model!r} has none; add one")
    content = load_table(table, origin=objects[0].origin, trust=trust)
    count = int(content.decals.images.max(initial=0)) + 1
    own = loaded.images if isinstance(loaded, Scene) else ()
    pictures = tuple(DecalImage.load(source) for source in images or ()) or content.images or own
    pictures = pictures or scale_images(count)
    if len(pictures) < count:
        raise InvalidInput(
            f"--table: decals refer to {count} images, got {len(pictures)}; give --image for each, "
            "or a column image_source"
        )
    if isinstance(loaded, Scene):
        return loaded.replace(decals=content.decals, images=pictures, recipe=None)
    camera = frame(objects, parse_view(None, axes_of(model)), ASPECT)
    return Scene(objects=objects, camera=camera, images=pictures, decals=content.decals)


def scale_images(count: int) -> tuple[DecalImage, ...]:
    """Return images of scales for a scene: the first in the default colour, the others in various hues."""
    hues = (colorsys.hsv_to_rgb(GOLDEN_RATIO * number % 1.0, 0.55, 0.65) for number in range(1, count))
    colors = ["".join(f"{round(255 * channel):02x}" for channel in hue) for hue in hues]
    return tuple(DecalImage.load(source) for source in ["scale", *(f"scale#{color}" for color in colors)])
