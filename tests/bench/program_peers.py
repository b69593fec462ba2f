"""The same programs meshed and drawn by other modellers: ``python -m tests.bench.program_peers FILE ...``.

    python -m tests.bench.program_peers prospero.vm architecture.frep molecule.json --balls 1000 \
        --fidget fidget-cli --libfive libfive.so --json peers.json

Files are programs of clauses (`.vm`, `.frep`) and scenes of spheres of Lipschitz Pruning (`.json`). Each
becomes one text of clauses in [-1, 1]³, which all modellers get; ours gets the tree that it reads from the
file. The rounding of a union is a parabola in scenes of Lipschitz Pruning and an arc in ours; the
difference counts as our error.

Peers are built from their public source, and left out by name where they are missing:

* ``--fidget``: the program `fidget-cli` of mkeeter/fidget, by ``cargo build --release`` in `demos/cli`. It
  meshes by dual contouring, and draws depth pictures;
* ``--libfive``: the shared library of libfive/libfive (CMake, without its applications). It meshes by dual
  contouring. Its interface for C draws no depth pictures;
* `sdf` of fogleman/sdf, and scikit-image, where Python finds them. It meshes by marching cubes from NumPy's
  values.

MPR and Lipschitz Pruning need a graphics card of NVIDIA; PyFRep needs PyTorch, and evaluates all cells.

Seconds are processor times of all threads, the least of three runs (one if it takes ten seconds), without
reading. Errors are distances of vertices from the surface of the text in float64, in cells: of first order,
or to the nearest other sign around a vertex if that is less.
*Missed* is the share of the surface, where lines meet it, that no triangle comes as near as a cell.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree import RIM, Expression, Node, Point, Sum, polygonize
from blobtree.foreign import read_lipschitz, read_program
from blobtree.foreign.json_values import parsed_json
from decals.surfaces import MeshSurface
from tests.bench.blobtree import centers
from tests.bench.command_line import bench_parser, write
from tests.bench.modeller_peers import Fidget, Floats, Libfive, Lines, Meshed, PythonSdf, field, least

HALF = 0.99
"""Half the side of the box at which programs end, inside the cube that all modellers divide."""

FILLED = 0.9
"""Half the longest side of scenes with bounds of their own."""

VERTICES = 4_000
"""Vertices of which errors are measured."""

LINES, STEPS = 300, 500
"""Lines along the axes that meet the surface, and samples of each."""

SLOPE_STEP = 1e-6
"""Half the step of differences."""

DOUBTFUL = 0.25
"""First-order distance in cells from which another sign is looked for, as far as two cells."""

SHELLS = 32
"""Distances at which it is looked for."""

Figures = dict[str, float]


@dataclass(frozen=True)
class Scene:
    """A text of clauses, and our tree of it."""

    name: str
    lines: tuple[str, ...]
    node: Node


def program_scene(path: Path) -> Scene:
    """Return a program of clauses that ends at a box."""
    flat = read_program(path).size[2]
    node = read_program(path, size=(2 * HALF, 2 * HALF, min(flat, 2 * HALF)))
    return Scene(path.stem, boxed(node), node)


def boxed(node: Expression) -> tuple[str, ...]:
    """Return the clauses of an expression, and those of its box around the origin."""
    lines = list(node.clauses)
    last = lines[-1].split()[0]
    for axis, side in zip("xyz", node.size, strict=True):
        lines += [
            f"box_{axis} var-{axis}",
            f"box_abs_{axis} abs box_{axis}",
            f"box_half_{axis} const {0.5 * side!r}",
            f"box_out_{axis} sub box_abs_{axis} box_half_{axis}",
            f"box_in_{axis} max {last} box_out_{axis}",
        ]
        last = f"box_in_{axis}"
    return tuple(lines)


def squared_distance(center: NDArray[np.floating], name: str) -> list[str]:
    """Return clauses of the squared distance from a point; the last has that name."""
    lines = []
    for axis, place in zip("xyz", center.tolist(), strict=True):
        lines += [
            f"{name}_at_{axis} const {place!r}",
            f"{name}_to_{axis} sub {axis} {name}_at_{axis}",
            f"{name}_square_{axis} square {name}_to_{axis}",
        ]
    return [*lines, f"{name}_xy add {name}_square_x {name}_square_y", f"{name} add {name}_xy {name}_square_z"]


def lipschitz_scene(path: Path) -> Scene:
    """Return a scene of spheres in unions, rounded or not, of Lipschitz Pruning."""
    scene = parsed_json(path.read_bytes())
    scale = FILLED / float(np.abs([scene["aabb_min"], scene["aabb_max"]]).max())
    lines = [f"{axis} var-{axis}" for axis in "xyz"]
    operands: list[tuple[Any, Floats, bool]] = [(scene, np.eye(4), False)]
    known: list[str] = []
    while operands:
        node, above, joined = operands.pop()
        matrix = above @ np.array([*node["matrix"], 0, 0, 0, 1], np.float64).reshape(4, 4)
        name = f"n{len(lines)}"
        if node["nodeType"] == "binaryOperator" and not joined:
            sides = [(node[side], matrix, False) for side in ("leftChild", "rightChild")]
            operands += [(node, above, True), *sides]
        elif joined:
            if node["blendMode"] != "union":
                raise ValueError(f"expected unions in {path}, got {node['blendMode']}")
            lines += union_lines(known.pop(), known.pop(), scale * node["blendRadius"], name)
            known.append(name)
        else:
            if node["primitiveType"] != "sphere":
                raise ValueError(f"expected spheres in {path}, got a {node['primitiveType']}")
            center = scale * np.linalg.inv(matrix)[:3, 3]
            lines += squared_distance(center, f"{name}_squared")
            lines += [f"{name}_r const {scale * node['radius']!r}", f"{name}_d sqrt {name}_squared"]
            lines.append(f"{name} sub {name}_d {name}_r")
            known.append(name)
    return Scene(path.stem, tuple(lines), read_lipschitz(path).scale(scale))


def union_lines(a: str, b: str, width: float, name: str) -> list[str]:
    """Return clauses of a union that a parabola rounds."""
    if width == 0.0:
        return [f"{name} min {a} {b}"]
    return [
        f"{name}_less min {a} {b}",
        f"{name}_apart sub {a} {b}",
        f"{name}_gap abs {name}_apart",
        f"{name}_width const {width!r}",
        f"{name}_zero const 0.0",
        f"{name}_within sub {name}_width {name}_gap",
        f"{name}_kept max {name}_within {name}_zero",
        f"{name}_square square {name}_kept",
        f"{name}_four const {0.25 / width!r}",
        f"{name}_off mul {name}_square {name}_four",
        f"{name} sub {name}_less {name}_off",
    ]


def balls_scene(count: int) -> Scene:
    """Return the sum of points of the other benchmarks, from -0.9 to 0.9."""
    places, s = centers(count)
    places, s = 2.0 * FILLED * (places - 0.5), 2.0 * FILLED * s
    lines = ["x var-x", "y var-y", "z var-z", "one const 1.0", "zero const 0.0", f"over const {1.0 / s**2!r}"]
    total = "zero"
    for number, place in enumerate(places):
        name = f"b{number}"
        lines += squared_distance(place, f"{name}_squared")
        lines += [
            f"{name}_z mul {name}_squared over",
            f"{name}_t sub one {name}_z",
            f"{name}_kept max {name}_t zero",
            f"{name}_two square {name}_kept",
            f"{name}_three mul {name}_two {name}_kept",
            f"{name} add {total} {name}_three",
        ]
        total = name
    lines += ["iso const 0.5", f"value sub iso {total}"]
    node = Sum(tuple(Point(tuple(place), radius=s * RIM) for place in places.tolist()))
    return Scene(f"sum of {count:,} balls", tuple(lines), node)


def scene_of(path: Path) -> Scene:
    """Return the scene of a file."""
    return lipschitz_scene(path) if path.suffix == ".json" else program_scene(path)


@dataclass(frozen=True)
class Blobtree:
    """This project."""

    node: Node

    def mesh(self, _lines: Lines, resolution: int) -> Meshed:
        """Mesh the tree with cells of the same size."""
        polygonize(self.node, cell_size=2.0 / 16)  # compiles
        mesh, seconds = least(lambda: polygonize(self.node, cell_size=2.0 / resolution))
        return Meshed(mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64), seconds)

    def rays(self, _lines: Lines, size: int) -> tuple[NDArray[np.bool_], float]:
        """Return which of parallel rays hit, the lowest row first, and the time."""
        place = (np.arange(size) + 0.5) * 2.0 / size - 1.0
        x, y = np.meshgrid(place, place)
        starts = np.stack([x, y, np.full_like(x, 1.5)], axis=-1).reshape(-1, 3)
        headings = np.broadcast_to((0.0, 0.0, -1.0), starts.shape)
        self.node.raycast(starts[:1000], headings[:1000])
        hits, seconds = least(lambda: self.node.raycast(starts, headings))
        return hits.hit.reshape(size, size), seconds


def distances(values: Callable[[Floats], Floats], points: Floats) -> Floats:
    """Return first-order distances of points from where a function is 0."""
    changes = [values(points + step) - values(points - step) for step in SLOPE_STEP * np.eye(3)]
    slope = np.linalg.norm(changes, axis=0) / (2.0 * SLOPE_STEP)
    return np.asarray(np.abs(values(points)) / np.maximum(slope, 1e-9))


def nearest_changes(values: Callable[[Floats], Floats], points: Floats, reach: float) -> Floats:
    """Return how far the nearest other sign is in 26 directions, in steps of a share of the reach; or inf."""
    ways = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    ways = ways[np.any(ways != 0.0, axis=1)]
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    radii = reach * np.arange(1, SHELLS + 1) / SHELLS
    around = points[:, None, None] + radii[:, None, None] * ways
    signs = values(around.reshape(-1, 3)).reshape(around.shape[:3]) < 0.0
    changed = (signs != (values(points) < 0.0)[:, None, None]).any(axis=2)
    return np.where(changed.any(axis=1), radii[changed.argmax(axis=1)], np.inf)


def surface_points(values: Callable[[Floats], Floats]) -> Floats:
    """Return points at which random lines along the axes meet the surface of a function."""
    rng = np.random.default_rng(0)
    found = []
    along = np.linspace(-1.0, 1.0, STEPS)
    for axis in range(3):
        across = rng.uniform(-1.0, 1.0, (LINES // 3, 2))
        points = np.empty((len(across), STEPS, 3))
        points[..., axis] = along
        points[..., [i for i in range(3) if i != axis]] = across[:, None]
        inside = values(points.reshape(-1, 3)).reshape(points.shape[:2]) < 0.0
        line, step = np.nonzero(inside[:, 1:] != inside[:, :-1])
        low, high, first = points[line, step], points[line, step + 1], inside[line, step]
        for _ in range(40):
            middle = 0.5 * (low + high)
            same = ((values(middle) < 0.0) == first)[:, None]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        found.append(0.5 * (low + high))
    return np.concatenate(found)


def errors(values: Callable[[Floats], Floats], on_surface: Floats, mesh: Meshed, cell: float) -> Figures:
    """Return mean and greatest errors of vertices, and the missed share of the surface."""
    chosen = mesh.vertices[np.random.default_rng(0).permutation(len(mesh.vertices))[:VERTICES]]
    off = distances(values, chosen) / cell
    far = off > DOUBTFUL
    off[far] = np.minimum(off[far], nearest_changes(values, chosen[far], 2.0 * cell) / cell)
    surface = MeshSurface(mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32))
    nearest = surface.project(on_surface.astype(np.float32))[0]
    missed = np.linalg.norm(nearest - on_surface, axis=1) > cell
    return {"mean": float(off.mean()), "worst": float(off.max()), "missed": float(missed.mean())}


def peers(options: argparse.Namespace) -> dict[str, Any]:
    """Return the modellers that are there, and name the others."""
    found: dict[str, Any] = {}
    if options.fidget:
        found["fidget"] = Fidget(options.fidget)
    if options.libfive:
        found["libfive"] = Libfive(options.libfive)
    if find_spec("sdf") and find_spec("skimage"):
        found["sdf, NumPy"] = PythonSdf()
    for name in ("fidget", "libfive", "sdf"):
        if not any(key.startswith(name) for key in found):
            print(f"{name} is left out: it is not there", file=sys.stderr)
    return found


def mesh_rows(scene: Scene, others: dict[str, Any], resolution: int) -> Iterator[tuple[str, Figures]]:
    """Yield the figures of each modeller's mesh."""
    values, cell = field(scene.lines), 2.0 / resolution
    on_surface = surface_points(values)
    for name, other in {"blobtree": Blobtree(scene.node), **others}.items():
        mesh = other.mesh(scene.lines, resolution)
        yield name, cost(mesh) | errors(values, on_surface, mesh, cell)


