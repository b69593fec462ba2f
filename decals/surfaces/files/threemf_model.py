"""A model part of a 3MF file: objects with meshes or components, and the items that are built."""

from array import array
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from blobtree._typing import Float64Array, Int64Array
from decals.surfaces.files.faults import Notes, Unreadable
from decals.surfaces.files.pieces import Piece
from decals.surfaces.files.xml_events import Attributes, parse_xml

PREFIXES = {
    "http://schemas.microsoft.com/3dmanufacturing/core/2015/02": "",
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02": "m:",
    "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02": "b:",
}
"""Namespaces of the elements that are read, and of those that are named in warnings."""

NONE = -1
"""Index of what is not there."""

DIGITS = 10
"""Most digits of an index of a colour."""

UNITS = ("micron", "millimeter", "centimeter", "inch", "foot", "meter")


@dataclass(frozen=True, slots=True)
class Use:
    """A place where an object is used."""

    number: int
    part: str | None
    """Part of the package that holds the object; None for the same one."""

    matrix: Float64Array
    """``[4, 4]``"""


@dataclass(slots=True)
class Palette:
    """A group of colours, or of places in a texture, which triangles name by their indices."""

    colors: list[str] = field(default_factory=list)
    coordinates: "array[float]" = field(default_factory=lambda: array("d"))
    texture: int | None = None
    """Number of the picture."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A texture's part of the package, and how it goes on outside of [0, 1]."""

    part: str
    tiles: tuple[str, str]


@dataclass(slots=True)
class Object:
    """A mesh or other objects."""

    mesh: Piece | None = None
    properties: Int64Array | None = None
    """The palette of each triangle, and its index there at each corner, ``[m, 4]``; -1 for none."""

    components: list[Use] = field(default_factory=list)


@dataclass(slots=True)
class Model:
    """The objects of a part by their numbers, and the items that are built."""

    unit: str = "millimeter"
    objects: dict[int, Object] = field(default_factory=dict)
    items: list[Use] = field(default_factory=list)
    palettes: dict[int, Palette] = field(default_factory=dict)
    pictures: dict[int, Picture] = field(default_factory=dict)


def parse_model(chunks: Iterable[bytes], notes: Notes) -> Model:
    """Return the model in the XML of a part."""
    return _Parser(notes).parse(chunks)


