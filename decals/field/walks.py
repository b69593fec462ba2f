"""Relays of the walked mapping, for all decals over their surfaces; `decals.field.walk` reads them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.kernels import loaded
from blobtree.progress import reporting
from blobtree.validation import items
from decals.field.mapping import ImageMapping
from decals.field.rules import PictureRules
from decals.field.walk import (
    CELLS,
    GRID,
    LISTED,
    NONE,
    NOWHERE,
    RELAY,
    RELAYS,
    RELAYS_PER_RADIUS,
    SIDE,
    SPACING,
    TWO_WAYS,
)
from decals.field.walk_kernels import (
    WalkedMesh,
    WalkStart,
    compare_relays,
    find_longer,
    list_relays,
    place_relays,
    smooth_relays,
)
from decals.index.editor import RECORDS, DecalEditor
from decals.model import Decals
from decals.record import RECORD, RIM_RADIUS
from decals.surfaces.convert import as_surface, is_model
from decals.surfaces.implicit import ImplicitSurface
from decals.surfaces.mesh import MeshSurface
from decals.surfaces.surface import is_surface

TOLERANCE = 0.004
"""Largest error of the corrected mapping, in visible radii, at which a decal needs no relays."""

FARTHEST = 0.5
"""Distance of a centre from its surface, in visible radii, from which a decal gets no relays."""

ASIDE = 1e-4
"""Distance from the centre, in visible radii along the second axis of the image, at which walks begin.

