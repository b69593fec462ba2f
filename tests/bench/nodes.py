"""Benchmark of the modeller's nodes: conformance, soundness, mathematics, and costs.

    python -m tests.bench.nodes                             # every group but `fits`, which takes an hour
    python -m tests.bench.nodes --only soundness --trees 2000 --seed 3
    python -m tests.bench.nodes --only costs --against ../before   # pure sums, paired with another checkout
    python -m tests.bench.nodes --quick --json nodes.json

* conformance: `nodes_conforming` of `nodes_total` classes pass `tests.conformance`.
* bounds: `bounds_violations` of intervals, slopes and boxes in `bounds_samples` samples of each class.
* soundness: `soundness_failures` of `soundness_trees` random trees (`tests.soundness`).
* derivatives: `parameter_gradients_wrong`, derivatives of random trees by parameters that differ from
  float64 by more than 1e-4; `curvature_error`, the largest relative one on a torus and an ellipsoid.
* rest: `rest_error` of rest coordinates, and `rest_over_colors`, their time over that of colours.
* contact, convolution: see `tests.bench.contact` and `tests.bench.convolution_surfaces`.
* meshes: `mesh_error_cells`, the distance of a sampled mesh's surface from the mesh in cells, and the times
  of a blend and of 10,000 rays with a mesh of 100,352 triangles.
* blends: `gradient_bulge` and `sum_bulge`, heights of a bar in a cube of its own width above both, over its
  radius.
* edges: of meshes of `sharp_solids` random solids with sharp edges, `sharp_edge_error`, the largest distance
  of a vertex on a crease from the edges over the size, `sharp_volume_error`, and `sharp_open`, how many are
  not closed.
* widths: `width_error`, how far from the asked distance roundings begin on surfaces of random pairs of
  half-spaces and balls, over that distance, the largest of all operators whose width is a length.
* repeats: `repeat_10000_over_visible`, the time of rays that meet 100 of 10,000 boxes in a grid, over that of
  the same rays through these 100; both grids keep their cells, as while they are drawn.
* outlines: `outline_ns_4` and `outline_ns_4096`, times of a point of solids over stars of 4 and 4,096 edges,
  and `text_ns`, that of the extruded text "Implicit & Decals" of `text_edges` edges.
* fits: see `tests.bench.fitting`.
* costs: `mixed_over_sum` is the cost per crossing cell of a tree with a clean union, solids in contact and a
  bend, over that of the pure sum of its primitives; `gradient_over_sum` is the same with a gradient blend in
  place of the clean union. `sum_regression` is the time of a pure sum here over that in the other
  checkout, by alternating processes. `first_use_s` is the time to define and mesh a warp
  by a noise over 27 cells that no process has compiled before.
"""

import argparse
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvista as pv
import warp as wp
from numpy.typing import NDArray

from blobtree import (
    Box,
    CleanUnion,
    Extrude,
    GradientBlend,
    Node,
    Outline,
    Point,
    Repeat,
    Segment,
    SolidContact,
    Sum,
    from_mesh,
    polygonize,
)
from blobtree.custom import define_warp
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.tracing.tree_cells import tracing_cells
from tests import rounded_widths
from tests.bench import contact, convolution_surfaces, fitting
from tests.bench.command_line import bench_parser, show, write
from tests.blobtree.derivatives import test_curvature
from tests.blobtree.nodes.test_attributes import REST, rest
from tests.blobtree.trees import points_around
from tests.conformance import broken_laws, problems_of, sample
from tests.parameter_derivatives import wrong_derivatives
from tests.sharp_solids import measured
from tests.soundness import failures_by_seed, random_tree

Figures = dict[str, float]

POINTS_IN_CUBES = 24 * 32
"""Samples of a node with which the law of intervals compares."""

ROUNDS = 7
SUM_SCRIPT = """
import time
from blobtree import Sum
from tests.bench.blobtree import blobs, mesh_of
tree = Sum(tuple(blobs(1000)))
mesh_of(tree, 96)
start = time.process_time()
for _ in range(3):
    mesh_of(tree, 96)
print(time.process_time() - start)
"""


def conformance(options: argparse.Namespace) -> Figures:
    """Count the classes that conform; print what the others violate."""
    conforming = 0
    for tag, kind in NODE_KINDS.items():
        problems = problems_of(kind, seed=options.seed, samples=1 if options.quick else 8)
        conforming += not problems
        for problem in problems:
            print(f"  {tag}: {problem[:200]}", flush=True)
    return {"nodes_total": len(NODE_KINDS), "nodes_conforming": conforming}


