"""Benchmark of decals beside other methods: ``python -m tests.bench.decals --peers``.

Measures set-up, time per decal and memory on the dragon, or on a knot if the dragon is not available. The
errors are those of `peer_errors`, over the decal's radius. Methods that are not installed are left out with a
message.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from decals import DecalImage, Decals, ImageMapping, MeshObject, Relaxation, Scene, evaluate
from decals.apps.models.figure_14 import even_decals
from decals.apps.models.samples import axes_of, sample
from decals.apps.models.shapes import torus_knot
from decals.apps.views import frame, parse_view
from decals.errors import InvalidInput
from decals.field import Walks
from decals.index import DecalIndex
from decals.rendering import Renderer, RenderOptions
from decals.scattering.neighbors import FacingTree, ideal_spacing, spacing_of_distances
from decals.surfaces import MeshSurface
from tests.bench import cellular_textures, implicit_uvs
from tests.bench.cellular_textures import Cells
from tests.bench.clipped_decals import ClippedMesh, MeshDecals
from tests.bench.exponential_maps import ExponentialMaps
from tests.bench.paper_octree import crowded_decals
from tests.bench.peer_errors import (
    RADII,
    Figures,
    at_vertices,
    bumpy_error,
    by_walk_to_seed,
    edge_field,
    errors_of,
    exponential_map,
    frame_at,
    implicit,
    implicit_walked,
    planar,
    potpourri,
    torus_field,
    torus_mesh,
)
from tests.bench.projected_boxes import RECORD_BYTES, fragments, marks
from tests.bench.texture_sprites import Sprites, shown_by_all
from tests.bench.tile_trees import TileTree
from tests.decals.field import log_maps as analytic
from tests.decals.field import unfolding
from tests.vectors import unit

COUNT = 1_000
LOG_MAPS = 20
"""Decals whose log maps are timed; the time of all decals is extrapolated from these."""

SPRITE_POINTS = 30_000
"""Points of the surface at which sprites are looked up."""

TILE_POINTS = 400_000
"""Samples of the surface of which a tile tree is made."""

IMAGE_SIDE = 256
"""Texels across a decal, in tile trees."""

CELL_AREA = 0.9
"""Sum of the areas of the cells over the surface, if they are as many as the decals."""

FIRST_CELLS = 10
RING_CELLS = 200
"""Cells with which a simulation starts, and about as many as grow on the torus."""

SEEDS, SEED_POINTS = 200, 4_000
"""Seeds on the torus, and points whose nearest seed is searched for."""

MANY_STEPS = 128
"""Steps of a walk, to show what is left of the error."""

SIZE = (800, 600)
RUNS = 3
COLUMNS = [
    *("set-up, s", "a decal, ms", "all, s", "memory, MB", "frame, ms"),
    *("torus 0.5", "torus 0.1", "ellipsoid 0.5", "ellipsoid 0.1"),
]
Float64Array = NDArray[np.float64]


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


def measure_walked(item: MeshObject, decals: Decals) -> Row:
    """Measure implicit decals with the walked mapping."""
    seconds, walks = timed(lambda: Walks.over(decals, [item.surface]))
    return Row(
        "implicit decals walked",
        "",
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * (DecalIndex.of(decals).nbytes + decals.packed().nbytes + walks.texels.nbytes),
        frame_ms=frame_time(item, decals, mapping=ImageMapping.WALKED),
        errors=errors_of(implicit_walked),
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


def measure_cells(item: MeshObject, decals: Decals) -> Row:
    """Measure cellular textures: a simulation, and a dome for each cell."""
    surface, count = item.surface, len(decals)
    size = float(np.sqrt(CELL_AREA * surface.area / (np.pi * count)))

    def on_mesh(points: Float64Array) -> tuple[Float64Array, Float64Array]:
        normals = surface.smooth_normals(points).astype(np.float64)
        return ((points - surface.project(points)[0]) * normals).sum(axis=1), normals

    start = surface.sample(FIRST_CELLS, 0)[0].astype(np.float64)
    begin = time.process_time()
    rest = cellular_textures.simulate(Cells.at(start, on_mesh, size), on_mesh, size, unrest=0.5)
    seconds = time.process_time() - begin
    cells = rest.cells
    oriented = cells.positions.astype(np.float32), cells.normals.astype(np.float32)
    distances, _ = FacingTree(*oriented).nearest(*oriented, count=6, skip_self=True)
    spacing = spacing_of_distances(distances, ideal_spacing(surface.area, len(cells)))
    relaxation = Relaxation(surface, count=count)
    relaxation.run()
    even = relaxation.statistics()
    shapes = decals.positions, decals.normals, decals.tangents, decals.radii
    discs = Cells(*(values.astype(np.float64) for values in shapes))
    cells.sizes *= np.sqrt((discs.sizes**2).sum() / (cells.sizes**2).sum())
    points, normals = (array.astype(np.float64) for array in surface.sample(SPRITE_POINTS, 0))
    over, beside = (cellular_textures.cover(some, points, normals) for some in (cells, discs))
    mesh = cellular_textures.domes(cells)
    gaps = ", ".join(f"{rim_gap(radius):.0%} at {radius}" for radius in RADII.values())
    notes = [
        f"{len(cells):,} cells after {rest.steps} steps, {rest.divisions} divisions and {rest.deaths} deaths",
        f"rho {spacing.rho:.2f}, CV {spacing.cv:.1%}, of scattered decals {even.rho:.2f}, {even.cv:.1%}",
        f"{(over > 1).mean():.0%} of the surface under several, {(over == 0).mean():.1%} under none",
        f"under discs of decals {(beside > 1).mean():.0%}, {(beside == 0).mean():.1%}",
        f"{len(mesh.faces):,} triangles",
        f"a step takes {1e3 * seconds / rest.steps:.1f} ms; a cell moved on a torus: {edited_ring()}",
        f"rims leave the torus by {gaps} of the radius",
    ]
    return Row(
        "cellular textures",
        "no contact: polygons pass through each other; places result from the simulation",
        decal_ms=1e3 * seconds / len(cells),
        megabytes=1e-6 * (cellular_textures.RECORD_BYTES * len(cells) + mesh.nbytes),
        frame_ms=frame_time(item, Decals.empty(), mesh),
        errors=errors_of(planar),
        note="; ".join(notes),
    )


def edited_ring() -> str:
    """Move a cell of a texture on the torus, and return what that changes."""

    def on_torus(points: Float64Array) -> tuple[Float64Array, Float64Array]:
        return torus_field(points), unit(analytic.torus_gradient(points))

    size = float(np.sqrt(CELL_AREA * 4 * np.pi**2 * 0.4 / (np.pi * RING_CELLS)))
    start = Cells.at(analytic.torus_points(np.random.default_rng(0), FIRST_CELLS), on_torus, size)
    cells = cellular_textures.simulate(start, on_torus, size).cells
    moved = cells.rows(np.arange(len(cells)))
    moved.positions[0] += 2 * size * moved.tangents[0]
    rest = cellular_textures.simulate(moved, on_torus, size)
    away, _ = cKDTree(rest.cells.positions).query(cells.positions)
    return (
        f"{rest.steps} steps, {rest.divisions} divisions, {rest.deaths} deaths, "
        f"{(away > 0.01 * size).sum()} of {len(cells)} cells move by more than 1 % of their size"
    )


def rim_gap(radius: float) -> float:
    """Return the mean distance of the rims of flat discs from the torus over their radius."""
    mesh, angle = torus_mesh(), np.linspace(0, 2 * np.pi, 90, endpoint=False)
    circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.random.default_rng(0).integers(0, len(mesh.vertices), 60).tolist()
    rims = np.concatenate(
        [mesh.vertices[vertex] + circle @ frame_at(mesh, vertex)[:2] for vertex in vertices]
    )
    return float(np.abs(torus_field(rims)).mean() / radius)


def measure_implicit_uvs(item: MeshObject, decals: Decals) -> Row:
    """Measure Implicit UVs; as they need a field, all but the memory is measured on other surfaces."""
    torus, evaluated = torus_mesh(), 0

    def counting(points: Float64Array) -> Float64Array:
        nonlocal evaluated
        evaluated += len(points)
        return torus_field(points)

    seeds = even_decals(MeshSurface(torus.vertices, torus.faces), count=SEEDS)
    points = analytic.torus_points(np.random.default_rng(0), SEED_POINTS)
    found = implicit_uvs.nearest(counting, points, seeds.positions.astype(np.float64))
    owner = evaluate(seeds, points, torus.normals(points), device="cpu").owner
    bumpy = max(bumpy_error(seed) for seed in range(8))
    edge = unfolding.edge(90, 0.3)
    beyond = edge.log[:, 0] > 0.3
    lost = np.isnan(implicit_uvs.log_maps(edge_field, edge.points, edge.centre)[:, 0])
    many = errors_of(partial(by_walk_to_seed, steps=MANY_STEPS))
    same = (found.seed == owner)[owner >= 0].mean()
    notes = [
        f"{found.walks:.1f} walks and {evaluated / len(points):.0f} evaluations of the field at a point of a "
        f"torus with {SEEDS} seeds",
        f"the nearest seed is the owner of implicit decals at {same:.2%} of the points",
        f"bumpy sphere {bumpy:.2%}",
        f"with {MANY_STEPS} steps large decals {many['torus_large']:.2%} and {many['ellipsoid_large']:.2%}",
        f"no coordinates at {lost[beyond].mean():.0%} of the points beyond an edge of 90°, and at "
        f"{lost[~beyond].mean():.0%} before it",
    ]
    return Row(
        "Implicit UVs",
        "fields of trees only, smooth ones; seeds part the surface, and images are cut there",
        setup_s=float("nan"),
        decal_ms=float("nan"),
        megabytes=1e-6 * implicit_uvs.SEED_BYTES * len(decals),
        errors=errors_of(by_walk_to_seed),
        note="; ".join(notes),
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
    normals = unit(vertex_normals(item))
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


def frame_time(
    item: MeshObject,
    decals: Decals,
    clipped: ClippedMesh | None = None,
    *,
    mapping: ImageMapping = ImageMapping.CORRECTED,
) -> float:
    """Return the time in ms of a frame of the model with decals, or with clipped triangles."""
    camera = frame([item], parse_view(None, axes_of(item.name)), SIZE)
    objects = [item]
    if clipped is not None:
        objects.append(
            MeshObject("decals", clipped.vertices.astype(np.float32), clipped.faces.astype(np.int32))
        )
    scene = Scene(objects=tuple(objects), camera=camera, decals=decals, images=(DecalImage.load("scale"),))
    options = RenderOptions(size=SIZE, mapping=mapping)
    with Renderer() as renderer:
        renderer.time_frame(scene, options)
        return 1e3 * statistics.median(renderer.time_frame(scene, options) for _ in range(RUNS))


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
        measure_walked(item, decals),
        measure_clipped(item, decals),
        measure_boxes(item, decals),
        measure_sprites(item, decals),
        measure_tiles(item, decals),
        measure_at_vertices(item, decals),
        measure_exponential_maps(item, decals, 5 if quick else LOG_MAPS),
        measure_log_maps(item, decals, 5 if quick else LOG_MAPS),
        measure_cells(item, decals),
        measure_implicit_uvs(item, decals),
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
