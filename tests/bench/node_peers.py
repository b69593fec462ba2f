"""Meshes of the same models by other methods: ``python -m tests.bench.node_peers [--resolution R]``.

Every method samples or meshes the same field in the same box, with cells of the same size:

* ours, `blobtree.polygonize`;
* the float64 oracle of the tests, in NumPy, at all grid points, then scikit-image's marching cubes;
* the same samples, then VTK's flying edges;
* Blender's metaballs (`bpy`), for the sum of balls, whose field is the same.

Methods whose package is missing are left out. `program_peers.py` compares modellers that are built from
source. Times are processor times of all threads, without compilation.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree import (
    RIM,
    BlendGraph,
    Box,
    ConvolutionStroke,
    Gyroid,
    Node,
    Point,
    Segment,
    SolidContact,
    Sum,
    Superquadric,
    polygonize,
)
from tests.bench.blobtree import centers
from tests.oracles import blobtree as oracle

Floats = NDArray[np.float64]
BALLS = 100
CHUNK = 200_000
"""Points per call of the oracle."""


@dataclass(frozen=True)
class Result:
    """Vertices, triangles and seconds of one method."""

    vertices: Floats
    faces: NDArray[np.int64]
    seconds: float


def balls() -> Node:
    """Return the sum of points of the other benchmarks."""
    places, s = centers(BALLS)
    return Sum(tuple(Point(tuple(place), radius=s * RIM) for place in places.tolist()))


def models() -> dict[str, Node]:
    """Return the models by name."""
    beam = Box((0, 0, 1), (0.4, 0.6, 2), radius=0.1)
    bar = Segment((-1, 0, 0), (1, 0, 0), radius=0.3)
    stroke = ConvolutionStroke(((-1, 0, 0), (-0.4, 0, 1), (0.4, 0, 0), (1, 0, 1)), (0.1, 0.25, 0.25, 0.1))
    pair = (Point((-0.5, 0, 0), radius=0.8), Point((0.6, 0, 0), radius=0.6))
    arms = (bar, bar.rotate((0, 0, 1), 90), bar.translate((0, 0, 0.5)))
    return {
        f"sum of {BALLS} balls": balls(),
        "gyroid": Gyroid((0, 0, 0), (2, 2, 2), period=1.0, thickness=0.15),
        "superquadric": Superquadric((0, 0, 0), (1.2, 0.8, 0.8), 0.3, 1.0),
        "convolution stroke": stroke,
        "bent box": beam.bend(40, (0, 2)),
        "two solids in contact": SolidContact(pair, stiffness=(1, 3), height=0.05),
        "blend graph": BlendGraph(arms, names=("a", "b", "c"), pairs=(("a", "b"),)),
    }


def samples(node: Node, lower: Floats, counts: NDArray[np.int64], cell: float) -> Floats:
    """Return the oracle's values at all grid points."""
    values = np.empty(int(counts.prod()))
    for start in range(0, len(values), CHUNK):
        places = np.unravel_index(np.arange(start, min(start + CHUNK, len(values))), counts)
        values[start : start + CHUNK] = oracle.value(node, lower + cell * np.column_stack(places))
    return values.reshape(counts)


def by_polygonize(node: Node, _lower: Floats, _counts: NDArray[np.int64], cell: float) -> tuple[Any, Any]:
    mesh = polygonize(node, cell_size=cell)
    return mesh.vertices, mesh.faces


def by_skimage(node: Node, lower: Floats, counts: NDArray[np.int64], cell: float) -> tuple[Any, Any]:
    measure = import_module("skimage.measure")
    vertices, faces, _, _ = measure.marching_cubes(samples(node, lower, counts, cell), 0.5)
    return lower + cell * vertices.astype(np.float64), faces


