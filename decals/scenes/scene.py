"""A scene: objects, the decals that lie on them, the decals' images, and the camera."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from decals import rendering
from decals.errors import InvalidScene, NoGraphics
from decals.images.load import load_image
from decals.model import Decals
from decals.scenes.camera import Camera
from decals.scenes.objects import Box, MeshObject, SceneObject, TreeObject, bounds_of, check_names
from decals.validation import describe, instance, require_rgba

NOTEBOOK_SIZE = (640, 480)
"""Size of the picture of a scene in a notebook."""


@dataclass(frozen=True, eq=False)
class DecalImage:
    """The picture on a decal: where it comes from, and its pixels.

    Parameters
    ----------
    source : str
        The name of a generated image (``"scale"``, ``"tile#b0413e"``) or the path of a picture.
    pixels : uint8[h, w, 4]
        Straight RGBA, row 0 at the top; the decal's rim is the ellipse that touches the four edges.

    Raises
    ------
    InvalidScene
        If the source is no text or the pixels are not uint8[h, w, 4].

    Examples
    --------
    >>> import numpy
    >>> import decals
    >>> decals.DecalImage.load("tile#b0413e")
    DecalImage(source='tile#b0413e')
    >>> decals.DecalImage("white", numpy.full((2, 2, 4), 255, numpy.uint8)).pixels.shape
    (2, 2, 4)
    """

    source: str
    pixels: NDArray[np.uint8] = field(repr=False)

    def __post_init__(self) -> None:
        instance("an image's source", self.source, str, InvalidScene, "give a name or a path")
        require_rgba(f"image {self.source!r}", self.pixels, InvalidScene)

    @classmethod
    def load(cls, source: str, *, folder: Path | None = None) -> Self:
        """Draw or read the picture behind ``source``; relative paths start at ``folder``."""
        instance("an image's source", source, str, InvalidScene, "give a name or a path")
        return cls(source, load_image(source, folder=folder))


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """Everything that a picture shows.

    Parameters
    ----------
    objects : sequence of MeshObject or TreeObject
        Surfaces, each in the scene's own coordinates; names are unique.
    camera : Camera
        The viewpoint of the picture.
    decals : Decals
        They lie over all objects; a decal belongs to no object in particular.
    images : sequence of DecalImage
        The images that ``decals.images`` indexes; index -1 is a plain tint and needs no image.

    Raises
    ------
    InvalidScene
        If names repeat or a decal shows an image that the scene lacks.

    See Also
    --------
    cover : a scene with decals all over its objects.

    Examples
    --------
    >>> import blobtree, decals
    >>> ball = decals.TreeObject("ball", blobtree.Point((0, 0, 0), radius=1))
    >>> scene = decals.Scene(objects=[ball], camera=decals.Camera((0, 0, 5)))
    >>> len(scene.objects), len(scene.decals)
    (1, 0)
    >>> scene.replace(camera=decals.Camera((0, 0, 8))).camera.distance
    8.0
    """

    objects: tuple[SceneObject, ...]
    camera: Camera
    decals: Decals = field(default_factory=Decals.empty)
    images: tuple[DecalImage, ...] = ()

    def __post_init__(self) -> None:
        objects = _each(
            "objects", self.objects, (MeshObject, TreeObject), "wrap each mesh and each tree in one"
        )
        images = _each("images", self.images, (DecalImage,), "DecalImage.load makes one")
        object.__setattr__(self, "objects", objects)
        object.__setattr__(self, "images", images)
        instance("camera", self.camera, Camera, InvalidScene, "Camera.framing makes one")
        instance("decals", self.decals, Decals, InvalidScene, "decals.scatter makes some")
        check_names(self.objects)
        last = int(self.decals.images.max(initial=-1))
        if last >= len(self.images):
            raise InvalidScene(
                f"a decal shows image {last}, but the scene has {len(self.images)} images; "
                "add the image or renumber the decals"
            )

    @property
    def bounds(self) -> Box:
        """Lower and upper corner of all objects together, float32[3] each."""
        return bounds_of(self.objects)

    def _repr_png_(self) -> bytes | None:
        """Return a PNG file for notebooks; None, so that they show text, without OpenGL."""
        try:
            with rendering.Renderer() as renderer:
                pixels = renderer.render(self, rendering.RenderOptions(size=NOTEBOOK_SIZE))
        except NoGraphics:
            return None
        return rendering.Picture(pixels)._repr_png_()

    def replace(
        self,
        *,
        objects: Sequence[SceneObject] | None = None,
        camera: Camera | None = None,
        decals: Decals | None = None,
        images: Sequence[DecalImage] | None = None,
    ) -> "Scene":
        """Return the same scene with some parts replaced."""
        given = {"objects": objects, "camera": camera, "decals": decals, "images": images}
        return replace(self, **{key: value for key, value in given.items() if value is not None})  # type: ignore[arg-type]


def _each(name: str, values: Any, kinds: tuple[type, ...], advice: str) -> tuple[Any, ...]:
    """Give a tuple of things of some kinds, or raise InvalidScene."""
    wanted = " or ".join(kind.__name__ for kind in kinds)
    try:
        found = tuple(values)
    except TypeError:
        raise InvalidScene(f"{name}: expected a list of {wanted}, got {describe(values)}; {advice}") from None
    for value in found:
        if not isinstance(value, kinds):
            raise InvalidScene(f"{name}: expected a list of {wanted}, got {describe(value)} in it; {advice}")
    return found
