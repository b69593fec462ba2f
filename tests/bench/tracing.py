"""Time of rays into implicit models, in Warp on any device; recordings of them for OpenGL.

    python -m tests.bench.tracing                           # Warp, all cores
    python -m tests.bench.tracing --device cuda:0           # Warp on a graphics card
    python -m tests.bench.tracing --record tracing.npz      # for tests/bench/replay.py

The scene is that of `tests.bench.blobtree`, N points of influence 0.6 N^(−1/3) summed in the unit cube, with
one ray per pixel of a view of the whole cube. Times are medians, without uploads and compilation.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree import Sum
from blobtree.tracing.trace import trace_arrays
from blobtree.tracing.tree_cells import tracing_cells
from decals import Camera
from tests.bench.blobtree import UNIT_BOX, blobs, median_time
from tests.bench.command_line import bench_parser, show, write

COUNTS = (100, 1_000, 10_000)
SIZE = (1600, 1200)
CHECKED = 8
"""Interval of the pixels along each axis whose distances in Warp are recorded for comparison."""


def camera_of(size: tuple[int, int]) -> Camera:
    """Return a camera that sees the whole cube."""
    return Camera.framing(UNIT_BOX, aspect=size[0] / size[1])


def pixel_rays(size: tuple[int, int], step: int = 1) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return origins and unit directions (n, 3) of every `step`-th pixel, from the lower left one."""
    rays = camera_of(size).rays(*size)
    x, y = np.meshgrid(np.arange(0, size[0], step) + 0.5, np.arange(0, size[1], step) + 0.5)
    directions = rays.directions(x, y).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.broadcast_to(rays.origin, directions.shape).astype(np.float32), directions.astype(np.float32)


def warp_times(device: str, counts: tuple[int, ...], size: tuple[int, int], runs: int) -> dict[str, float]:
    """Return the time in ms for the distances of all pixels, without uploads, and the fraction of hits."""
    figures = {}
    for count in counts:
        tree = Sum(tuple(blobs(count)))
        rays: list[Any] = [wp.array(array, dtype=wp.vec3, device=device) for array in pixel_rays(size)]

        def work(tree: Sum = tree, rays: list[Any] = rays) -> Any:
            distances = trace_arrays(tree, *rays)[0]
            wp.synchronize_device(device)
            return distances

        figures[f"hits_{count}"] = float(np.isfinite(work().numpy()).mean())
        figures[f"trace_{count}_ms"] = 1e3 * median_time(work, runs)
    return figures


def record(path: Path, counts: tuple[int, ...], size: tuple[int, int]) -> None:
    """Write the shaders, textures and uniforms of the scenes, and distances traced by Warp."""
    from decals.rendering.pixel_pass import GROUP, PassBackend  # `warp_times` needs no OpenGL
    from decals.rendering.tracing_shader import Kinds, tracing_shader
    from decals.rendering.tree import tracing_uniforms
    from decals.rendering.viewpoint import PictureView, covered_rectangle
    from decals.shaders import compose

    tile = PictureView.of(camera_of(size), size, UNIT_BOX).whole()
    arrays: dict[str, NDArray[Any]] = {"camera": np.frombuffer(tile.block(), np.float32)}
    scenes: dict[str, dict[str, Any]] = {}
    for count in counts:
        tree = Sum(tuple(blobs(count)))
        cells = tracing_cells(tree)
        kinds = Kinds.of(tree.tape)
        part = covered_rectangle(tree.support, tile)
        arrays[f"tape/{count}"], arrays[f"blocks/{count}"] = cells.tape, cells.blocks
        arrays[f"distances/{count}"] = tree.raycast(*pixel_rays(size, CHECKED)).distances
        scenes[str(count)] = {
            "fragment": tracing_shader(kinds, PassBackend.FRAGMENT).text,
            "compute": tracing_shader(kinds, PassBackend.COMPUTE).text,
            "uniforms": {
                **tracing_uniforms(cells),
                "box_lower": tree.support[0].tolist(),
                "box_upper": tree.support[1].tolist(),
                "rectangle": [part.x, part.y, part.width, part.height],
                "object_id": 0,
            },
        }
    settings = {
        "size": size,
        "checked": CHECKED,
        "group": GROUP,
        "vertex": compose("box.vert").text,
        "clear": compose("clear.comp", defines={"GROUP": GROUP}, version="430 core").text,
        "scenes": scenes,
    }
    np.savez_compressed(path, settings=np.array(json.dumps(settings)), **arrays)  # type: ignore[arg-type]


def main() -> None:
    """Parse the command line; measure or record."""
    parser = bench_parser("tracing", __doc__)
    parser.add_argument("--device", default="cpu", help="Warp device, such as cuda:0")
    parser.add_argument("--record", type=Path, metavar="PATH", help="write a recording instead of measuring")
    parser.add_argument("--size", default="x".join(map(str, SIZE)))
    parser.add_argument("--points", type=int, nargs="+", default=COUNTS)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    width, height = (int(part) for part in options.size.split("x"))
    if options.record:
        record(options.record, tuple(options.points), (width, height))
        return
    with wp.ScopedDevice(options.device):
        figures = warp_times(options.device, tuple(options.points), (width, height), options.runs)
    print(f"{wp.get_device(options.device).name}, warp-lang {wp.__version__}, {width}x{height} rays")
    show(figures)
    write(options.json, figures)


if __name__ == "__main__":
    main()