def by_vtk(node: Node, lower: Floats, counts: NDArray[np.int64], cell: float) -> tuple[Any, Any]:
    import pyvista as pv

    grid = pv.ImageData(dimensions=tuple(counts), spacing=(cell,) * 3, origin=tuple(lower))
    grid["field"] = samples(node, lower, counts, cell).ravel(order="F")
    surface = grid.contour([0.5], scalars="field", method="flying_edges")
    return surface.points, surface.regular_faces


def by_blender(node: Node, _lower: Floats, _counts: NDArray[np.int64], cell: float) -> tuple[Any, Any]:
    bpy = import_module("bpy")
    assert isinstance(node, Sum)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    metaball = bpy.data.metaballs.new("balls")
    metaball.resolution = metaball.render_resolution = cell
    metaball.threshold = 0.5
    for operand in node.operands:
        element = metaball.elements.new()
        element.co, element.radius = operand.center, operand.radius / RIM  # type: ignore[attr-defined]
        element.stiffness = 1.0
    made = bpy.data.objects.new("balls", metaball)
    bpy.context.collection.objects.link(made)
    mesh = made.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    mesh.calc_loop_triangles()
    vertices = np.array([vertex.co for vertex in mesh.vertices])
    return vertices, np.array([triangle.vertices for triangle in mesh.loop_triangles])


METHODS: dict[str, Callable[..., tuple[Any, Any]]] = {
    "blobtree": by_polygonize,
    "NumPy + scikit-image": by_skimage,
    "NumPy + VTK": by_vtk,
    "Blender": by_blender,
}


def run(method: Callable[..., tuple[Any, Any]], node: Node, resolution: int) -> Result:
    """Return what a method makes of a model, timed at the second run."""
    low, high = (corner.astype(np.float64) for corner in node.bounds)
    cell = float((high - low).max() / resolution)
    counts = np.ceil((high - low) / cell).astype(np.int64) + 5
    method(node, low - 2.0 * cell, counts, cell)
    start = time.process_time()
    vertices, faces = method(node, low - 2.0 * cell, counts, cell)
    seconds = time.process_time() - start
    return Result(np.asarray(vertices, np.float64), np.asarray(faces, np.int64), seconds)


def vertex_errors(node: Node, vertices: Floats, cell: float) -> Floats:
    """Return first-order distances of vertices from the surface, in cells."""
    chosen = vertices[np.random.default_rng(0).permutation(len(vertices))[:5000]]
    slopes = np.linalg.norm(oracle.gradient(node, chosen), axis=1)
    distances: Floats = np.abs(oracle.value(node, chosen) - 0.5) / np.maximum(slopes, 1e-9) / cell
    return distances


def qualities(result: Result) -> Floats:
    """Return 4√3 · area / Σ edge² of triangles, 1 for an equilateral one."""
    corners = result.vertices[result.faces]
    edges = corners - np.roll(corners, 1, axis=1)
    areas = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    squares = (edges**2).sum(axis=(1, 2))
    shape: Floats = 4.0 * np.sqrt(3.0) * areas / np.where(squares > 0.0, squares, 1.0)
    return shape


def row(name: str, method: str, node: Node, resolution: int) -> str:
    """Return a line of the table."""
    result = run(METHODS[method], node, resolution)
    cell = float(np.ptp(np.stack(node.bounds), axis=0).max() / resolution)
    errors = vertex_errors(node, result.vertices, cell)
    return (
        f"| {name} | {method} | {result.seconds:.2f} | {len(result.vertices):,} | {errors.mean():.1e} | "
        f"{np.percentile(errors, 99):.1e} | {np.percentile(qualities(result), 1):.2f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--resolution", type=int, default=96, help="cells along the longest side of a model")
    resolution = parser.parse_args().resolution
    print("| model | method | s | vertices | mean error, cells | 99 % | quality, 1 % |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for name, node in models().items():
        for method in METHODS:
            if method == "Blender" and not isinstance(node, Sum):
                continue
            try:
                print(row(name, method, node, resolution), flush=True)
            except ImportError as error:
                print(f"{method} is left out: {error}", file=sys.stderr)


if __name__ == "__main__":
    main()
