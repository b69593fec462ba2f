"""`MeshSurface`: a triangle mesh, on the host and on devices, and its edges."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree._typing import BoolArray, Float32Array, Float64Array, Int32Array, Int64Array
from blobtree.device import known_device, launch
from blobtree.identity import Value
from blobtree.lazy import Lazy
from blobtree.validation import point_array
from decals.errors import InvalidMesh, InvalidScattering
from decals.model import MAX_COORDINATE
from decals.surfaces.mesh_kernels import closest_faces, closest_points, first_hits, mark_inside
from decals.surfaces.normals import SplitMesh, split_at_creases
from decals.surfaces.surface import (
    Scalars,
    Vectors,
    as_rays,
    contains_host,
    make_read_only,
    project_host,
    row_blocks,
    unit_rows,
    vectors,
)
from decals.surfaces.topology import edge_twins, parts_of, sheets_of, welded
from decals.surfaces.windings import MeshOrientation, Triangles, Windings, wind
from decals.validation import count_number, member, whole_number

MIN_FACE_QUALITY = 1e-6
"""Smallest ratio of a face's doubled area to its squared edges; faces below it have no usable normal.

Warp's mesh queries skip the same faces.
"""

SQUARED_AREAS = 2.0**-126, 2.0**127
"""Range of the square of a face's doubled area: Warp's queries divide by it, in float32."""

MAX_ODD_AREA = 0.01
"""Largest share of the area in faces outside of that range; a mesh with more is refused."""

REPORTED_AREA = 1e-4
"""The log names faces that are left out if they have at least this share of the area."""

_logger = logging.getLogger(__name__)

MAX_SAMPLES = 1 << 30
"""Most points that `sample` returns."""

MAX_SHELLS = 32
"""Most parts of a mesh that may hide others."""

R2_STEPS = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of the R2 sequence (Roberts 2018): powers of the inverse of the plastic number."""


