"""A scene to edit: a mesh and a tree that touch, covered with decals; and its bytes."""

import hashlib
from functools import cache
from typing import Any

import numpy as np

from blobtree import Node, Point, Segment
from decals import Camera, DecalImage, Decals, MeshObject, Scene, TreeObject, scatter
from decals.editing import Document, EditSession

TREE = Point((0, 0, 0), radius=1.0) + Segment((0.9, 0.5, 0), (1.4, 1.3, 0), radius=0.5, color=(0.9, 0.5, 0.2))
CARVED = TREE - Point((0, -0.9, 0.6), radius=0.5)


def box(low: Any, high: Any) -> Any:
    corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(3, 8).T
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return corners.astype(np.float32), np.array(faces, np.int32)


@cache
def scene(count: int = 60) -> Any:
    objects = (TreeObject("blob", CARVED), MeshObject("box", *box((-3.5, -1, -1), (-1.5, 1, 1))))
    decals = scatter([item.surface for item in objects], count=count)
    images = tuple(DecalImage.load(name) for name in ("scale", "eye"))
    return Scene(objects=objects, decals=decals, images=images, camera=Camera.framing(objects[0].bounds))


def one(position: Any = (0, 0, 1), radius: Any = 0.2, **values: Any) -> Any:
    return Decals([position], [[0, 0, 1]], [[1, 0, 0]], [radius], **values)


def digest(document: Document) -> str:
    """Everything that a document holds; parts by identity, as renderers tell them apart."""
    decals = document.decals
    same = document.objects, document.images, document.camera
    parts = (decals.numbers.tolist(), *map(id, same), document.layer_names, document.drawing)
    arrays = [
        getattr(decals.decals, name) for name in ("positions", "normals", "tangents", "radii", "images")
    ]
    arrays += [
        getattr(decals.decals, name) for name in ("spill", "interactions", "layers", "tints", "opacities")
    ]
    arrays += [
        decals.decals.fade_angles,
        decals.decals.fade_depths,
        np.array(decals.decals.receivers.tolist(), np.str_),
    ]
    records = decals.arrays["decal_records"].reshape(-1, 4, 4)[decals.numbers]
    content = [repr(parts).encode(), *(_bytes(array) for array in [*arrays, records])]
    return hashlib.sha256(b"".join(content)).hexdigest()


def _bytes(array: Any) -> bytes:
    """Return the bytes of an array; a zero has no sign, as equal decals may differ in it."""
    unsigned = np.where(array == 0, np.zeros_like(array), array) if array.dtype.kind == "f" else array
    return bytes(unsigned.tobytes())


def goes_back_and_forth(session: EditSession) -> None:
    """Make sure that undoing all gives back the first state of `scene`, and redoing all the last."""
    entries, last = len(session.labels), digest(session.document)
    for _ in range(entries):
        session.undo()
    assert digest(session.document) == digest(EditSession(scene()).document)
    for _ in range(entries):
        session.redo()
    assert digest(session.document) == last


def tree_of(document: Document | Scene, number: int = 0) -> Node:
    """Return the tree of an object."""
    item = document.objects[number]
    assert isinstance(item, TreeObject)
    return item.tree