def bounds(options: argparse.Namespace) -> Figures:
    """Count the violated bounds of all classes; print them."""
    nodes, count = 26 if options.quick else 1_300, 0
    laws = ("interval", "Lipschitz bound", "box")
    for tag, kind in NODE_KINDS.items():
        rng = np.random.default_rng(options.seed)
        violations = [text for _ in range(nodes) for text in broken_laws(sample(kind, rng), rng, *laws)]
        count += len(violations)
        for violation in violations:
            print(f"  {tag}: {violation[:300]}", flush=True)
    return {"bounds_samples": nodes * POINTS_IN_CUBES, "bounds_violations": count}


def soundness(options: argparse.Namespace) -> Figures:
    """Count the random trees that violate something; print what."""
    count = min(options.trees, 20) if options.quick else options.trees
    failing = 0
    for number, tree, failures in failures_by_seed(options.seed, count):
        failing += 1
        for failure in failures:
            print(f"  tree {number}: {failure}: {repr(tree)[:200]}", flush=True)
    return {"soundness_trees": count, "soundness_failures": failing}


def derivatives(options: argparse.Namespace) -> Figures:
    """Compare derivatives by parameters, of nodes of each class and of random trees; and curvatures."""
    rng = np.random.default_rng(options.seed)
    rounds = 1 if options.quick else 10
    trees = [sample(kind, rng) for _ in range(rounds) for kind in NODE_KINDS.values()]
    trees += [random_tree(rng, 1) for _ in range(20 * rounds)]
    compared, wrong = 0, 0
    for tree in trees:
        count, problems = wrong_derivatives(tree, rng)
        compared += count
        wrong += len(problems)
        for problem in problems:
            print(f"  {problem}", flush=True)
    curvature_error = 0.0
    for node, samples in (
        (test_curvature.TORUS, test_curvature.torus_samples),
        (test_curvature.ELLIPSOID, test_curvature.ellipsoid_samples),
    ):
        points, _, expected = samples(500)
        size = np.abs(expected).max(axis=1, keepdims=True)
        errors = np.abs(node.curvatures(points).principal - expected) / size
        curvature_error = max(curvature_error, float(errors.max()))
    return {
        "parameter_gradients": compared,
        "parameter_gradients_wrong": wrong,
        "curvature_error": curvature_error,
    }


def rest_coordinates(options: argparse.Namespace) -> Figures:
    """Compare rest coordinates with float64, and their time with that of colours."""
    rng = np.random.default_rng(options.seed)
    largest = 0.0
    for name, tree in REST.items():
        points = points_around(rng, tree, 400)
        value, expected = rest(tree, points.astype(np.float64))
        strong = value > 1e-2
        if name == "united":  # where two solids have equal fields, either is right
            values = np.array([operand(points) for operand in tree.children])
            strong &= np.ptp(values, axis=0) > 1e-4
        error = np.abs(tree.rest_coordinates(points) - expected)[strong]
        largest = max(largest, float(error.max()))
    limbs = [
        Segment((0, 0, 0), (0.5, 0, 0), radius=0.2)
        .rotate(rng.normal(size=3), float(rng.uniform(0, 180)))
        .translate(rng.uniform(-1.0, 1.0, 3))
        for _ in range(30)
    ]
    tree = Sum(tuple(limbs))
    points = points_around(rng, tree, 20_000)
    best = np.full(2, np.inf)
    for _ in range(5 * ROUNDS):
        for number, call in enumerate((tree.rest_coordinates, tree.colors)):
            start = time.process_time()
            call(points)
            best[number] = min(best[number], time.process_time() - start)
    return {"rest_error": largest, "rest_over_colors": float(best[0] / best[1])}


def meshes(_: argparse.Namespace) -> Figures:
    """Measure a large sampled mesh: its error, and times of a blend and of rays."""
    sphere = pv.Sphere(radius=1.0, theta_resolution=225, phi_resolution=225)
    start = time.perf_counter()
    solid = from_mesh(sphere)
    figures = {"mesh_triangles": float(sphere.n_cells), "mesh_sampled_s": time.perf_counter() - start}
    vertices = polygonize(solid, resolution=64).vertices
    away = np.abs(np.linalg.norm(vertices, axis=1) - 1.0).max()
    tree = solid + Segment((0, 0, 0), (0, 0, 1.5), radius=0.2)
    rays = np.random.default_rng(7).normal(size=(10_000, 3))
    polygonize(tree, resolution=48)
    tree.raycast(4.0 * rays[:10], -rays[:10])
    start = time.perf_counter()
    polygonize(tree.translate((0.1, 0.0, 0.0)), resolution=48)
    blended = time.perf_counter()
    tree.raycast(4.0 * rays, -rays)
    return figures | {
        "mesh_error_cells": float(away) / solid.spacing,
        "mesh_blended_s": blended - start,
        "mesh_traced_s": time.perf_counter() - blended,
    }


