"""Texture of unwrapped meshes: texels to surface points, their colours, and gutters around charts."""

from collections.abc import Callable, Sequence

import numpy as np

from blobtree._typing import Float32Array, Float64Array, Int64Array, UInt8Array
from blobtree.progress import Progress
from decals.baking.atlas import Unwrapped
from decals.baking.meshes import BakeMesh
from decals.images.texels import encode_srgb
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.windings import MeshOrientation

BLOCK_SAMPLES = 1 << 19
"""Points that are coloured at once, which bounds the memory besides that of the texture."""

MIN_GUTTER = 4.0
GUTTER_SHARE = 1 / 256
"""Width of the gutters: so many texels, or this part of the texture if that is more."""

ROUNDING = 1e-2
"""Distance in texels below which a texel counts as inside a chart."""

ColorFunction = Callable[
    [int, Float32Array, Float32Array, Float32Array | None, Float64Array | None], Float64Array
]
"""Linear colours ``float64[n, 3]`` of the surface of the mesh with a number, at points with unit normals; or
other values, of as many channels, which need the tangents there. At last base colours, linear."""


def color_bytes(colors: Float64Array) -> UInt8Array:
    """Return linear colours as sRGB bytes."""
    levels: UInt8Array = np.rint(255.0 * encode_srgb(colors)).astype(np.uint8)
    return levels


def bake_texture(
    meshes: Sequence[BakeMesh],
    unwrapped: Sequence[Unwrapped],
    size: int,
    samples: int,
    color_at: ColorFunction,
    report: Progress,
    *,
    channels: int = 3,
    encode: Callable[[Float64Array], UInt8Array] = color_bytes,
    tangents: Sequence[Float32Array] | None = None,
) -> UInt8Array:
    """Return the texture ``uint8[size, size, channels]``, by default sRGB, first row at the top.

    A texel is the mean colour of ``samples`` × ``samples`` points on it. Texels outside all charts take the
    colours of the closest points of charts within the gutter, and the mean colour of the charts beyond it, so
    that smaller mip levels mix in no foreign colour.
    """
    sheet = _Sheet(meshes, unwrapped, tangents)
    gutter = max(MIN_GUTTER, GUTTER_SHARE * size)
    image = np.zeros((size, size, channels), np.uint8)
    empty = np.ones((size, size), np.bool_)
    total, count = np.zeros(channels), 0
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    height = max(1, BLOCK_SAMPLES // (size * samples**2))
    for top in range(0, size, height):
        report("colouring texels", top / size)
        rows, columns = np.mgrid[top : min(top + height, size), 0:size].reshape(2, -1)
        centers = np.stack([columns, rows], axis=1) + 0.5
        distances = sheet.distances(centers)
        near = distances <= gutter
        if not near.any():
            continue
        points = (centers[near, None] + offsets).reshape(-1, 2)
        colors = sheet.colors(points, color_at).reshape(-1, len(offsets), channels).mean(axis=1)
        image[rows[near], columns[near]] = encode(colors)
        empty[rows[near], columns[near]] = False
        inside = distances[near] < ROUNDING
        total, count = total + colors[inside].sum(axis=0), count + int(inside.sum())
    if count:
        image[empty] = encode(total[None] / count)[0]
    return image


class _Sheet:
    """All unwrapped meshes as one flat mesh on the texture."""

    def __init__(
        self,
        meshes: Sequence[BakeMesh],
        unwrapped: Sequence[Unwrapped],
        tangents: Sequence[Float32Array] | None,
    ) -> None:
        counts = [len(part.rows) for part in unwrapped]
        starts = np.cumsum([0, *counts[:-1]])
        places = np.concatenate([part.places for part in unwrapped])
        faces = np.concatenate([part.faces + start for part, start in zip(unwrapped, starts, strict=True)])
        self._flat = MeshSurface(
            np.column_stack([places, np.zeros(len(places))]), faces, orientation=MeshOrientation.KEEP
        )
        pairs = list(zip(meshes, unwrapped, strict=True))
        self._vertices = np.concatenate([mesh.places[part.rows] for mesh, part in pairs])
        self._normals = np.concatenate([mesh.facings[part.rows] for mesh, part in pairs])
        self._tangents = None if tangents is None else np.concatenate(tangents)
        self._rows = np.concatenate([part.rows for part in unwrapped])
        self._bases = [mesh.base for mesh in meshes]
        self._first_faces = np.cumsum([0, *(len(part.faces) for part in unwrapped[:-1])])
        self._mesh_of_face = np.repeat(np.arange(len(meshes)), [len(part.faces) for part in unwrapped])

    def distances(self, points: Float64Array) -> Float64Array:
        """Return distances in texels to the closest points of charts, 0 inside up to rounding."""
        faces, weights = self._locate(points)
        closest = self._mixed(self._flat.vertices, faces, weights)[:, :2]
        distances: Float64Array = np.linalg.norm(closest - points, axis=1)
        return distances

    def colors(self, points: Float64Array, color_at: ColorFunction) -> Float64Array:
        """Return colours of the surface at points of the texture."""
        faces, weights = self._locate(points)
        positions = self._mixed(self._vertices, faces, weights).astype(np.float32)
        normals = self._mixed(self._normals, faces, weights)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        units = (normals / np.maximum(lengths, 1e-30)).astype(np.float32)
        meshes = self._mesh_of_face[faces]
        tangents = None
        if self._tangents is not None:
            tangents = self._mixed(self._tangents, faces, weights).astype(np.float32)
        parts = []
        order = [np.nonzero(meshes == number)[0] for number in np.unique(meshes)]
        for rows in order:
            along = None if tangents is None else tangents[rows]
            number = int(meshes[rows[0]])
            light = self._base_light(number, faces[rows], weights[rows])
            parts.append(color_at(number, positions[rows], units[rows], along, light))
        colors: Float64Array = np.concatenate(parts)[np.argsort(np.concatenate(order))]
        return colors

    def _base_light(self, number: int, faces: Int64Array, weights: Float64Array) -> Float64Array | None:
        """Return the linear base colours of a mesh at points of faces; None for a mesh without any."""
        base = self._bases[number]
        if base is None:
            return None
        corners = self._rows[self._flat.faces[faces]]
        return base.light_of(corners, faces - self._first_faces[number], weights)

    def _locate(self, points: Float64Array) -> tuple[Int64Array, Float64Array]:
        return self._flat.locate(np.column_stack([points, np.zeros(len(points))]))

    def _mixed(self, values: Float32Array, faces: Int64Array, weights: Float64Array) -> Float64Array:
        """Return values at the vertices, interpolated in faces."""
        corners = self._flat.faces[faces]
        mixed: Float64Array = np.einsum("ij,ijk->ik", weights, values[corners].astype(np.float64))
        return mixed
