"""Models of other kinds as our surfaces: pyvista and trimesh meshes, arrays, files and BlobTrees."""

import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeGuard, Union, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

import blobtree
from blobtree import Mesh, Node
from blobtree.files import no_file
from blobtree.validation import describe, items, point_array
from decals.errors import ImplicitDecalsError, InvalidMesh, InvalidScattering
from decals.model import MAX_COORDINATE
from decals.surfaces.base_color import BaseColor, checked_color, linear_colors
from decals.surfaces.extras import READERS
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.mesh_data import MeshData, joined
from decals.surfaces.surface import Surface, is_surface
from decals.surfaces.triangulate import polygon_triangles

if TYPE_CHECKING:
    import pyvista as pv

TREE_SUFFIXES = (".json", ".vm", ".frep")
"""Suffixes of files that hold a tree."""

MODEL_ADVICE = (
    "give a BlobTree, a pyvista dataset, a mesh with vertices and faces, a pair of arrays (vertices, faces)"
    " or the path of a model"
)


@runtime_checkable
class MeshLike(Protocol):
    """A mesh of any library (trimesh, blobtree, ours): ``float[n, 3]`` and ``int[m, k]`` arrays."""

    @property
    def vertices(self) -> ArrayLike:
        """Positions of the vertices."""
        ...

    @property
    def faces(self) -> ArrayLike:
        """Corner indices of the faces."""
        ...


class HasSurface(Protocol):
    """Anything with a surface of its own, such as an object of a scene."""

    @property
    def surface(self) -> Surface:
        """Surface for decals."""
        ...


Model: TypeAlias = Union[
    Node, MeshLike, "pv.DataSet", "pv.MultiBlock", tuple[ArrayLike, ArrayLike], str, os.PathLike[str]
]
"""Everything that has a shape: see `as_shape`."""


def as_shape(
    model: object, *, name: str = "model", error: type[ImplicitDecalsError] = InvalidMesh
) -> Node | MeshData:
    """Return the tree of a model, or its triangles with their base colour.

    Parameters
    ----------
    model : Model
        A BlobTree. Or a pyvista dataset, whose surface is extracted and triangulated. Or any object with
        ``vertices`` and ``faces``, such as a trimesh mesh. Or a trimesh scene, whose
        parts are joined. Or a tuple ``(vertices, faces)`` of arrays. Or the path of a mesh file or of a tree
        in JSON.
    name : str
        Name of the model in messages.
    error : type
        Exception that is raised for an object of any other kind.

    Returns
    -------
    Node or MeshData
        A tree; or vertices, faces and the base colour that the model has.

    Raises
    ------
    InvalidMesh, InvalidFile
        If the model has no faces, its indices are wrong, or its file cannot be used.
    """
    if isinstance(model, Node):
        return model
    if isinstance(model, str | os.PathLike):
        if reason := no_file(model):
            raise error(f"{name}: expected a model, {reason}; check the path")
        return read_shape(model)
    if _is_dataset(model):
        data: MeshData = READERS["dataset"](model, name=name)
        return data
    if _is_trimesh_scene(model):
        parts = [part for part in model.dump() if hasattr(part, "faces") and len(part.faces)]
        if parts:
            return joined([_mesh_data(part, name) for part in parts])
        model = model.to_geometry()  # points or curves, which have no faces
    if isinstance(model, MeshData):
        return model
    if isinstance(model, MeshLike) and not isinstance(model, type):
        return _mesh_data(model, name)
    if _is_array_pair(model):
        return _array_mesh(*model, name)
    raise error(f"{name}: expected a model, got {describe(model)}; {MODEL_ADVICE}")


