"""A scene: objects, the decals that lie on them, the decals' images, and the camera."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from blobtree import Node
from blobtree.lazy import Lazy
from decals.checks import instance, shown, triple
from decals.errors import InvalidScene, NoGraphics
from decals.images import load_image
from decals.model import Decals
from decals.scenes.camera import Camera
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface

Color = tuple[float, float, float]
Box = tuple[NDArray[np.float32], NDArray[np.float32]]

PICTURE = (640, 480)
"""Size of the picture that a notebook shows of a scene."""

PIXELS = "give uint8 pixels [h, w, 4]"

CLAY: Color = (0.72, 0.68, 0.62)
"""Colour of a mesh that brings none of its own."""


@dataclass(frozen=True, eq=False)
class MeshObject:
    """A triangle mesh in a scene.

    Parameters
    ----------
    name : str
        What people call it; unique in its scene.
    vertices : float32[n, 3]
        Positions in the scene's units.
    faces : int32[m, 3]
        Corner indices, counter-clockwise seen from outside.
    color : (red, green, blue)
        Colour between the decals, each in [0, 1].
    source : str, optional
        Where the mesh came from, so that a scene file need not repeat it: a path, or ``"sample:NAME"``.

    Raises
    ------
    InvalidMesh
        If the arrays have wrong shapes or indices, NaN, or no area.
    InvalidScene
        If the name is empty or the colour is none.
    """

    name: str
    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    color: Color = CLAY
    source: str | None = None
    surface: MeshSurface = field(init=False, repr=False)

    def __post_init__(self) -> None:
        surface = MeshSurface(self.vertices, self.faces)
        checked = {
            "name": _name(self.name),
            "color": _color(self.name, self.color),
            "surface": surface,
            "vertices": surface.vertices,
            "faces": surface.faces,
        }
        for key, value in checked.items():
            object.__setattr__(self, key, value)

    @property
    def bounds(self) -> Box:
        """Lower and upper corner of the mesh, float32[3] each."""
        return self.surface.bounds


@dataclass(frozen=True, eq=False)
class TreeObject:
    """A BlobTree in a scene; its colour is an attribute of its field."""

    name: str
    tree: Node

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", _name(self.name))
        if not isinstance(self.tree, Node):
            raise InvalidScene(f"object {self.name!r}: expected a BlobTree, got {type(self.tree).__name__}")

    @Lazy
    def surface(self) -> ImplicitSurface:
        """The tree's surface, polygonized once to know where it lies."""
        return ImplicitSurface(self.tree)

    @property
    def bounds(self) -> Box:
        """Lower and upper corner of the surface (not of the field's support), float32[3] each."""
        return self.surface.bounds


SceneObject = MeshObject | TreeObject


@dataclass(frozen=True, eq=False)
class DecalImage:
    """The picture on a decal: where it comes from, and its pixels.

    Parameters
    ----------
    source : str
        The name of a generated image (``"scale"``, ``"tile#b0413e"``) or the path of a picture.
    pixels : uint8[h, w, 4]
        Straight RGBA, row 0 at the top; the decal's rim is the ellipse that touches the four edges.
    """

    source: str
    pixels: NDArray[np.uint8] = field(repr=False)

    def __post_init__(self) -> None:
        instance("an image's source", self.source, str, InvalidScene, "give a name or a path")
        pixels = instance(f"image {self.source!r}", self.pixels, np.ndarray, InvalidScene, PIXELS)
        if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 4 or 0 in pixels.shape:
            got = f"{pixels.dtype}{list(pixels.shape)}"
            raise InvalidScene(f"image {self.source!r}: expected uint8 pixels [h, w, 4], got {got}")

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
        Where the picture is taken from.
    decals : Decals
        One coat over all objects; a decal belongs to no object in particular.
    images : sequence of DecalImage
        What ``decals.images`` counts; at least one where there are decals.

    Raises
    ------
    InvalidScene
        If names repeat or a decal asks for an image that is not there.
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
        instance("decals", self.decals, Decals, InvalidScene, "decals.seed makes some")
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
        """What a notebook shows: a picture, or None (then it shows text) where there is no OpenGL."""
        from decals.render import render

        try:
            pixels = render(self, size=PICTURE)
        except NoGraphics:
            return None
        file = BytesIO()
        Image.fromarray(pixels).save(file, "png")
        return file.getvalue()

    def replace(
        self,
        *,
        objects: Sequence[SceneObject] | None = None,
        camera: Camera | None = None,
        decals: Decals | None = None,
        images: Sequence[DecalImage] | None = None,
    ) -> "Scene":
        """The same scene with some parts exchanged."""
        given = {"objects": objects, "camera": camera, "decals": decals, "images": images}
        return replace(self, **{key: value for key, value in given.items() if value is not None})  # type: ignore[arg-type]


def bounds_of(objects: Iterable[SceneObject]) -> Box:
    """Box around several objects."""
    boxes = [item.bounds for item in objects]
    if not boxes:
        raise InvalidScene("expected at least one object, got none; add a mesh or a BlobTree")
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def check_names(objects: Sequence[SceneObject]) -> None:
    """Refuse objects of which two have the same name."""
    names = [item.name for item in objects]
    for name in names:
        if names.count(name) > 1:
            raise InvalidScene(f"expected a different name for each object, got {name!r} twice; rename one")


def _each(name: str, values: Any, kinds: tuple[type, ...], advice: str) -> tuple[Any, ...]:
    """Give a tuple of things of some kinds, or raise InvalidScene."""
    wanted = " or ".join(kind.__name__ for kind in kinds)
    try:
        found = tuple(values)
    except TypeError:
        raise InvalidScene(f"{name}: expected a list of {wanted}, got {shown(values)}; {advice}") from None
    for value in found:
        if not isinstance(value, kinds):
            raise InvalidScene(f"{name}: expected a list of {wanted}, got {shown(value)} in it; {advice}")
    return found


def _name(name: str) -> str:
    instance("an object's name", name, str, InvalidScene, "give it a name of letters")
    if not name.strip():
        raise InvalidScene("expected a name for the object, got an empty one; give it a name")
    return name


def _color(name: str, color: ArrayLike) -> Color:
    values = triple(f"object {name!r}, colour", color, InvalidScene)
    if not ((values >= 0.0) & (values <= 1.0)).all():
        raise InvalidScene(f"object {name!r}: expected a colour of three numbers in [0, 1], got {color!r}")
    red, green, blue = values.tolist()
    return red, green, blue