class _Parser:
    """Builds a model from the elements of its XML."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._model: Model | None = None
        self._object = Object()
        self._name = "it"
        self._points, self._corners, self._properties = array("d"), array("q"), array("q")
        self._defaults = NONE, NONE
        self._palette = Palette()

    def parse(self, chunks: Iterable[bytes]) -> Model:
        """Return the model in an XML text."""
        starts = {
            "model": self._start_model, "object": self._start_object, "mesh": self._start_mesh,
            "vertex": self._vertex, "triangle": self._triangle, "component": self._component,
            "item": self._item, "b:beam": self._beam,
            "basematerials": self._start_palette, "base": self._base,
            "m:colorgroup": self._start_palette, "m:color": self._color,
            "m:texture2dgroup": self._start_palette, "m:tex2coord": self._coordinate,
            "m:texture2d": self._picture,
        }  # fmt: skip
        parse_xml(chunks, PREFIXES, starts, {"mesh": self._end_mesh})
        if self._model is None:
            raise Unreadable("a part of it holds no model")
        return self._model

    @property
    def _parsed(self) -> Model:
        if self._model is None:
            raise Unreadable("its XML does not begin with a model")
        return self._model

    def _start_model(self, attributes: Attributes) -> None:
        unit = attributes.get("unit", "millimeter")
        if unit not in UNITS:
            self._notes.add("units are unknown", unit[:40])
        self._model = Model(unit)

    def _start_object(self, attributes: Attributes) -> None:
        number = _whole(attributes, "id", "an object")
        self._name = f"object {number}"
        if number in self._parsed.objects:
            raise Unreadable(f"{self._name} is there twice")
        if attributes.get("type") == "support":
            self._notes.add("supports are kept as parts of the mesh", self._name)
        self._object = self._parsed.objects[number] = Object()
        self._defaults = _index(attributes, "pid"), _index(attributes, "pindex")

    def _start_mesh(self, _: Attributes) -> None:
        self._points, self._corners, self._properties = array("d"), array("q"), array("q")

    def _vertex(self, attributes: Attributes) -> None:
        try:
            self._points.extend((float(attributes["x"]), float(attributes["y"]), float(attributes["z"])))
        except (KeyError, ValueError):
            raise self._expected("a vertex with three numbers", attributes) from None

    def _triangle(self, attributes: Attributes) -> None:
        try:
            self._corners.extend((int(attributes["v1"]), int(attributes["v2"]), int(attributes["v3"])))
        except (KeyError, ValueError, OverflowError):
            raise self._expected("a triangle with three vertices", attributes) from None
        if "p1" in attributes:
            palette, first = _index(attributes, "pid", self._defaults[0]), _index(attributes, "p1")
            others = _index(attributes, "p2", first), _index(attributes, "p3", first)
            self._properties.extend((palette, first, *others))
        else:
            self._properties.extend((self._defaults[0], *(self._defaults[1:] * 3)))

    def _expected(self, what: str, attributes: Attributes) -> Unreadable:
        return Unreadable(f"{self._name} should have {what}, and has {str(attributes)[:80]}")

    def _end_mesh(self) -> None:
        points = np.array(self._points).reshape(-1, 3)
        faces = np.array(self._corners).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise Unreadable(f"{self._name} has points that are no finite numbers")
        if len(faces) and not (faces.min() >= 0 and faces.max() < len(points)):
            bad = faces.min() if faces.min() < 0 else faces.max()
            raise Unreadable(f"{self._name} has {len(points)} points but a face asks for number {bad}")
        self._object.mesh = Piece(points, faces)
        properties = np.array(self._properties).reshape(-1, 4)
        self._object.properties = properties if (properties[:, 0] != NONE).any() else None

    def _start_palette(self, attributes: Attributes) -> None:
        texture = _index(attributes, "texid")
        self._palette = Palette(texture=None if texture == NONE else texture)
        self._parsed.palettes[_index(attributes, "id")] = self._palette

    def _base(self, attributes: Attributes) -> None:
        self._palette.colors.append(attributes.get("displaycolor", ""))

    def _color(self, attributes: Attributes) -> None:
        self._palette.colors.append(attributes.get("color", ""))

    def _coordinate(self, attributes: Attributes) -> None:
        try:
            self._palette.coordinates.extend((float(attributes["u"]), float(attributes["v"])))
        except (KeyError, ValueError):
            self._palette.coordinates.extend((0.0, 0.0))

    def _picture(self, attributes: Attributes) -> None:
        tiles = attributes.get("tilestyleu", "wrap"), attributes.get("tilestylev", "wrap")
        picture = Picture(attributes.get("path", ""), tiles)
        self._parsed.pictures[_index(attributes, "id")] = picture

    def _component(self, attributes: Attributes) -> None:
        self._object.components.append(_use(attributes, self._name))

    def _item(self, attributes: Attributes) -> None:
        self._parsed.items.append(_use(attributes, "the build"))

    def _beam(self, _: Attributes) -> None:
        self._notes.add("beams are left out", self._name)


def _use(attributes: Attributes, place: str) -> Use:
    """Return the use of an object by a component or an item."""
    number = _whole(attributes, "objectid", place)
    matrix = np.eye(4)
    if text := attributes.get("transform"):
        try:
            numbers = np.array([float(word) for word in text.split()]).reshape(4, 3)
        except ValueError:
            raise Unreadable(f"{place} has the transform {text[:80]!r}, not 12 numbers") from None
        matrix[:3] = numbers.T  # the file has row vectors
    if not np.isfinite(matrix).all():
        raise Unreadable(f"{place} has a transform with numbers that are not finite")
    return Use(number, attributes.get("path"), matrix)


def _index(attributes: Attributes, name: str, default: int = NONE) -> int:
    """Return an index of a colour; a wrong one is none, because colours cost no face."""
    text = attributes.get(name)
    return default if text is None else int(text) if text.isdecimal() and len(text) < DIGITS else NONE


def _whole(attributes: Attributes, name: str, place: str) -> int:
    try:
        return int(attributes[name])
    except (KeyError, ValueError):
        raise Unreadable(
            f"{place} has {attributes.get(name, 'no')!r} in place of a number {name!r}"
        ) from None
