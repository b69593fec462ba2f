"""A triangle mesh as a surface for decals."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree.lazy import Lazy
from decals.errors import InvalidMesh
from decals.model import LARGEST
from decals.surfaces.ground import asked, inside, vectors
from decals.surfaces.mesh_ground import MeshGround
from decals.surfaces.surface import Flags, Floats, as_points, as_rays, as_reaches, frozen
from decals.wishes import device_or_error, whole

Faces = NDArray[np.int32]

SLIVER = 1e-6
"""A face whose doubled area is below this share of its squared edges has no usable normal and is left out
(Warp's own mesh queries skip the same faces)."""

EVEN_STEPS = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of the R2 sequence (Roberts 2018): powers of the inverse of the plastic number."""


class MeshSurface:
    """A triangle mesh: closest points, rays and containment through a bounding volume hierarchy.

    Degenerate faces are tolerated; they carry no samples and nothing projects onto them. The mesh
    contains points only where it is closed: every edge is used equally often in both directions,
    vertices at the same place counting as one.

    Parameters
    ----------
    vertices
        ``float[n, 3]``, finite and within ±LARGEST.
    faces
        ``int[m, 3]``, indices into the vertices, counter-clockwise seen from outside.
    device
        Warp device that answers questions of the host.

    Raises
    ------
    InvalidMesh
        For wrong shapes, NaN, infinite or huge vertices, indices out of range, no faces, no area.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, *, device: str = "cpu") -> None:
        self.device = device_or_error(device)
        self.vertices = _as_vertices(vertices)
        self.faces = _as_faces(faces, len(self.vertices))
        self.sound, normals, areas = _sound_faces(self.vertices, self.faces)
        self._corners = corners = np.ascontiguousarray(self.faces[self.sound])
        self._cumulative = np.cumsum(areas)
        self._normals = normals
        used = self.vertices[corners]
        self._bounds = used.min(axis=(0, 1)), used.max(axis=(0, 1))
        for array in (self.vertices, self.faces, *self._bounds):
            frozen(array)
        self._grounds: dict[str, MeshGround] = {}

    def __repr__(self) -> str:
        return f"MeshSurface({len(self.vertices)} vertices, {len(self.faces)} faces)"

    @property
    def area(self) -> float:
        """Sum of the areas of the faces."""
        return float(self._cumulative[-1])

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Corners of the box around the faces."""
        return self._bounds

    @Lazy
    def closed(self) -> bool:
        """Whether the faces bound a volume, with or without the degenerate ones."""
        return any(_is_closed(self.vertices, faces) for faces in (self.faces, self._corners))

    @Lazy
    def _winding(self) -> int:
        """1 if the mesh is closed and winds counter-clockwise seen from outside, -1 if clockwise, else 0."""
        if not self.closed:
            return 0
        return -1 if _volume(self.vertices, self.faces) < 0 else 1

    def sample(self, count: int, seed: int) -> tuple[Floats, Floats]:
        """Points uniform by area, one in each ``1/count`` of it along the order of the faces.

        Within a face they lie around a sequence of low discrepancy, so that parts of large faces get their
        share, but what is near each is chance.
        """
        whole("count", count)
        rng = np.random.default_rng(whole("seed", seed))
        levels = (np.arange(count) + rng.random(count)) * (self.area / max(count, 1))
        face = np.minimum(np.searchsorted(self._cumulative, levels, side="right"), len(self._corners) - 1)
        even = rng.random(2) + np.arange(count)[:, None] * EVEN_STEPS
        areas = np.diff(self._cumulative, prepend=0.0)[face]
        apart = 1.0 / np.sqrt(np.maximum(count * areas / self.area, 1.0))
        square = (even + apart[:, None] * rng.uniform(-1.0, 1.0, (count, 2))) % 1.0
        root, along = np.sqrt(square[:, :1]), square[:, 1:]
        a, b, c = np.moveaxis(self.vertices[self._corners[face]].astype(np.float64), 1, 0)
        positions = (1 - root) * a + root * ((1 - along) * b + along * c)
        return positions.astype(np.float32), self._normals[face]

    def on(self, device: str) -> MeshGround:
        """Return the mesh in the memory of a device; it is taken there once."""
        if device not in self._grounds:
            self._grounds[device] = MeshGround(
                self.vertices,
                self._corners,
                self._normals,
                bounds=self._bounds,
                winding=lambda: self._winding,
                device=device,
            )
        return self._grounds[device]

    def project(self, points: ArrayLike, *, within: Floats | None = None) -> tuple[Floats, Floats]:
        """Closest points of the mesh and the normals of their faces."""
        queries = as_points(points)
        reaches = as_reaches(within, len(queries))
        return asked(self.on(self.device), queries, reaches, self.device)

    def locate(self, points: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Rows of the faces closest to the points, and the weights of their corners there, ``[n, 3]``."""
        queries = as_points(points)
        faces: Any = wp.zeros(len(queries), dtype=wp.int32, device=self.device)
        weights: Any = wp.zeros(len(queries), dtype=wp.vec2, device=self.device)
        if len(queries):
            self.on(self.device).locate(vectors(queries, self.device), faces, weights)
        first, second = weights.numpy().reshape(-1, 2).astype(np.float64).T
        return self.sound[faces.numpy()], np.stack([first, second, 1.0 - first - second], axis=1)

    def normal(self, points: ArrayLike) -> Floats:
        """Return the normals of the faces closest to the points."""
        return self.project(points)[1]

    def raycast(self, origins: ArrayLike, directions: ArrayLike) -> Floats:
        """Distance to the first face that each ray meets, from either side."""
        starts, ways = as_rays(origins, directions)
        found: Any = wp.zeros(len(starts), dtype=wp.float32, device=self.device)
        self.on(self.device).hit(vectors(starts, self.device), vectors(ways, self.device), found)
        distances: Floats = found.numpy()
        distances[~ways.any(axis=1)] = np.inf
        return distances

    def contains(self, points: ArrayLike) -> Flags:
        """Whether the mesh winds around each point; an open mesh contains nothing."""
        return inside(self.on(self.device), as_points(points), self.device)


