"""Benchmark of decals beside other methods: ``python -m tests.bench.decals --peers``.

Measures set-up, time per decal and memory on the dragon, or on a knot if the dragon is not available. Errors
are RMS errors of the image coordinates against log maps from integrated geodesics, on a torus and an
ellipsoid, divided by the decal's radius. Methods that are not installed are left out with a message.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals.apps.commands.bench import even_decals
from decals.apps.models.samples import axes_of, sample
from decals.apps.models.shapes import torus_knot
from decals.apps.views import frame, parse_view
from decals.errors import InvalidInput
from decals.field.evaluate import evaluate
from decals.field.mapping import ImageMapping
from decals.index.index import DecalIndex
from decals.model import Decals
from decals.rendering import Renderer
from decals.rendering.options import RenderOptions
from decals.scenes.objects import MeshObject
from decals.scenes.scene import DecalImage, Scene
from tests.bench.clipped_decals import ClippedMesh, MeshDecals
from tests.bench.exponential_maps import ExponentialMaps
from tests.bench.paper_octree import crowded_decals
from tests.bench.projected_boxes import RECORD_BYTES, fragments, marks
from tests.bench.texture_sprites import Sprites, shown_by_all
from tests.bench.tile_trees import TileTree
from tests.decals.field import log_maps as analytic
from tests.decals.shapes import torus

COUNT = 1_000
LOG_MAPS = 20
"""Decals whose log maps are timed; the time of all decals is extrapolated from these."""

RADII = {"large": 0.5, "small": 0.1}
"""Radii of the decals on the torus (tube 0.4) and the ellipsoid (1, 0.7, 0.45)."""

SPRITE_POINTS = 30_000
"""Points of the surface at which sprites are looked up."""

TILE_POINTS = 400_000
"""Samples of the surface of which a tile tree is made."""

IMAGE_SIDE = 256
"""Texels across a decal, in tile trees."""

SIZE = (800, 600)
RUNS = 3
COLUMNS = [
    *("set-up, s", "a decal, ms", "all, s", "memory, MB", "frame, ms"),
    *("torus 0.5", "torus 0.1", "ellipsoid 0.5", "ellipsoid 0.1"),
]
Figures = dict[str, float]


Float64Array = NDArray[np.float64]
IndexArray = NDArray[np.intp]
NEAREST = 12
"""Triangles among which the one of a point is searched."""


@dataclass(frozen=True)
class SmoothMesh:
    """A mesh with its vertices on a smooth surface, and the gradient of that surface."""

    vertices: Float64Array
    faces: IndexArray
    gradient: Callable[[Float64Array], Float64Array]

    def normals(self, points: Float64Array) -> Float64Array:
        """Return unit normals of the smooth surface."""
        normals: Float64Array = analytic.unit(self.gradient(points))
        return normals

    def discs(
        self, rng: np.random.Generator, centres: IndexArray, radius: float, count: int
    ) -> tuple[Float64Array, Float64Array]:
        """Sample points around vertices, and their log maps, out to a radius: float64[c, count, 3] each.

        The points are ends of integrated geodesics of uniform lengths and directions.
        """
        start = np.repeat(self.vertices[centres], count, axis=0)
        directions = analytic.tangents(rng, self.normals(start))
        length = rng.uniform(0, radius, (len(start), 1))
        ends = analytic.walk(self.gradient, start, directions, length)
        shape = len(centres), count, 3
        return ends.reshape(shape), (directions * length).reshape(shape)


def torus_mesh(*, rows: int = 316) -> SmoothMesh:
    """Return a torus of radii 1 and 0.4 with 100,000 faces."""
    shape = torus(rows=rows, columns=rows // 2)
    return SmoothMesh(shape.vertices.astype(np.float64), shape.faces.astype(np.intp), analytic.torus_gradient)


def ellipsoid_mesh(*, level: int = 6) -> SmoothMesh:
    """Return an ellipsoid of axes 1, 0.7 and 0.45 with 82,000 faces."""
    ball = pv.Icosphere(nsub=level)
    vertices = analytic.unit(np.asarray(ball.points, np.float64)) * analytic.AXES
    return SmoothMesh(vertices, ball.regular_faces.astype(np.intp), analytic.ellipsoid_gradient)


class Locator:
    """Search for the triangle next to a point, and the point's barycentric weights."""

    def __init__(self, vertices: Float64Array, faces: IndexArray) -> None:
        self._corners, self._faces = vertices[faces], faces
        self._tree = cKDTree(self._corners.mean(axis=1))

    def find(self, points: Float64Array) -> tuple[IndexArray, Float64Array]:
        """Return the vertices int[n, 3] of the triangles, and the weights float64[n, 3]."""
        near = self._tree.query(points, k=NEAREST)[1]
        a, b, c = np.moveaxis(self._corners[near], 2, 0)
        e1, e2, w = b - a, c - a, points[:, None] - a
        d11, d12, d22 = _dots(e1, e1), _dots(e1, e2), _dots(e2, e2)
        d1, d2, area = _dots(w, e1), _dots(w, e2), d11 * d22 - d12 * d12
        v, u = (d22 * d1 - d12 * d2) / area, (d11 * d2 - d12 * d1) / area
        weights = np.stack([1 - v - u, v, u], axis=2)
        best = weights.min(axis=2).argmax(axis=1)
        rows = np.arange(len(points))
        return self._faces[near[rows, best]], weights[rows, best]

    def interpolate(self, values: Any, points: Float64Array) -> Float64Array:
        """Return values per vertex [v, k], interpolated linearly at points."""
        vertices, weights = self.find(points)
        result: Float64Array = np.einsum("nc,nck->nk", weights, np.asarray(values)[vertices])
        return result


