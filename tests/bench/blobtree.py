"""What the implicit engine costs: ``python -m tests.bench.blobtree [--json PATH] [--quick]``.

The scene: N points of influence s = 0.6 N^(−1/3), uniform in the unit cube, summed; (R + 1)³ samples.
Times are medians of whole pipelines in process, nodes to triangles, compiles excluded. The rival stamps
each point's box with NumPy and contours with vtkFlyingEdges3D: it can only sum points, and it is fast.

With `--device cuda:0` (NumPy and Warp are enough there): meshes that stay on the device, the same brought to
the host, and what tapes and cells take of it.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree import RIM, Mesh, Node, Point, Polygonizer, Ricci, Sum, Union
from blobtree.meshing.polygonize import download
from blobtree.meshing.surface import Surface, extract_surface
from blobtree.sparse.cells import SparseCells, build_cells
from blobtree.sparse.grid import BRANCHING, aligned_grid
from blobtree.tracing.trace import trace
from tests.bench.marching_cubes import marching_cubes

RUNS = 5
UNIT_BOX = (np.zeros(3), np.ones(3))
PEERS = (
    "fidget 22.0 s (5.25 with hand-made gates), Blender metaballs 7.38 s, Warp dense 30.7 s, Warp sparse "
    "marching cubes 15.6 s, NumPy + skimage 49 s at N=1000, R=256 (two cores, 2026-11)"
)
Figures = dict[str, float]
Clock = Callable[[], float]


def centers(count: int) -> tuple[NDArray[np.float64], float]:
    """The scene's points (n, 3) and their influence."""
    s = 0.6 * count ** (-1.0 / 3.0)
    rng = np.random.default_rng(1234 + count)
    return rng.uniform(0.75 * s, 1.0 - 0.75 * s, (count, 3)), s


def blobs(count: int) -> list[Point]:
    """The scene's points as nodes."""
    places, s = centers(count)
    return [Point((x, y, z), radius=s * RIM) for x, y, z in places.tolist()]


def mixed(count: int) -> Node:
    """The same points under unions, Ricci blends, differences and one twist around the cube's axis."""
    nodes = blobs(count)
    groups = [nodes[i : i + 10] for i in range(0, count, 10)]
    parts = [(Ricci(tuple(g[:5]), exponent=3.0) | Sum(tuple(g[5:9]))) - g[9] for g in groups]
    return Union(tuple(parts)).translate((-0.5, -0.5, 0.0)).twist(20.0).translate((0.5, 0.5, 0.0))


def cells_of(tree: Node, resolution: int, device: str = "cpu") -> SparseCells:
    """The sparse cells of the unit cube."""
    cells = build_cells(tree.tape, aligned_grid(*UNIT_BOX, 1.0 / resolution), device=device)
    wp.synchronize_device(device)
    return cells


def surface_of(tree: Node, resolution: int, device: str = "cpu") -> Surface:
    """The whole pipeline, up to triangles in the device's memory."""
    surface = extract_surface(cells_of(tree, resolution, device), lambda _stage, _fraction: None)
    wp.synchronize_device(device)
    return surface


def mesh_of(tree: Node, resolution: int, device: str = "cpu") -> Mesh:
    """The whole pipeline."""
    return download(surface_of(tree, resolution, device))


def stamped(count: int, resolution: int) -> Any:
    """The rival: each point's box of influence added to a dense grid, then contoured by VTK."""
    import pyvista as pv

    places, s = centers(count)
    side = resolution + 1
    axis = np.linspace(0.0, 1.0, side, dtype=np.float32)
    values = np.zeros((side, side, side), np.float32)
    for center in places:
        low = np.maximum(np.ceil((center - s) * resolution).astype(int), 0)
        high = np.minimum(np.floor((center + s) * resolution).astype(int) + 1, side)
        x, y, z = (
            ((axis[a:b] - np.float32(c)) / np.float32(s)) ** 2
            for a, b, c in zip(low, high, center, strict=True)
        )
        rest = np.maximum(1.0 - (x[:, None, None] + y[:, None] + z), 0.0)
        values[low[0] : high[0], low[1] : high[1], low[2] : high[2]] += rest * rest * rest
    grid = pv.ImageData(dimensions=(side, side, side), spacing=(1.0 / resolution,) * 3)
    grid["field"] = values.ravel(order="F")
    return grid.contour([0.5], scalars="field", method="flying_edges")


def timed(work: Callable[[], object], clock: Clock = time.perf_counter) -> float:
    """Seconds that `work` takes."""
    start = clock()
    work()
    return clock() - start