From a centre on a corner, walks begin on its face above, and the cut lies below.
"""

CORNER = 0.1
"""Difference of the sum of angles at a vertex from a full turn, in radians, from which there is a corner."""

BESIDE = 0.3
"""Least distance from a corner, in visible radii, from which walks are compared."""

CELLS_PER_RADIUS = 8
"""Cells of the mesh of a BlobTree along the visible radius of the smallest decal."""

LEAST_COSINE = -0.5
"""Cosine between the normals of a decal and of its face, from which the decal gets relays."""


@dataclass(frozen=True, eq=False)
class Walks:
    """Log maps around decals over their surfaces, for the image mapping WALKED.

    Make them with `Walks.over`. They are those of decals and surfaces at that time.

    Attributes
    ----------
    texels : float32[k, 4]
        First a row (grid or −1, n, 0, 0) for each of n decals, then the grids of relays.
    """

    texels: Float32Array
    _rows: Float32Array
    _meshes: tuple[MeshSurface, ...]

    def __len__(self) -> int:
        return len(self._rows)

    @classmethod
    def over(
        cls,
        decals: Decals | DecalEditor,
        models: Any,
        *,
        previous: "Walks | None" = None,
        only: ArrayLike | None = None,
    ) -> "Walks":
        """Walk from the centres of decals over surfaces.

        Each decal walks over the surface nearest to its centre. It gets a grid of relays if the corrected
        mapping would err by more than 0.4 % of its radius.

        Parameters
        ----------
        decals : Decals or DecalEditor
            The decals.
        models : model or sequence of models
            Objects of a scene, meshes, BlobTrees or surfaces.
        previous : Walks, optional
            Earlier walks, of which those of decals and surfaces that have not changed are kept.
        only : int[k], optional
            Numbers of the decals that walk. The others are drawn in the corrected mapping. Default: all.

        Examples
        --------
        >>> import decals, pyvista
        >>> cube = pyvista.Cube()
        >>> disk = decals.Decals([[0.4, 0, 0.5]], [[0, 0, 1]], [[1, 0, 0]], [0.3])
        >>> walks = decals.field.Walks.over(disk, [cube])
        >>> beyond = [[0.5, 0.1, 0.4]]  # 0.1 behind the edge, 0.2 from the centre on the unrolled faces
        >>> seen = decals.evaluate(disk, beyond, [[1, 0, 0]], mapping="walked", walks=walks)
        >>> (0.6 * (seen.uv - 0.5)).round(3).tolist()
        [[0.2..., 0.1...]]
        """
        single = is_model(models) or is_surface(getattr(models, "surface", None))
        members = None if single else items(models)
        several = (models,) if members is None else members
        return cls.of_rows(walk_rows(decals), several, previous=previous, only=only)

    @classmethod
    def of_rows(
        cls,
        rows: Float32Array,
        models: Iterable[Any],
        *,
        previous: "Walks | None" = None,
        only: ArrayLike | None = None,
    ) -> "Walks":
        """Walk from the centres of decals as `over` does; the rows are those of `walk_rows`."""
        radii = (RIM_RADIUS * rows[:, 3]).astype(np.float32)
        meshes = tuple(_meshes(models, radii))
        slots = np.full(len(rows), -1, np.int64)
        kept = np.zeros((0, GRID, 4), np.float32)
        changed = np.ones(len(rows), np.bool_)
        if previous is not None and [*map(id, previous._meshes)] == [*map(id, meshes)]:
            shared = min(len(rows), len(previous._rows))
            changed[:shared] = (rows[:shared] != previous._rows[:shared]).any(axis=1)
            before = previous.texels[:shared, 0].astype(np.int64)
            used = ~changed[:shared] & (before >= 0)
            slots[:shared][used] = np.arange(used.sum())
            kept = previous.texels[len(previous._rows) :].reshape(-1, GRID, 4)[before[used]]
        if only is not None:
            changed &= np.isin(np.arange(len(rows)), only)
        chosen = np.flatnonzero(changed & (radii > 0.0) & np.isfinite(rows).all(axis=1))
        numbers, grids = _walk(rows[chosen], meshes)
        slots[chosen[numbers]] = len(kept) + np.arange(len(numbers))
        heads = np.zeros((len(rows), 4), np.float32)
        heads[:, 0], heads[:, 1] = slots, len(rows)
        texels = np.concatenate([heads, kept.reshape(-1, 4), grids.reshape(-1, 4)])
        return cls(texels, rows, meshes)

    def take(self, numbers: Int64Array) -> "Walks":
        """Return the walks of some of the decals."""
        heads = self.texels[numbers]
        heads[:, 1] = len(numbers)
        texels = np.concatenate([heads, self.texels[len(self) :]])
        return Walks(texels, self._rows[numbers], self._meshes)

    def points(self, places: Float64Array) -> Float64Array:
        """Return surface points at places in the images, ``float64[n, k, 2]``, one row for each decal.

        They are relative to the centres, in visible radii, ``float64[n, k, 3]``; NaN where no walk leads.
        """
        result = np.full((*places.shape[:2], 3), np.nan)
        rows = np.flatnonzero(self.texels[: len(self), 0] >= 0)
        grids = self.texels[len(self) :].reshape(-1, GRID, 4)[self.texels[rows, 0].astype(np.int64)]
        numbers = np.clip(np.rint(places[rows] / SPACING).astype(np.int64) + RELAYS_PER_RADIUS, 0, SIDE - 1)
        relays = grids[:, :RELAYS].reshape(len(rows), SIDE, SIDE, RELAY, 4).astype(np.float64)
        near = relays[np.arange(len(rows))[:, None], numbers[..., 1], numbers[..., 0]]
        aside = places[rows] - SPACING * (numbers - RELAYS_PER_RADIUS)
        along_x, along_y, normals = near[..., 1, :3], near[..., 2, :3], near[..., 3]
        steps = np.cross(along_y * aside[..., :1] - along_x * aside[..., 1:], normals)
        there = near[..., 0, 0] != NOWHERE
        area = np.einsum("...i,...i->...", np.cross(along_x, along_y), normals)
        led = near[..., 0, :3] + steps / np.where(there, area, 1.0)[..., None]
        result[rows] = np.where(there[..., None], led, np.nan)
        return result


def walk_rows(decals: Decals | DecalEditor) -> Float32Array:
    """Return a copy of what decides the walks of decals: their centres, radii and axes, float32[n, 12]."""
    records = decals.arrays[RECORDS] if isinstance(decals, DecalEditor) else decals.packed()
    return records.reshape(-1, RECORD, 4)[:, :3].reshape(-1, 12).copy()


def walks_for(
    mapping: ImageMapping,
    decals: Decals | DecalEditor,
    objects: Iterable[Any],
    *,
    only: ArrayLike | None = None,
) -> Walks | None:
    """Return the walks of decals over the objects with a surface; None in mappings that need none."""
    if mapping is not ImageMapping.WALKED:
        return None
    return Walks.over(decals, with_surface(objects), only=only)


def evaluation_options(
    rules: PictureRules, decals: Decals | DecalEditor, objects: Iterable[Any]
) -> dict[str, Any]:
    """Return the arguments of `evaluate` for these rules, and for decals on these objects."""
    return rules.modes | {"walks": walks_for(rules.mapping, decals, objects)}


def with_surface(objects: Iterable[Any]) -> list[Any]:
    """Return the objects over which decals can walk."""
    return [item for item in objects if hasattr(item, "surface")]


def _meshes(models: Iterable[Any], radii: Float32Array) -> Iterable[MeshSurface]:
    """Yield the triangles of models; those of BlobTrees resolve the smallest radius."""
    least = float(radii[radii > 0].min(initial=np.inf))
    for model in models:
        surface = getattr(model, "surface", None)
        if surface is None:
            surface = as_surface(model)
        if isinstance(surface, ImplicitSurface):
            surface = surface.triangulated(least / CELLS_PER_RADIUS)
        if isinstance(surface, MeshSurface):
            yield surface


def _walk(rows: Float32Array, meshes: Sequence[MeshSurface]) -> tuple[Int32Array, Float32Array]:
    """Return the rows of the decals that need relays, and their grids ``float32[g, GRID, 4]``."""
    best = np.full(len(rows), np.inf)
    mesh_of = np.full(len(rows), -1)
    for number, mesh in enumerate(meshes):
        found = np.linalg.norm(mesh.project(rows[:, :3])[0] - rows[:, :3], axis=1)
        mesh_of[found < best] = number
        best = np.minimum(best, found)
    mesh_of[best > FARTHEST * RIM_RADIUS * rows[:, 3]] = -1
    numbers, grids = [np.zeros(0, np.int64)], [np.zeros((0, GRID, 4), np.float32)]
    with reporting() as report:
        for number, mesh in enumerate(meshes):
            own = np.flatnonzero(mesh_of == number)
            for first in range(0, len(own), AT_ONCE):
                report("walking over the surface", first / len(own))
                part = own[first : first + AT_ONCE]
                needed, made = _grids(rows[part], mesh)
                numbers.append(part[needed])
                grids.append(made)
    return np.concatenate(numbers).astype(np.int32), np.concatenate(grids)


AT_ONCE = 64
"""Decals whose grids are made at once; the 441 relays and 512 cells of each take 29 KB."""


def _grids(rows: Float32Array, mesh: MeshSurface) -> tuple[BoolArray, Float32Array]:
    """Return True for the decals that need relays, and the grids of these."""
    begun = _starts(rows, mesh)
    starts: Any = wp.array(begun, dtype=WalkStart, device="cpu")
    relays = len(rows) * SIDE * SIDE
    placed: Any = wp.zeros(len(rows) * RELAYS, dtype=wp.vec4, device="cpu")
    texels: Any = wp.zeros_like(placed)
    wp.launch(loaded(place_relays, "cpu"), relays, [starts, _walked(mesh)], [placed], device="cpu")
    wp.launch(loaded(smooth_relays, "cpu"), relays, [placed], [texels], device="cpu")
    errors: Any = wp.zeros(relays, dtype=wp.float32, device="cpu")
    frames: list[Any] = [
        wp.array(rows[:, 4 * k : 4 * k + 3].copy(), dtype=wp.vec3, device="cpu") for k in (1, 2)
    ]
    wp.launch(loaded(compare_relays, "cpu"), relays, [*frames, texels], [errors], device="cpu")
    needed = errors.numpy().reshape(len(rows), -1).max(axis=1) > TOLERANCE
    grids = texels.numpy().reshape(len(rows), RELAYS, 4)[needed]
    origins = np.pad(begun["origin"][needed], ((0, 0), (0, 2)))[:, None]
    return needed, np.concatenate([grids, _cells(begun[needed], grids), origins], axis=1)


def _cells(begun: Any, grids: Float32Array) -> Float32Array:
    """Drop the longer one of two walks to a place from grids, and return the texels of their cells."""
    starts: Any = wp.array(begun, dtype=WalkStart, device="cpu")
    texels: Any = wp.array(grids.reshape(-1, 4), dtype=wp.vec4, device="cpu", copy=False)
    longer: Any = wp.zeros(len(grids) * SIDE * SIDE, dtype=wp.int32, device="cpu")
    wp.launch(loaded(find_longer, "cpu"), len(longer), [starts, texels], [longer], device="cpu")
    grids.reshape(-1, RELAY, 4)[longer.numpy() > 0] = [NOWHERE, NOWHERE, NOWHERE, 0.0]
    lists: Any = wp.full((len(grids) * CELLS, LISTED), NONE, dtype=wp.int32, device="cpu")
    two_ways: Any = wp.zeros(len(lists), dtype=wp.int32, device="cpu")
    wp.launch(loaded(list_relays, "cpu"), len(lists), [texels], [lists, two_ways], device="cpu")
    pairs = lists.numpy().reshape(-1, CELLS, LISTED // 2, 2)
    packed = pairs[..., 0] + (NONE + 1) * pairs[..., 1]
    packed[..., 0] += TWO_WAYS * two_ways.numpy().reshape(-1, CELLS)
    cells: Float32Array = packed.astype(np.float32)
    return cells


def _walked(mesh: MeshSurface) -> Any:
    """Return the triangles of a mesh, a `WalkedMesh`."""
    walked: Any = WalkedMesh()
    corners, normals, twins = mesh.triangles
    walked.vertices = wp.array(mesh.vertices, dtype=wp.vec3, device="cpu", copy=False)
    walked.corners = wp.array(corners.reshape(-1), dtype=wp.int32, device="cpu", copy=False)
    walked.normals = wp.array(normals, dtype=wp.vec3, device="cpu", copy=False)
    walked.twins = wp.array(twins, dtype=wp.int32, device="cpu", copy=False)
    return walked


def _starts(rows: Float32Array, mesh: MeshSurface) -> Any:
    """Return where the walks of decals begin; their axes turn with the normal, from the decal to its face."""
    centers, normals, tangents = (rows[:, 4 * k : 4 * k + 3].astype(np.float64) for k in range(3))
    radii = RIM_RADIUS * rows[:, 3]
    corners, face_normals, _ = mesh.triangles
    faces, weights = mesh.locate(centers + ASIDE * radii[:, None] * np.cross(normals, tangents))
    sound = np.searchsorted(mesh.sound, faces)
    weights = np.maximum(weights, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    points = np.einsum("nk,nki->ni", weights, mesh.vertices[corners[sound]] - centers[:, None])
    up = face_normals[sound].astype(np.float64)
    facing = (normals * up).sum(axis=1)
    tilt = (tangents * up).sum(axis=1) / np.maximum(1.0 + facing, 1.0 + LEAST_COSINE)
    u = tangents - tilt[:, None] * (normals + up)
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-30)
    kind: Any = WalkStart
    starts: Any = np.zeros(len(rows), kind.numpy_dtype())
    starts["centre"], starts["radius"] = centers, radii
    starts["point"], starts["u"], starts["v"] = points, u, np.cross(up, u)
    starts["place"] = np.clip(_along_axes(starts, points) / radii[:, None], -ASIDE, ASIDE)
    starts["origin"] = _origins(starts, mesh, corners[sound])
    starts["face"] = np.where(facing > LEAST_COSINE, sound, -1)
    return starts


def _along_axes(starts: Any, offsets: Float64Array) -> Float64Array:
    """Return offsets ``float64[n, 3]`` along the axes of decals, ``float64[n, 2]``."""
    return np.stack([np.einsum("ni,ni->n", offsets, starts[axis]) for axis in ("u", "v")], axis=1)


def _origins(starts: Any, mesh: MeshSurface, faces: Int32Array) -> Float64Array:
    """Return from which places in the image walks that begin in these faces are compared, ``float64[n, 2]``.

    From a centre close to a corner, all walks around it are about equally long. They are compared from a
    place farther from the corner, beyond the centre. Around one corner that gives the same cut.
    """
    offsets = mesh.vertices[faces] - (starts["centre"] + starts["point"])[:, None]
    distances = np.linalg.norm(offsets, axis=2) / starts["radius"][:, None]
    distances[mesh.angle_defects[faces] < CORNER] = np.inf
    nearest = np.arange(len(faces)), distances.argmin(axis=1)
    away = -_along_axes(starts, offsets[nearest])
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-30)
    origins: Float64Array = np.maximum(BESIDE - distances[nearest], 0.0)[:, None] * away
    return origins
