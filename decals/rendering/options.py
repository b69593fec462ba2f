"""Options of a picture, and what the renderer reads of a scene."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, Protocol, TypeAlias

import numpy as np

from blobtree._typing import Float32Array, Float64Array
from blobtree.colors import ColorLike, Rgba, color_rgba
from blobtree.validation import describe
from decals.errors import InvalidScene
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact, PictureRules
from decals.images.load import AnyImage, HasPixels
from decals.index.editor import DecalEditor
from decals.model import Decals
from decals.options import Values, inherit_descriptions
from decals.receivers import takes_named_only
from decals.record import DEFAULT_CONTACT, DEFAULT_STIFFNESS
from decals.rendering.environment import Environment, as_environment
from decals.rendering.lights import Lighting
from decals.rendering.viewpoint import Viewpoint
from decals.validation import count_number, instance, whole_number

Size: TypeAlias = tuple[int, int]
"""Width and height."""

MAX_PICTURE_SIDE = 16384
"""Pixels along each side of a picture, at most."""

MAX_SAMPLES = 1024
"""Samples along each axis of a pixel, at most."""

RELIEF_LOOKUPS = 64
"""Most points at which heights are looked up for a pixel, see ``shaders/relief.glsl``."""


@dataclass(frozen=True, slots=True)
class Background:
    """A vertical gradient behind all objects.

    Parameters
    ----------
    top, bottom : (red, green, blue, alpha) or str
        sRGB and alpha at the upper and the lower edge, each in [0, 1], not premultiplied; or the name of a
        colour. Alpha is 1 if it is left out.

    Raises
    ------
    InvalidScene
        If a colour is neither three or four such numbers nor a name.

    Examples
    --------
    >>> from decals.rendering import Background
    >>> Background("white", (0.5, 0.5, 0.5))
    Background(top=(1.0, 1.0, 1.0, 1.0), bottom=(0.5, 0.5, 0.5, 1.0))
    """

    top: Rgba
    bottom: Rgba

    if TYPE_CHECKING:  # names of colours are converted

        def __init__(self, top: ColorLike, bottom: ColorLike) -> None: ...

    def __post_init__(self) -> None:
        for name in ("top", "bottom"):
            color = color_rgba(f"a background's {name}", getattr(self, name), InvalidScene)
            object.__setattr__(self, name, color)


STUDIO = Background((0.80, 0.82, 0.85, 1.0), (0.96, 0.96, 0.95, 1.0))
"""Light grey, a little darker at the top."""

TRANSPARENT = Background((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
"""No background: alpha is the part of a pixel that objects cover."""


def as_background(value: Background | ColorLike) -> Background:
    """Return a background, or that of one colour; raise InvalidScene for other values."""
    if isinstance(value, Background):
        return value
    if isinstance(value, str) and value.strip().lower() == "transparent":
        return TRANSPARENT
    color = color_rgba("background", value, InvalidScene)
    return Background(color, color)


@dataclass(frozen=True, kw_only=True)
class Drawing(PictureRules):
    """How a scene is drawn, in pictures of any size; a scene and its file keep it.

    Parameters
    ----------
    samples : int
        Samples along each axis of a pixel; 2 means 4 samples a pixel.
    background : Background or colour
        Colours behind the objects: a gradient; or one colour, by its name such as ``"white"`` or
        ``"transparent"``, or by numbers.
    lights : Lighting, optional
        Lights in place of the studio light.
    environment : Environment or image, optional
        Picture of all directions as light, in place of the studio light; ``lights`` are added to it.

    Raises
    ------
    InvalidScene
        If an option is of another type, or out of range.
    InvalidImage
        If the picture of the environment cannot be used.

    Examples
    --------
    >>> import decals
    >>> drawing = decals.rendering.Drawing(contact="elastic", samples=4)
    >>> drawing.overridden(samples=None, contact="radial").contact
    <Contact.RADIAL: 2>
    """

    samples: Annotated[int, Values(1, 8)] = 2
    background: Background = STUDIO
    lights: Lighting | None = None
    environment: Environment | None = None

    if TYPE_CHECKING:  # names of modes and colours are converted

        def __init__(
            self,
            *,
            samples: int = 2,
            contact: AnyContact | str = DEFAULT_CONTACT,
            mapping: ImageMapping | str = ImageMapping.CORRECTED,
            background: Background | ColorLike = STUDIO,
            lights: Lighting | None = None,
            stiffness: float = DEFAULT_STIFFNESS,
            filtered: bool = False,
            environment: Environment | AnyImage | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set(
            samples=count_number("samples", self.samples, 1, MAX_SAMPLES, InvalidScene),
            background=as_background(self.background),
            environment=None if self.environment is None else as_environment(self.environment),
        )
        if self.lights is not None:
            instance("lights", self.lights, Lighting, InvalidScene, "leave them out for the studio light")

    def at(self, size: Size) -> "RenderOptions":
        """Return the options of a picture of a size, drawn like this."""
        return RenderOptions(size, **{field.name: getattr(self, field.name) for field in fields(Drawing)})


inherit_descriptions(Drawing)


@dataclass(frozen=True)
class RenderOptions(Drawing):
    """Everything that decides a picture besides its scene and viewpoint: a `Drawing`, and the size.

    Parameters
    ----------
    size : (int, int)
        Width and height in pixels.
    **drawing
        The parameters of `Drawing`.

    Raises
    ------
    InvalidScene
        If an option is of another type, or out of range.

    Examples
    --------
    >>> from decals.rendering import RenderOptions
    >>> RenderOptions(size=(320, 240), samples=4).sample_size
    (1280, 960)
    """

    size: Size = (800, 600)

    if TYPE_CHECKING:  # names of modes and colours are converted

        def __init__(
            self,
            size: Size = (800, 600),
            *,
            samples: int = 2,
            contact: AnyContact | str = DEFAULT_CONTACT,
            mapping: ImageMapping | str = ImageMapping.CORRECTED,
            background: Background | ColorLike = STUDIO,
            lights: Lighting | None = None,
            stiffness: float = DEFAULT_STIFFNESS,
            filtered: bool = False,
            environment: Environment | AnyImage | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set(size=_size(self.size))

    @property
    def sample_size(self) -> Size:
        """Width and height in samples."""
        return self.size[0] * self.samples, self.size[1] * self.samples


def drawing_of(scene: object) -> Drawing:
    """Return how a scene says that it is drawn; the default for models and other scenes."""
    drawing = getattr(scene, "drawing", None)
    return drawing if isinstance(drawing, Drawing) else Drawing()


def _size(size: Any) -> Size:
    try:
        width, height = size
    except (TypeError, ValueError, KeyError):
        raise InvalidScene(f"size: expected width and height in pixels, got {describe(size)}") from None
    width, height = (
        whole_number("size", side, 1, MAX_PICTURE_SIDE, InvalidScene) for side in (width, height)
    )
    return width, height


def relief_texels(image: HasPixels) -> Float32Array | None:
    """Return the heights of an image in radii, times alpha; None without relief."""
    texels: Float32Array | None = image.relief_texels() if hasattr(image, "relief_texels") else None
    return texels


def relief_ranges(images: Sequence[HasPixels]) -> Float64Array:
    """Return the least and the greatest height of each image in radii, 0 included.

    The last row of float64[n + 1, 2] is that of decals without image, which have number -1.
    """
    ranges = np.zeros((len(images) + 1, 2))
    for number, image in enumerate(images):
        heights = relief_texels(image)
        if heights is not None:
            ranges[number] = min(float(heights.min()), 0.0), max(float(heights.max()), 0.0)
    return ranges


class SceneLike(Protocol):
    """What the renderer reads of a scene, such as a `decals.Scene` or an editing document.

    Examples
    --------
    >>> import blobtree, decals
    >>> from decals.rendering import SceneLike
    >>> def count_decals(scene: SceneLike) -> int:
    ...     return len(scene.decals)
    >>> count_decals(decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20))
    20
    """

    @property
    def objects(self) -> Sequence[object]: ...  # noqa: D102
    @property
    def decals(self) -> Decals | DecalEditor: ...  # noqa: D102
    @property
    def images(self) -> Sequence[HasPixels]: ...  # noqa: D102
    @property
    def camera(self) -> Viewpoint: ...  # noqa: D102


def is_scene_like(scene: object) -> bool:
    """Return True if a value has objects, decals and images to draw."""
    return all(hasattr(scene, name) for name in ("objects", "decals", "images"))


def is_limited(scene: SceneLike) -> bool:
    """Return True if decals of a scene have receivers or fades, or an object takes decals by name only."""
    limited: bool = scene.decals.limited
    return len(scene.decals) > 0 and (limited or any(map(takes_named_only, scene.objects)))


def has_relief(scene: SceneLike) -> bool:
    """Return True if decals of a scene have relief that is drawn: posed objects are drawn without it."""
    posed = any(hasattr(item, "rest") for item in scene.objects)
    return has_materials(scene) and not posed and any(getattr(image, "relief", 0.0) for image in scene.images)


def relief_lookups(scene: SceneLike) -> int:
    """Return the number of points at which decals of a scene are looked up for a pixel."""
    return RELIEF_LOOKUPS if has_relief(scene) else 1


def has_materials(scene: SceneLike) -> bool:
    """Return True if a scene has decals, and an image with maps of its surface."""
    return len(scene.decals) > 0 and any(hasattr(image, "surface_texels") for image in scene.images)


def needed_effects(scene: SceneLike, drawing: Drawing) -> list[str]:
    """Return the names of the effects that a picture needs."""
    needed = {
        "materials": has_materials(scene),
        "relief": has_relief(scene),
        "walks": drawing.walked and len(scene.decals) > 0,
        "environment": drawing.environment is not None,
    }
    return [name for name, is_needed in needed.items() if is_needed]


def check_scene(scene: object) -> None:
    """Raise InvalidScene for a value without objects, decals and images."""
    if not is_scene_like(scene):
        raise InvalidScene(f"scene: expected a Scene, got {describe(scene)}; decals.cover makes one")


def drawn_objects(scene: SceneLike) -> list[object]:
    """Return what is to be seen of a scene's objects; an object says so with ``shown``."""
    parts = [getattr(item, "shown", item) for item in scene.objects]
    return [part for part in parts if part is not None]


def is_viewpoint(value: object) -> bool:
    """Return True for a camera or a projection."""
    return not isinstance(value, type) and hasattr(value, "clip_matrix") and hasattr(value, "rays")


def viewpoint_of(scene: SceneLike, viewpoint: Viewpoint | None) -> Viewpoint:
    """Return the viewpoint of a picture: the scene's camera by default."""
    chosen: Any = getattr(scene, "camera", None) if viewpoint is None else viewpoint
    if not is_viewpoint(chosen):
        raise InvalidScene(f"viewpoint: expected a Camera or a Projection, got {describe(chosen)}")
    checked: Viewpoint = chosen
    return checked