class MeshSurface(Value):
    """Triangle mesh as a `Surface`, with a bounding volume hierarchy for all queries.

    Degenerate faces and copies of other faces are allowed, but get no samples and no projected points. Faces
    that are thinner than a millionth of their length are degenerate; the log says so if they have area. Faces
    that wind differently from their neighbours are turned, and the log says so. Closed parts that wind inward
    are turned too, with the parts inside them. A mesh contains points only if it is closed: with equal
    vertices welded, every edge is used equally often in both directions.

    Parameters
    ----------
    vertices : float[n, 3]
        Positions in model units, finite and within ±MAX_COORDINATE (2**50).
    faces : int[m, 3]
        Indices into the vertices, counter-clockwise seen from outside.
    device : str, optional
        Warp device for queries of the host. Default "cpu".
    orientation : MeshOrientation or str
        ``"outward"`` (default): closed parts turn outward, with what lies inside them. ``"keep"``: parts keep
        their winding. ``"flip"``: all faces are turned.

    Raises
    ------
    InvalidMesh
        Wrong shapes; NaN, infinite or huge vertices; indices out of range; no faces or no area; areas of
        triangles that are too small or too large for float32, as in a model of 1e-9 units (but with "keep").
    InvalidDevice
        Warp has no such device.

    See Also
    --------
    ImplicitSurface : the surface of a BlobTree.

    Examples
    --------
    >>> import decals
    >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> surface = decals.surfaces.MeshSurface(square, [[0, 1, 2], [0, 2, 3]])
    >>> surface.area, surface.closed
    (1.0, False)
    >>> surface.raycast([[0.5, 0.25, 2]], [[0, 0, -1]])
    array([2.], dtype=float32)
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        device: str = "cpu",
        orientation: MeshOrientation | str = MeshOrientation.OUTWARD,
    ) -> None:
        self.device = known_device(device)
        rule = member("orientation", orientation, MeshOrientation, InvalidMesh)
        self.vertices = _as_vertices(vertices)
        self.faces = _as_faces(faces, len(self.vertices))
        triangles = Triangles.of(self.vertices, self.faces)
        self._welded = self._same_vertices()
        windings = self._windings(triangles, rule)
        if rule is not MeshOrientation.KEEP:  # else they were reported when they were read
            windings.report()
        turned = np.flatnonzero(windings.turned)
        self.faces[turned] = self.faces[turned][:, ::-1]
        triangles = triangles.turned(turned)
        if rule is not MeshOrientation.KEEP:  # of a tree, whose own queries correct those of the mesh
            _require_scale(triangles)
            _report_thin(triangles)
        self._take_sound(_sound_faces(triangles, windings.copies), triangles)
        self._one_sided = windings.one_sided[self.sound]

    def _take_sound(self, sound: Int64Array, triangles: Triangles) -> None:
        """Compute what follows from the arrays and the rows of the faces that have a normal."""
        self.sound = sound
        self._corners = corners = np.ascontiguousarray(self.faces[sound])
        doubled = np.linalg.norm(triangles.crosses[sound], axis=1)
        self._normals = (triangles.crosses[sound] / doubled[:, None]).astype(np.float32)
        self._cumulative = np.cumsum(0.5 * doubled)
        used = self.vertices[corners]
        self._bounds = used.min(axis=(0, 1)), used.max(axis=(0, 1))
        for array in (self.vertices, self.faces, *self._bounds):
            make_read_only(array)

    def _same_vertices(self) -> Int64Array:
        """Return the first vertex at the position of each."""
        return welded(self.vertices)

    def _windings(self, triangles: Triangles, rule: MeshOrientation) -> Windings:
        """Return how faces are to wind."""
        return wind(self.faces, self._welded, triangles, rule)

    def _contents(self) -> dict[str, Any]:
        return {"vertices": self.vertices, "faces": self.faces}

    def __getstate__(self) -> dict[str, Any]:
        """Return what the other arrays follow from."""
        sound = np.zeros(len(self.faces), np.bool_)
        sound[self.sound] = True
        marks = {"sound": np.packbits(sound), "one_sided": np.packbits(self._one_sided)}
        return {"vertices": self.vertices, "faces": self.faces, "device": self.device, **marks}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.vertices, self.faces, self.device = state["vertices"], state["faces"], state["device"]
        self._welded = self._same_vertices()
        sound = np.flatnonzero(np.unpackbits(state["sound"], count=len(self.faces)))
        self._take_sound(sound, Triangles.of(self.vertices, self.faces))
        self._one_sided = np.unpackbits(state["one_sided"], count=len(sound)).astype(np.bool_)

    def __repr__(self) -> str:
        return f"MeshSurface({len(self.vertices)} vertices, {len(self.faces)} faces)"

    @property
    def area(self) -> float:
        """Sum of the areas of the faces."""
        return float(self._cumulative[-1])

    @property
    def bounds(self) -> tuple[Float32Array, Float32Array]:
        """Corners of the box around the faces."""
        return self._bounds

    @Lazy
    def _on_devices(self) -> dict[str, "DeviceMeshSurface"]:
        return {}

    @Lazy
    def closed(self) -> bool:
        """Return True if the faces bound a volume, with or without the degenerate ones."""
        return any(_is_closed(self.vertices, faces) for faces in (self.faces, self._corners))

    @Lazy
    def shells(self) -> tuple["MeshSurface", ...]:
        """Return the closed connected parts whose boxes meet the box of another part; they may hide it.

        Of many parts the `MAX_SHELLS` largest count.
        """
        corners = self._welded[self._corners]
        parts = parts_of(corners)
        count = int(parts.max()) + 1
        if count == 1:
            return ()
        boxes = np.empty((count, 2, 3))
        for side, fold in enumerate((np.minimum, np.maximum)):
            boxes[:, side] = np.inf if side == 0 else -np.inf
            fold.at(boxes[:, side], np.repeat(parts, 3), self.vertices[self._corners].reshape(-1, 3))
        found: list[MeshSurface] = []
        for number in np.argsort(-np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1), kind="stable")[
            :MAX_SHELLS
        ]:
            meet = (boxes[:, 0] <= boxes[number, 1]).all(axis=1) & (boxes[:, 1] >= boxes[number, 0]).all(
                axis=1
            )
            if meet.sum() > 1:
                rows, corners = np.unique(self._corners[parts == number], return_inverse=True)
                part = MeshSurface(
                    self.vertices[rows],
                    corners.reshape(-1, 3),
                    device=self.device,
                    orientation=MeshOrientation.KEEP,
                )
                found += [part] if part.closed else []
        return tuple(found)

    @Lazy
    def triangles(self) -> tuple[Int32Array, Float32Array, Int32Array]:
        """Return corners ``int32[m, 3]`` and unit normals of all sound faces, and their `edge_twins`."""
        return self._corners, self._normals, edge_twins(self._welded[self._corners])

    @Lazy
    def sheets(self) -> Int64Array:
        """Return numbers of the sheets of the sound faces: connected parts, or several that borders join."""
        corners, _, twins = self.triangles
        sides = np.flatnonzero(twins < 0)
        rows, k = sides // 3, sides % 3
        ends = np.stack([corners[rows, k], corners[rows, (k + 1) % 3]], axis=1)
        parts = parts_of(self._welded[corners])
        return sheets_of(parts, self.vertices[ends].astype(np.float64), parts[rows])

    @Lazy
    def sheet_areas(self) -> Float64Array:
        """Return the area of each sheet, ``float64[k]``."""
        areas = np.diff(self._cumulative, prepend=0.0)
        return np.bincount(self.sheets, areas).astype(np.float64)

    @Lazy
    def angle_defects(self) -> Float64Array:
        """Return how far the sum of the angles at each vertex is from a full turn, ``float64[n]``."""
        points = self.vertices[self._corners].astype(np.float64)
        sides = np.roll(points, -1, axis=1) - points
        sides /= np.linalg.norm(sides, axis=2, keepdims=True)
        cosines = -np.einsum("nki,nki->nk", sides, np.roll(sides, 1, axis=1))
        angles = np.arccos(np.clip(cosines, -1.0, 1.0))
        numbers = self._welded[self._corners]
        sums = np.bincount(numbers.ravel(), angles.ravel(), minlength=len(self.vertices))
        defects: Float64Array = np.abs(2.0 * np.pi - sums)[self._welded]
        return defects

    @Lazy
    def _winding(self) -> int:
        """1 if the mesh is closed and winds counter-clockwise seen from outside, -1 if clockwise, else 0."""
        if not self.closed:
            return 0
        return -1 if _volume(self.vertices, self.faces) < 0 else 1

    @property
    def inverted(self) -> bool:
        """True if the mesh is closed and its normals point inward."""
        return self._winding < 0

    def sample(self, count: int, seed: int) -> tuple[Float32Array, Float32Array]:
        """Return positions and normals of points uniform by area, ``float32[n, 3]`` each.

        One point falls into each ``1/count`` of the area, in the order of the faces. Within a face, points
        are jittered around a sequence of low discrepancy, so that all parts of large faces get their share.
        """
        count = count_number("count", count, 0, MAX_SAMPLES, InvalidScattering)
        rng = np.random.default_rng(whole_number("seed", seed, 0, None, InvalidScattering))
        levels = (np.arange(count) + rng.random(count)) * (self.area / max(count, 1))
        face = np.minimum(np.searchsorted(self._cumulative, levels, side="right"), len(self._corners) - 1)
        sequence = rng.random(2) + np.arange(count)[:, None] * R2_STEPS
        areas, jitter = np.diff(self._cumulative, prepend=0.0), rng.uniform(-1.0, 1.0, (count, 2))
        positions = np.empty((count, 3), np.float32)
        for rows in row_blocks(count, "sampling"):
            spread = 1.0 / np.sqrt(np.maximum(count * areas[face[rows]] / self.area, 1.0))
            square = (sequence[rows] + spread[:, None] * jitter[rows]) % 1.0
            root, along = np.sqrt(square[:, :1]), square[:, 1:]
            a, b, c = np.moveaxis(self.vertices[self._corners[face[rows]]].astype(np.float64), 1, 0)
            positions[rows] = (1 - root) * a + root * ((1 - along) * b + along * c)
        return positions, self._normals[face]

    def on(self, device: str) -> "DeviceMeshSurface":
        """Return the surface in the memory of a device; later calls return the same object.

        Raises
        ------
        InvalidDevice
            There is no such device.
        """
        device = known_device(device)
        if device not in self._on_devices:
            self._on_devices[device] = DeviceMeshSurface(
                self.vertices,
                self._corners,
                self._normals,
                bounds=self._bounds,
                winding=lambda: self._winding,
                device=device,
            )
        return self._on_devices[device]

    def project(
        self, points: ArrayLike, *, within: Float32Array | None = None
    ) -> tuple[Float32Array, Float32Array]:
        """Return the closest points of the mesh, and the normals of their faces; see `Surface.project`."""
        return project_host(self.on(self.device), points, within, self.device)

    def one_sided(self, points: ArrayLike) -> BoolArray:
        """Return True for points closest to a part that has one side only, such as a Möbius strip."""
        if not self._one_sided.any():
            return np.zeros(len(point_array(points)), np.bool_)
        rows = np.searchsorted(self.sound, self.locate(points)[0])
        return self._one_sided[rows]

    def locate(self, points: ArrayLike) -> tuple[Int64Array, Float64Array]:
        """Return rows of the closest faces, ``int64[n]``, and barycentric weights, ``float64[n, 3]``."""
        queries = point_array(points)
        faces: Any = wp.zeros(len(queries), dtype=wp.int32, device=self.device)
        weights: Any = wp.zeros(len(queries), dtype=wp.vec2, device=self.device)
        if len(queries):
            self.on(self.device).locate(vectors(queries, self.device), faces, weights)
        first, second = weights.numpy().reshape(-1, 2).astype(np.float64).T
        return self.sound[faces.numpy()], np.stack([first, second, 1.0 - first - second], axis=1)

    def normal(self, points: ArrayLike) -> Float32Array:
        """Return the normals of the faces closest to the points."""
        return self.project(points)[1]

    def smooth_normals(self, points: ArrayLike) -> Float32Array:
        """Return the unit normals of the picture at the points closest to some points.

        They are interpolated in each face, and smooth up to the default crease angle.
        """
        faces, weights = self.locate(points)
        corners = self._split.normals[self._split.faces[faces]].astype(np.float64)
        return unit_rows(np.einsum("nc,nca->na", weights, corners))

    @Lazy
    def _split(self) -> SplitMesh:
        return split_at_creases(self.vertices, self.faces)

    def raycast(self, origins: ArrayLike, directions: ArrayLike) -> Float32Array:
        """Return distances to the first faces that rays hit, from either side; see `Surface.raycast`."""
        starts, headings = as_rays(origins, directions)
        hits: Any = wp.zeros(len(starts), dtype=wp.float32, device=self.device)
        self.on(self.device).raycast(vectors(starts, self.device), vectors(headings, self.device), hits)
        distances: Float32Array = hits.numpy()
        distances[~headings.any(axis=1)] = np.inf
        return distances

    def contains(self, points: ArrayLike) -> BoolArray:
        """Return True for each point that a closed mesh winds around, ``bool[n]``."""
        return contains_host(self.on(self.device), points, self.device)


def _as_vertices(vertices: ArrayLike) -> Float32Array:
    array = point_array(vertices, "vertices", InvalidMesh, MAX_COORDINATE)
    if len(array) == 0:
        raise InvalidMesh("vertices: expected an array of shape (n, 3) with n > 0, got none")
    return array.copy()


def _as_faces(faces: ArrayLike, vertex_count: int) -> Int32Array:
    try:
        indices = np.asarray(faces)
    except ValueError as error:  # rows of different lengths
        raise InvalidMesh(
            "faces: expected shape [m, 3], got rows of different lengths; triangulate polygons first"
        ) from error
    if indices.ndim != 2 or indices.shape[1] != 3 or len(indices) == 0:
        raise InvalidMesh(
            f"faces: expected shape [m, 3] with m > 0, got {list(indices.shape)}; triangulate polygons first"
        )
    if not np.issubdtype(indices.dtype, np.integer):
        raise InvalidMesh(
            f"faces: expected whole numbers, got {indices.dtype}; convert them with .astype(int)"
        )
    if indices.min() < 0 or indices.max() >= vertex_count:
        bad = indices.min() if indices.min() < 0 else indices.max()
        raise InvalidMesh(f"faces: expected indices from 0 to {vertex_count - 1}, got {bad}")
    return np.array(indices, dtype=np.int32, order="C")


def have_area(triangles: Triangles) -> BoolArray:
    """Return True for triangles with a usable normal, ``bool[m]``."""
    a, b, c = np.moveaxis(triangles.corners, 1, 0)
    edges = sum(np.einsum("ij,ij->i", edge, edge) for edge in (b - a, c - a, c - b))
    found: BoolArray = np.linalg.norm(triangles.crosses, axis=1) > MIN_FACE_QUALITY * edges
    return found


def _sound_faces(triangles: Triangles, copies: BoolArray) -> Int64Array:
    """Return the rows of the faces that have a normal and are no copies."""
    usable = have_area(triangles)
    if usable.any():
        return np.flatnonzero(usable & ~copies)
    if triangles.doubled_areas.any():
        raise InvalidMesh(
            "expected a mesh of triangles that are wider than a millionth of their length, got "
            f"{len(copies)} thinner ones; divide them along their length, or check the indices"
        )
    raise InvalidMesh(
        f"expected a mesh with area, got {len(copies)} triangles without any; check its units and its indices"
    )


def _require_scale(triangles: Triangles) -> None:
    """Raise `InvalidMesh` if triangles with much of the area are too small or too large for the queries."""
    doubled, (low, high) = triangles.doubled_areas, SQUARED_AREAS
    odd = have_area(triangles) & ((doubled * doubled < low) | (doubled * doubled > high))
    if doubled[odd].sum() > MAX_ODD_AREA * doubled.sum():
        raise InvalidMesh(
            f"expected triangles of an area from {0.5 * low**0.5:.0e} to {0.5 * high**0.5:.0e}, got "
            f"{odd.sum()} others of {len(odd)}; rescale the model"
        )


def _report_thin(triangles: Triangles) -> None:
    """Log that faces without a usable normal are left out, if they have area worth mentioning."""
    thin, doubled = ~have_area(triangles), triangles.doubled_areas
    share = float(doubled[thin].sum() / max(doubled.sum(), np.finfo(np.float64).tiny))
    if REPORTED_AREA < share < 1.0:
        _logger.warning(
            "Left out %d of %d triangles that are thinner than a millionth of their length, %.2g %% of the "
            "area; divide them along their length",
            (doubled[thin] > 0.0).sum(),
            len(thin),
            100.0 * share,
        )


def _is_closed(vertices: Float32Array, faces: Int32Array) -> bool:
    """Return True if every edge is used equally often in both directions, with equal vertices welded."""
    welded = np.unique(vertices + np.float32(0), axis=0, return_inverse=True)[1].reshape(-1)
    corners = welded[faces].astype(np.int64)
    start, end = corners.reshape(-1), np.roll(corners, -1, axis=1).reshape(-1)
    _, edge = np.unique(np.minimum(start, end) * len(vertices) + np.maximum(start, end), return_inverse=True)
    return not np.bincount(edge.reshape(-1), weights=np.sign(end - start)).any()


def _volume(vertices: Float32Array, faces: Int32Array) -> float:
    """Return the signed volume: positive if faces wind counter-clockwise seen from outside."""
    wide = vertices.astype(np.float64) - vertices.mean(axis=0, dtype=np.float64)
    a, b, c = np.moveaxis(wide[faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


class DeviceMeshSurface:
    """Non-degenerate faces of a mesh, with a bounding volume hierarchy, on one device.

    Parameters
    ----------
    vertices, corners, normals
        ``float32[n, 3]``, ``int32[m, 3]`` and the faces' unit normals ``float32[m, 3]``.
    bounds
        Corners of the box around the faces.
    winding
        Function that returns 1 for a closed mesh that winds counter-clockwise seen from outside, -1 for a
        clockwise one, 0 for an open one. The first call of `mark_inside` calls it.
    device
        Warp device.
    """

    def __init__(
        self,
        vertices: Float32Array,
        corners: Int32Array,
        normals: Float32Array,
        *,
        bounds: tuple[Float32Array, Float32Array],
        winding: Callable[[], int],
        device: str,
    ) -> None:
        self.device = device
        self._winding, self._corners = winding, corners
        self._points: Any = wp.array(vertices, dtype=wp.vec3, device=device)
        self._normals: Any = wp.array(normals, dtype=wp.vec3, device=device)
        indices: Any = wp.array(corners.reshape(-1), dtype=wp.int32, device=device)
        self._mesh = wp.Mesh(points=self._points, indices=indices)
        low, high = (corner.astype(np.float64) for corner in bounds)
        self._low, self._high = wp.vec3(*bounds[0]), wp.vec3(*bounds[1])
        self._ball = wp.vec3(*(0.5 * (low + high))), float(0.51 * np.linalg.norm(high - low))

    @property
    def query_inputs(self) -> list[Any]:
        """Inputs of kernels that query the closest point: mesh, normals, centre and radius of a ball."""
        return [self._mesh.id, self._normals, *self._ball]

    def project(self, points: Vectors, reaches: Scalars, positions: Vectors, normals: Vectors) -> None:
        """Write the closest points and the normals of their faces."""
        inputs = [*self.query_inputs, points, reaches]
        launch(closest_points, len(points), inputs, [positions, normals], device=self.device)

    def locate(self, points: Vectors, faces: Scalars, weights: Any) -> None:
        """Write the closest face of each point, and the weights of its first two corners there."""
        inputs = [self._mesh.id, *self._ball, points]
        launch(closest_faces, len(points), inputs, [faces, weights], device=self.device)

    def raycast(self, origins: Vectors, directions: Vectors, distances: Scalars) -> None:
        """Write the distance to the first face that each ray hits, infinity for a miss."""
        launch(first_hits, len(origins), [self._mesh.id, origins, directions], [distances], self.device)

    def mark_inside(self, points: Vectors, flags: Scalars) -> None:
        """Write 1 where the closed mesh winds around the point."""
        if self._winding():
            inputs = [self._winding_mesh.id, self._low, self._high, points]
            launch(mark_inside, len(points), inputs, [flags], device=self.device)

    @Lazy
    def _winding_mesh(self) -> wp.Mesh:
        """Mesh whose faces wind counter-clockwise, as winding numbers require."""
        turned = np.ascontiguousarray(self._corners[:, :: self._winding()])
        indices: Any = wp.array(turned.reshape(-1), dtype=wp.int32, device=self.device)
        return wp.Mesh(points=self._points, indices=indices, support_winding_number=True)


@dataclass(frozen=True)
class Edges:
    """Edges of the non-degenerate faces of a mesh, with equal vertices welded.

    Attributes
    ----------
    vertices : float64[n, 3]
        Welded vertices.
    ends : int64[k, 2]
        Vertices of each edge, the lower first.
    counts : int64[k]
        Number of faces at each edge: 1 on the boundary.
    normals : float64[k, 2, 3]
        Unit normals of the first and the last face at each edge.
    apexes : int64[k]
        Vertex of the first face that is not on the edge.
    """

    vertices: Float64Array
    ends: Int64Array
    counts: Int64Array
    normals: Float64Array
    apexes: Int64Array


def edges_of(surface: "MeshSurface") -> Edges:
    """Weld vertices and collect the edges that have length."""
    vertices, welded = np.unique(surface.vertices + np.float32(0), axis=0, return_inverse=True)
    corners = welded.reshape(-1)[surface.faces[surface.sound]].astype(np.int64)
    wide = vertices.astype(np.float64)
    a, b, c = np.moveaxis(wide[corners], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    apexes = np.roll(corners, -2, axis=1).reshape(-1)
    edges, which, counts = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(which.reshape(-1), kind="stable")
    first, last = order[np.cumsum(counts) - counts], order[np.cumsum(counts) - 1]
    sides = np.stack([normals[first // 3], normals[last // 3]], axis=1)
    long = edges[:, 0] != edges[:, 1]
    return Edges(wide, edges[long], counts[long], sides[long], apexes[first][long])