def median_time(work: Callable[[], object], runs: int = RUNS, clock: Clock = time.perf_counter) -> float:
    """Median seconds, after one run that is not counted."""
    return statistics.median([timed(work, clock) for _ in range(runs + 1)][1:])


def meshing(quick: bool) -> Figures:
    """Times of whole pipelines, ours and the rival's, in turn."""
    runs = 3 if quick else RUNS
    figures = {
        "mesh_1000_256_s": median_time(lambda: mesh_of(Sum(tuple(blobs(1000))), 256), runs),
        "stamp_1000_256_s": median_time(lambda: stamped(1000, 256), runs),
        "mesh_10000_256_s": median_time(lambda: mesh_of(Sum(tuple(blobs(10_000))), 256), runs),
    }
    figures["mesh_over_stamp"] = figures["mesh_1000_256_s"] / figures["stamp_1000_256_s"]
    trees = Sum(tuple(blobs(1000))), mixed(1000)
    per_cell = [
        median_time(lambda t=tree: mesh_of(t, 256), 3) / len(mesh_of(tree, 256).vertices) for tree in trees
    ]
    figures["mixed_over_sum"] = per_cell[1] / per_cell[0]
    return figures


def begun(tree: Node, resolution: int, device: str) -> None:
    """The triangles of a tree from nothing, on the device."""
    Polygonizer(tree, cell_size=1.0 / resolution, device=device)
    wp.synchronize_device(device)


def remeshing(device: str = "cpu", resolution: int = 256) -> Figures:
    """One of 1,000 points moved, again and again: the time from the new tree to its triangles."""
    nodes, rng = blobs(1000), np.random.default_rng(7)
    polygonizer = Polygonizer(Sum(tuple(nodes)), cell_size=1.0 / resolution, device=device)
    edits, fresh = [], []
    for edit in range(16):
        moved = int(rng.integers(len(nodes)))
        x, y, z = nodes[moved].center + rng.normal(size=3) * 0.01
        nodes[moved] = replace(nodes[moved], center=(x, y, z))
        tree = Sum(tuple(nodes))

        def renewed(tree: Node = tree) -> None:
            polygonizer.update_surface(tree)
            wp.synchronize_device(device)

        edits.append(timed(renewed))
        if edit % 4 == 0:
            again = Sum(tuple(nodes))
            fresh.append(timed(lambda tree=again: begun(tree, resolution, device)))
    sources = polygonizer.surface.cells.leaves.sources.numpy()
    return {
        "remesh_ms": 1e3 * statistics.median(edits[2:]),
        "remesh_over_fresh": statistics.median(edits[2:]) / statistics.median(fresh[1:]),
        "remesh_blocks": float((sources < 0).mean()),
    }


def cost_of_quality(device: str = "cpu", resolution: int = 256) -> Figures:
    """Our triangles against plain marching cubes, in turn, on the same cells."""
    tree = Sum(tuple(blobs(1000)))

    def plain() -> None:
        marching_cubes(cells_of(tree, resolution, device))
        wp.synchronize_device(device)

    ours, theirs = [], []
    for run in range(8):
        ours.append(timed(lambda: surface_of(tree, resolution, device)))
        theirs.append(timed(plain))
        if run == 0:
            ours, theirs = [], []
    return {"quality_cost": statistics.median(ours) / statistics.median(theirs)}


def curve(device: str = "cpu", *, quick: bool = False) -> Figures:
    """Nanoseconds per cell that the surface crosses, at one overlap, over N and R.

    Of the processor, all threads together, where that does the work: other programs do not bend it then.
    """
    clock = time.process_time if device == "cpu" else time.perf_counter
    figures = {}
    for count in (100, 1000, 10_000):
        for resolution in (128, 256) if quick else (128, 256, 512):
            tree = Sum(tuple(blobs(count)))
            crossing = len(surface_of(tree, resolution, device).vertices)
            seconds = median_time(lambda t=tree, r=resolution: surface_of(t, r, device), 3, clock)
            figures[f"crossing_{count}_{resolution}"] = float(crossing)
            figures[f"ns_per_crossing_{count}_{resolution}"] = 1e9 * seconds / crossing
    return figures