def as_surface(
    model: object, *, name: str = "surface", error: type[ImplicitDecalsError] = InvalidMesh
) -> Surface:
    """Return a model as a surface for decals.

    A `Surface` is returned as it is, an object of a scene gives its own surface. All other models, and the
    arguments and errors, are those of `as_shape`.

    Examples
    --------
    >>> import pyvista
    >>> from decals.surfaces import as_surface
    >>> round(as_surface(pyvista.Cube()).area, 3)
    6.0
    """
    if is_surface(model):
        return model
    if is_surface(own := getattr(model, "surface", None)):
        return own
    shape = as_shape(model, name=name, error=error)
    return ImplicitSurface(shape) if isinstance(shape, Node) else MeshSurface(shape.vertices, shape.faces)


def listed(models: object) -> list[object]:
    """Return one model or several as a list."""
    members = None if is_model(models) else items(models)
    return [models] if members is None else list(members)


def as_surfaces(models: object) -> tuple[Surface, ...]:
    """Return one model or several as a tuple of surfaces, or raise `InvalidScattering`."""
    return tuple(as_surface(model, name="surfaces", error=InvalidScattering) for model in listed(models))


def as_mesh_surface(
    model: object, advice: str, *, name: str, error: type[ImplicitDecalsError]
) -> MeshSurface:
    """Return a model with vertices as a surface; raise an error with advice for a tree or another surface."""
    for known in (model, getattr(model, "surface", None)):
        if isinstance(known, MeshSurface):
            return known
    shape = None if is_surface(model) or hasattr(model, "tree") else as_shape(model, name=name, error=error)
    if not isinstance(shape, MeshData):
        raise error(f"{name}: expected a mesh, got {describe(model)}; {advice}")
    return MeshSurface(shape.vertices, shape.faces)


def is_model(value: object) -> bool:
    """Return True if the value is one model, so not a sequence of models."""
    known = (Node, str, os.PathLike, MeshLike)
    datasets = _is_dataset(value) or _is_trimesh_scene(value)
    return is_surface(value) or isinstance(value, known) or datasets or _is_array_pair(value)


def _is_dataset(value: object) -> "TypeGuard[pv.DataSet | pv.MultiBlock]":
    """Return True for a dataset of pyvista, which is not imported for that: a dataset comes from it."""
    pyvista = sys.modules.get("pyvista")
    return pyvista is not None and isinstance(value, pyvista.DataSet | pyvista.MultiBlock)


def _is_trimesh(value: object) -> bool:
    """Return True for a mesh of trimesh, which is not imported for that."""
    trimesh = sys.modules.get("trimesh")
    return trimesh is not None and isinstance(value, trimesh.Trimesh)


def _is_trimesh_scene(value: object) -> TypeGuard[Any]:
    """Return True for a scene of trimesh, which is not imported for that."""
    trimesh = sys.modules.get("trimesh")
    return trimesh is not None and isinstance(value, trimesh.Scene)


def read_shape(path: str | os.PathLike[str]) -> Node | MeshData:
    """Read a mesh file, or a tree from the file of this package or of another program.

    Raises
    ------
    InvalidMesh, InvalidFile
        If the file is missing or cannot be used.
    """
    path = Path(path)
    if path.suffix.lower() not in TREE_SUFFIXES:
        data: MeshData = READERS["file"](path)
        return data
    try:
        tree: Node = READERS.get("tree", blobtree.load)(path)
    except OSError as error:
        raise InvalidMesh(
            f"could not read {str(path)!r} ({error.strerror}); check its permissions"
        ) from error
    return tree


def _is_array_pair(model: object) -> TypeGuard[tuple[ArrayLike, ArrayLike]]:
    arrays = (np.ndarray, list, tuple)
    return isinstance(model, tuple) and len(model) == 2 and all(isinstance(part, arrays) for part in model)


def _mesh_data(mesh: MeshLike, name: str) -> MeshData:
    """Return a mesh of any library with the colours that it has."""
    data = _array_mesh(mesh.vertices, mesh.faces, name)
    color = checked_color(lambda: _color(mesh), name, len(data.vertices), len(data.faces))
    return data if color is None else replace(data, color=color)


def _color(mesh: MeshLike) -> BaseColor | None:
    """Return the colours of a mesh of trimesh or of `blobtree.polygonize`."""
    if isinstance(mesh, Mesh):
        return BaseColor(linear_colors(mesh.colors))
    return READERS["trimesh"](mesh) if _is_trimesh(mesh) else None


