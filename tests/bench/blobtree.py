"""Benchmark of the implicit engine: ``python -m tests.bench.blobtree [--json PATH] [--quick]``.

The scene: N points of influence s = 0.6 N^(−1/3), uniform in the unit cube, summed; (R + 1)³ samples.
Times are medians of whole pipelines in process, from nodes to triangles, without compilation. The reference
adds each point's box to a grid with NumPy and contours it with vtkFlyingEdges3D: fast, but for sums of points
only.

With `--device cuda:0` (needs only NumPy and Warp): meshes on the device, meshes copied to the host, and the
parts of tapes and cells.
"""

import argparse
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree import RIM, Mesh, Node, Point, Polygonizer, Ricci, Sum, Tape, Union
from blobtree.cells.grid import BRANCHING, aligned_grid
from blobtree.cells.sparse_cells import SparseCells, build_cells
from blobtree.meshing.mesh import DeviceMesh, download, extract_mesh
from blobtree.tracing.trace import trace
from tests.bench.command_line import bench_parser, show, write
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
    """Return the points (n, 3) of the scene and their influence radius."""
    s = 0.6 * count ** (-1.0 / 3.0)
    rng = np.random.default_rng(1234 + count)
    return rng.uniform(0.75 * s, 1.0 - 0.75 * s, (count, 3)), s


def blobs(count: int) -> list[Point]:
    """Return the points of the scene as nodes."""
    positions, s = centers(count)
    return [Point((x, y, z), radius=s * RIM) for x, y, z in positions.tolist()]


def mixed(count: int) -> Node:
    """Return the points under unions, Ricci blends, differences and a twist around the cube's axis."""
    nodes = blobs(count)
    groups = [nodes[i : i + 10] for i in range(0, count, 10)]
    parts = [(Ricci(tuple(g[:5]), exponent=3.0) | Sum(tuple(g[5:9]))) - g[9] for g in groups]
    return Union(tuple(parts)).translate((-0.5, -0.5, 0.0)).twist(20.0).translate((0.5, 0.5, 0.0))


def tape_of(nodes: tuple[Node, ...]) -> Tape:
    """Return the tape of a new sum."""
    return Sum(nodes).tape


def cells_of(tree: Node, resolution: int, device: str = "cpu") -> SparseCells:
    """Return the sparse cells of the unit cube."""
    cells = build_cells(tree.tape, aligned_grid(*UNIT_BOX, 1.0 / resolution), device=device)
    wp.synchronize_device(device)
    return cells


def surface_of(tree: Node, resolution: int, device: str = "cpu") -> DeviceMesh:
    """Run the pipeline, up to triangles in the device's memory."""
    surface = extract_mesh(cells_of(tree, resolution, device), lambda _stage, _fraction: None)
    wp.synchronize_device(device)
    return surface


def mesh_of(tree: Node, resolution: int, device: str = "cpu") -> Mesh:
    """Run the pipeline, up to triangles on the host."""
    return download(surface_of(tree, resolution, device))


def stamped(count: int, resolution: int) -> Any:
    """Run the reference: add each point's box of influence to a dense grid, and contour it by VTK."""
    import pyvista as pv

    positions, s = centers(count)
    side = resolution + 1
    axis = np.linspace(0.0, 1.0, side, dtype=np.float32)
    values = np.zeros((side, side, side), np.float32)
    for center in positions:
        low = np.maximum(np.ceil((center - s) * resolution).astype(int), 0)
        high = np.minimum(np.floor((center + s) * resolution).astype(int) + 1, side)
        x, y, z = (
            ((axis[a:b] - np.float32(c)) / np.float32(s)) ** 2
            for a, b, c in zip(low, high, center, strict=True)
        )
        falloff = np.maximum(1.0 - (x[:, None, None] + y[:, None] + z), 0.0)
        values[low[0] : high[0], low[1] : high[1], low[2] : high[2]] += falloff * falloff * falloff
    grid = pv.ImageData(dimensions=(side, side, side), spacing=(1.0 / resolution,) * 3)
    grid["field"] = values.ravel(order="F")
    return grid.contour([0.5], scalars="field", method="flying_edges")


