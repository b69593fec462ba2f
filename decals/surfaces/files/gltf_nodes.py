"""The nodes of a glTF file: their places in space, and what its scene shows at them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from blobtree._typing import Float64Array
from decals.surfaces.files.faults import Notes, Unreadable, item
from decals.surfaces.files.gltf_accessors import Accessors
from decals.surfaces.files.gltf_document import Document, Node

NONE = -1
"""Parent of a node without one."""

MATRIX_TOLERANCE = 1e-5
"""Largest deviation of a matrix's last row from (0, 0, 0, 1)."""

_PLACES = {"TRANSLATION": ("VEC3", (0.0, 0.0, 0.0)), "ROTATION": ("VEC4", (0.0, 0.0, 0.0, 1.0)),
           "SCALE": ("VEC3", (1.0, 1.0, 1.0))}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Placement:
    """A mesh at a node."""

    mesh: int
    weights: tuple[float, ...]
    matrices: Float64Array
    """Maps of the copies to the scene, ``[k, 4, 4]``."""

    joints: Float64Array | None
    """Maps of the skin's joints from the mesh to the scene, ``[j, 4, 4]``."""

    name: str


def placements(document: Document, accessors: Accessors, notes: Notes) -> Iterator[Placement]:
    """Yield the meshes that the default scene shows; without scenes, those of all nodes."""
    nodes = document.nodes
    parents = _parents(nodes)
    worlds = _worlds(nodes, parents)
    skins: dict[int, Float64Array] = {}
    for index in _shown(nodes, _roots(document, parents), notes):
        node, name = nodes[index], f"node {index}"
        if node.mesh is None:
            continue
        mesh = item(document.meshes, node.mesh, "mesh", name)
        if not mesh.primitives:
            continue
        weights = mesh.weights if node.weights is None else node.weights
        matrices = worlds[index : index + 1]
        if node.skin is not None and node.skin not in skins:
            skins[node.skin] = _joints(document, accessors, worlds, node.skin, name)
        if node.extensions.instancing is not None:
            matrices = matrices @ _copies(accessors, node.extensions.instancing.attributes, name)
        _check_finite(matrices, name)
        yield Placement(node.mesh, weights, matrices, None if node.skin is None else skins[node.skin], name)


def _parents(nodes: Sequence[Node]) -> list[int]:
    """Return the parent of each node; `Unreadable` for children with several."""
    parents: list[int] = [NONE] * len(nodes)
    for index, node in enumerate(nodes):
        for child in node.children:
            item(nodes, child, "node", f"node {index}")
            if parents[child] != NONE:
                raise Unreadable(f"node {child} is a child of node {parents[child]} and of node {index}")
            parents[child] = index
    return parents


def _worlds(nodes: Sequence[Node], parents: Sequence[int]) -> Float64Array:
    """Return the map of each node to the scene, ``[n, 4, 4]``, one level of the tree after the other."""
    worlds = _locals(nodes)
    level = [index for index, parent in enumerate(parents) if parent == NONE]
    count = len(level)
    with np.errstate(over="ignore", invalid="ignore"):  # those that are used are checked
        while level := [child for index in level for child in nodes[index].children]:
            worlds[level] = worlds[[parents[index] for index in level]] @ worlds[level]
            count += len(level)
    if count < len(nodes):
        raise Unreadable(
            f"{len(nodes) - count} of its {len(nodes)} nodes are their own descendants or below such"
        )
    return worlds


def _locals(nodes: Sequence[Node]) -> Float64Array:
    """Return the map of each node to its parent."""
    maps = _maps(
        *(np.array([getattr(node, name) for node in nodes]) for name in ("translation", "rotation", "scale"))
    )
    for index, node in enumerate(nodes):
        if node.matrix is not None:
            maps[index] = np.reshape(node.matrix, (4, 4)).T
            if np.abs(maps[index, 3] - (0.0, 0.0, 0.0, 1.0)).max() > MATRIX_TOLERANCE:
                raise Unreadable(f"node {index} has a matrix that is no affine map")
    return maps


def _maps(translations: Float64Array, rotations: Float64Array, scales: Float64Array) -> Float64Array:
    """Return matrices of translations, quaternions of any length, and scales."""
    count = len(translations)
    x, y, z, w = rotations.reshape(count, 4).T
    with np.errstate(all="ignore"):
        lengths = (rotations.reshape(count, 4) ** 2).sum(axis=1)
        s = np.where(lengths > 0.0, 2.0 / lengths, 0.0)
        rows = [[1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
                [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
                [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)]]  # fmt: skip
        maps = np.zeros((count, 4, 4))
        maps[:, :3, :3] = np.moveaxis(np.array(rows), -1, 0) * scales.reshape(count, 1, 3)
    maps[:, :3, 3] = translations.reshape(count, 3)
    maps[:, 3, 3] = 1.0
    return maps


def _roots(document: Document, parents: Sequence[int]) -> Sequence[int]:
    """Return the nodes at which the default scene begins."""
    if not document.scenes:
        return [index for index, parent in enumerate(parents) if parent == NONE]
    roots = item(document.scenes, document.scene or 0, "scene", "the file").nodes
    for index in roots:
        item(document.nodes, index, "node", "its scene")
        if parents[index] != NONE:
            raise Unreadable(f"its scene begins at node {index}, which is a child of node {parents[index]}")
    return list(dict.fromkeys(roots))


def _shown(nodes: Sequence[Node], roots: Sequence[int], notes: Notes) -> Iterator[int]:
    """Yield the nodes below the roots, parents first, without hidden ones."""
    rest = list(reversed(roots))
    while rest:
        index = rest.pop()
        if nodes[index].extensions.visibility.visible:
            yield index
            rest.extend(reversed(nodes[index].children))
        else:
            notes.add("hidden nodes are left out", f"node {index}")


def _joints(
    document: Document, accessors: Accessors, worlds: Float64Array, index: int, name: str
) -> Float64Array:
    """Return the maps of a skin's joints. They hold the whole way to the scene: a skin ignores its node."""
    skin, place = item(document.skins, index, "skin", name), f"skin {index}"
    for joint in skin.joints:
        item(document.nodes, joint, "node", place)
    joints = worlds[list(skin.joints)]
    if skin.inverse_bind_matrices is not None:
        inverse = accessors.floats(skin.inverse_bind_matrices, ("MAT4",), place, slice(len(joints)))
        if len(inverse) < len(joints):
            raise Unreadable(f"{place} has {len(joints)} joints, but {len(inverse)} inverse bind matrices")
        joints = joints @ inverse.reshape(-1, 4, 4).swapaxes(1, 2)
    _check_finite(joints, place)
    return joints


def _check_finite(matrices: Float64Array, place: str) -> None:
    if not np.isfinite(matrices).all():
        raise Unreadable(f"{place} has a matrix with numbers that are not finite")


def _copies(accessors: Accessors, attributes: dict[str, int], name: str) -> Float64Array:
    """Return the maps of the copies of a node's mesh (EXT_mesh_gpu_instancing)."""
    counts = {accessors.of(index, name).count for index in attributes.values()}
    if len(counts) != 1:
        raise Unreadable(f"{name} has copies at {sorted(counts) or 'no'} places")
    places = [
        accessors.floats(attributes[key], (kind,), name)
        if key in attributes
        else np.tile(default, (*counts, 1))
        for key, (kind, default) in _PLACES.items()
    ]
    return _maps(*places)
