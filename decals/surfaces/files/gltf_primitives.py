"""The primitives of a glTF mesh as triangles: corners of every mode, morph targets and skins."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree._typing import Float64Array, Int64Array
from decals.errors import InvalidMesh
from decals.surfaces.base_color import WHITE, BaseColor, BaseTexture
from decals.surfaces.files.faults import Notes, Unreadable
from decals.surfaces.files.gltf_accessors import Accessors, compressed
from decals.surfaces.files.gltf_document import DRACO, Primitive
from decals.surfaces.files.gltf_materials import Materials
from decals.surfaces.files.pieces import Piece, mirrors, turned

TRIANGLES, STRIP, FAN = 4, 5, 6
"""Modes of primitives with faces; the others are points and lines."""

CHUNK = 1 << 18
"""Weights of joints that are used at once."""

_VECTOR, _COLORS, _COORDINATES = ("VEC3",), ("VEC3", "VEC4"), ("VEC2",)


@dataclass(frozen=True, slots=True)
class Skinned:
    """Joints that move each vertex of a piece, and how strongly."""

    joints: Int64Array
    """``[n, k]``"""

    weights: Float64Array
    """``[n, k]``; each row has the sum 1."""


def read_primitive(
    primitive: Primitive,
    weights: tuple[float, ...],
    accessors: Accessors,
    materials: Materials,
    notes: Notes,
    place: str,
    *,
    skinned: bool,
) -> tuple[Piece, Skinned | None] | None:
    """Return the triangles of a primitive, moved by its morph targets, and its skin if it should have one.

    None stands for a primitive without faces.
    """
    position = primitive.attributes.get("POSITION")
    if not TRIANGLES <= primitive.mode <= FAN:
        if not 0 <= primitive.mode < TRIANGLES:
            raise Unreadable(f"{place} has the unknown mode {primitive.mode}")
        notes.add("points and lines are left out", place)
        return None
    if position is None:
        notes.add("primitives without positions are left out", place)
        return None
    _check_compression(primitive, accessors, place)
    corners = _corners(primitive, position, accessors, place)
    triangles = _triangles(corners, primitive.mode, notes, place)
    rows, faces = _used(triangles, accessors.of(position, place).count)
    points = _morphed("POSITION", _VECTOR, primitive, weights, accessors, rows, place)
    if not np.isfinite(points).all():
        raise Unreadable(f"{place} has positions that are no finite numbers")
    color = _color(primitive, accessors, materials, notes, rows, place)
    skin = _skinned(primitive, accessors, rows, place) if skinned else None
    return Piece(points, faces, color), skin


def _check_compression(primitive: Primitive, accessors: Accessors, place: str) -> None:
    """Refuse a compressed primitive, unless its accessors hold the same elements without compression."""
    used = [primitive.attributes["POSITION"], primitive.indices]
    if primitive.extensions.draco and any(
        index is not None and accessors.of(index, place).buffer_view is None for index in used
    ):
        raise compressed(DRACO, place)


def _corners(primitive: Primitive, position: int, accessors: Accessors, place: str) -> Int64Array:
    """Return the vertices that a primitive names in turn."""
    count = len(accessors.stored(position, _VECTOR, place))
    corners: NDArray[Any] | None = None
    if primitive.indices is not None:
        corners = accessors.stored(primitive.indices, ("SCALAR",), place)[:, 0]
    length = count if corners is None else len(corners)
    accessors.budget.read(min(count, length), length // 3 if primitive.mode == TRIANGLES else length, place)
    if corners is None:
        return np.arange(count)
    if corners.dtype.kind != "u":
        raise Unreadable(f"{place} has indices that are no unsigned integers")
    if length and corners.max() >= count:
        raise Unreadable(f"{place} has {count} points but a face asks for number {corners.max()}")
    return corners.astype(np.int64)


def _triangles(corners: Int64Array, mode: int, notes: Notes, place: str) -> Int64Array:
    """Return the triangles, ``[m, 3]``, of corners in a mode."""
    if mode == TRIANGLES:
        whole = len(corners) - len(corners) % 3
        if whole < len(corners):
            notes.add("triangles of fewer than three corners are left out", place)
        return corners[:whole].reshape(-1, 3)
    first = np.arange(max(len(corners) - 2, 0))
    if mode == FAN:
        steps = np.stack([first + 1, first + 2, np.zeros_like(first)], axis=1)
    else:
        odd = first % 2
        steps = np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)
    return corners[steps]


def _used(triangles: Int64Array, count: int) -> tuple[Int64Array, Int64Array]:
    """Return which of the points triangles use, in order, and the triangles as indices into these."""
    if count > triangles.size:  # few corners of many points, which other primitives use
        rows, faces = np.unique(triangles, return_inverse=True)
        return rows, faces.reshape(-1, 3)
    flags = np.zeros(count, np.bool_)
    flags[triangles] = True
    return np.flatnonzero(flags), (np.cumsum(flags) - 1)[triangles]


def _morphed(
    name: str, kinds: tuple[str, ...], primitive: Primitive, weights: tuple[float, ...],
    accessors: Accessors, rows: Int64Array, place: str,
) -> Float64Array:  # fmt: skip
    """Return rows of an attribute, moved by the morph targets."""
    values = accessors.floats(primitive.attributes[name], kinds, place, rows)
    for target, weight in zip(primitive.targets, weights, strict=False):
        if weight != 0.0 and name in target:
            values += weight * accessors.floats(target[name], kinds, place, rows)
    return values


def _color(
    primitive: Primitive,
    accessors: Accessors,
    materials: Materials,
    notes: Notes,
    rows: Int64Array,
    place: str,
) -> BaseColor | None:
    """Return the base colour of rows by the material and the colours of vertices; None without either."""
    material = materials.of(primitive.material, place)
    if material is None and "COLOR_0" not in primitive.attributes:
        return None
    colors = np.tile(WHITE if material is None else material.factor, (len(rows), 1))
    coordinates = None
    textures: list[BaseTexture] = []
    try:
        if "COLOR_0" in primitive.attributes:
            colors *= accessors.floats(primitive.attributes["COLOR_0"], _COLORS, place, rows)[:, :3]
        if material is not None and material.texture is not None:
            index = primitive.attributes.get(f"TEXCOORD_{material.texcoord}")
            if index is None:
                notes.add("textures without coordinates are left out", place)
            else:
                coordinates = material.placed(accessors.floats(index, _COORDINATES, place, rows))
                textures.append(material.texture)
        return BaseColor(np.clip(colors, 0.0, 1.0), coordinates, textures)
    except (InvalidMesh, Unreadable) as fault:
        notes.add("colours are left out", f"{place} ({fault})")
        return None


def _skinned(primitive: Primitive, accessors: Accessors, rows: Int64Array, place: str) -> Skinned | None:
    """Return the joints of the rows and their weights; None for a primitive that no skin moves."""
    names = primitive.attributes
    sets = [name[7:] for name in names if name.startswith("JOINTS_") and "WEIGHTS_" + name[7:] in names]
    if not sets:
        return None
    joints = [accessors.stored(names["JOINTS_" + key], ("VEC4",), place, rows) for key in sets]
    given = [accessors.floats(names["WEIGHTS_" + key], ("VEC4",), place, rows) for key in sets]
    weights = np.concatenate(given, axis=1)
    if any(array.dtype.kind != "u" for array in joints) or not np.isfinite(weights).all():
        raise Unreadable(f"{place} has joints that are no unsigned integers, or weights that are not finite")
    weights[weights.sum(axis=1) <= 0.0, 0] = 1.0
    used = np.where(weights != 0.0, np.concatenate(joints, axis=1).astype(np.int64), 0)
    return Skinned(used, weights / weights.sum(axis=1, keepdims=True))


def posed(piece: Piece, skinned: Skinned, joints: Float64Array, place: str) -> Piece:
    """Return a piece whose vertices the joints have moved; parts that these mirror are turned."""
    if len(skinned.joints) and skinned.joints.max() >= len(joints):
        raise Unreadable(f"{place} asks for joint {skinned.joints.max()}, but its skin has {len(joints)}")
    points, mirrored = np.empty_like(piece.points), np.zeros(len(piece.points), np.bool_)
    size = CHUNK // skinned.joints.shape[1] + 1
    for start in range(0, len(points), size):
        part = slice(start, start + size)
        maps = np.einsum("nk,nkij->nij", skinned.weights[part], joints[skinned.joints[part], :3])
        points[part] = (maps[:, :, :3] @ piece.points[part, :, None])[..., 0] + maps[:, :, 3]
        mirrored[part] = mirrors(maps)
    return replace(piece, points=points, faces=turned(piece.faces, mirrored[piece.faces].sum(axis=1) > 1))
