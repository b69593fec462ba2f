"""What one would pick in place of these decals, in one run: ``python -m tests.bench.decals --peers``.

Decals on the dragon, or on a knot where there is no dragon: the time to set up and to lay them, the memory.
Errors are RMS errors of the place in the image against log maps from integrated geodesics, on a torus and an
ellipsoid, over the decal's radius. Peers that are not installed are left out, and it is said.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decals.field.evaluate import evaluate
from decals.grid.index import DecalIndex
from decals.model import Decals
from decals.render import Renderer
from decals.scenes.scene import DecalImage, MeshObject, Scene
from implicit_decals.apps.errors import UsageError
from implicit_decals.apps.measuring.coats import even_coat
from implicit_decals.apps.models.knot import torus_knot
from implicit_decals.apps.models.samples import axes_of, sample
from implicit_decals.apps.views import frame, parse_view
from tests.bench import decal_rivals as rivals
from tests.bench.mesh_decals import ClippedMesh, MeshDecals
from tests.bench.on_meshes import SmoothMesh, ellipsoid_mesh, torus_mesh

COUNT = 1_000
LOG_MAPS = 20
"""Decals whose log maps are timed; the time of all of them is reckoned from these."""

RADII = {"large": 0.5, "small": 0.1}
"""Of the decals on the torus (tube 0.4) and the ellipsoid (1, 0.7, 0.45)."""

SIZE = (800, 600)
RUNS = 3
COLUMNS = [
    *("set-up, s", "a decal, ms", "all, s", "memory, MB", "frame, ms"),
    *("torus 0.5", "torus 0.1", "ellipsoid 0.5", "ellipsoid 0.1"),
]
Figures = dict[str, float]


@dataclass
class Row:
    """A way to lay decals: what it costs, and what it cannot do."""

    title: str
    lacks: str
    setup_s: float = 0.0
    decal_ms: float = 0.0
    megabytes: float = 0.0
    frame_ms: float = float("nan")
    errors: Figures = field(default_factory=dict)
    note: str = ""


def model() -> MeshObject:
    """The dragon, or a knot."""
    try:
        item = sample("dragon")
    except UsageError:
        vertices, faces = torus_knot()
        item = MeshObject("knot", vertices, faces)
    assert isinstance(item, MeshObject)
    return item


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Median seconds of some runs, and the last result."""
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times), result


def ours(item: MeshObject, decals: Decals) -> Row:
    """Index and records: all there is to do; the rest is done a pixel."""
    seconds, index = timed(lambda: (DecalIndex.of(decals), decals.packed()))
    return Row(
        "implicit decals",
        "",
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * (index[0].nbytes + index[1].nbytes),
        frame_ms=frame_time(item, decals),
        errors=errors_of(rivals.drawn),
    )


def clipped(item: MeshObject, decals: Decals) -> Row:
    """Mesh-clipped decals, all in one batch."""
    setup, mesh = timed(lambda: MeshDecals(item.vertices, item.faces))
    seconds, result = timed(lambda: mesh.clip(decals))
    return Row(
        "mesh-clipped (three.js)",
        "no contact; nothing for implicit surfaces; one object at a time; a new mesh for every edit",
        setup_s=setup,
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * result.nbytes,
        frame_ms=frame_time(item, Decals.empty(), result),
        errors=errors_of(rivals.planar),
        note=f"{len(result.faces):,} triangles; {backward(result, decals):.0%} of what is painted faces away",
    )


def interpolated(item: MeshObject, decals: Decals) -> Row:
    """Texture coordinates at the vertices, by our own formulas."""
    index, normals = DecalIndex.of(decals), vertex_normals(item)
    seconds, samples = timed(lambda: evaluate(decals, item.vertices, normals, index=index, device="cpu"))
    owners = samples.owner[item.faces]
    straddling = (owners != owners[:, :1]).any(axis=1)
    corners = item.vertices[item.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return Row(
        "uv at vertices",
        "no line of contact or rim inside a triangle; nothing for implicit surfaces",
        decal_ms=1e3 * seconds / len(decals),
        megabytes=1e-6 * len(item.vertices) * 12,
        frame_ms=frame_time(item, Decals.empty()),
        errors=errors_of(rivals.interpolated),
        note=f"{area[straddling].sum() / area.sum():.0%} of the surface lies in triangles of several owners; "
        "the frame is that of the bare mesh",
    )


def geodesic(item: MeshObject, decals: Decals, count: int) -> Row | None:
    """Log maps of the mesh, a decal at its nearest vertex each."""
    maps = rivals.log_maps()
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
        "no contact; nothing for implicit surfaces; one connected mesh; decals at vertices alone",
        setup_s=setup,
        decal_ms=1e3 * seconds / count,
        megabytes=1e-6 * grown,
        errors=errors_of(maps.offsets),
        note=f"{count} decals timed; drawn as uv at vertices are",
    )


