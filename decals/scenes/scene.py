"""A scene: objects, the decals that lie on them, the decals' images, and the camera."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from blobtree.identity import Value
from blobtree.immutable import read_only
from blobtree.progress import Progress
from blobtree.validation import describe
from decals import rendering
from decals.errors import ImplicitDecalsError, InvalidScene, NoGraphics
from decals.images.builtin import generate_image, is_builtin
from decals.images.load import AnyImage, each_image, image_pixels
from decals.images.texels import Pixels
from decals.model import LAYER_LIMIT, Decals
from decals.receivers import check_receivers
from decals.scenes.camera import Camera
from decals.scenes.objects import (
    Box,
    SceneObject,
    as_object,
    bounds_of,
    check_names,
    checked_name,
    with_common_origin,
)
from decals.scenes.origin import WORLD, Origin
from decals.scenes.recipe import Recipe
from decals.shortcuts import public
from decals.surfaces.convert import Model
from decals.validation import instance, require_rgba, whole_number

NOTEBOOK_SIZE = (640, 480)
"""Size of the picture of a scene in a notebook."""


@dataclass(frozen=True, eq=False)
class DecalImage(Value):
    """The picture on a decal: where it comes from, and its pixels.

    Parameters
    ----------
    source : str
        The name of a generated image (``"scale"``, ``"tile#b0413e"``) or the path of a picture.
    pixels : uint8, uint16 or float32[h, w, 4]
        Straight RGBA, row 0 at the top. Integers hold sRGB; floats hold linear light of any brightness. The
        decal's rim is the ellipse that touches the four edges.

    Raises
    ------
    InvalidScene
        If the source is no text or the pixels are others.

    Examples
    --------
    >>> import numpy
    >>> import decals
    >>> decals.DecalImage.load("tile#b0413e")
    DecalImage(source='tile#b0413e')
    >>> decals.DecalImage("white", numpy.full((2, 2, 4), 255, numpy.uint8)).pixels.shape
    (2, 2, 4)
    """

    source: str = field(compare=False)
    pixels: Pixels = field(repr=False)

    def __post_init__(self) -> None:
        instance("an image's source", self.source, str, InvalidScene, "give a name or a path")
        pixels = require_rgba(f"image {self.source!r}", self.pixels, InvalidScene)
        object.__setattr__(self, "pixels", read_only(pixels))

    @property
    def is_generated(self) -> bool:
        """True if the image is what its source generates, and has no maps."""
        if type(self) is not DecalImage or not is_builtin(self.source):
            return False
        return np.array_equal(self.pixels, generate_image(self.source))

    @classmethod
    def load(cls, source: AnyImage, *, folder: Path | None = None, name: str = "image") -> "DecalImage":
        """Return the image of a name, a path, an array, a PIL image or a texture.

        Parameters
        ----------
        source : str, path, PIL.Image.Image, numpy.ndarray, pyvista.Texture or DecalImage
            Any image, see `decals.images.image_pixels`; a `DecalImage` is returned as it is.
        folder : Path, optional
            Folder of relative paths. Default: the working directory.
        name : str
            Source of an image without name and path.

        Raises
        ------
        InvalidImage
            The image is of another kind, or cannot be read.
        """
        if isinstance(source, DecalImage):
            return source
        pixels = image_pixels(source, name=name, folder=folder)
        return cls(os.fspath(source) if isinstance(source, str | os.PathLike) else name, pixels)


def as_images(images: AnyImage | Iterable[AnyImage]) -> tuple[DecalImage, ...]:
    """Return images of any kind, or a single one, as images of a scene."""
    return tuple(
        DecalImage.load(image, name=f"image {number}") for number, image in enumerate(each_image(images))
    )


def check_camera(camera: Camera, origin: Origin) -> None:
    """Raise InvalidScene for a camera in the coordinates of a scene's models, whose origin is far away."""
    if origin != WORLD and np.abs(camera.target).max() > 0.5 * np.abs(origin).max():
        raise InvalidScene(
            f"camera: expected one relative to the scene's origin {origin}, got one that looks at "
            f"{camera.target}; subtract the origin, or use decals.Camera.framing(scene.bounds)"
        )


def as_layers(name: str, layers: Any, error: type[ImplicitDecalsError]) -> tuple[int, ...]:
    """Return numbers of layers, each once, in order; raise an error for other values."""
    try:
        numbers = {whole_number(name, one, -LAYER_LIMIT, LAYER_LIMIT - 1, error) for one in layers}
    except TypeError:
        raise error(f"{name}: expected numbers of layers, got {describe(layers)}") from None
    return tuple(sorted(numbers))