def _as_vertices(vertices: ArrayLike) -> Floats:
    try:
        with np.errstate(over="ignore"):  # what overflows is refused below
            array = np.array(vertices, dtype=np.float32, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidMesh(
            f"vertices: expected numbers of shape [n, 3], got {type(vertices).__name__}"
        ) from error
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise InvalidMesh(f"vertices: expected shape [n, 3] with n > 0, got {list(array.shape)}")
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise InvalidMesh(
            f"vertices: expected finite numbers, got {array[row]} in row {row}; repair the mesh"
        )
    if np.abs(array).max() > LARGEST:
        row = int(np.abs(array).max(axis=1).argmax())
        raise InvalidMesh(
            f"vertices: expected coordinates within ±{LARGEST:g}, got {array[row]} in row {row}; "
            "rescale the model"
        )
    return array


def _as_faces(faces: ArrayLike, vertex_count: int) -> Faces:
    try:
        given = np.asarray(faces)
    except ValueError as error:  # rows of different lengths
        raise InvalidMesh(
            "faces: expected shape [m, 3], got rows of different lengths; triangulate polygons first"
        ) from error
    if given.ndim != 2 or given.shape[1] != 3 or len(given) == 0:
        raise InvalidMesh(
            f"faces: expected shape [m, 3] with m > 0, got {list(given.shape)}; triangulate polygons first"
        )
    if not np.issubdtype(given.dtype, np.integer):
        raise InvalidMesh(f"faces: expected integers, got {given.dtype}")
    if given.min() < 0 or given.max() >= vertex_count:
        bad = given.min() if given.min() < 0 else given.max()
        raise InvalidMesh(f"faces: expected indices from 0 to {vertex_count - 1}, got {bad}")
    return np.array(given, dtype=np.int32, order="C")


def _sound_faces(vertices: Floats, faces: Faces) -> tuple[NDArray[np.int64], Floats, NDArray[np.float64]]:
    """Rows of the faces that have a normal, with unit normals and areas."""
    a, b, c = np.moveaxis(vertices.astype(np.float64)[faces], 1, 0)
    crosses = np.cross(b - a, c - a)
    doubled = np.linalg.norm(crosses, axis=1)
    edges = sum(np.einsum("ij,ij->i", edge, edge) for edge in (b - a, c - a, c - b))
    sound = doubled > SLIVER * edges
    if not sound.any():
        raise InvalidMesh(
            f"expected a mesh with area, got {len(faces)} degenerate faces; check its units and its indices"
        )
    normals = (crosses[sound] / doubled[sound, None]).astype(np.float32)
    return np.flatnonzero(sound), normals, 0.5 * doubled[sound]


def _is_closed(vertices: Floats, faces: Faces) -> bool:
    """Whether every edge is walked equally often in both directions, after welding equal vertices."""
    welded = np.unique(vertices + np.float32(0), axis=0, return_inverse=True)[1].reshape(-1)
    corners = welded[faces].astype(np.int64)
    start, end = corners.reshape(-1), np.roll(corners, -1, axis=1).reshape(-1)
    _, edge = np.unique(np.minimum(start, end) * len(vertices) + np.maximum(start, end), return_inverse=True)
    return not np.bincount(edge.reshape(-1), weights=np.sign(end - start)).any()


def _volume(vertices: Floats, faces: Faces) -> float:
    """Signed volume: positive where the faces wind counter-clockwise seen from outside."""
    wide = vertices.astype(np.float64) - vertices.mean(axis=0, dtype=np.float64)
    a, b, c = np.moveaxis(wide[faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
