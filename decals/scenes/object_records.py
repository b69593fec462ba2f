"""Objects as a scene file has them: meshes by reference or in full, trees as BlobTree documents."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from blobtree.nodes.io import Document, from_document, to_document
from decals.errors import InvalidScene
from decals.images import is_builtin
from decals.scenes.camera import Vector
from decals.scenes.mesh_file import MeshArrays, read_mesh
from decals.scenes.scene import MeshObject, SceneObject, TreeObject

SAMPLE = "sample:"
"""How the source of a mesh begins that is a sample and no file."""

SampleLoader = Callable[[str], MeshArrays]
"""Gives the vertices and faces of a sample mesh by its name."""


class _InlineMesh(Struct, forbid_unknown_fields=True):
    """Little-endian float32 and int32 rows; msgspec writes bytes as base64."""

    vertices: bytes
    faces: bytes


class MeshRecord(Struct, tag="mesh", tag_field="type", forbid_unknown_fields=True, omit_defaults=True):
    """A mesh: where its triangles come from, or the triangles."""

    name: str
    color: Vector
    source: str | None = None
    data: _InlineMesh | None = None


class TreeRecord(Struct, tag="tree", tag_field="type", forbid_unknown_fields=True):
    """A tree."""

    name: str
    tree: Document


def record_of(item: SceneObject, folder: Path) -> MeshRecord | TreeRecord:
    """Describe an object; paths are relative to the folder."""
    if isinstance(item, TreeObject):
        return TreeRecord(item.name, to_document(item.tree))
    if item.source is not None:
        return MeshRecord(item.name, item.color, source=relative(item.source, folder))
    data = _InlineMesh(_packed(item.vertices, "<f4"), _packed(item.faces, "<i4"))
    return MeshRecord(item.name, item.color, data=data)


def object_of(record: MeshRecord | TreeRecord, folder: Path, samples: SampleLoader | None) -> SceneObject:
    """Make, read or fetch an object that was described.

    Raises
    ------
    InvalidScene, InvalidMesh, blobtree.BlobTreeError
        If what it names is missing or broken.
    """
    if isinstance(record, TreeRecord):
        return TreeObject(record.name, from_document(record.tree))
    if (record.source is None) == (record.data is None):
        raise InvalidScene(f"mesh {record.name!r}: expected either 'source' or 'data'; give one of them")
    if record.data is not None:
        vertices, faces = _unpacked(record.name, record.data)
        return MeshObject(record.name, vertices, faces, record.color)
    vertices, faces = _mesh(str(record.source), folder, samples)
    source = absolute(str(record.source), folder)
    return MeshObject(record.name, vertices, faces, record.color, source)


def _mesh(source: str, folder: Path, samples: SampleLoader | None) -> MeshArrays:
    if not source.startswith(SAMPLE):
        return read_mesh(folder / source)
    if samples is None:
        raise InvalidScene(f"the mesh {source!r} is a sample; pass samples=, or use the command line")
    return samples(source.removeprefix(SAMPLE))


def _packed(array: NDArray[Any], kind: str) -> bytes:
    return np.ascontiguousarray(array, kind).tobytes()


def _unpacked(name: str, data: _InlineMesh) -> MeshArrays:
    try:
        vertices = np.frombuffer(data.vertices, "<f4").reshape(-1, 3)
        faces = np.frombuffer(data.faces, "<i4").reshape(-1, 3)
    except ValueError as error:
        raise InvalidScene(f"mesh {name!r}: expected rows of three 4-byte numbers ({error})") from error
    return vertices.astype(np.float32), faces.astype(np.int32)


def relative(source: str, folder: Path) -> str:
    """Write a path as seen from the folder, so that scene and files can move together."""
    path = Path(source)
    if _is_name(source):
        return source
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()


def absolute(source: str, folder: Path) -> str:
    """Undo `relative`."""
    return source if _is_name(source) else str(folder / source)


def _is_name(source: str) -> bool:
    """Whether a source is a sample or a generated image rather than a path."""
    return source.startswith(SAMPLE) or is_builtin(source)
