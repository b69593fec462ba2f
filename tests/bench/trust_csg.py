"""Holes in pictures of sharp CSG: pixels that miss, or see through, where a ray is deep inside in float64.

    python -m tests.bench.trust_csg [--seeds 1 2 3] [--workers 16] [--backend compute] [--json FILE]

Each process has a renderer of its own. Each case is printed with its pixels and holes; a case is the tree and
the camera of ``scene(seed, number)``. A campaign that was interrupted goes on with ``--first``.
"""

import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from itertools import count, islice
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from blobtree import Node
from decals import Camera
from decals.rendering import Context, Renderer, RenderOptions
from decals.rendering.pixel_pass import PassBackend
from tests.bench.command_line import bench_parser, show, write
from tests.blobtree.csg_trees import visible_tree
from tests.blobtree.trees import triple
from tests.decals.glsl.tapes import Model
from tests.decals.shapes import View
from tests.oracles.csg import deep_hits, signed_distance
from tests.oracles.pixels import middle_rays

TARGETS = {"csg_holes": "0", "csg_ray_holes": "0"}

DEPTH = 1e-4
"""How deep a ray must be inside, over the diagonal of the model's box."""

MAX_DEPTH = 4
"""Depth of the deepest trees."""

FAR = 0.5
"""Vertical angle of view of far cameras in degrees: the eye is 200 diagonals away."""

CLOSEST = 0.01
"""Least distance of a near eye from the solid, over the diagonal of the model's box."""

TREES, QUICK_TREES = 100, 12
SIZE, QUICK_SIZE = (160, 120), (60, 45)
AT_ONCE = 48
"""Cases that are given to the processes at once."""


@dataclass(frozen=True)
class Holes:
    """Pixels that must show the surface; those of them that do not, in a picture and among traced rays."""

    pixels: int
    of_picture: int
    of_rays: int


@dataclass(frozen=True)
class Case:
    """The holes of one case, and the seconds that it took."""

    seed: int
    number: int
    holes: Holes
    seconds: float

    def __str__(self) -> str:
        found = f"{self.holes.of_picture} holes of {self.holes.pixels} pixels, {self.holes.of_rays} of rays"
        return f"seed {self.seed}, case {self.number}: {found}, {self.seconds:.1f} s"


Runner: TypeAlias = Callable[[Callable[[int], Case], Iterable[int]], Iterator[Case]]
"""Calls a function for numbers, in order; ``map``, or that of several processes."""


def measure(seed: int = 1, *, quick: bool) -> dict[str, float]:
    """Draw random trees that are not empty from random places, and count the holes."""
    with Renderer() as renderer:
        size, trees = (QUICK_SIZE, QUICK_TREES) if quick else (SIZE, TREES)
        cases = (holes_of(*scene(seed, case), renderer, size) for case in count())
        return figures_of(list(islice((holes for holes in cases if holes.pixels), trees)))


def figures_of(found: list[Holes]) -> dict[str, float]:
    """Return the sums over the trees that show."""
    return {
        "csg_holes": sum(holes.of_picture for holes in found),
        "csg_ray_holes": sum(holes.of_rays for holes in found),
        "csg_cases": len(found),
        "csg_pixels": sum(holes.pixels for holes in found),
    }


