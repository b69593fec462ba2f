"""What other programs cannot show of a scene: one list for all exports, which the documentation repeats."""

from collections.abc import Callable
from typing import NamedTuple

from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import ContactLaw
from decals.rendering.options import Drawing, SceneLike


class Unsupported(NamedTuple):
    """A feature that exports refuse.

    Attributes
    ----------
    feature
        Its name.
    advice
        What to do instead.
    used
        True for a scene, drawn in a way, that uses it.
    """

    feature: str
    advice: str
    used: Callable[[SceneLike, Drawing], bool]


UNSUPPORTED = (
    Unsupported(
        "the walked mapping",
        "use the mapping 'corrected'",
        lambda scene, drawing: drawing.mapping is ImageMapping.WALKED,
    ),
    Unsupported(
        "relief of materials",
        "set the relief of its materials to 0, or move the surface by decals.displace",
        lambda scene, drawing: any(getattr(image, "relief", 0.0) for image in scene.images),
    ),
    Unsupported(
        "the filter of decals over samples",
        "set filtered=False in its drawing, and let the program take several samples",
        lambda scene, drawing: drawing.filtered,
    ),
    Unsupported(
        "poses",
        "take the scene that was posed",
        lambda scene, drawing: any(hasattr(item, "rest") for item in scene.objects),
    ),
    Unsupported(
        "contact laws of your own",
        "use one of the contact modes",
        lambda scene, drawing: isinstance(drawing.contact, ContactLaw),
    ),
)
"""Features that a shader does not have."""


def refuse_unsupported(scene: SceneLike, drawing: Drawing) -> None:
    """Raise InvalidScene for the first feature of a scene that exports do not have."""
    for feature, advice, used in UNSUPPORTED:
        if used(scene, drawing):
            raise InvalidScene(f"scene: expected one without {feature}, got one with it; {advice}")
