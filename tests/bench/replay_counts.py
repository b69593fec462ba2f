"""Draw a recording again under other numbers of decals, up to a million, and time the decal pass.

    python -m tests.bench.replay_counts sheet.npz radial.npz layered.npz --device cuda:0 --json times.json

`tests/bench/record.py` writes the recordings. The decals are laid and indexed here, on a Warp device: random
on the recorded mesh, at equal coverage for every number. Needs moderngl, NumPy, Warp and msgspec, not Warp's
CPU device.
Times are medians of OpenGL timer queries, in milliseconds.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import warp as wp

from blobtree.typed.glsl import TEXTURE_WIDTH_BITS
from decals.grid.index import DeviceIndex
from decals.model import RECORD, Decals
from tests.bench.replay import Replay, milliseconds

WIDTH = 1 << TEXTURE_WIDTH_BITS
COVERAGE = 2.5
"""Area of all rims over that of the surface; random decals leave a twelfth of it bare."""

COUNTS = (100, 10_000, 100_000, 1_000_000)
LISTS, LIST = 24, 12
"""Lists that a moved decal leaves and enters, and decals in one."""

Figures = dict[str, float]


def random_coat(vertices: Any, faces: Any, count: int, *, layered: bool) -> Decals:
    """Equal decals at random places of a mesh; of all interactions in three layers if these are wished."""
    rng = np.random.default_rng(count)
    corners = vertices.astype(np.float64)[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    face = rng.choice(len(areas), count, p=areas / areas.sum())
    more: dict[str, Any] = {}
    if layered:
        more = {"interactions": rng.integers(0, 3, count), "layers": rng.integers(-1, 2, count)}
    radius = np.sqrt(COVERAGE * areas.sum() / (np.pi * count))
    return Decals(
        np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], count), corners[face]),
        normals[face],
        np.cross(normals[face], rng.normal(size=(count, 3))),
        np.full(count, radius),
        **more,
    )


class CountedReplay(Replay):
    """A recorded picture whose decals can be exchanged."""

    def __init__(self, gl: moderngl.Context, path: Path) -> None:
        super().__init__(gl, path)
        self.arrays = dict(self.arrays)
        rows = [name for name in self.arrays if name.startswith("rows/")]
        assert len(rows) == 1, "expected a recording of one mesh"
        self.vertices = self.arrays[rows[0]].reshape(-1, 9)[:, :3]
        self.faces = self.arrays[rows[0].replace("rows", "faces")].reshape(-1, 3)

    def lay(self, count: int, device: Any) -> Figures:
        """Put so many decals in place of the recorded ones; seconds of index, megabytes."""
        decals = random_coat(self.vertices, self.faces, count, layered=self.settings["layered"])
        DeviceIndex.of(decals, device)
        wp.synchronize_device(device)
        begin = time.perf_counter()
        index = DeviceIndex.of(decals, device)
        wp.synchronize_device(device)
        seconds = time.perf_counter() - begin
        arrays = {
            "decal_records": decals.packed(),
            "index_levels": index.levels.numpy(),
            "index_table": index.table.numpy(),
            "index_ids": index.ids.numpy(),
        }
        for name, array in arrays.items():
            self._exchange(name, array)
        numbers = {"index_level_count": index.level_count, "index_mask": index.mask}
        for passes in self.settings["passes"].values():
            for one in passes.values():
                one["uniforms"] |= {name: v for name, v in numbers.items() if name in one["uniforms"]}
        return {"index_ms": 1e3 * seconds, "mb": 1e-6 * sum(array.nbytes for array in arrays.values())}

    def upload_ms(self, runs: int) -> float:
        """Median milliseconds to send what one edit changes: a record, and a dozen lists of a cell."""
        records, ids = self._made["decal_records"], self._made["index_ids"]
        rng, times = np.random.default_rng(0), []
        for _ in range(runs):
            rows = rng.integers(0, ids.size[1], LISTS)
            self.gl.finish()
            begin = time.perf_counter()
            records.write(bytes(16 * RECORD), viewport=(0, int(rng.integers(0, records.size[1])), RECORD, 1))
            for row in rows.tolist():
                ids.write(bytes(4 * LIST), viewport=(0, row, LIST, 1))
            self.gl.finish()
            times.append(1e3 * (time.perf_counter() - begin))
        return float(np.median(times))

    def painted(self) -> float:
        """Share of the objects' pixels that decals recolour."""
        bare, painted = (
            np.frombuffer(self.targets[name].read(), np.float16).reshape(-1, 4).astype(np.float32)
            for name in ("g_color", "g_paint")
        )
        seen = painted[:, 3] > 0
        return float((np.abs(painted - bare)[seen, :3] > 1e-3).any(axis=1).mean())

    def _exchange(self, name: str, array: Any) -> None:
        rows = max(1, -(-len(array) // WIDTH))
        padded = np.zeros(rows * WIDTH * int(np.prod(array.shape[1:])), array.dtype)
        padded[: array.size] = array.reshape(-1)
        self.arrays[f"texture/{name}"] = padded.view(np.uint8)
        if name in self._made:
            self._made.pop(name).release()
        for passes in self.settings["passes"].values():
            for one in passes.values():
                if name in one["textures"]:
                    one["textures"][name]["size"] = [WIDTH, rows]


def measure(gl: moderngl.Context, path: Path, counts: list[int], runs: int, device: Any) -> Figures:
    """Time the decal pass and the frame under every number of decals, through both entry points."""
    replay, figures = CountedReplay(gl, path), {}
    replay.draw_surface()
    for count in counts:
        figures |= {f"{name}_{count}": value for name, value in replay.lay(count, device).items()}
        for entry in replay.settings["passes"]:
            if entry == "compute" and gl.version_code < 430:
                continue
            paint = replay.pass_(entry, "paint.glsl", "g_paint")
            figures[f"decals_{entry}_{count}"] = milliseconds(gl, paint, runs)
        figures[f"painted_{count}"] = replay.painted()
        figures[f"upload_ms_{count}"] = replay.upload_ms(runs)
    for entry in replay.settings["passes"]:
        first, last = (figures.get(f"decals_{entry}_{count}") for count in (counts[0], counts[-1]))
        if first and last:
            figures[f"decals_{entry}_{counts[-1]}_over_{counts[0]}"] = last / first
    return figures


def main() -> None:
    """Read the command line, print a table and write the figures."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.replay_counts", description=__doc__)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--counts", default=",".join(map(str, COUNTS)))
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--device", default="cpu", help="Warp device that lays and indexes decals")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    wp.init()
    gl = moderngl.create_context(require=430, standalone=True, backend="egl")
    print(gl.info["GL_RENDERER"], gl.info["GL_VERSION"], wp.get_device(options.device).name)
    counts = [int(part) for part in options.counts.split(",")]
    results: Figures = {}
    for path in options.paths:
        figures = measure(gl, path, counts, options.runs, options.device)
        results |= {f"{path.stem}_{name}": value for name, value in figures.items()}
        print(
            path.stem, *(f"  {name:32} {value:.4g}" for name, value in figures.items()), sep="\n", flush=True
        )
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
