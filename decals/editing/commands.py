"""Commands for decals, images and the camera; each is an immutable value that computes an `Edit`."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array, Int64Array
from blobtree.validation import describe, finite_number, finite_vector, point_array, truth
from decals.editing.document import Document, Edit, EditCommand, SceneParts
from decals.editing.queries import SurfacePoints, move_decals, nearest_points, shortest_rotations
from decals.errors import InvalidEdit
from decals.images.load import AnyImage
from decals.index.rows import as_numbers
from decals.model import LAYER_LIMIT, NO_IMAGE, Decals, Interaction
from decals.options import inherit_descriptions
from decals.rendering.options import Drawing
from decals.scenes.camera import Camera
from decals.scenes.objects import surface_is_known
from decals.scenes.scene import DecalImage, Scene
from decals.surfaces.surface import unit_rows
from decals.validation import called, color_values, instance, whole_number

MAX_IMMEDIATE_DECALS = 500
"""Commands for more decals than this run in the background."""

DUPLICATE_OFFSET = 1.0
"""Distance between a decal and its duplicate, in radii."""


def are_many(numbers: ArrayLike) -> bool:
    """Return True if an edit of these decals belongs in the background."""
    return np.size(numbers) > MAX_IMMEDIATE_DECALS


class AddDecals(EditCommand):
    """Add decals on top of their layers, under new numbers.

    Parameters
    ----------
    decals
        The decals.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import AddDecals, EditSession
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(AddDecals(session.document.scene.decals[:1]))
    >>> session.document.decals.numbers
    array([0, 1, 2, 3])
    """

    decals: Decals
    label: ClassVar[str] = "add"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        return document.compute_addition(self.decals)


class DecalCommand(EditCommand):
    """Base of commands for some decals.

    Parameters
    ----------
    numbers
        Numbers of the decals.
    """

    numbers: ArrayLike

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        inherit_descriptions(cls)

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", as_numbers(self.numbers))

    @property
    def long(self) -> bool:
        """True if the command belongs in the background."""
        return are_many(self.numbers)


class DeleteDecals(DecalCommand):
    """Delete decals; their numbers are not given to other decals.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import DeleteDecals, EditSession
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(DeleteDecals([1]))
    >>> session.document.decals.numbers
    array([0, 2])
    """

    label: ClassVar[str] = "delete"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        return document.compute_deletion(self.numbers)


class SetValues(DecalCommand):
    """Set values of decals, such as image, tint, opacity, layer, interaction or radius.

    Parameters
    ----------
    values
        Arrays by their names in `decals.Decals`. Each is one value for all decals, or a row per decal.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, SetValues
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(SetValues.each([0, 2], layers=1, opacities=0.5))
    >>> session.document.decals.decals.opacities
    array([0.5, 1. , 0.5], dtype=float32)
    """

    values: Mapping[str, ArrayLike]
    label: str = "set values"

    @classmethod
    def each(cls, numbers: ArrayLike, label: str = "set values", **values: ArrayLike) -> Self:
        """Return the command with the values as keyword arguments."""
        return cls(numbers, values, label)

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        if not isinstance(self.values, Mapping):
            raise InvalidEdit(f"values: expected {{'layers': 1}} or such, got {describe(self.values)}")
        before = document.decals.take(self.numbers)
        arrays = {name: _broadcast(before, name, value) for name, value in self.values.items()}
        return document.compute_replacement(self.numbers, before.replace(**arrays))


class MapValues(DecalCommand):
    """Set one value of decals to a function of the decals, such as half their opacity.

    Parameters
    ----------
    name
        Name of the array in `decals.Decals`.
    function
        Computes the new values from the decals.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, MapValues
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(MapValues([1], "opacities", lambda decals: 0.5 * decals.opacities))
    >>> session.document.decals.decals.opacities
    array([1. , 0.5, 1. ], dtype=float32)
    """

    name: str
    function: Callable[[Decals], ArrayLike]
    label: str = "set values"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        taken = document.decals.take(self.numbers)
        _array_named(taken, self.name)
        values = {self.name: called("function", self.function, taken, error=InvalidEdit)}
        return SetValues(self.numbers, values, self.label).compute(document)


class ScaleDecals(DecalCommand):
    """Multiply the radii of decals.

    Parameters
    ----------
    factor
        Above 1 for larger decals, below 1 for smaller ones.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, ScaleDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> radius = float(session.document.decals[1].radii[0])
    >>> edit = session.do(ScaleDecals([1], 1.5))
    >>> round(float(session.document.decals[1].radii[0]) / radius, 3)
    1.5
    """

    factor: float
    label: ClassVar[str] = "scale"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        factor = finite_number("factor", self.factor, InvalidEdit)
        before = document.decals.take(self.numbers)
        with np.errstate(over="ignore"):  # Decals refuses radii that are not finite
            radii = before.radii.astype(np.float64) * factor
        return document.compute_replacement(self.numbers, before.replace(radii=radii))


class TurnDecals(DecalCommand):
    """Turn decals about their normals.

    Parameters
    ----------
    degrees
        Angle in degrees, counter-clockwise seen from outside.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, TurnDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> tangent = session.document.decals[1].tangents[0]
    >>> edit = session.do(TurnDecals([1], 60))
    >>> round(float(session.document.decals[1].tangents[0] @ tangent), 3)
    0.5
    """

    degrees: float
    label: ClassVar[str] = "turn"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        angle = np.radians(finite_number("degrees", self.degrees, InvalidEdit))
        before = document.decals.take(self.numbers)
        tangents = np.cos(angle) * before.tangents + np.sin(angle) * before.bitangents
        return document.compute_replacement(self.numbers, before.replace(tangents=tangents))


class MoveDecals(DecalCommand):
    """Move decals over the surfaces, also from one object to another.

    The first decal moves to the given point. The others keep their offsets from it: the offsets turn with the
    first decal's normal, and end on the nearest surface.

    Parameters
    ----------
    position, normal
        Surface point for the first decal and its normal, shape (3,) each.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, MoveDecals
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(MoveDecals([1], (0, 0, 1), (0, 0, 1)))
    >>> session.document.decals[1].positions
    array([[0., 0., 1.]], dtype=float32)
    """

    position: ArrayLike
    normal: ArrayLike
    label: ClassVar[str] = "move"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        before = document.decals.take(self.numbers)
        position, normal = _checked_point(self.position, self.normal)
        first = move_decals(before[:1], SurfacePoints(position, normal, np.zeros(1, np.int32)))
        if len(before) == 1:
            return document.compute_replacement(self.numbers, first)
        rotation = shortest_rotations(before.normals[:1], first.normals)[0]
        offsets = (before.positions[1:].astype(np.float64) - before.positions[0]) @ rotation.T
        targets = nearest_points(document.objects, first.positions + offsets)
        others = move_decals(before[1:], targets)
        return document.compute_replacement(self.numbers, Decals.concatenate([first, others]))


class OrderDecals(DecalCommand):
    """Draw decals over, or under, all others of their layer and interaction.

    Such decals are drawn in the order of their numbers, so decals exchange their numbers: `numbers_after`
    returns those of the moved ones. Contact decals push each other and have no order.

    Parameters
    ----------
    numbers
        Numbers of the decals. Contact decals among them stay as they are.
    front
        True to bring the decals to the front, False to send them to the back.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, OrderDecals
    >>> scene = decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"])
    >>> scene = scene.replace(decals=scene.decals.replace(interactions="overlap", layers=[0, 0, 1]))
    >>> session = EditSession(scene)
    >>> command = OrderDecals([0], front=True)
    >>> command.numbers_after(session.document)
    array([1])
    >>> edit = session.do(command)
    >>> bool((session.document.decals[1].positions == scene.decals[[0]].positions).all())
    True
    """

    front: bool

    def __post_init__(self) -> None:
        super().__post_init__()
        truth("front", self.front, InvalidEdit)

    @property
    def label(self) -> str:
        """Name of the undo entry."""
        return "bring to front" if self.front else "send to back"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        new, old = self._order(document)
        changed = new != old
        return document.compute_replacement(new[changed], document.decals.take(old[changed]))

    def numbers_after(self, document: Document) -> Int64Array:
        """Return the numbers that the decals will have, in the order of `numbers`."""
        new, old = self._order(document)
        moved = dict(zip(old.tolist(), new.tolist(), strict=True))
        return np.array([moved.get(number, number) for number in as_numbers(self.numbers).tolist()], np.int64)

    def _order(self, document: Document) -> tuple[Int64Array, Int64Array]:
        """Return all numbers of the ranks of the decals, and which decals come to have them."""
        editor = document.decals
        given = editor.take(self.numbers)
        ordered = given.interactions != Interaction.PUSH
        if not ordered.any():
            raise InvalidEdit(
                "expected overlapping or independent decals, got contact decals, which push each other; "
                "change their interaction or their layer"
            )
        numbers = editor.numbers
        ranks = (editor.column("layers") + LAYER_LIMIT) * 4 + editor.column("interactions")
        new, old = [], []
        for rank in np.unique(given.ranks[ordered]):
            members = numbers[ranks == rank]
            moved = np.isin(members, self.numbers)
            parts = (members[~moved], members[moved]) if self.front else (members[moved], members[~moved])
            new.append(members)
            old.append(np.concatenate(parts))
        return np.concatenate(new), np.concatenate(old)


class DuplicateDecals(DecalCommand):
    """Add copies of decals, beside them along the u axes of their images.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import DuplicateDecals, EditSession
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(DuplicateDecals([0, 1]))
    >>> session.document.decals.numbers
    array([0, 1, 2, 3, 4])
    """

    label: ClassVar[str] = "duplicate"
    reads_looks: ClassVar[bool] = True

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        before = document.decals.take(self.numbers)
        targets = before.positions + DUPLICATE_OFFSET * before.radii[:, None] * before.tangents
        return document.compute_addition(move_decals(before, nearest_points(document.objects, targets)))


class ReplaceScene(EditCommand):
    """Replace all objects, decals and images, the camera and the drawing by those of another scene.

    Parameters
    ----------
    scene
        The other scene.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, ReplaceScene
    >>> ball = Point((0, 0, 0), radius=1.0)
    >>> session = EditSession(decals.cover(ball, count=3, images=["eye"]))
    >>> edit = session.do(ReplaceScene(decals.cover(ball, count=5, images=["scale"])))
    >>> len(session.document.decals)
    5
    """

    scene: Scene
    label: str = "replace the scene"
    ignores_locks: ClassVar[bool] = True

    @property
    def long(self) -> bool:
        """True if surfaces are to be built first; see `decals.editing.session.takes_long`."""
        return not all(surface_is_known(item) for item in getattr(self.scene, "objects", ()))

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        scene = instance("scene", self.scene, Scene, InvalidEdit, "decals.load_scene reads one")
        first = document.decals.next_number
        addition = document.compute_replacement(
            np.arange(first, first + len(scene.decals)),
            scene.decals,
            **vars(SceneParts.of(scene, first + len(scene.decals))),
        )
        return document.compute_deletion(document.decals.numbers).then(addition)


class AddImage(EditCommand):
    """Add an image, as the last one.

    Parameters
    ----------
    image
        The image.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import AddImage, EditSession
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(AddImage(decals.DecalImage.load("scale")))
    >>> len(session.document.images)
    2
    """

    image: AnyImage
    label: ClassVar[str] = "add an image"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        name = f"image {len(document.images)}"
        return document.compute_parts(images=(*document.images, DecalImage.load(self.image, name=name)))


class ReplaceImage(EditCommand):
    """Replace an image; decals that show it show the new one.

    Parameters
    ----------
    number
        Index of the image.
    image
        The new image.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, ReplaceImage
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> scale = decals.DecalImage.load("scale")
    >>> edit = session.do(ReplaceImage(0, scale))
    >>> session.document.images[0] is scale
    True
    """

    number: int
    image: AnyImage
    label: str = "replace an image"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        images, number = list(document.images), _image_index(document, self.number)
        images[number] = DecalImage.load(self.image, name=f"image {number}")
        return document.compute_parts(images=tuple(images))


class RemoveImage(EditCommand):
    """Remove an image. Decals that showed it show their tint; the index of later images decreases by one.

    Parameters
    ----------
    number
        Index of the image.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, RemoveImage
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(RemoveImage(0))
    >>> session.document.decals.decals.images
    array([-1, -1, -1], dtype=int32)
    """

    number: int
    label: ClassVar[str] = "remove an image"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        index = _image_index(document, self.number)
        images = (*document.images[:index], *document.images[index + 1 :])
        decals, numbers = document.decals.decals, document.decals.numbers
        affected = decals.images >= index
        hidden = replace(document.hidden, decals=_without_image(document.hidden.decals, index))
        return document.compute_replacement(
            numbers[affected], _without_image(decals[affected], index), images=images, hidden=hidden
        )


class SetCamera(EditCommand):
    """Replace the camera of the scene.

    Parameters
    ----------
    camera
        The new camera.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, SetCamera
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(SetCamera(decals.Camera.framing([[-5, -5, -5], [5, 5, 5]])))
    >>> session.labels
    ('set the camera',)
    """

    camera: Camera
    label: ClassVar[str] = "set the camera"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        instance("camera", self.camera, Camera, InvalidEdit, "Camera.framing makes one")
        return document.compute_parts(camera=self.camera)


class SetDrawing(EditCommand):
    """Replace how the scene is drawn: contact mode, mapping, samples, background.

    Parameters
    ----------
    drawing
        The new options.
    label
        Name of the undo entry.

    Examples
    --------
    >>> import decals
    >>> from blobtree import Point
    >>> from decals.editing import EditSession, SetDrawing
    >>> session = EditSession(decals.cover(Point((0, 0, 0), radius=1.0), count=3, images=["eye"]))
    >>> edit = session.do(SetDrawing(decals.rendering.Drawing(contact="radial")))
    >>> session.document.scene.drawing.contact
    <Contact.RADIAL: 2>
    """

    drawing: Drawing
    label: str = "set the drawing"

    def compute(self, document: Document) -> Edit:
        """Return the edit."""
        instance("drawing", self.drawing, Drawing, InvalidEdit, "a scene has .drawing")
        return Edit() if self.drawing == document.drawing else document.compute_parts(drawing=self.drawing)


def _without_image(decals: Decals, index: int) -> Decals:
    """Return decals that show their tint in place of an image, and later images under the next index."""
    images = decals.images
    return decals.replace(images=np.where(images == index, NO_IMAGE, images - (images > index)))


def _checked_point(position: ArrayLike, normal: ArrayLike) -> tuple[Float32Array, Float32Array]:
    """Return a point and its unit normal as arrays of one row, or raise `InvalidEdit`."""
    point = finite_vector("position", position, InvalidEdit)
    direction = finite_vector("normal", normal, InvalidEdit)
    if not any(direction):
        raise InvalidEdit("normal: expected a direction, got a zero vector")
    return point_array([point]), unit_rows(np.array([direction]))


def _array_named(decals: Decals, name: str) -> NDArray[Any]:
    present = getattr(decals, name, None) if isinstance(name, str) else None
    if not isinstance(present, np.ndarray):
        raise InvalidEdit(f"expected the name of an array of decals, such as 'layers', got {describe(name)}")
    return present


def _broadcast(decals: Decals, name: str, value: ArrayLike) -> Any:
    """Return a row of a value for each decal."""
    present = _array_named(decals, name)
    if name == "tints":
        value = color_values(name, value, InvalidEdit)
    try:
        array = np.asarray(value)
        return array if array.ndim == present.ndim else np.broadcast_to(array, present.shape)
    except ValueError as error:
        raise InvalidEdit(
            f"{name}: expected one value for all decals, or one for each of {len(decals)}, got {value!r:.60}"
        ) from error


def _image_index(document: Document, number: int) -> int:
    return whole_number("image", number, 0, len(document.images) - 1, InvalidEdit)