def on_device(device: str, *, quick: bool) -> Figures:
    """What a graphics card takes: the pipeline and its stages."""
    figures = {}
    scenes = [(1000, 256), (1000, 512)] + ([] if quick else [(10_000, 512), (100_000, 512)])
    for count, resolution in scenes:
        nodes, name = tuple(blobs(count)), f"{count}_{resolution}"
        tree = Sum(nodes)
        figures[f"tape_{name}_ms"] = 1e3 * median_time(lambda n=nodes: Sum(n).tape, 3)
        figures[f"cells_{name}_ms"] = 1e3 * median_time(lambda t=tree, r=resolution: cells_of(t, r, device))
        for kind, work in (("mesh", surface_of), ("host", mesh_of)):
            seconds = median_time(lambda w=work, t=tree, r=resolution: w(t, r, device))
            figures[f"{kind}_{name}_ms"] = 1e3 * seconds
        figures[f"vertices_{name}"] = float(len(surface_of(tree, resolution, device).vertices))
    return figures | remeshing(device) | cost_of_quality(device) | curve(device, quick=quick)


def quality() -> Figures:
    """How few cells and primitives are looked at, and what the triangles are like."""
    tree = Sum(tuple(blobs(1000)))
    cells = cells_of(tree, 256)
    mesh = mesh_of(tree, 256)
    spans = cells.leaves.spans.numpy()
    value, slope = tree(mesh.vertices), np.linalg.norm(tree.gradient(mesh.vertices), axis=1)
    a, b, c = np.moveaxis(mesh.vertices.astype(np.float64)[mesh.faces], 1, 0)
    squares = sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
    shape = 2.0 * np.sqrt(3.0) * np.linalg.norm(np.cross(b - a, c - a), axis=1) / squares
    return {
        "cells_per_crossing": len(cells.leaves) * BRANCHING**3 / len(mesh.vertices),
        "prims_per_block": float((spans[:, 1] - spans[:, 0] - 1).mean() / 2.0),
        "vertex_error_h": float((np.abs(value - 0.5) / slope).mean() * 256.0),
        "quality_p01": float(np.percentile(shape, 1)),
        "boundary_edges": float(_unpaired_edges(mesh)),
    }


def _unpaired_edges(mesh: Mesh) -> int:
    """Directed edges that occur more than once, or without their opposite."""
    faces = mesh.faces.astype(np.int64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = len(mesh.vertices)
    forward, backward = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    return len(forward) - len(np.unique(forward)) + len(np.setxor1d(forward, backward))


def tracing() -> Figures:
    """512×512 rays into the scene of 1,000 points, on all cores."""
    tree = Sum(tuple(blobs(1000)))
    x, y = np.meshgrid(np.linspace(-0.45, 0.45, 512), np.linspace(-0.45, 0.45, 512))
    directions = np.stack([x, y, np.full_like(x, -1.5)], axis=-1).reshape(-1, 3)
    eye = np.broadcast_to([0.5, 0.5, 2.3], directions.shape)
    return {"trace_1000_512_ms": 1e3 * median_time(lambda: trace(tree, eye, directions))}


def peak() -> Figures:
    """Memory that meshing adds to a process that has compiled and loaded everything, in MB."""
    result = subprocess.run(
        [sys.executable, "-m", "tests.bench.blobtree", "--peak"], check=True, capture_output=True, text=True
    )
    return {"peak_mb": float(result.stdout)}


def print_peak() -> None:
    """What `peak` runs in a process of its own."""
    mesh_of(Sum(tuple(blobs(20))), 32)
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # forget the peak so far
    before = _resident("VmRSS")
    mesh_of(Sum(tuple(blobs(1000))), 256)
    print(_resident("VmHWM") - before)


def _resident(field: str) -> float:
    """Resident memory in MB, now (VmRSS) or at its peak (VmHWM); Linux alone tells."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return float(status.split(f"{field}:")[1].split()[0]) / 1024.0


def main() -> None:
    """Measure, print a table, and write the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="also write one flat object {figure: number}")
    parser.add_argument("--quick", action="store_true", help="fewer runs; ends within a minute on two cores")
    parser.add_argument("--device", default="cpu", help="a Warp device, say cuda:0")
    parser.add_argument("--peak", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.peak:
        print_peak()
        return
    if options.device == "cpu":
        figures = meshing(options.quick) | remeshing() | cost_of_quality() | quality() | tracing() | peak()
        figures |= curve(quick=options.quick)
        versions = f", vtk {version('vtk')}"
    else:
        figures = on_device(options.device, quick=options.quick)
        versions = ""
    print(f"{wp.get_device(options.device).name}, {os.cpu_count()} cores ({platform.machine()})")
    print(f"python -m {' '.join(['tests.bench.blobtree', *sys.argv[1:]])}")
    print(f"warp-lang {wp.config.version}, numpy {np.__version__}{versions}")
    for name, number in figures.items():
        print(f"  {name:28} {number:12.6g}")
    if options.device == "cpu":
        print(f"Others, quoted: {PEERS}.")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