def fits(options: argparse.Namespace) -> Figures:
    """Recover random trees from samples."""
    return fitting.figures(2, 3000) if options.quick else fitting.figures(fitting.TREES, fitting.SAMPLES)


def lattice_trees() -> dict[str, Node]:
    """Return a sum of points, and the same points with solids in contact, under two blends and a bend."""
    parts = [Point((x, y, 0.0), radius=0.35) for x in (-0.5, 0.0, 0.5) for y in (-0.4, 0.0, 0.4)]
    raised = [part.translate((0, 0, 0.5)) for part in parts]
    pressed = SolidContact((Sum(tuple(parts[:4])), Sum(tuple(parts[4:]))), width=0.3, height=0.03)
    blends = {
        "mixed": CleanUnion(pressed, Sum(tuple(raised))),
        "gradient": GradientBlend(pressed, Sum(tuple(raised)), start_angle=15, full_angle=75),
    }
    return {"sum": Sum((*parts, *raised))} | {
        name: blend.bend(30.0, (-0.5, 0.5)) for name, blend in blends.items()
    }


def costs(options: argparse.Namespace) -> Figures:
    """Compare times per vertex, of which each crossing cell has one; and pure sums with another checkout."""
    resolution = 48 if options.quick else 96
    trees = lattice_trees()
    counts = {name: len(polygonize(tree, resolution=resolution).vertices) for name, tree in trees.items()}
    best = dict.fromkeys(trees, np.inf)
    for _ in range(ROUNDS):
        for name, tree in trees.items():
            start = time.process_time()
            polygonize(tree, resolution=resolution)
            best[name] = min(best[name], (time.process_time() - start) / counts[name])
    figures = {f"{name}_over_sum": best[name] / best["sum"] for name in ("mixed", "gradient")} | first_use()
    if options.against:
        figures |= regression(options.against.resolve(), 3 if options.quick else ROUNDS)
    return figures


def bulges(_: argparse.Namespace) -> Figures:
    """Compare the tops of a bar in a cube of its own width, in a gradient blend and a sum, with a union."""
    cube, bar = Box((-1, 0, 0), (1.2, 0.8, 0.8), radius=0.1), Segment((-1, 0, 0), (2, 0, 0), radius=0.5)
    z = np.linspace(0.4, 0.8, 4001)
    x = np.linspace(-1.6, 1.2, 57)
    points = np.stack(np.broadcast_arrays(x[:, None], 0.0, z), axis=-1).reshape(-1, 3)

    def tops(tree: Node) -> NDArray[np.float64]:
        inside = tree(points).reshape(len(x), len(z)) >= 0.5
        return np.asarray(np.where(inside, z, 0.0).max(axis=1))

    blended = GradientBlend(cube, bar, start_angle=15, full_angle=75)
    union = tops(cube | bar)
    rises = {"gradient_bulge": tops(blended) - union, "sum_bulge": tops(cube + bar) - union}
    return {name: float(rise.max()) / bar.radius for name, rise in rises.items()}


@wp.func
def hashed(i: wp.float32, j: wp.float32, k: wp.float32) -> wp.float32:
    """Return a random number from 0 to 288 for a cell of the unit lattice."""
    number = int(0)
    for axis in range(3):
        number += int(wp.where(axis == 0, i, wp.where(axis == 1, j, k)))
        number = (((34 * number + 10) * number) % 289 + 289) % 289
    return wp.float32(number)


@wp.func
def fresh(q: wp.vec3, amount: wp.float32) -> wp.vec3:
    """Return q lifted by noise: a bump of random height in each of the 27 cells around it."""
    base = wp.vec3(wp.floor(q[0]), wp.floor(q[1]), wp.floor(q[2]))
    rise = float(0.0)
    for i in range(-1, 2):
        for j in range(-1, 2):
            for k in range(-1, 2):
                cell = base + wp.vec3(float(i), float(j), float(k))
                apart = q - cell - wp.vec3(0.5, 0.5, 0.5)
                rise += hashed(cell[0], cell[1], cell[2]) * wp.exp(-8.0 * wp.dot(apart, apart))
    return wp.vec3(q[0], q[1], q[2] + amount / 289.0 * rise)


def first_use() -> Figures:
    """Time the definition and the first mesh of a warp under a new name, which no process has compiled."""
    start = time.perf_counter()
    name = f"fresh{time.time_ns()}"
    lifted = define_warp(fresh, stretch=2.0, box=0.5, name=name, limits={"amount": (0.0, 0.2)})
    polygonize(lifted(Point((0, 0, 0), radius=1.0), 0.1), resolution=32)
    return {"first_use_s": time.perf_counter() - start}