def _dots(a: Float64Array, b: Float64Array) -> Float64Array:
    result: Float64Array = (a * b).sum(axis=-1)
    return result


def frame_at(mesh: SmoothMesh, vertex: int) -> Float64Array:
    """Return two tangents and the normal at a vertex: rows of float64[3, 3]."""
    normal = mesh.normals(mesh.vertices[vertex : vertex + 1])[0]
    u = np.cross(normal, [0.36, 0.48, 0.8])
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(normal, u), normal])


def planar(mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
    """Return the coordinates of points in the box of a mesh-clipped decal.

    They are linear in each triangle, so those of the clipped mesh are equal.
    """
    coordinates: Float64Array = (points - mesh.vertices[vertex]) @ frame_at(mesh, vertex)[:2].T
    return coordinates


def implicit(
    mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float, **options: Any
) -> Float64Array:
    """Return the coordinates that the decal pass draws."""
    u, _, normal = frame_at(mesh, vertex)
    decal = Decals(mesh.vertices[vertex : vertex + 1], [normal], [u], [radius])
    uv = evaluate(decal, points, mesh.normals(points), device="cpu", **options).uv
    return 2 * radius * (uv.astype(np.float64) - 0.5)


def implicit_by_chord(mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
    """Return the coordinates of the paper's mapping."""
    return implicit(mesh, vertex, points, radius, mapping=ImageMapping.CHORD)


def at_vertices(mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
    """Return the decal pass's coordinates at the vertices, interpolated linearly."""
    near = np.linalg.norm(mesh.vertices - mesh.vertices[vertex], axis=1) < 1.5 * radius
    values = np.zeros((len(mesh.vertices), 2))
    values[near] = implicit(mesh, vertex, mesh.vertices[near], 2 * radius)
    return Locator(mesh.vertices, mesh.faces).interpolate(values, points)


@dataclass
class LogMaps:
    """Log maps of potpourri3d by the affine heat method.

    The strategy is the default, `AffineLocal`. `AffineAdaptive` was not more exact and factors a matrix per
    decal. `VectorHeat` is about as fast, with errors of 7 to 11 % for decals of a tenth of the model's size.
    """

    module: Any
    version: str

    def solver(self, vertices: Any, faces: Any) -> Any:
        """Return the solver of a mesh; its first log map completes the set-up."""
        return self.module.MeshVectorHeatSolver(
            np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces)
        )

    def log_map(self, solver: Any, vertex: int) -> Float64Array:
        """Return the log map at all vertices, in the solver's frame."""
        result: Float64Array = solver.compute_log_map(int(vertex), strategy="AffineLocal")
        return result

    def offsets(self, mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
        """Return the interpolated log map, rotated into the frame of `frame_at`."""
        solver = self._solver_of(mesh)
        x, y, _ = (np.asarray(axis)[vertex] for axis in solver.get_tangent_frames())
        flat = self.log_map(solver, vertex)
        world = flat[:, :1] * x + flat[:, 1:] * y
        return Locator(mesh.vertices, mesh.faces).interpolate(world @ frame_at(mesh, vertex)[:2].T, points)

    def _solver_of(self, mesh: SmoothMesh) -> Any:
        cached = getattr(self, "_cached", None)
        if cached is None or cached[0] is not mesh:
            cached = self._cached = mesh, self.solver(mesh.vertices, mesh.faces)
        return cached[1]


def exponential_map(mesh: SmoothMesh, vertex: int, points: Float64Array, radius: float) -> Float64Array:
    """Return the discrete exponential map of the vertices around a vertex, interpolated linearly."""
    maps = ExponentialMaps.of(mesh.vertices, mesh.faces, mesh.normals(mesh.vertices))
    reached, offsets = maps.map(vertex, 1.5 * radius)
    values = np.zeros((len(mesh.vertices), 2))
    values[reached] = offsets @ frame_at(mesh, vertex)[:2].T
    return Locator(mesh.vertices, mesh.faces).interpolate(values, points)


def potpourri() -> LogMaps | None:
    """Return the log maps of potpourri3d, or None if it is not installed."""
    try:
        return LogMaps(import_module("potpourri3d"), version("potpourri3d"))
    except (ImportError, PackageNotFoundError, OSError):
        return None


@dataclass
class Row:
    """Costs, errors and limits of a method."""

    title: str
    limits: str
    setup_s: float = 0.0
    decal_ms: float = 0.0
    megabytes: float = 0.0
    frame_ms: float = float("nan")
    errors: Figures = field(default_factory=dict)
    note: str = ""


def model() -> MeshObject:
    """Return the dragon, or a knot if the dragon is not available."""
    try:
        item = sample("dragon")
    except InvalidInput:
        vertices, faces = torus_knot()
        item = MeshObject("knot", vertices, faces)
    assert isinstance(item, MeshObject)
    return item


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the median seconds of some runs, and the last result."""
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times), result


def measure_implicit(item: MeshObject, decals: Decals) -> Row:
    """Measure implicit decals: index and records; all other work is done per pixel."""
    seconds, index = timed(lambda: (DecalIndex.of(decals), decals.packed()))
    return Row(
        "implicit decals",
        "",
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * (index[0].nbytes + index[1].nbytes),
        frame_ms=frame_time(item, decals),
        errors=errors_of(implicit),
    )


def measure_clipped(item: MeshObject, decals: Decals) -> Row:
    """Measure mesh-clipped decals, in one batch."""
    setup, mesh = timed(lambda: MeshDecals(item.vertices, item.faces))
    seconds, result = timed(lambda: mesh.clip(decals))
    return Row(
        "mesh-clipped (three.js)",
        "no contact, no implicit surfaces, one object at a time, a new mesh for every edit",
        setup_s=setup,
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * result.nbytes,
        frame_ms=frame_time(item, Decals.empty(), result),
        errors=errors_of(planar),
        note=f"{len(result.faces):,} triangles, {backward_fraction(result, decals):.0%} of the area backward",
    )


def measure_boxes(item: MeshObject, decals: Decals) -> Row:
    """Measure projected boxes: one matrix for each decal; all other work is done per pixel."""
    seconds, _ = timed(lambda: np.linalg.inv(_matrices(decals)))
    found = marks(MeshDecals(item.vertices, item.faces), item.faces, decals)
    camera = frame([item], parse_view(None, axes_of(item.name)), SIZE)
    with Renderer() as renderer:
        buffers = renderer.buffers(
            Scene(objects=(item,), camera=camera), RenderOptions(size=(160, 120), samples=1)
        )
    visible = buffers.position[buffers.object_id >= 0].reshape(-1, 3).astype(np.float64)
    drawn, used = fragments(decals, np.asarray(camera.position, np.float64), visible)
    return Row(
        "projected boxes",
        "no contact; marks surface behind the visible one",
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * RECORD_BYTES * len(decals),
        errors=errors_of(planar),
        note=f"{found.backward:.1%} of the marked area faces away, {found.other:.1%} lies on another part; "
        f"faded, {found.other_faded:.1%} on another part and {found.own_lost:.1%} of the own part lost; "
        f"{drawn:.1f} boxes drawn at a pixel, of which {used:.1f} contain its point",
    )


def _matrices(decals: Decals) -> Float64Array:
    """Return the matrices that take the box [-1, 1]³ to each decal: float64[n, 4, 4]."""
    result = np.tile(np.eye(4), (len(decals), 1, 1))
    axes = np.stack([decals.tangents, decals.bitangents, decals.normals], axis=2)
    result[:, :3, :3] = axes * decals.radii[:, None, None]
    result[:, :3, 3] = decals.positions
    return result


def measure_sprites(item: MeshObject, decals: Decals) -> Row:
    """Measure texture sprites, of even decals and of crowded ones."""
    seconds, sprites = timed(lambda: Sprites.of(decals))
    points, normals = (array.astype(np.float64) for array in item.surface.sample(SPRITE_POINTS, 0))
    crowd = Sprites.of(crowded_decals(item.surface, COUNT, np.random.default_rng(0)))
    notes = []
    for name, some in (("even", sprites), ("crowded", crowd)):
        owner, reads = some.shown(points, normals)
        expected, count = shown_by_all(some.decals, points, normals)
        index = DecalIndex.of(some.decals)
        notes.append(
            f"{name}: {len(some.tree.children):,} voxels, {1e-6 * some.nbytes:.2g} MB, {reads:.1f} reads, "
            f"{some.leaves:.0f} leaves for each sprite ({len(index.ids) / len(some.decals):.0f} cells of the "
            f"index), {(owner != expected).mean():.2%} of the points wrong, {(count > 8).mean():.2%} under "
            "more than eight sprites"
        )
    return Row(
        "texture sprites",
        "no contact; at most eight sprites in a leaf",
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * sprites.nbytes,
        errors=errors_of(planar),
        note="; ".join(notes),
    )


def measure_tiles(item: MeshObject, decals: Decals) -> Row:
    """Measure a tile tree with as many texels across a decal as its image has.

    Of trees of different least depths, the one with the fewest texels is taken.
    """
    points, normals = (array.astype(np.float64) for array in item.surface.sample(TILE_POINTS, 0))
    density = IMAGE_SIDE / (2 * float(np.median(decals.radii)))
    trees = (TileTree.of(points, normals, least=least) for least in range(4, 8))
    tree = min(trees, key=lambda tree: tree.texels(density))
    area = float(item.surface.area)
    texels = tree.texels(density)
    return Row(
        "tile trees",
        "a texture, into which decals are painted: one colour at each texel",
        setup_s=float("nan"),
        decal_ms=float("nan"),
        megabytes=1e-6 * (4 * texels + 32 * tree.voxels),
        note=f"{tree.voxels:,} voxels, {len(tree.width):,} tiles, {tree.reads:.1f} reads; "
        f"{texels:.3g} texels, {texels / (area * density**2):.2f} times those of the area, "
        f"of which the surface covers {area * density**2 * tree.cosine.mean() / texels:.0%}; "
        f"stretch {(1 / tree.cosine).mean():.2f} on average, {(1 / tree.cosine).max():.2f} at most",
    )


def measure_at_vertices(item: MeshObject, decals: Decals) -> Row:
    """Measure texture coordinates at the vertices, by the formulas of implicit decals."""
    index, normals = DecalIndex.of(decals), vertex_normals(item)
    seconds, samples = timed(lambda: evaluate(decals, item.vertices, normals, index=index, device="cpu"))
    owners = samples.owner[item.faces]
    straddling = (owners != owners[:, :1]).any(axis=1)
    corners = item.vertices[item.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return Row(
        "uv at vertices",
        "no line of contact or rim inside a triangle, no implicit surfaces",
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * len(item.vertices) * 12,
        frame_ms=frame_time(item, Decals.empty()),
        errors=errors_of(at_vertices),
        note=f"{area[straddling].sum() / area.sum():.0%} of the surface lies in triangles of several owners; "
        "the frame is that of the mesh without decals",
    )


def measure_exponential_maps(item: MeshObject, decals: Decals, count: int) -> Row:
    """Measure discrete exponential maps of the mesh, each decal at its nearest vertex."""
    vertices = item.vertices.astype(np.float64)
    normals = analytic.unit(vertex_normals(item))
    setup, maps = timed(lambda: ExponentialMaps.of(vertices, item.faces, normals))
    centers = [int(np.linalg.norm(item.vertices - p, axis=1).argmin()) for p in decals.positions[:count]]
    begin = time.perf_counter()
    reached = sum(
        len(maps.map(center, 1.5 * float(radius))[0])
        for center, radius in zip(centers, decals.radii[:count], strict=True)
    )
    seconds = time.perf_counter() - begin
    return Row(
        "discrete exponential maps",
        "no contact, no implicit surfaces, one connected mesh, decals at vertices only",
        setup_s=setup,
        decal_ms=1e3 * seconds / count,
        megabytes=1e-6 * 12 * reached / count * len(decals),
        errors=errors_of(exponential_map),
        note=f"{count} decals timed, in NumPy; memory: two coordinates and a vertex number for each vertex; "
        "drawn as uv at vertices",
    )


def measure_log_maps(item: MeshObject, decals: Decals, count: int) -> Row | None:
    """Measure log maps of the mesh, each decal at its nearest vertex."""
    maps = potpourri()
    if maps is None:
        return None
    before = resident()
    begin = time.perf_counter()
    solver = maps.solver(item.vertices, item.faces)
    maps.log_map(solver, 0)
    setup = time.perf_counter() - begin
    grown = resident() - before
    vertices = [int(np.linalg.norm(item.vertices - p, axis=1).argmin()) for p in decals.positions[:count]]
    begin = time.perf_counter()
    for vertex in vertices:
        maps.log_map(solver, vertex)
    seconds = time.perf_counter() - begin
    return Row(
        f"log maps (potpourri3d {maps.version})",
        "no contact, no implicit surfaces, one connected mesh, decals at vertices only",
        setup_s=setup,
        decal_ms=1e3 * seconds / count,
        megabytes=1e-6 * grown,
        errors=errors_of(maps.offsets),
        note=f"{count} decals timed; drawn as uv at vertices",
    )


def backward_fraction(result: ClippedMesh, decals: Decals) -> float:
    """Return the fraction of the clipped area that faces away from its decal."""
    a, b, c = (result.vertices[result.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    backward = (normal * decals.normals[result.decals]).sum(axis=1) < 0
    return float(area[backward].sum() / area.sum())


def vertex_normals(item: MeshObject) -> NDArray[np.float64]:
    """Return the normals of vertices: area-weighted sums of those of their triangles."""
    corners = item.vertices[item.faces].astype(np.float64)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((len(item.vertices), 3))
    for corner in range(3):
        np.add.at(normals, item.faces[:, corner], faces)
    return normals


def frame_time(item: MeshObject, decals: Decals, clipped: ClippedMesh | None = None) -> float:
    """Return the time in ms of a frame of the model with decals, or with clipped triangles."""
    camera = frame([item], parse_view(None, axes_of(item.name)), SIZE)
    objects = [item]
    if clipped is not None:
        objects.append(
            MeshObject("decals", clipped.vertices.astype(np.float32), clipped.faces.astype(np.int32))
        )
    scene = Scene(objects=tuple(objects), camera=camera, decals=decals, images=(DecalImage.load("scale"),))
    with Renderer() as renderer:
        renderer.time_frame(scene, RenderOptions(size=SIZE))
        return 1e3 * statistics.median(
            renderer.time_frame(scene, RenderOptions(size=SIZE)) for _ in range(RUNS)
        )


@cache
def errors_of(offsets: Callable[[SmoothMesh, int, Any, float], Any], decals: int = 6) -> Figures:
    """Return the RMS errors against the log map over the radius, on both surfaces and for both radii."""
    results: Figures = {}
    for name, mesh in (("torus", torus_mesh()), ("ellipsoid", ellipsoid_mesh())):
        for size, radius in RADII.items():
            rng = np.random.default_rng(0)
            centres = rng.integers(0, len(mesh.vertices), decals)
            points, logs = mesh.discs(rng, centres, radius, 300)
            squares = [
                ((offsets(mesh, vertex, q, radius) - log @ frame_at(mesh, vertex)[:2].T) ** 2).sum(1)
                for vertex, q, log in zip(centres.tolist(), points, logs, strict=True)
            ]
            results[f"{name}_{size}"] = float(np.sqrt(np.mean(squares)) / radius)
    return results


def resident() -> float:
    """Return the resident memory of this process in bytes, or NaN if it is not known."""
    status = Path("/proc/self/statm")
    if not status.exists():
        return float("nan")
    return float(status.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def measure(*, quick: bool) -> tuple[str, list[Row]]:
    """Measure all methods; return a description of the model too."""
    item = model()
    decals = even_decals(item.surface, count=COUNT)
    rows = [
        measure_implicit(item, decals),
        measure_clipped(item, decals),
        measure_boxes(item, decals),
        measure_sprites(item, decals),
        measure_tiles(item, decals),
        measure_at_vertices(item, decals),
        measure_exponential_maps(item, decals, 5 if quick else LOG_MAPS),
        measure_log_maps(item, decals, 5 if quick else LOG_MAPS),
    ]
    return f"{item.name}, {len(item.faces):,} faces", [row for row in rows if row is not None]


def table(subject: str, rows: list[Row]) -> str:
    """Return the rows as a table in Markdown."""
    lines = [
        f"{COUNT:,} decals on {subject}",
        "",
        f"| | {' | '.join(COLUMNS)} |",
        "| --- |" + " ---: |" * len(COLUMNS),
    ]
    for row in rows:
        total = row.setup_s + 1e-3 * COUNT * row.decal_ms
        frame = f"{row.frame_ms:.0f}" if np.isfinite(row.frame_ms) else ""
        costs = (row.setup_s, row.decal_ms, total, row.megabytes)
        cells = [*(f"{cost:.3g}" if np.isfinite(cost) else "" for cost in costs), frame]
        cells += [f"{value:.2%}" for value in row.errors.values()]
        lines.append(f"| {row.title} | {' | '.join(cells)} |")
    lines += ["", *(f"{row.title}: {'; '.join(filter(None, [row.note, row.limits]))}" for row in rows[1:])]
    return "\n".join(lines)


def figures(rows: list[Row]) -> Figures:
    """Return all numbers by flat names."""
    results: Figures = {}
    for row in rows:
        name = row.title.split(" (")[0].replace(" ", "_").replace("-", "_")
        results |= {f"{name}_{key}": value for key, value in row.errors.items()}
        results |= {
            f"{name}_{key}": getattr(row, key) for key in ("setup_s", "decal_ms", "megabytes", "frame_ms")
        }
    return {name: value for name, value in results.items() if np.isfinite(value)}


def run(*, quick: bool) -> Figures:
    """Measure, print and return the figures."""
    from tests.bench.decals import graphics

    subject, rows = measure(quick=quick)
    print(f"python -m tests.bench.decals {' '.join(sys.argv[1:])}\n{graphics()}\n")
    print(table(subject, rows))
    if potpourri() is None:
        print("potpourri3d is not installed and was left out: pip install potpourri3d")
    return figures(rows)
