"""Objects of a scene: meshes and BlobTrees by name, and models of other kinds as such objects."""

import operator
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import Node
from blobtree._typing import Float32Array, Int32Array
from blobtree.colors import ColorLike, color_rgb
from blobtree.errors import InvalidNode
from blobtree.identity import Value
from blobtree.lazy import Lazy
from blobtree.nodes.paths import Path, moved, node_at
from blobtree.validation import describe, truth
from decals.errors import InvalidMesh, InvalidScene
from decals.images.load import AnyImage
from decals.receivers import label_names
from decals.scenes.origin import Origin, as_origin, check_distance, local_tree, local_vertices
from decals.surfaces.base_color import CLAY, BaseColor, BaseTexture, Color, as_texture
from decals.surfaces.convert import as_shape
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.mesh_data import MeshData
from decals.surfaces.normals import CREASE_ANGLE
from decals.surfaces.windings import MeshOrientation
from decals.validation import allowed_number, instance, is_unicode, member

Paths = tuple[Path, ...]
"""Paths of nodes in a tree; ``()`` is the path of its root."""

Names = dict[Path, str]
"""Names of nodes by their paths."""

Box = tuple[Float32Array, Float32Array]
"""Lower and upper corner, ``float32[3]`` each."""


@dataclass(frozen=True, eq=False)
class MeshObject(Value):
    """A triangle mesh in a scene.

    Parameters
    ----------
    name : str
        Name of the object, unique in its scene.
    vertices : float32[n, 3]
        Positions in the scene's units.
    faces : int32[m, 3]
        Corner indices, counter-clockwise seen from outside.
    color : (red, green, blue), str or BaseColor
        sRGB colour between the decals, each channel in [0, 1]; or the name of a colour; or colours of
        vertices, faces or textures, see `decals.surfaces.BaseColor`.
    source : str, optional
        Where the mesh came from, so that a scene file need not repeat it: a path, or ``"sample:NAME"``.
    crease_angle : float
        Least angle between two faces in degrees, from 0 to 180, at which their edge is drawn sharp. Smaller
        angles are smoothed. Default 35.
    origin : (x, y, z), optional
        Point that vertices are relative to. By default the zero point; for a model farther from it than
        1,000 times its size, a point near the model, which is subtracted in float64.
    labels : str or sequence of str
        Labels besides the name, by which decals choose the objects that they lie on (`Decals.receivers`).
    named_only : bool
        True if only decals lie on the object that name it, or one of its labels.
    orientation : MeshOrientation or str
        ``"outward"`` (default): closed parts that wind inward are turned, with what lies inside them.
        ``"keep"``: all parts stay as they are. ``"flip"``: all faces are turned once; the object then keeps
        them, and has no source.

    coordinates : float32[m, 3, 2], optional
        Texture coordinates of each corner of each face, u to the right and v upward, by which
        ``decals.bake(layout="own")`` places a mesh whose colour has none. With a source, those of the source.

    hidden, locked : tuple of paths
        ``((),)`` for an object that is not drawn, and for one that the editor does not change; ``()`` else.

    Raises
    ------
    InvalidMesh
        If the arrays have wrong shapes or indices, NaN, or no area.
    InvalidScene
        If the name is empty, or the colour or the crease angle is out of range.

    Examples
    --------
    >>> import decals
    >>> corner = decals.MeshObject("corner", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> corner
    MeshObject('corner', 3 vertices, 1 faces)
    >>> corner.surface.area
    0.5
    """

    name: str
    vertices: Float32Array
    faces: Int32Array
    color: Color | BaseColor = CLAY
    source: str | None = field(default=None, compare=False)
    crease_angle: float = CREASE_ANGLE
    origin: Origin = None  # type: ignore[assignment]  # filled in by __post_init__
    hidden: Paths = field(default=(), repr=False)
    locked: Paths = field(default=(), repr=False)
    labels: tuple[str, ...] = ()
    named_only: bool = False
    orientation: MeshOrientation = field(default=MeshOrientation.OUTWARD, compare=False)
    coordinates: Float32Array | None = field(default=None, repr=False)
    surface: MeshSurface = field(init=False, repr=False, compare=False)

    if TYPE_CHECKING:  # lists of numbers and names of colours are converted

        def __init__(
            self,
            name: str,
            vertices: ArrayLike,
            faces: ArrayLike,
            color: ColorLike | BaseColor = CLAY,
            source: str | None = None,
            crease_angle: float = CREASE_ANGLE,
            origin: ArrayLike | None = None,
            hidden: Paths = (),
            locked: Paths = (),
            labels: str | Iterable[str] = (),
            named_only: bool = False,
            orientation: MeshOrientation | str = MeshOrientation.OUTWARD,
            coordinates: ArrayLike | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        given = (self.vertices, as_origin(self.origin)) if self.origin is not None else None
        vertices, origin = given or local_vertices(self.vertices)
        rule = member("orientation", self.orientation, MeshOrientation, InvalidScene)
        flipped = rule is MeshOrientation.FLIP
        surface = MeshSurface(vertices, self.faces, orientation=rule)
        checked = {
            "name": checked_name("an object's name", self.name),
            "color": _mesh_color(self.name, self.color, np.asarray(self.faces), surface),
            "source": None if flipped else _source(self.name, self.source),
            "crease_angle": as_crease_angle(self.crease_angle),
            "origin": origin,
            **_by_paths(self),
            **_labels(self),
            "surface": surface,
            "vertices": surface.vertices,
            "faces": surface.faces,
            "orientation": MeshOrientation.KEEP if flipped else rule,
            "coordinates": _coordinates(self.name, self.coordinates, np.asarray(self.faces), surface),
        }
        for key, value in checked.items():
            object.__setattr__(self, key, value)

    def _contents(self) -> dict[str, Any]:
        """Return what counts of the object; coordinates only where it has some."""
        contents: dict[str, Any] = super()._contents()
        if self.coordinates is None:
            del contents["coordinates"]
        return contents

    def __repr__(self) -> str:
        """Return the name and the numbers of vertices and faces, as arrays would fill the screen."""
        return f"MeshObject({self.name!r}, {len(self.vertices)} vertices, {len(self.faces)} faces)"

    @property
    def shown(self) -> "MeshObject | None":
        """The object; None if it is hidden."""
        return None if self.hidden else self

    @property
    def bounds(self) -> Box:
        """Lower and upper corner of the mesh, float32[3] each, relative to the origin."""
        return self.surface.bounds


@dataclass(frozen=True, eq=False)
class TreeObject(Value):
    """A BlobTree in a scene; its colour is an attribute of its field.

    Parameters
    ----------
    name : str
        Name of the object, unique in its scene.
    tree : Node
        The model; its iso surface is drawn.
    origin : (x, y, z), optional
        Point that the tree is relative to. By default the zero point; for a model farther from it than
        1,000 times its size, a point near the model, which is subtracted in float64.
    labels, named_only
        Which decals lie on the object, as for `MeshObject`.

    hidden, locked : tuple of paths
        Nodes that are not drawn, and nodes that the editor does not change. A path has the index of the child
        at each step from the root; ``()`` is the whole object.
    names : mapping of path to str
        Names of nodes; nodes without one are named by their class.

    Raises
    ------
    InvalidScene
        If a name is empty, the tree is not a BlobTree, or a path leads to no node of it.

    Examples
    --------
    >>> import blobtree, decals
    >>> ball = decals.TreeObject("ball", blobtree.Point((0, 0, 0), radius=1))
    >>> ball.name
    'ball'
    """

    name: str
    tree: Node
    origin: Origin = None  # type: ignore[assignment]  # filled in by __post_init__
    hidden: Paths = field(default=(), repr=False)
    locked: Paths = field(default=(), repr=False)
    labels: tuple[str, ...] = ()
    named_only: bool = False
    names: Names = field(default_factory=dict, repr=False)

    if TYPE_CHECKING:

        def __init__(
            self,
            name: str,
            tree: Node,
            origin: ArrayLike | None = None,
            hidden: Paths = (),
            locked: Paths = (),
            labels: str | Iterable[str] = (),
            named_only: bool = False,
            names: Mapping[Path, str] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", checked_name("an object's name", self.name))
        if not isinstance(self.tree, Node):
            raise InvalidScene(f"object {self.name!r}: expected a BlobTree, got {type(self.tree).__name__}")
        if self.origin is None:
            tree, origin = local_tree(self.tree)
            object.__setattr__(self, "tree", tree)
        else:
            origin = as_origin(self.origin)
        object.__setattr__(self, "origin", origin)
        for key, value in (_by_paths(self) | _labels(self)).items():
            object.__setattr__(self, key, value)

    @property
    def shown(self) -> "TreeObject | None":
        """The object without its hidden nodes; None if nothing of it is to be seen."""
        return None if () in self.hidden else self._shown_part if self.hidden else self

    @Lazy
    def _shown_part(self) -> "TreeObject | None":
        from blobtree.nodes.surgery import without_branches  # most scenes hide nothing

        try:
            return replace(
                self, tree=without_branches(self.tree, self.hidden), hidden=(), locked=(), names={}
            )
        except InvalidNode:  # all nodes are hidden
            return None

    @Lazy
    def surface(self) -> ImplicitSurface:
        """Return the surface of the whole tree; the first call polygonizes it to find where it lies."""
        return ImplicitSurface(self.tree)

    @property
    def bounds(self) -> Box:
        """Lower and upper corner of the surface (not of the field's support), float32[3] each."""
        return self.surface.bounds


SceneObject = MeshObject | TreeObject


def same_shape(item: SceneObject, other: SceneObject) -> bool:
    """Return True if two objects have the same surface in the same place, whatever their names and flags."""
    if item is other:
        return True
    if item.origin != other.origin:
        return False
    if isinstance(item, TreeObject):
        return isinstance(other, TreeObject) and item.tree == other.tree
    return (
        isinstance(other, MeshObject)
        and np.array_equal(item.vertices, other.vertices)
        and np.array_equal(item.faces, other.faces)
    )


def surface_is_known(item: SceneObject) -> bool:
    """Return True if the surface of an object has been computed; that of a mesh always has."""
    return not isinstance(item, TreeObject) or "surface" in vars(item)


def forget_surface(item: SceneObject) -> None:
    """Drop what was computed for a tree's surface, some megabytes; it is computed again when needed."""
    if isinstance(item, TreeObject):
        for name in ("surface", "_shown_part"):
            vars(item).pop(name, None)


def _labels(item: SceneObject) -> dict[str, Any]:
    """Return the checked labels of an object, and whether it takes only decals that name it."""
    return {
        "labels": label_names(f"object {item.name!r}, labels", item.labels, InvalidScene),
        "named_only": truth("named_only", item.named_only, InvalidScene),
    }


def _by_paths(item: SceneObject) -> dict[str, Any]:
    """Return what an object says of nodes by their paths: checked, in order; a mesh has its root alone."""
    tree = item.tree if isinstance(item, TreeObject) else None
    checked: dict[str, Any] = {}
    for flag in ("hidden", "locked") if tree is None else ("hidden", "locked", "names"):
        given = getattr(item, flag)
        try:
            by_path = {tuple(map(operator.index, path)): path for path in given}
            known = by_path.keys() <= {()} if tree is None else all(node_at(tree, path) for path in by_path)
            if flag == "names":
                what = f"object {item.name!r}, name of a node"
                checked[flag] = {path: checked_name(what, given[by_path[path]]) for path in sorted(by_path)}
            else:
                checked[flag] = tuple(sorted(by_path))
        except (TypeError, InvalidNode):
            known = False
        if not known:
            example = "names by paths of its nodes, such as {(0, 1): 'head'}"
            expected = example if flag == "names" else "paths of its nodes, such as ((0, 1),)"
            got = describe(list(given) if isinstance(given, Mapping) else given)
            raise InvalidScene(f"object {item.name!r}, {flag}: expected {expected}, got {got}")
    return checked


def flagged(item: SceneObject, **changed: Any) -> SceneObject:
    """Return an object with another ``name``, ``hidden`` or ``locked`` nodes, or ``names`` of nodes.

    Its surface is not built again.
    """
    twin = object.__new__(type(item))
    vars(twin).update(vars(item))
    for name in ("_shown_part", "content_hash"):
        vars(twin).pop(name, None)
    vars(twin).update(changed)
    vars(twin).update(name=checked_name("an object's name", twin.name), **_by_paths(twin))
    return twin


def _paths_after(item: TreeObject, tree: Node) -> dict[str, Any]:
    """Return the flags and names of an object for another tree, of which most nodes are the same."""
    from blobtree.nodes.surgery import paths_after

    kept: dict[str, Any] = {}
    for name in ("hidden", "locked"):
        paths = getattr(item, name)
        if paths:
            found = paths_after(item.tree, tree, [path for path in paths if path])
            kept[name] = (*((),) * (() in paths), *found)
    if item.names:
        each = ((paths_after(item.tree, tree, [path]), name) for path, name in item.names.items())
        kept["names"] = {found[0]: name for found, name in each if found}
    return kept


def with_tree(item: TreeObject, tree: Node) -> TreeObject:
    """Return an object with another tree; nodes that stay are hidden, locked and named as before."""
    return replace(item, tree=tree, **_paths_after(item, tree))


def displaced(item: SceneObject, offset: ArrayLike, name: str) -> SceneObject:
    """Return a copy of an object at another place, under another name; ``offset`` has shape (3,)."""
    if isinstance(item, TreeObject):
        tree = moved(item.tree, np.asarray(offset, np.float64))
        return flagged(with_tree(item, tree), name=name)
    vertices = (item.vertices + np.asarray(offset, np.float64)).astype(np.float32)
    return replace(item, name=name, vertices=vertices, source=None)


def shown_objects(objects: Iterable[SceneObject]) -> list[SceneObject]:
    """Return what is to be seen of objects: without hidden ones, and without hidden nodes."""
    return [shown for item in objects if (shown := item.shown) is not None]


def as_crease_angle(angle: object) -> float:
    """Return a crease angle in degrees; InvalidScene for other values."""
    return allowed_number(
        "crease_angle", angle, "degrees from 0 to 180", lambda value: 0.0 <= value <= 180.0, InvalidScene
    )


def as_object(
    model: object,
    name: str,
    *,
    color: ColorLike | BaseColor | None = None,
    texture: AnyImage | BaseTexture | None = None,
    crease_angle: float = CREASE_ANGLE,
    orientation: MeshOrientation | str = MeshOrientation.OUTWARD,
) -> SceneObject:
    """Return a model as an object of a scene.

    Parameters
    ----------
    model : Model or SceneObject
        An object of a scene is returned as it is; `decals.surfaces.convert.as_shape` lists all other kinds.
    name : str
        Name of the object; the model of a file is named after the file.
    color : (red, green, blue), str or BaseColor, optional
        Colour of a mesh, in place of the colours and textures that it has.
    texture : image, pyvista.Texture or BaseTexture, optional
        Texture of a mesh with texture coordinates, in place of its colours.
    crease_angle : float
        Crease angle of a mesh, in degrees; see `MeshObject`.
    orientation : MeshOrientation or str
        Which way the faces of a mesh wind; see `MeshObject`.

    Raises
    ------
    InvalidScene, InvalidMesh, InvalidFile
        If the model is of another kind, or cannot be used.
    """
    angle = as_crease_angle(crease_angle)
    orientation = member("orientation", orientation, MeshOrientation, InvalidScene)
    if isinstance(model, MeshObject | TreeObject):
        return model
    source = os.fspath(model) if isinstance(model, str | os.PathLike) else None
    shape = as_shape(model, name=name, error=InvalidScene)
    name = name if source is None else FilePath(source).stem
    if isinstance(shape, Node):
        return TreeObject(name, shape)
    if color is None:
        color = shape_color(shape, texture, source)
    coordinates = spare_coordinates(shape, color)
    return MeshObject(
        name, *shape.arrays, color, source, angle, orientation=orientation, coordinates=coordinates
    )


def shape_color(
    shape: MeshData, texture: AnyImage | BaseTexture | None, source: str | None
) -> Color | BaseColor:
    """Return the colours of a mesh, or a texture on its coordinates; clay for a mesh without.

    Raises
    ------
    InvalidMesh
        A texture is given, but the mesh has no texture coordinates.
    """
    base = shape.color
    if texture is not None:
        if base is None or base.coordinates is None:
            raise InvalidMesh(
                "texture: expected a mesh with texture coordinates, got one without; "
                "for pyvista, mesh.texture_map_to_plane() adds some"
            )
        return base.with_texture(as_texture(texture))
    color = None if base is None else base.simplified
    if isinstance(color, BaseColor):
        return color if source is None else replace(color, source=source)
    return CLAY if color is None else color


def spare_coordinates(shape: MeshData, color: ColorLike | BaseColor) -> Float32Array | None:
    """Return the coordinates of corners, ``float32[m, 3, 2]``, of a mesh whose colour has none; or None."""
    base = shape.color
    if base is None or base.coordinates is None:
        return None
    if isinstance(color, BaseColor) and color.coordinates is not None:
        return None
    return base.coordinates[base.rows_of(shape.faces)]


def relative_to(item: SceneObject, origin: Origin) -> SceneObject:
    """Return an object relative to another origin.

    Raises
    ------
    InvalidScene
        If it lies so far from the origin that float32 would show steps.
    """
    shift = np.subtract(item.origin, origin)
    if not shift.any():
        return item
    box = item.tree.support if isinstance(item, TreeObject) else item.bounds
    check_distance(item.name, *(corner.astype(np.float64) + shift for corner in box))
    if isinstance(item, TreeObject):
        tree = item.tree.translate(tuple(shift))
        return replace(with_tree(item, tree), origin=origin)
    vertices = (item.vertices + shift).astype(np.float32)
    return replace(item, vertices=vertices, origin=origin)


def with_common_origin(objects: Sequence[SceneObject]) -> tuple[SceneObject, ...]:
    """Return objects relative to the origin of the first."""
    return tuple(relative_to(item, objects[0].origin) for item in objects)


def as_objects(
    models: Iterable[object],
    *,
    crease_angle: float = CREASE_ANGLE,
    orientation: MeshOrientation | str = MeshOrientation.OUTWARD,
) -> list[SceneObject]:
    """Return models as objects with different names: the second object of a name becomes ``name-2``.

    Kinds of models, the options of meshes and errors are those of `as_object`. All get the origin of the
    first.
    """
    objects: list[SceneObject] = []
    for number, model in enumerate(models, 1):
        item = as_object(model, f"model {number}", crease_angle=crease_angle, orientation=orientation)
        name = unused_name(item.name, {other.name for other in objects}, "-")
        objects.append(item if name == item.name else replace(item, name=name))
    return list(with_common_origin(objects))


def unused_name(name: str, taken: Collection[str], separator: str) -> str:
    """Return a name; if it is taken, with a separator and a number from 2 on behind it."""
    numbered = chain([name], (f"{name}{separator}{number}" for number in count(2)))
    return next(one for one in numbered if one not in taken)


def bounds_of(objects: Iterable[SceneObject]) -> Box:
    """Return the box around several objects; InvalidScene without objects, or for other kinds."""
    try:
        listed = list(objects)
    except TypeError:
        listed = [cast("SceneObject", objects)]
    for item in listed:
        if not isinstance(item, MeshObject | TreeObject):
            raise InvalidScene(f"objects: expected objects of a scene, got {describe(item)}; use as_objects")
    boxes = [item.bounds for item in listed]
    if not boxes:
        raise InvalidScene("expected at least one object, got none; add a mesh or a BlobTree")
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def check_names(objects: Sequence[SceneObject]) -> None:
    """Raise InvalidScene if two objects have the same name."""
    names = [item.name for item in objects]
    for name in names:
        if names.count(name) > 1:
            raise InvalidScene(f"expected a different name for each object, got {name!r} twice; rename one")


def checked_name(what: str, name: Any) -> str:
    """Return the name of an object, a node or a layer; InvalidScene if it is empty, or no Unicode text."""
    instance(what, name, str, InvalidScene, "give it a name of letters")
    if not name.strip():
        raise InvalidScene(f"expected {what}, got an empty one; give it a name")
    if not is_unicode(name):
        raise InvalidScene(f"expected {what} of Unicode characters, got {name!r}; rename it")
    checked: str = name
    return checked


def _mesh_color(name: str, color: object, faces: NDArray[Any], surface: MeshSurface) -> Color | BaseColor:
    """Return the checked colour of a mesh, whose surface may have turned some of the given faces."""
    if not isinstance(color, BaseColor):
        return color_rgb(f"object {name!r}, colour", color, InvalidScene)
    color.check_mesh(f"object {name!r}", len(surface.vertices), len(surface.faces))
    return color.turned(faces, surface.faces)


def _coordinates(
    name: str, coordinates: object, faces: NDArray[Any], surface: MeshSurface
) -> Float32Array | None:
    """Return checked coordinates of corners, for a surface that may have turned some of the given faces."""
    if coordinates is None:
        return None
    expected = (len(faces), 3, 2)
    try:
        array = np.asarray(coordinates)
    except (TypeError, ValueError, OverflowError):  # rows of different lengths
        array = np.empty(0)
    if array.shape != expected:
        got = describe(coordinates) if array.ndim == 0 or not array.size else f"shape {list(array.shape)}"
        raise InvalidMesh(f"object {name!r}, coordinates: expected shape {list(expected)}, got {got}")
    corners = np.arange(3 * len(faces)).reshape(-1, 3)
    turned = BaseColor(coordinates=array.reshape(-1, 2), corners=corners).turned(faces, surface.faces)
    placed: Float32Array = cast("Float32Array", turned.coordinates)[turned.rows_of(surface.faces)]
    placed.setflags(write=False)
    return placed


def _source(name: str, source: object) -> str | None:
    if source is None:
        return None
    try:
        text = os.fspath(cast("str | os.PathLike[str]", source))
    except TypeError:
        text = ""
    if not isinstance(text, str) or not text or not is_unicode(text):
        raise InvalidScene(
            f"object {name!r}, source: expected a path or 'sample:NAME', got {describe(source)}; leave it out"
        )
    return text