def regression(other: Path, rounds: int) -> Figures:
    """Compare pure sums in alternating processes here and in another checkout."""
    times: dict[Path, list[float]] = {Path.cwd(): [], other: []}
    for _ in range(rounds):
        for folder, seconds in times.items():
            run = [sys.executable, "-c", SUM_SCRIPT]
            seconds.append(float(subprocess.check_output(run, cwd=folder, text=True).split()[-1]))
    here, there = (statistics.median(seconds) for seconds in times.values())
    return {"sum_regression": here / there}


def edges(options: argparse.Namespace) -> Figures:
    """Measure meshes of random solids with sharp edges."""
    found = [measured(seed) for seed in range(10 if options.quick else 100)]
    return {
        "sharp_solids": len(found),
        "sharp_edge_error": max(one.edge for one in found),
        "sharp_volume_error": max(one.volume for one in found),
        "sharp_open": sum(not one.closed for one in found),
    }


def widths(options: argparse.Namespace) -> Figures:
    """Measure where roundings of random pairs begin."""
    found = [pair for seed in range(5 if options.quick else 50) for pair in rounded_widths.errors(seed)]
    return {"width_pairs": len(found), "width_error": max(error for _, error in found)}


def repeats(_: argparse.Namespace) -> Figures:
    """Time rays down on a hundred boxes of a large grid, and of a grid of these alone."""
    brick = Box((0, 0, 0), (0.6, 0.6, 0.6), radius=0)
    grids = [Repeat(Repeat(brick, (1, 0, 0), side, "union"), (0, 1, 0), side, "union") for side in (100, 10)]
    kept = [tracing_cells(grid) for grid in grids]
    places = np.random.default_rng(0).uniform(0.0, 9.0, (100_000, 2))
    origins = np.column_stack([places, np.full(len(places), 5.0)])
    downward = np.tile([0.0, 0.0, -1.0], (len(places), 1))
    times: list[list[float]] = [[], []]
    for _round in range(4):
        for grid, seconds in zip(grids, times, strict=True):
            start = time.perf_counter()
            grid.raycast(origins, downward)
            seconds.append(time.perf_counter() - start)
    many, few = (statistics.median(seconds[1:]) for seconds in times)
    return {"repeat_10000_over_visible": many / few, "repeat_10000_cells_mb": kept[0].nbytes / 1e6}


def outlines(_: argparse.Namespace) -> Figures:
    """Time points around extrusions of few and of many edges."""

    def star(count: int) -> Outline:
        angles = np.arange(count) * 2.0 * np.pi / count
        rays = 1.0 + 0.2 * np.sin(9.0 * angles)
        return Outline.polygon(rays[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]))

    def nanoseconds(outline: Outline) -> float:
        solid = Extrude(outline, 0.3)
        points = np.random.default_rng(0).uniform(*solid.support, (200_000, 3))
        times: list[float] = []
        for _round in range(4):
            start = time.perf_counter()
            solid(points)
            times.append(time.perf_counter() - start)
        return 1e9 * min(times[1:]) / len(points)

    text = Outline.text("Implicit & Decals")
    return {
        "outline_ns_4": nanoseconds(star(4)),
        "outline_ns_4096": nanoseconds(star(4096)),
        "text_edges": sum(len(loop.points) for loop in text.loops),
        "text_ns": nanoseconds(text),
    }


GROUPS: dict[str, Callable[[argparse.Namespace], Figures]] = {
    "conformance": conformance,
    "bounds": bounds,
    "soundness": soundness,
    "derivatives": derivatives,
    "rest": rest_coordinates,
    "contact": lambda options: contact.figures(quick=options.quick),
    "convolution": lambda _: convolution_surfaces.figures(),
    "meshes": meshes,
    "blends": bulges,
    "edges": edges,
    "widths": widths,
    "repeats": repeats,
    "outlines": outlines,
    "costs": costs,
    "fits": fits,
}


def main() -> None:
    """Parse the command line and measure."""
    parser = bench_parser("nodes", __doc__)
    parser.add_argument("--only", nargs="+", choices=GROUPS, help="groups of figures")
    parser.add_argument("--trees", type=int, default=200, help="number of random trees")
    parser.add_argument("--seed", type=int, default=1, help="seed of random nodes and trees")
    parser.add_argument("--against", type=Path, help="another checkout, for sum_regression")
    parser.add_argument("--quick", action="store_true", help="few samples and trees")
    options = parser.parse_args()
    figures: Figures = {}
    for group in options.only or [name for name in GROUPS if name != "fits"]:
        added = GROUPS[group](options)
        figures |= added
        show(added)
    write(options.json, figures)


if __name__ == "__main__":
    main()