def timed(work: Callable[[], object], clock: Clock = time.perf_counter) -> float:
    """Return the seconds that `work` takes."""
    start = clock()
    work()
    return clock() - start


def median_time(work: Callable[[], object], runs: int = RUNS, clock: Clock = time.perf_counter) -> float:
    """Return the median seconds of some runs after one untimed run."""
    return statistics.median([timed(work, clock) for _ in range(runs + 1)][1:])


def meshing(quick: bool) -> Figures:
    """Measure whole pipelines and the reference."""
    runs = 3 if quick else RUNS
    figures = {
        "mesh_1000_256_s": median_time(lambda: mesh_of(Sum(tuple(blobs(1000))), 256), runs),
        "stamp_1000_256_s": median_time(lambda: stamped(1000, 256), runs),
        "mesh_10000_256_s": median_time(lambda: mesh_of(Sum(tuple(blobs(10_000))), 256), runs),
    }
    figures["mesh_over_stamp"] = figures["mesh_1000_256_s"] / figures["stamp_1000_256_s"]
    trees = Sum(tuple(blobs(1000))), mixed(1000)
    per_cell = [
        median_time(partial(mesh_of, tree, 256), 3) / len(mesh_of(tree, 256).vertices) for tree in trees
    ]
    figures["mixed_over_sum"] = per_cell[1] / per_cell[0]
    return figures


def mesh_from_scratch(tree: Node, resolution: int, device: str) -> None:
    """Polygonize a tree on the device, without reuse."""
    Polygonizer(tree, cell_size=1.0 / resolution, device=device)
    wp.synchronize_device(device)


def remeshing(device: str = "cpu", resolution: int = 256) -> Figures:
    """Measure edits: the time from a tree with one of 1,000 points moved to its triangles."""
    nodes, rng = blobs(1000), np.random.default_rng(7)
    polygonizer = Polygonizer(Sum(tuple(nodes)), cell_size=1.0 / resolution, device=device)
    edits, fresh = [], []
    for edit in range(16):
        number = int(rng.integers(len(nodes)))
        x, y, z = nodes[number].center + rng.normal(size=3) * 0.01
        nodes[number] = replace(nodes[number], center=(x, y, z))
        tree = Sum(tuple(nodes))

        def update(tree: Node = tree) -> None:
            polygonizer.update_device_mesh(tree)
            wp.synchronize_device(device)

        edits.append(timed(update))
        if edit % 4 == 0:
            copy = Sum(tuple(nodes))
            fresh.append(timed(partial(mesh_from_scratch, copy, resolution, device)))
    sources = polygonizer.dual_mesh.cells.leaves.sources.numpy()
    return {
        "remesh_ms": 1e3 * statistics.median(edits[2:]),
        "remesh_over_fresh": statistics.median(edits[2:]) / statistics.median(fresh[1:]),
        "remesh_blocks": float((sources < 0).mean()),
    }


def cost_of_quality(device: str = "cpu", resolution: int = 256) -> Figures:
    """Measure dual polygonization over marching cubes on the same cells, in alternating runs."""
    tree = Sum(tuple(blobs(1000)))

    def reference() -> None:
        marching_cubes(cells_of(tree, resolution, device))
        wp.synchronize_device(device)

    dual, cubes = [], []
    for run in range(8):
        dual.append(timed(lambda: surface_of(tree, resolution, device)))
        cubes.append(timed(reference))
        if run == 0:
            dual, cubes = [], []
    return {"quality_cost": statistics.median(dual) / statistics.median(cubes)}