def as_layer_names(names: Any) -> dict[int, str]:
    """Return names of layers by their numbers, in order; raise `InvalidScene` for other values."""
    if not isinstance(names, Mapping):
        raise InvalidScene(
            f"layer_names: expected names by layers, such as {{1: 'rust'}}, got {describe(names)}"
        )
    layers = as_layers("layer_names", names, InvalidScene)
    return {layer: checked_name(f"a name of layer {layer}", names[layer]) for layer in layers}


SHOWN_NAMES = 3
"""Objects that the text of a scene names."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene(Value):
    """Everything that a picture shows.

    Parameters
    ----------
    objects : sequence of MeshObject, TreeObject or Model
        Surfaces; names are unique. Other models become objects. All become relative to the `origin` of the
        first.
    camera : Camera
        The viewpoint of the picture, relative to the origin.
    decals : Decals
        They lie over all objects, relative to the origin; a decal belongs to no object in particular.
    images : sequence of images
        The images that ``decals.images`` indexes, or a single one; index -1 is a plain tint and needs no
        image.
    drawing : Drawing
        How the scene is drawn where nothing else is said: contact mode, samples, background, lights.
    recipe : Recipe, optional
        How its decals were made.
    hidden_decals : Decals
        Decals that are not drawn; the editor shows them again.
    locked_layers : tuple of int
        Layers whose decals the editor does not change.
    layer_names : mapping of int to str
        Names of layers, by their numbers.

    Raises
    ------
    InvalidScene
        If names repeat, a decal shows an image or names a receiver that the scene lacks, objects are too far
        apart for float32, or the camera is not relative to the origin of a scene far away.

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
    drawing: rendering.Drawing = field(default_factory=lambda: rendering.Drawing())
    recipe: Recipe | None = field(default=None, compare=False)
    hidden_decals: Decals = field(default_factory=Decals.empty)
    locked_layers: tuple[int, ...] = ()
    layer_names: dict[int, str] = field(default_factory=dict)

    if TYPE_CHECKING:  # models and images of any kind are converted

        def __init__(
            self,
            *,
            objects: Iterable[SceneObject | Model],
            camera: Camera,
            decals: Decals = ...,
            images: AnyImage | Iterable[AnyImage] = ...,
            drawing: rendering.Drawing = ...,
            recipe: Recipe | None = None,
            hidden_decals: Decals = ...,
            locked_layers: Iterable[int] = (),
            layer_names: Mapping[int, str] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        try:
            items = None if isinstance(self.objects, str | Mapping) else list(self.objects)
        except TypeError:  # not iterable; arrays without dimensions say so only here
            items = None
        if items is None:
            raise InvalidScene(f"objects: expected a list of models, got {describe(self.objects)}")
        objects = tuple(as_object(item, f"model {number}") for number, item in enumerate(items, 1))
        object.__setattr__(self, "objects", with_common_origin(objects))
        object.__setattr__(self, "images", as_images(self.images))
        instance("camera", self.camera, Camera, InvalidScene, "Camera.framing makes one")
        instance("decals", self.decals, Decals, InvalidScene, "decals.scatter makes some")
        instance(
            "drawing", self.drawing, rendering.Drawing, InvalidScene, "decals.rendering.Drawing() is one"
        )
        if self.recipe is not None:
            instance("recipe", self.recipe, Recipe, InvalidScene, "leave it out")
        check_names(self.objects)
        check_camera(self.camera, self.origin)
        instance("hidden_decals", self.hidden_decals, Decals, InvalidScene, "decals.scatter makes some")
        object.__setattr__(
            self, "locked_layers", as_layers("locked_layers", self.locked_layers, InvalidScene)
        )
        object.__setattr__(self, "layer_names", as_layer_names(self.layer_names))
        shown_images = self.decals.images, self.hidden_decals.images
        last = max(int(images.max(initial=-1)) for images in shown_images)
        if last >= len(self.images):
            raise InvalidScene(
                f"a decal shows image {last}, but the scene has {len(self.images)} images; "
                "add the image or renumber the decals"
            )
        for shown_or_hidden in (self.decals, self.hidden_decals):
            check_receivers(shown_or_hidden.receivers, self.objects, InvalidScene)

    def __repr__(self) -> str:
        """Return the names of the first objects, the decals, and the number of images."""
        names = [repr(item.name) for item in self.objects[:SHOWN_NAMES]]
        if len(self.objects) > SHOWN_NAMES:
            names.append(f"… {len(self.objects) - SHOWN_NAMES} more")
        objects = ", ".join(names)
        return f"Scene(objects=[{objects}], decals={self.decals!r}, images={len(self.images)})"

    @property
    def origin(self) -> Origin:
        """Point that all coordinates of the scene are relative to: zero, or near objects far from zero.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((1e6, 0, 0), radius=1), count=3)
        >>> scene.origin
        (1000000.0, 0.0, 0.0)
        >>> bool(abs(scene.decals.positions).max() < 1.1)
        True
        """
        return self.objects[0].origin if self.objects else WORLD

    @property
    def bounds(self) -> Box:
        """Lower and upper corner of all objects together, float32[3] each, relative to the origin."""
        return bounds_of(self.objects)

    def save(self, path: str | os.PathLike[str], *, progress: Progress | None = None) -> None:
        """Write the scene to a JSON file; see `decals.save_scene`.

        Examples
        --------
        >>> import blobtree, decals
        >>> decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20).save("ball.json")
        >>> len(decals.load_scene("ball.json").decals)
        20
        """
        public("save_scene")(self, path, progress=progress)

    def save_html(self, path: str | os.PathLike[str], **options: Any) -> None:
        """Write the scene as one HTML page whose decals can be moved; see `decals.pages.page`.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
        >>> scene.save_html("ball.html", resolution=16)
        """
        public("save_html")(self, path, **options)

    def page(self, **options: Any) -> Any:
        """Return the scene as one HTML page, which a notebook shows inline; see `decals.pages.page`.

        Examples
        --------
        >>> import blobtree, decals
        >>> decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20).page(title="Ball", resolution=16)
        Page(title='Ball')
        """
        return public("pages").page(self, **options)

    def render(self, **options: Any) -> rendering.Picture:
        """Draw the scene as its `drawing` says; options and errors are those of `decals.render`.

        Examples
        --------
        >>> import blobtree, decals
        >>> decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20).render(size=(64, 48))
        Picture(64 × 48 pixels)
        """
        picture: rendering.Picture = public("render")(self, **options)
        return picture

    def measure(self, **options: Any) -> Any:
        """Measure how the decals lie; options and errors are those of `decals.measure`.

        Examples
        --------
        >>> import blobtree, decals
        >>> decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20).measure().coverage > 0.99
        True
        """
        return public("measure")(self, **options)

    def show(self, **options: Any) -> Any:
        """Show the scene in a window or a notebook; options and errors are those of `decals.show`.

        Examples
        --------
        >>> import blobtree, decals
        >>> decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20).show()  # doctest: +SKIP
        """
        return public("show")(self, **options)

    def edit(self, **options: Any) -> "Scene":
        """Edit the scene in a window, and return the edited one; options are those of `decals.edit`.

        Examples
        --------
        >>> import blobtree, decals
        >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=20)
        >>> scene = scene.edit()  # doctest: +SKIP
        """
        edited: Scene = public("edit")(self, **options)
        return edited

    def _repr_png_(self) -> bytes | None:
        """Return a PNG file for notebooks; None, so that they show text, without OpenGL."""
        try:
            with rendering.Renderer() as renderer:
                pixels = renderer.render(self, self.drawing.at(NOTEBOOK_SIZE))
        except NoGraphics:
            return None
        return rendering.Picture(pixels)._repr_png_()

    def replace(
        self,
        *,
        objects: Sequence[SceneObject | Model] | None = None,
        camera: Camera | None = None,
        decals: Decals | None = None,
        images: AnyImage | Sequence[AnyImage] | None = None,
        drawing: rendering.Drawing | None = None,
        recipe: Recipe | None = None,
        hidden_decals: Decals | None = None,
        locked_layers: Iterable[int] | None = None,
        layer_names: Mapping[int, str] | None = None,
    ) -> "Scene":
        """Return the same scene with some parts replaced; None leaves a part as it is.

        Arguments and errors are those of the class.
        """
        given: dict[str, Any] = {
            "objects": objects,
            "camera": camera,
            "decals": decals,
            "images": images,
            "drawing": drawing,
            "recipe": recipe,
            "hidden_decals": hidden_decals,
            "locked_layers": locked_layers,
            "layer_names": layer_names,
        }
        return replace(self, **{key: value for key, value in given.items() if value is not None})


def require_scene(name: str, scene: object, advice: str) -> Scene:
    """Return a scene at rest; raise InvalidScene for any other value, with the advice for a posed one."""
    if getattr(scene, "posed", False):
        raise InvalidScene(f"{name}: expected a Scene at rest, got a posed one; {advice}")
    return instance(name, scene, Scene, InvalidScene, "decals.cover makes one")
