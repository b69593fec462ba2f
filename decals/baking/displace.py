"""`displace`: the surface of a scene, moved by the heights of its decals."""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.meshing.polygonize import polygonize
from blobtree.progress import Cancel, Progress, reporting
from blobtree.pyvista_views import MESH_SUFFIXES
from blobtree.validation import truth
from decals.baking.export import VERTICES, bake_parts, export
from decals.baking.fine_trees import middles_on
from decals.baking.plain_files import as_polydata
from decals.baking.surface_colors import options_on
from decals.errors import InvalidMesh, InvalidScene
from decals.field.evaluate import evaluate
from decals.field.mapping import ImageMapping
from decals.field.rules import AnyContact
from decals.model import Decals
from decals.scenes.cover import as_scene
from decals.scenes.objects import MeshObject, SceneObject, TreeObject
from decals.scenes.pose import PosedMesh, PosedScene
from decals.scenes.scene import Scene
from decals.surfaces import subdivide
from decals.surfaces.base_color import BaseColor
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.normals import split_at_creases
from decals.surfaces.subdivide import subdivided
from decals.surfaces.surface import Surface, unit_rows
from decals.surfaces.topology import welded
from decals.surfaces.windings import MeshOrientation
from decals.validation import allowed_number, checked_path

if TYPE_CHECKING:
    import pyvista as pv

EDGES_PER_RADIUS = 16
"""Edges along the radius of a decal, by default."""

ESTIMATE_SAMPLES = 2000
"""Points on each object by which the number of triangles is estimated."""

BLOCK = 1 << 18
"""Points that are evaluated at once."""