def curve(device: str = "cpu", *, quick: bool = False) -> Figures:
    """Measure nanoseconds per cell that the surface crosses, for several N and R at equal overlap.

    On the processor this is processor time of all threads, which other programs do not affect.
    """
    clock = time.process_time if device == "cpu" else time.perf_counter
    figures = {}
    for count in (100, 1000, 10_000):
        for resolution in (128, 256) if quick else (128, 256, 512):
            tree = Sum(tuple(blobs(count)))
            crossing = len(surface_of(tree, resolution, device).vertices)
            seconds = median_time(partial(surface_of, tree, resolution, device), 3, clock)
            figures[f"crossing_{count}_{resolution}"] = float(crossing)
            figures[f"ns_per_crossing_{count}_{resolution}"] = 1e9 * seconds / crossing
    return figures


def on_device(device: str, *, quick: bool) -> Figures:
    """Measure the pipeline and its stages on a graphics card."""
    figures = {}
    scenes = [(1000, 256), (1000, 512)] + ([] if quick else [(10_000, 512), (100_000, 512)])
    for count, resolution in scenes:
        nodes, name = tuple(blobs(count)), f"{count}_{resolution}"
        tree = Sum(nodes)
        figures[f"tape_{name}_ms"] = 1e3 * median_time(partial(tape_of, nodes), 3)
        figures[f"cells_{name}_ms"] = 1e3 * median_time(partial(cells_of, tree, resolution, device))
        for kind, work in (("mesh", surface_of), ("host", mesh_of)):
            seconds = median_time(partial(work, tree, resolution, device))
            figures[f"{kind}_{name}_ms"] = 1e3 * seconds
        figures[f"vertices_{name}"] = float(len(surface_of(tree, resolution, device).vertices))
    return figures | remeshing(device) | cost_of_quality(device) | curve(device, quick=quick)


def quality() -> Figures:
    """Measure cells per crossing, primitives per block, and the quality of triangles."""
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
    """Count the directed edges that occur more than once, or without their opposite."""
    faces = mesh.faces.astype(np.int64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = len(mesh.vertices)
    forward, backward = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    return len(forward) - len(np.unique(forward)) + len(np.setxor1d(forward, backward))


def tracing() -> Figures:
    """Measure 512×512 rays into the scene of 1,000 points, on all cores."""
    tree = Sum(tuple(blobs(1000)))
    x, y = np.meshgrid(np.linspace(-0.45, 0.45, 512), np.linspace(-0.45, 0.45, 512))
    directions = np.stack([x, y, np.full_like(x, -1.5)], axis=-1).reshape(-1, 3)
    eye = np.broadcast_to([0.5, 0.5, 2.3], directions.shape)
    return {"trace_1000_512_ms": 1e3 * median_time(lambda: trace(tree, eye, directions))}


def peak() -> Figures:
    """Measure the memory that meshing adds to a process with all kernels loaded, in MB."""
    result = subprocess.run(
        [sys.executable, "-m", "tests.bench.blobtree", "--peak"], check=True, capture_output=True, text=True
    )
    return {"peak_mb": float(result.stdout)}


def print_peak() -> None:
    """Print the figure of `peak`, which runs this in another process."""
    mesh_of(Sum(tuple(blobs(20))), 32)
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # resets the peak
    before = _resident("VmRSS")
    mesh_of(Sum(tuple(blobs(1000))), 256)
    print(_resident("VmHWM") - before)


def _resident(field: str) -> float:
    """Return the resident memory in MB, now (VmRSS) or at its peak (VmHWM); Linux only."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return float(status.split(f"{field}:")[1].split()[0]) / 1024.0


def main() -> None:
    """Parse the command line, measure, print a table and write the figures."""
    parser = bench_parser("blobtree", __doc__)
    parser.add_argument("--quick", action="store_true", help="fewer runs; ends within a minute on two cores")
    parser.add_argument("--device", default="cpu", help="a Warp device, such as cuda:0")
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
    show(figures)
    if options.device == "cpu":
        print(f"Other engines, quoted: {PEERS}.")
    write(options.json, figures)


if __name__ == "__main__":
    main()