def cost(mesh: Meshed) -> Figures:
    """Return time and size of a mesh."""
    return {"s": mesh.seconds, "triangles": float(len(mesh.faces))}


def ray_rows(scene: Scene, others: dict[str, Any], size: int) -> Iterator[tuple[str, Figures]]:
    """Yield the figures of each modeller's picture, those that draw none left out."""
    drawing = {name: other for name, other in others.items() if hasattr(other, "rays")}
    ours = None
    for name, other in {"blobtree": Blobtree(scene.node), **drawing}.items():
        hit, seconds = other.rays(scene.lines, size)
        ours = hit if ours is None else ours
        yield name, {"s": seconds, "hit": float(hit.mean()), "apart": float((hit != ours).mean())}


def row(name: str, modeller: str, figures: Figures) -> str:
    """Return a line of a table."""
    forms = {"s": "{:.2f}", "triangles": "{:,.0f}", "mean": "{:.1e}", "worst": "{:.1e}"}
    cells = (forms.get(key, "{:.2%}").format(value) for key, value in figures.items())
    return f"| {name} | {modeller} | {' | '.join(cells)} |"


def main() -> None:
    """Measure and print."""
    parser = bench_parser("program_peers", __doc__)
    parser.add_argument("files", type=Path, nargs="*", help="programs, and scenes of Lipschitz Pruning")
    parser.add_argument("--balls", type=int, nargs="*", default=[], help="numbers of balls in a sum")
    parser.add_argument("--fidget", type=Path, help="path of fidget-cli")
    parser.add_argument("--libfive", type=Path, help="path of libfive's shared library")
    parser.add_argument("--resolutions", type=int, nargs="*", default=[256], help="powers of two")
    parser.add_argument("--rays", type=int, nargs="*", default=[1024], help="pixels along a picture's side")
    options = parser.parse_args()
    scenes = [*map(scene_of, options.files), *map(balls_scene, options.balls)]
    others = peers(options)
    results: Figures = {}
    tables: list[tuple[str, Callable[..., Iterator[tuple[str, Figures]]], int]] = [
        *(("triangles | mean error | worst | missed", mesh_rows, count) for count in options.resolutions),
        *(("hit | apart", ray_rows, count) for count in options.rays),
    ]
    for head, measure, count in tables:
        columns = f"{count}: scene | by | s | {head}"
        print(f"\n| {columns} |", "| --- | --- |" + " ---: |" * (columns.count("|") - 1), sep="\n")
        for scene in scenes:
            for name, figures in measure(scene, others, count):
                print(row(scene.name, name, figures), flush=True)
                results |= {f"{scene.name}, {name}, {count}, {key}": value for key, value in figures.items()}
                write(options.json, results)


if __name__ == "__main__":
    main()