@dataclass(frozen=True, eq=False)
class DisplacedScene(PosedScene):
    """A scene whose surface is moved; its decals lie on the surface at rest. `displace` makes some."""

    def to_polydata(self) -> "pv.PolyData":
        """Return all objects as one mesh with normals and the colours of surface and decals, as "RGB"."""
        with reporting() as report:
            return as_polydata(bake_parts(self, VERTICES, report).merged())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the surface to a file with the colours of surface and decals at its vertices.

        Parameters
        ----------
        path : str or path
            The file: glb (with a node for each object), ply (one mesh with colours), vtp (with colours and
            normals), obj or stl.

        Raises
        ------
        InvalidScene
            The path cannot be used, or the file cannot be written.
        MissingPackage
            A GLB file needs the extra ``bake``; the message has the command.
        """
        path = checked_path(path, (".glb", *MESH_SUFFIXES))
        export(self, path, colors=None if path.suffix.lower() == ".stl" else VERTICES)


def displace(
    scene: Scene | str | os.PathLike[str],
    *,
    edge_length: float | None = None,
    contact: AnyContact | str | None = None,
    stiffness: float | None = None,
    mapping: ImageMapping | str | None = None,
    resolution: int | None = None,
    creases: bool = False,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> DisplacedScene:
    """Move the surface of a scene along its normals by the heights of its decals.

    Heights are those of `evaluate`: they follow contact as the images do. Objects become fine triangle
    meshes where decals with relief lie. New vertices on a tree lie on its surface. A closed object stays
    closed. The surface may pass through itself where heights exceed the radius of curvature of a groove.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, or its file. Some images are a `DecalMaterial` with ``relief``.
    edge_length : float, optional
        Greatest length of an edge below a decal with relief, in model units. By default a sixteenth of the
        decal's radius.
    contact : Contact or str, optional
        Contact mode; by default that of the scene, as for stiffness and mapping.
    stiffness : float, optional
        Stiffness of elastic contact, from 1.
    mapping : ImageMapping or str, optional
        Image mapping: ``"corrected"``, ``"chord"`` or ``"walked"``.
    resolution : int, optional
        Cells along the longest side of a tree's support, before triangles are divided. Default 64.
    creases : bool
        Keep the edges that unions, intersections and differences leave on implicit objects.
    progress : callable, optional
        Called with a stage and the fraction done.
    cancel : callable, optional
        Called often; the work stops if it returns True.

    Returns
    -------
    DisplacedScene
        A scene for `decals.render` and `decals.bake`, with ``to_polydata()`` and ``save(path)``.

    Raises
    ------
    InvalidScene
        No decal has relief, an option is out of range, or the scene is posed.
    InvalidMesh
        A tree has no surface at this resolution, or edges so short need too many triangles.
    Cancelled
        `cancel` returned True.

    See Also
    --------
    decals.evaluate : heights at any points, `Samples.height`.

    Examples
    --------
    >>> import blobtree, decals, numpy
    >>> dome = numpy.hypot(*numpy.mgrid[-1:1:32j, -1:1:32j]) < 0.7
    >>> stud = decals.DecalMaterial("stud", numpy.ones((32, 32, 3)), height=1.0 * dome, relief=0.3)
    >>> scene = decals.cover(blobtree.Point((0, 0, 0), radius=1), count=12, images=stud)
    >>> studded = decals.displace(scene, edge_length=0.1, resolution=16)
    >>> studded.to_polydata().is_manifold
    True
    >>> float(studded.to_polydata().length) > 2 * 3**0.5
    True
    """
    if isinstance(scene, PosedScene):
        raise InvalidScene(
            f"scene: expected a Scene at rest, got a {type(scene).__name__}; heights move surfaces at rest"
        )
    known = as_scene(scene)
    drawing = known.drawing.overridden(contact=contact, stiffness=stiffness, mapping=mapping)
    if edge_length is not None:
        edge_length = allowed_number(
            "edge_length", edge_length, "a length above 0", _is_positive, InvalidScene
        )
    creases = truth("creases", creases, InvalidScene)
    raised = [image for image, one in enumerate(known.images) if getattr(one, "relief", 0.0) != 0.0]
    rows = known.decals[np.isin(known.decals.images, raised)]
    if not len(rows):
        raise InvalidScene(
            "expected a decal whose image has relief, got none; give a DecalMaterial height= and relief="
        )
    needs = [_Edges(rows, edge_length) for _ in known.objects]
    fewest = [need.fewest_triangles(item.surface) for need, item in zip(needs, known.objects, strict=True)]
    if sum(fewest) > subdivide.MAX_FACES:
        raise subdivide.too_many(f"about {sum(fewest):.2g}")
    objects: list[SceneObject | PosedMesh] = []
    options = options_on(known.objects, known.decals, drawing) | {"images": known.images}
    with reporting(progress, cancel) as report:
        for number, item in enumerate(known.objects):
            report_part = partial(_report_part, report, number, len(known.objects))
            are_long = partial(needs[number].are_long, more=1.5 * fewest[number], report=report_part)
            rest, normals, colors = (
                _fine_mesh(item, are_long)
                if isinstance(item, MeshObject)
                else _fine_tree(item, are_long, resolution, creases, report_part)
            )
            heights = np.zeros(len(normals), np.float32)
            for first in range(0, len(normals), BLOCK):
                report_part("reading heights", first / len(normals))
                at = slice(first, first + BLOCK)
                found = evaluate(known.decals, rest.vertices[at], normals[at], on=item, **options)
                assert found.height is not None  # there are images with relief
                heights[at] = found.height
            moved = (rest.vertices + heights[:, None].astype(np.float64) * normals).astype(np.float32)
            objects.append(PosedMesh(rest, moved, colors) if heights.any() else item)
    return DisplacedScene(tuple(objects), known.decals, known.images, known.camera, drawing)


def _report_part(report: Progress, number: int, count: int, stage: str, fraction: float) -> None:
    """Report the progress of one of several objects as that of all of them."""
    report(stage, (number + fraction) / count)


def _is_positive(value: float) -> bool:
    return value > 0.0


class _Edges:
    """Which edges are too long for the decals near them."""

    def __init__(self, decals: Decals, length: float | None) -> None:
        self._centers, self._radii = decals.positions.astype(np.float64), decals.radii.astype(np.float64)
        limits = self._radii / EDGES_PER_RADIUS if length is None else np.full(len(decals), length)
        self._limits, self._seen = limits, 0

    def fewest_triangles(self, surface: Surface) -> float:
        """Return the number of triangles below the decals if each is as large as allowed, by samples."""
        from scipy.spatial import cKDTree

        points = surface.sample(ESTIMATE_SAMPLES, seed=0)[0]
        limits = np.full(len(points), np.inf)
        for decal, near in enumerate(cKDTree(points).query_ball_point(self._centers, self._radii)):
            limits[near] = np.minimum(limits[near], self._limits[decal])
        with np.errstate(over="ignore", divide="ignore"):  # an infinite number is refused too
            return float(surface.area * np.mean(4.0 / math.sqrt(3.0) / limits**2))

    def are_long(
        self, starts: Float64Array, ends: Float64Array, *, first: float, more: float, report: Progress
    ) -> BoolArray:
        """Return True for edges that may lie in a decal in part, and are longer than its limit.

        For reports: ``first`` edges in the first call, and about ``more`` in the others.
        """
        from scipy.spatial import cKDTree  # imported where it is used: it takes a quarter of a second

        self._seen += len(starts)
        report("dividing triangles", min(max(self._seen - first, 0.0) / max(more, 1.0), 1.0))
        lengths = np.sqrt(((ends - starts) ** 2).sum(axis=1))
        long = np.zeros(len(lengths), np.bool_)
        rows = np.flatnonzero(lengths > self._limits.min())
        if not len(rows):
            return long
        middles = cKDTree(0.5 * (starts[rows] + ends[rows]))
        reaches = self._radii + 0.5 * lengths[rows].max()
        for decal, near in enumerate(middles.query_ball_point(self._centers, reaches)):
            own = rows[near]
            gaps = np.linalg.norm(middles.data[near] - self._centers[decal], axis=1) - 0.5 * lengths[own]
            long[own[(gaps <= self._radii[decal]) & (lengths[own] > self._limits[decal])]] = True
        return long


FineMesh = tuple[MeshObject, Float32Array, Float32Array | None]
"""A mesh, and its normals and colours at vertices."""


def _fine_mesh(item: MeshObject, are_long: Callable[..., BoolArray]) -> FineMesh:
    """Return a mesh with short edges, with one vertex at each position."""
    split = split_at_creases(item.vertices, item.faces, item.crease_angle)
    corners = np.hstack([item.vertices[split.rows], split.normals]).astype(np.float64)
    faces = split.faces.astype(np.int64)
    rows, faces = subdivided(corners, faces, partial(are_long, first=1.5 * len(faces)))
    same = welded(rows[:, :3].astype(np.float32))
    kept, number = np.unique(same, return_inverse=True)
    sums: Float64Array = np.stack([np.bincount(number, axis, len(kept)) for axis in rows[:, 3:].T], axis=1)
    vertices, joined = rows[kept, :3].astype(np.float32), _int32(number.reshape(-1)[faces])
    color = item.color
    if isinstance(color, BaseColor):
        color = _carried(color, item, vertices[joined])
    coordinates: Float32Array | None = None
    if item.coordinates is not None:
        places = np.arange(3 * len(item.faces)).reshape(-1, 3)
        spare = BaseColor(coordinates=item.coordinates.reshape(-1, 2), corners=places)
        carried = _carried(spare, item, vertices[joined]).coordinates
        coordinates = None if carried is None else carried.reshape(-1, 3, 2)
    rest = replace(
        item,
        vertices=vertices,
        faces=joined,
        color=color,
        source=None,
        orientation=MeshOrientation.KEEP,
        coordinates=coordinates,
    )
    return rest, unit_rows(sums), None


def _carried(color: BaseColor, item: MeshObject, corners: Float32Array) -> BaseColor:
    """Return the base colour of a mesh on parts of its faces, whose corners ``[m, 3, 3]`` lie on it."""
    points = corners.astype(np.float64)
    numbers, _ = item.surface.locate(points.mean(axis=1))
    a, b, c = np.moveaxis(item.vertices[item.faces[numbers]].astype(np.float64), 1, 0)
    sides = np.stack([b - a, c - a], axis=2)
    second_third = np.einsum("nij,nkj->nki", np.linalg.pinv(sides), points - a[:, None])
    weights = np.concatenate([1.0 - second_third.sum(axis=2, keepdims=True), second_third], axis=2)
    weights = np.clip(weights, 0.0, 1.0)
    weights /= weights.sum(axis=2, keepdims=True)
    rows = color.rows_of(item.faces)[numbers]

    def at_corners(values: Float32Array | None) -> Float64Array | None:
        return (
            None
            if values is None
            else np.einsum("nkc,nci->nki", weights, values[rows]).reshape(-1, values.shape[1])
        )

    return BaseColor(
        at_corners(color.colors),
        at_corners(color.coordinates),
        color.textures,
        None if color.texture_of_face is None else color.texture_of_face[numbers],
        np.arange(3 * len(points)).reshape(-1, 3),
    )


def _fine_tree(
    item: TreeObject,
    are_long: Callable[..., BoolArray],
    resolution: int | None,
    creases: bool,
    report: Progress,
) -> FineMesh:
    """Return the surface of a tree as a mesh with short edges, whose vertices lie on it."""
    mesh = polygonize(item.tree, resolution=resolution, creases=creases, progress=report)
    if len(mesh.faces) == 0:
        raise InvalidMesh(
            f"object {item.name!r}: expected a tree with a surface, got none in cells of this size; "
            "increase the resolution"
        )
    surface = ImplicitSurface(item.tree)

    def midpoints(rows: Float64Array, ends: Int64Array) -> Float64Array:
        return np.hstack(middles_on(surface, *rows[ends.T, :3])[:2])

    corners = np.hstack([mesh.vertices, mesh.normals]).astype(np.float64)
    faces = mesh.faces.astype(np.int64)
    rows, faces = subdivided(corners, faces, partial(are_long, first=1.5 * len(faces)), midpoints)
    options: dict[str, Any] = {name: getattr(item, name) for name in ("labels", "named_only", "origin")}
    whole: dict[str, Any] = {
        name: ((),) if () in getattr(item, name) else () for name in ("hidden", "locked")
    }
    options["orientation"] = MeshOrientation.KEEP
    rest = MeshObject(item.name, rows[:, :3].astype(np.float32), _int32(faces), **options, **whole)
    return rest, rows[:, 3:].astype(np.float32), item.tree.colors(rest.vertices)


def _int32(faces: Int64Array) -> Int32Array:
    return faces.astype(np.int32)