def scene(seed: int, case: int) -> tuple[Node, Camera]:
    """The tree and the camera of a case: every other tree is regular, and cameras are far or near in turn."""
    rng = np.random.default_rng([seed, case])
    tree = visible_tree(rng, 1 + case % MAX_DEPTH, regular=case // MAX_DEPTH % 2 == 1)
    place = case % 3
    if place == 2 and (camera := _near(rng, tree)):
        return tree, camera
    direction = rng.normal(size=3) if rng.random() < 0.7 else np.roll([1.0, 0.0, 0.0], rng.integers(3))
    fov = FAR if place == 1 else 30.0
    return tree, Camera.framing(tree.support, direction=direction.tolist(), fov=fov)


def _near(rng: np.random.Generator, tree: Node) -> Camera | None:
    """A wide camera in or beside the box of a tree, but not in or at its solid; None if none is found."""
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    diagonal = float(np.linalg.norm(upper - lower))
    for _ in range(100):
        eye, target = rng.uniform(lower - 0.1 * diagonal, upper + 0.1 * diagonal), rng.uniform(lower, upper)
        if signed_distance(tree, eye[None])[0] > CLOSEST * diagonal:
            return Camera(triple(eye), target=triple(target), fov=80.0)
    return None


def holes_of(
    tree: Node, camera: Camera, renderer: Renderer, size: tuple[int, int], *, twin: Node | None = None
) -> Holes:
    """Return the holes of a tree in a camera's view; pixels beside a silhouette do not count.

    `twin` has the same shape, of kinds that the oracle knows.
    """
    width, height = size
    origin, directions = middle_rays(camera, size)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = np.broadcast_to(origin, directions.shape)
    depth = DEPTH * float(np.linalg.norm(tree.support[1] - tree.support[0]))
    deep = deep_hits(twin or tree, origins, directions, depth)
    counted = _surrounded(np.isfinite(deep).reshape(height, width)).ravel()
    buffers = renderer.buffers(View((Model(tree),), camera), RenderOptions(size=size))
    distances = np.linalg.norm(buffers.position.reshape(-1, 3) - origin, axis=1)
    distances = np.where(buffers.object_id.ravel() < 0, np.inf, distances)
    traced = tree.raycast(origins, directions).distances
    late = (distances > deep + depth) & counted, (traced > deep + depth) & counted
    return Holes(int(counted.sum()), *(int(pixels.sum()) for pixels in late))


def _surrounded(hits: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the hits among whose eight neighbours is no miss."""
    padded = np.pad(hits, 1, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return np.asarray(windows.all(axis=(2, 3)))


def campaign(seed: int, trees: int, size: tuple[int, int], first: int, run: Runner) -> Iterator[Case]:
    """Yield this many cases that show, from the number `first` on; some more are drawn at once."""
    for start in count(first, AT_ONCE):
        for case in run(partial(drawn, seed, size), range(start, start + AT_ONCE)):
            trees -= case.holes.pixels > 0
            yield case
            if trees == 0:
                return


def drawn(seed: int, size: tuple[int, int], number: int) -> Case:
    """Draw one case with the renderer of this process."""
    start = time.perf_counter()
    holes = holes_of(*scene(seed, number), _renderer(), size)
    return Case(seed, number, holes, time.perf_counter() - start)


@cache
def _renderer() -> Renderer:
    """Return the renderer of this process."""
    return Renderer(Context.standalone(backend=_BACKEND.get("name")))


_BACKEND: dict[str, str | None] = {}
"""How the renderer of this process draws, if the command line says so."""


def _choose(backend: str | None) -> None:
    """Choose how this process draws."""
    _BACKEND["name"] = backend


def main() -> int:
    """Draw the cases that the command line asks for; the exit code is 1 if a pixel misses."""
    parser = bench_parser("trust_csg", __doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--trees", type=int, default=TREES, help="trees of each seed that show")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--size", default="x".join(map(str, SIZE)))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--backend", choices=[backend.value for backend in PassBackend])
    options = parser.parse_args()
    width, height = (int(part) for part in options.size.split("x"))
    found: list[Holes] = []
    spawned = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.workers, spawned, _choose, (options.backend,)) as pool:
        for seed in options.seeds:
            for case in campaign(seed, options.trees, (width, height), options.first, pool.map):
                found += [case.holes] if case.holes.pixels else []
                print(case, file=sys.stderr, flush=True)
    figures = figures_of(found)
    show(figures)
    write(options.json, figures)
    return int(figures["csg_holes"] + figures["csg_ray_holes"] > 0)


if __name__ == "__main__":
    sys.exit(main())
