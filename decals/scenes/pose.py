"""Posed scenes: meshes and trees that deform, with decals that stretch with them.

Decals lie on the rest pose. Each pixel of a posed object finds its place in the rest pose, and decals and
their contact are evaluated there. So a decal keeps its place and its neighbours in every pose. A posed tree
is drawn as a mesh, whose vertices know their places on the tree at rest.
This removes the limitation that section 3.5 of the paper states.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from blobtree import Node, polygonize
from blobtree._typing import Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.errors import InvalidNode
from blobtree.validation import describe, real, truth
from decals.errors import InvalidScene
from decals.model import Decals
from decals.rendering.options import Drawing
from decals.rendering.picture import Picture
from decals.scenes.camera import Camera
from decals.scenes.objects import Box, MeshObject, SceneObject, TreeObject
from decals.scenes.origin import Origin
from decals.scenes.scene import DecalImage, Scene, require_scene
from decals.shortcuts import public
from decals.surfaces.base_color import BaseColor, Color
from decals.surfaces.convert import as_shape, is_model
from decals.surfaces.mesh_data import MeshData
from decals.surfaces.windings import MeshOrientation
from decals.validation import instance, whole_number

if TYPE_CHECKING:
    import pyvista as pv

TREE_RESOLUTION = 192
"""Cells along the longest side of the mesh of a posed tree."""

SHARED_EDGES = 1 / 3
"""Least share of the edges of a rest pose that a posed mesh has too; polygons may be divided otherwise."""

WEIGHT_ERROR, LAST_ROW_ERROR = 1e-3, 1e-6
"""Largest differences of a vertex's summed skin weights from 1, and of a matrix's last row from 0 0 0 1."""


@dataclass(frozen=True, eq=False)
class PosedMesh:
    """A mesh object in another pose; its decals lie on its rest pose. `pose` makes some.

    Attributes
    ----------
    rest : MeshObject
        The mesh in its rest pose.
    vertices : float32[n, 3]
        Positions of its vertices in this pose, relative to the origin of the rest pose.
    colors : float32[n, 3], optional
        sRGB colours of its vertices between the decals, in place of that of the rest pose.
    tree : TreeObject, optional
        The posed tree that this is the mesh of.
    """

    rest: MeshObject
    vertices: Float32Array
    colors: Float32Array | None = None
    tree: TreeObject | None = None

    @property
    def name(self) -> str:
        """Name of the object."""
        return self.rest.name

    @property
    def faces(self) -> Int32Array:
        """Corner indices, int32[m, 3]."""
        return self.rest.faces

    @property
    def color(self) -> Color | BaseColor | Float32Array:
        """Colour between the decals, or one colour for each vertex."""
        return self.rest.color if self.colors is None else self.colors

    @property
    def crease_angle(self) -> float:
        """Least angle in degrees between two faces of the rest pose at which their edge is drawn sharp."""
        return self.rest.crease_angle

    @property
    def origin(self) -> Origin:
        """Point that vertices are relative to."""
        return self.rest.origin

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels besides the name."""
        return self.rest.labels

    @property
    def named_only(self) -> bool:
        """True if only decals lie on the object that name it."""
        return self.rest.named_only

    @property
    def bounds(self) -> Box:
        """Lower and upper corner of this pose, float32[3] each."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)


@dataclass(frozen=True, eq=False)
class PosedScene:
    """A scene of which some meshes are posed, for `decals.render` and `decals.rendering.Renderer`.

    Attributes
    ----------
    objects : tuple of MeshObject, TreeObject or PosedMesh
    decals : Decals
        Decals, in the rest pose.
    images : tuple of DecalImage
    camera : Camera
    drawing : Drawing
        How the scene is drawn.
    """

    posed: ClassVar[bool] = True
    objects: tuple[SceneObject | PosedMesh, ...]
    decals: Decals
    images: tuple[DecalImage, ...]
    camera: Camera
    drawing: Drawing

    def render(self, **options: Any) -> Picture:
        """Draw the scene as its `drawing` says; options and errors are those of `decals.render`."""
        picture: Picture = public("render")(self, **options)
        return picture

    def save(self, path: str | os.PathLike[str]) -> None:
        """Raise `InvalidScene`: a file holds the rest pose, so save the scene that was posed.

        `decals.bake` writes the pose itself, with the decals in a texture.
        """
        public("save_scene")(cast(Any, self), path)


def pose(
    scene: Scene,
    poses: Mapping[str, "ArrayLike | MeshObject | pv.PolyData | Node"],
    *,
    rigid: bool = False,
    camera: Camera | None = None,
    resolution: int = TREE_RESOLUTION,
) -> PosedScene:
    """Pose meshes and trees of a scene; their decals stretch with them.

    Decals are evaluated in the rest pose, so a point of the surface has the same owner, contact and image
    place in all poses. Objects that are not posed are drawn as they are. A posed tree is drawn as a mesh.

    Parameters
    ----------
    scene : Scene
        Scene with objects in their rest pose, and decals on them.
    poses : mapping from str to float[n, 3], MeshObject, pyvista.PolyData or Node
        For some objects, by name: new positions of all vertices of a mesh, or a mesh with these and the same
        faces; or the posed tree, with the same leaves as the tree at rest, from left to right. Warps bend
        and twist it, and skeletons may move; see `blobtree.Node.rest_coordinates`. The tree at rest may have
        other warps.
    rigid : bool
        True for decals that keep their shape: each moves and turns with the nearest triangle of a posed mesh,
        and meets its neighbours in the new pose.
    camera : Camera, optional
        Camera in place of the scene's.
    resolution : int
        Cells along the longest side of the mesh of a posed tree.

    Returns
    -------
    PosedScene

    Raises
    ------
    InvalidScene
        No object has such a name, the positions are not as many as its vertices, a posed mesh has other
        faces, a posed tree has other leaves than the tree at rest, or a rigid decal lies on a triangle whose
        area in the pose is zero.

    See Also
    --------
    skin : positions from joints, by linear blend skinning.
    decals.Relaxation : particles that follow a surface whose triangles change.

    Examples
    --------
    >>> import pyvista
    >>> import decals
    >>> tube = pyvista.Cylinder(radius=0.3, height=2).triangulate().clean().subdivide(2)
    >>> scene = decals.cover(decals.MeshObject("tube", tube.points, tube.regular_faces), count=60)
    >>> bent = tube.points + [[0, 0, 1]] * tube.points[:, :1] ** 2
    >>> decals.render(decals.pose(scene, {"tube": bent}), size=(64, 48))
    Picture(64 × 48 pixels)
    """
    require_scene("scene", scene, "pose the scene that was posed")
    if not isinstance(poses, Mapping):
        raise InvalidScene(f"poses: expected positions by the names of objects, got {describe(poses)}")
    whole_number("resolution", resolution, 4, 2048, InvalidScene)
    items = {item.name: item for item in scene.objects}
    for name in poses:
        if name not in items:
            known = ", ".join(repr(item) for item in items) or "none"
            raise InvalidScene(
                f"poses: expected names of objects of the scene ({known}), got {describe(name)}"
            )
    posed = {name: _posed(items[name], given, resolution) for name, given in poses.items()}
    view = scene.camera
    if camera is not None:
        view = instance("camera", camera, Camera, InvalidScene, "leave it out for the scene's")
    if truth("rigid", rigid, InvalidScene):
        return PosedScene(
            tuple(_as_object(posed.get(item.name, item)) for item in scene.objects),
            _carried(scene, posed),
            scene.images,
            view,
            scene.drawing,
        )
    objects = tuple(posed.get(item.name, item) for item in scene.objects)
    return PosedScene(objects, scene.decals, scene.images, view, scene.drawing)


def _as_object(item: SceneObject | PosedMesh) -> SceneObject:
    """Return a posed mesh as a mesh without another pose; other objects as they are."""
    if not isinstance(item, PosedMesh):
        return item
    if item.tree is not None:
        return item.tree
    return replace(item.rest, vertices=item.vertices, source=None)


def _carried(scene: Scene, posed: Mapping[str, PosedMesh]) -> Decals:
    """Return decals that have moved and turned with the nearest triangles of posed meshes.

    Decals that are nearer to another object stay.
    """
    decals = scene.decals
    positions, normals, tangents = decals.positions.copy(), decals.normals.copy(), decals.tangents.copy()
    distances = [
        np.linalg.norm(item.surface.project(decals.positions)[0] - decals.positions, axis=1)
        for item in scene.objects
    ]
    nearest = np.argmin(distances, axis=0) if len(decals) else np.zeros(0, np.int64)
    for number, item in enumerate(scene.objects):
        own = np.flatnonzero(nearest == number)
        if item.name not in posed or not len(own):
            continue
        mesh = posed[item.name]
        faces, weights = mesh.rest.surface.locate(decals.positions[own])
        before, after = (
            vertices.astype(np.float64)[mesh.faces[faces]] for vertices in (mesh.rest.vertices, mesh.vertices)
        )
        flat = np.flatnonzero(~np.cross(after[:, 1] - after[:, 0], after[:, 2] - after[:, 0]).any(axis=1))
        if len(flat):
            raise InvalidScene(
                f"pose of {item.name!r}: expected triangles with area below rigid decals, got none for decal "
                f"{own[flat[0]]}; leave out rigid, or repair triangle {faces[flat[0]]}"
            )
        offsets = decals.positions[own] - np.einsum("nc,nca->na", weights, before)
        turns = _frames(after) @ _frames(before).transpose(0, 2, 1)
        moved = np.einsum("nc,nca->na", weights, after) + np.einsum("nab,nb->na", turns, offsets)
        positions[own] = moved
        normals[own] = np.einsum("nab,nb->na", turns, decals.normals[own])
        tangents[own] = np.einsum("nab,nb->na", turns, decals.tangents[own])
    return decals.replace(positions=positions, normals=normals, tangents=tangents)


def _frames(corners: Float64Array) -> Float64Array:
    """Return orthonormal frames of triangles float64[n, 3, 3]: the first edge, the normal, and their product.

    The frames are columns.
    """
    edge = corners[:, 1] - corners[:, 0]
    normal = np.cross(edge, corners[:, 2] - corners[:, 0])
    units = [
        axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-300) for axis in (edge, normal)
    ]
    frames: Float64Array = np.stack([*units, np.cross(*units)], axis=2)
    return frames


def _posed(
    item: SceneObject, given: "ArrayLike | MeshObject | pv.PolyData | Node", resolution: int
) -> PosedMesh:
    """Return an object in a pose."""
    if isinstance(item, TreeObject):
        if not isinstance(given, Node):
            raise InvalidScene(f"pose of {item.name!r}: expected the posed tree, got {describe(given)}")
        return _posed_tree(item, given, resolution)
    if isinstance(given, Node):
        raise InvalidScene(f"pose of {item.name!r}: expected positions of vertices, got a tree")
    return _posed_mesh(item, given)


def _posed_tree(item: TreeObject, tree: Node, resolution: int) -> PosedMesh:
    """Return the mesh of a posed tree, with the places of its vertices on the tree at rest."""
    moved = replace(item, tree=tree.translate(np.negative(item.origin)) if any(item.origin) else tree)
    mesh = polygonize(moved.tree, resolution=resolution)
    try:
        places = moved.tree.rest_coordinates(mesh.vertices, rest=item.tree)
    except InvalidNode as error:
        raise InvalidScene(f"pose of {item.name!r}: {error}") from error
    if not np.isfinite(places).all():
        raise InvalidScene(f"pose of {item.name!r}: expected a surface near its leaves; it has other parts")
    rest = MeshObject(
        item.name,
        item.surface.project(places)[0],
        mesh.faces,
        origin=item.origin,
        labels=item.labels,
        named_only=item.named_only,
        orientation=MeshOrientation.KEEP,
    )
    return PosedMesh(rest, mesh.vertices, moved.tree.colors(mesh.vertices), moved)


def _posed_mesh(rest: MeshObject, given: "ArrayLike | MeshObject | pv.PolyData") -> PosedMesh:
    name, vertices = f"pose of {rest.name!r}", cast(Any, given)
    advice = "a pose has the vertices of the rest pose"
    faces = None
    if is_model(given) and not isinstance(given, str | os.PathLike | tuple | list):
        vertices, faces = cast(MeshData, as_shape(given, name=name, error=InvalidScene)).arrays
        if isinstance(given, MeshObject):
            vertices = np.add(vertices, given.origin, dtype=np.float64)
    positions = _numbers(name, vertices, rest.vertices.shape, advice)
    if faces is not None:
        shared = np.isin(_edges(rest.faces), _edges(faces)).mean()
        if shared < SHARED_EDGES:
            raise InvalidScene(
                f"{name}: expected the faces of the rest pose, got a mesh that has {shared:.0%} of its "
                "edges; give a mesh of the same topology"
            )
    return PosedMesh(rest, (positions - np.asarray(rest.origin)).astype(np.float32))


def _edges(faces: Int32Array) -> Int64Array:
    """Return the edges of triangles, each as one number."""
    ends = np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64), axis=1)
    return np.unique(ends[:, 0] << 32 | ends[:, 1])


def skin(vertices: ArrayLike, weights: ArrayLike, transforms: ArrayLike) -> Float64Array:
    """Return vertices moved by joints: linear blend skinning, as in glTF.

    Parameters
    ----------
    vertices : float[n, 3]
        Positions in the rest pose.
    weights : float[n, j]
        Weights of j joints for each vertex, from 0, whose sum is 1.
    transforms : float[j, 4, 4]
        Matrices of the joints, from the rest pose to the new one, for column vectors: the last row of each is
        [0, 0, 0, 1], and its last column the translation.

    Returns
    -------
    float64[n, 3]

    Raises
    ------
    InvalidScene
        Arrays of other shapes, values that are not finite, negative weights, sums other than 1, or matrices
        with another last row.

    Examples
    --------
    >>> import numpy
    >>> import decals
    >>> shift = numpy.eye(4)
    >>> shift[0, 3] = 2.0
    >>> decals.skin([[0, 0, 0], [1, 0, 0]], [[1, 0], [0.5, 0.5]], [numpy.eye(4), shift]).tolist()
    [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    """
    points = _numbers("vertices", vertices, (-1, 3), "give one row per vertex")
    matrices = _numbers("transforms", transforms, (-1, 4, 4), "give one matrix per joint")
    advice = "give one row per vertex, one column per joint"
    shares = _numbers("weights", weights, (len(points), len(matrices)), advice)
    astray = np.abs(matrices[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1) > LAST_ROW_ERROR
    if astray.any():
        worst = int(astray.argmax())
        raise InvalidScene(
            "transforms: expected matrices whose last row is [0, 0, 0, 1], got "
            f"{matrices[worst, 3].tolist()} in matrix {worst}; transpose matrices for row vectors"
        )
    off = np.where((shares < 0.0).any(axis=1), np.inf, np.abs(shares.sum(axis=1) - 1.0))
    if off.max(initial=0.0) > WEIGHT_ERROR:
        worst = int(off.argmax())
        raise InvalidScene(
            "weights: expected numbers from 0 whose sum is 1 for each vertex, "
            f"got {shares[worst].tolist()} at vertex {worst}; divide each row by its sum"
        )
    moved = np.einsum("jab,nb->nja", matrices[:, :3, :3], points) + matrices[:, :3, 3]
    result: Float64Array = np.einsum("nj,nja->na", shares, moved)
    return result


def _numbers(name: str, values: ArrayLike, shape: tuple[int, ...], advice: str) -> Float64Array:
    """Return finite numbers of a shape (-1: any length), or raise InvalidScene."""
    lengths = ", ".join("n" if length == -1 else str(length) for length in shape)
    try:
        array = np.asarray(real(values), np.float64)
    except (TypeError, ValueError, OverflowError):
        found = describe(values)
        raise InvalidScene(f"{name}: expected numbers of shape [{lengths}], got {found}; {advice}") from None
    fits = array.ndim == len(shape) and all(e in (-1, s) for s, e in zip(array.shape, shape, strict=True))
    if not fits:
        raise InvalidScene(f"{name}: expected shape [{lengths}], got {list(array.shape)}; {advice}")
    if not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0])
        raise InvalidScene(
            f"{name}: expected finite numbers, got {array[row].tolist()} in row {row}; drop or repair it"
        )
    return array