def _array_mesh(vertices: ArrayLike, faces: ArrayLike | Sequence[Any], name: str) -> MeshData:
    point_array(vertices, f"{name}: vertices", InvalidMesh, MAX_COORDINATE)
    arrays = polygon_triangles(np.asarray(vertices).reshape(-1, 3), _polygons(faces, name), name=name)
    return MeshData(*arrays)


def _polygons(faces: ArrayLike | Sequence[Any], name: str) -> Any:
    """Return corner indices as ``int[m, k]``, or as a list of ``int[k_i]``."""
    try:
        rows = np.asarray(faces)
        if rows.size == 0:
            return []
        polygons: Any = rows if rows.ndim == 2 else None
    except (TypeError, ValueError, OverflowError):  # rows of different lengths
        polygons = _ragged(faces)
    listed = [polygons] if isinstance(polygons, np.ndarray) else polygons
    if listed and all(row.dtype.kind == "f" for row in listed):
        raise InvalidMesh(
            f"{name}: expected faces as rows of whole numbers, got {listed[0].dtype}; convert them with "
            ".astype(int)"
        )
    if not listed or any(row.dtype.kind not in "iu" or row.ndim not in (1, 2) for row in listed):
        raise InvalidMesh(f"{name}: expected faces as rows of corner indices, got {describe(faces)}")
    if any(row.shape[-1] < 3 for row in listed) and isinstance(polygons, np.ndarray):
        raise InvalidMesh(f"{name}: expected faces of 3 or more corners, got {polygons.shape[1]}")
    _refuse_counts(listed, name)
    if isinstance(polygons, np.ndarray):
        _refuse_columns(polygons, name)
    return polygons


COUNTED_ROWS = 8
"""Rows of faces up to which the same first number in all of them may be by chance."""


TRANSPOSED_ROWS = (3, 4)
"""Numbers of rows of an array that holds a triangle or quadrilateral in each column."""


def _refuse_counts(listed: list[Any], name: str) -> None:
    """Refuse rows that all begin with the number of the corners behind it, as pyvista writes faces."""
    rows = listed if len(listed) > 1 else listed[0]
    if len(rows) > COUNTED_ROWS and all(len(row) > 3 and row[0] == len(row) - 1 for row in rows):
        one = isinstance(listed[0], np.ndarray) and listed[0].ndim == 2
        advice = "faces[:, 1:]" if one else "[row[1:] for row in faces]"
        raise InvalidMesh(
            f"{name}: expected faces as rows of corner indices, got rows that begin with the number of their "
            f"corners; give {advice}"
        )


def _refuse_columns(faces: NDArray[Any], name: str) -> None:
    """Refuse an array whose columns are the faces: its rows share vertices as polygons never do."""
    corners, count = faces.shape
    if corners > 3 and count > COUNTED_ROWS and (faces[0] == corners - 1).all():
        raise InvalidMesh(
            f"{name}: expected faces as rows of corner indices, got an array of {corners} rows whose {count} "
            "columns begin with the number of their corners; give faces[1:].T"
        )
    if corners not in TRANSPOSED_ROWS or count <= corners or len(np.unique(faces)) > faces.size // 2:
        return
    repeated, column_repeated = (
        (np.diff(np.sort(rows, axis=1)) == 0).any(axis=1) for rows in (faces, faces.T)
    )
    padded = (faces[:, -1] == faces[:, -2]).any()  # as polygons of fewer corners are
    if not column_repeated.any() and (count > COUNTED_ROWS or (repeated.any() and not padded)):
        raise InvalidMesh(
            f"{name}: expected faces as rows of corner indices, got an array of {corners} rows whose "
            f"{count} columns are the faces; give faces.T"
        )


def _ragged(faces: Any) -> list[Any]:
    try:
        return [np.asarray(row) for row in faces]
    except (TypeError, ValueError, OverflowError):
        return []