def backward(result: ClippedMesh, decals: Decals) -> float:
    """Share of the clipped area that faces away from its decal."""
    a, b, c = (result.vertices[result.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    away = (normal * decals.normals[result.decals]).sum(axis=1) < 0
    return float(area[away].sum() / area.sum())


def vertex_normals(item: MeshObject) -> NDArray[np.float64]:
    """Sums of the triangles' normals."""
    corners = item.vertices[item.faces].astype(np.float64)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((len(item.vertices), 3))
    for corner in range(3):
        np.add.at(normals, item.faces[:, corner], faces)
    return normals


def frame_time(item: MeshObject, decals: Decals, more: ClippedMesh | None = None) -> float:
    """Milliseconds a frame of the model with decals, or with clipped triangles as an object of their own."""
    camera = frame([item], parse_view(None, axes_of(item.name)), SIZE)
    objects = [item]
    if more is not None:
        objects.append(MeshObject("decals", more.vertices.astype(np.float32), more.faces.astype(np.int32)))
    scene = Scene(objects=objects, camera=camera, decals=decals, images=(DecalImage.load("scale"),))
    with Renderer() as renderer:
        renderer.time_frame(scene, size=SIZE)
        return 1e3 * statistics.median(renderer.time_frame(scene, size=SIZE) for _ in range(RUNS))


def errors_of(offsets: Callable[[SmoothMesh, int, Any, float], Any], decals: int = 6) -> Figures:
    """RMS errors against the log map, over the radius, on both surfaces and for both radii."""
    found: Figures = {}
    for name, mesh in (("torus", torus_mesh()), ("ellipsoid", ellipsoid_mesh())):
        for size, radius in RADII.items():
            rng = np.random.default_rng(0)
            centres = rng.integers(0, len(mesh.vertices), decals)
            points, logs = mesh.discs(rng, centres, radius, 300)
            squares = [
                ((offsets(mesh, vertex, q, radius) - log @ rivals.frame_at(mesh, vertex)[:2].T) ** 2).sum(1)
                for vertex, q, log in zip(centres.tolist(), points, logs, strict=True)
            ]
            found[f"{name}_{size}"] = float(np.sqrt(np.mean(squares)) / radius)
    return found


def resident() -> float:
    """Bytes of memory that this process holds; NaN where the system does not say."""
    status = Path("/proc/self/statm")
    if not status.exists():
        return float("nan")
    return float(status.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def measure(*, quick: bool) -> tuple[str, list[Row]]:
    """Measure all; what was measured on."""
    item = model()
    decals = even_coat(item.surface, count=COUNT)
    rows = [
        ours(item, decals),
        clipped(item, decals),
        interpolated(item, decals),
        geodesic(item, decals, 5 if quick else LOG_MAPS),
    ]
    return f"{item.name}, {len(item.faces):,} faces", [row for row in rows if row is not None]


def table(subject: str, rows: list[Row]) -> str:
    """Lay rows out as a table in Markdown."""
    lines = [
        f"{COUNT:,} decals on {subject}",
        "",
        f"| | {' | '.join(COLUMNS)} |",
        "| --- |" + " ---: |" * len(COLUMNS),
    ]
    for row in rows:
        total = row.setup_s + 1e-3 * COUNT * row.decal_ms
        drawn = f"{row.frame_ms:.0f}" if np.isfinite(row.frame_ms) else ""
        cells = [f"{row.setup_s:.3g}", f"{row.decal_ms:.3g}", f"{total:.3g}", f"{row.megabytes:.3g}", drawn]
        cells += [f"{value:.2%}" for value in row.errors.values()]
        lines.append(f"| {row.title} | {' | '.join(cells)} |")
    lines += ["", *(f"{row.title}: {'; '.join(filter(None, [row.note, row.lacks]))}" for row in rows[1:])]
    return "\n".join(lines)


def figures(rows: list[Row]) -> Figures:
    """All numbers under flat names."""
    found: Figures = {}
    for row in rows:
        name = row.title.split(" (")[0].replace(" ", "_").replace("-", "_")
        found |= {f"{name}_{key}": value for key, value in row.errors.items()}
        found |= {
            f"{name}_{key}": getattr(row, key) for key in ("setup_s", "decal_ms", "megabytes", "frame_ms")
        }
    return {name: value for name, value in found.items() if np.isfinite(value)}


def run(*, quick: bool) -> Figures:
    """Measure, print and give the figures."""
    from tests.bench.decals import graphics

    subject, rows = measure(quick=quick)
    print(f"python -m tests.bench.decals {' '.join(sys.argv[1:])}\n{graphics()}\n")
    print(table(subject, rows))
    if rivals.log_maps() is None:
        print("potpourri3d is not installed and was left out: pip install potpourri3d")
    return figures(rows)
