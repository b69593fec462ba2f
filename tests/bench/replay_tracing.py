"""Trace again what ``tests.bench.tracing --record`` wrote, and time it on this machine's graphics card.

Needs moderngl and NumPy alone, and nothing of this project:

    python tests/bench/replay_tracing.py tracing.npz --runs 20 --json times.json

Times are medians of OpenGL timer queries, in milliseconds, of clearing the G-buffer and tracing into it;
`clear_ms` and `clear_compute_ms` are of clearing alone, as each entry point does it.
`apart` is the share of the checked pixels where the depth differs from Warp's by more than 1e-4 of the cube,
`entries_apart` the share of all pixels where the two entry points differ by more than 1e-6.
"""

import argparse
import json
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

WIDTH = 4096
WARM_UP = 3
BOX_VERTICES = 36
COMPUTE = 430
ENTRIES = ("fragment", "compute")


class Replay:
    """A recording in an OpenGL context."""

    def __init__(self, gl: moderngl.Context, path: Path) -> None:
        self.gl = gl
        self.arrays = np.load(path)
        self.settings: dict[str, Any] = json.loads(str(self.arrays["settings"]))
        self.size: tuple[int, int] = tuple(self.settings["size"])
        self.camera = gl.buffer(self.arrays["camera"].tobytes())
        self.camera.bind_to_uniform_block(0)
        self.targets = [gl.texture(self.size, 4, dtype=dtype) for dtype in ("f4", "f4", "f2")]
        depth = gl.depth_texture(self.size)
        self.surface = gl.framebuffer(self.targets, depth)
        self.depth_alone = gl.framebuffer([], depth)
        if gl.version_code >= COMPUTE:
            self.clearing = gl.compute_shader(self.settings["clear"])
            self.clearing["end_texel"] = self.size

    def entry(self, entry: str, count: str) -> Callable[[], None]:
        """Compile a scene's tracer; what is returned clears the G-buffer and runs it."""
        scene = self.settings["scenes"][count]
        program: Any
        if entry == "compute":
            program = self.gl.compute_shader(scene["compute"])
        else:
            program = self.gl.program(
                vertex_shader=self.settings["vertex"], fragment_shader=scene["fragment"]
            )
        for name, value in {**scene["uniforms"], "tape": 0, "blocks": 1}.items():
            if name in program:
                program[name] = tuple(value) if isinstance(value, list) else value
        textures = self._texture(f"tape/{count}", "f4"), self._texture(f"blocks/{count}", "i4")
        array = None if entry == "compute" else self.gl.vertex_array(program, [])
        part = scene["uniforms"]["rectangle"]

        clear = self.clear_by_compute if entry == "compute" else self.clear

        def run() -> None:
            clear()
            self.gl.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            self.gl.cull_face = "front"
            for unit, texture in enumerate(textures):
                texture.use(unit)
            if array is not None:
                array.render(vertices=BOX_VERTICES)
            else:
                self._dispatch(program, part)

        return run

    def clear(self) -> None:
        """Empty the G-buffer through its framebuffer."""
        self.surface.use()
        self.surface.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)

    def clear_by_compute(self) -> None:
        """The same through a compute shader, the depth apart."""
        group = self.settings["group"]
        for unit, target in enumerate(self.targets):
            target.bind_to_image(unit, read=False, write=True)
        self.clearing.run(-(-self.size[0] // group), -(-self.size[1] // group))
        self.gl.memory_barrier()
        self.depth_alone.clear(depth=1.0)
        self.surface.use()

    def _dispatch(self, program: Any, part: list[int]) -> None:
        for unit, target in enumerate(self.targets):
            target.bind_to_image(unit, read=unit == 0, write=True)
        self.gl.memory_barrier()
        group = self.settings["group"]
        program.run(-(-part[2] // group), -(-part[3] // group))
        self.gl.memory_barrier()

    def _texture(self, name: str, dtype: str) -> moderngl.Texture:
        """An array as the project's `DataTexture` holds it."""
        array = self.arrays[name]
        components = array.shape[1] if array.ndim == 2 else 1
        rows = -(-len(array) // WIDTH)
        padded = np.zeros((rows * WIDTH, components), array.dtype)
        padded[: len(array)] = array.reshape(len(array), components)
        texture = self.gl.texture((WIDTH, rows), components, padded.tobytes(), dtype=dtype)
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def positions(self) -> NDArray[np.float32]:
        """Position and object + 1 of every pixel, float32[h, w, 4], the lowest row first."""
        data = np.frombuffer(self.targets[0].read(), np.float32)
        return data.reshape(self.size[1], self.size[0], 4)

    def apart(self, count: str) -> float:
        """Share of the checked pixels whose depth is not Warp's."""
        step = self.settings["checked"]
        seen = self.positions()[::step, ::step].reshape(-1, 4)
        eye = self.arrays["camera"].reshape(-1, 4)[4, :3]
        distance = np.where(seen[:, 3] > 0, np.linalg.norm(seen[:, :3] - eye, axis=1), np.inf)
        expected = self.arrays[f"distances/{count}"]
        with np.errstate(invalid="ignore"):
            same = (distance == expected) | (np.abs(distance - expected) <= 1e-4)
        return float(1.0 - same.mean())


def milliseconds(gl: moderngl.Context, work: Callable[[], None], runs: int) -> float:
    """Median time of some work on the graphics card."""
    query = gl.query(time=True)
    times = []
    for number in range(WARM_UP + runs):
        with query:
            work()
        if number >= WARM_UP:
            times.append(query.elapsed * 1e-6)
    return statistics.median(times)


def measure(gl: moderngl.Context, path: Path, runs: int) -> dict[str, float]:
    """Time a recording's scenes through both entry points."""
    replay = Replay(gl, path)
    figures = {"clear_ms": milliseconds(gl, replay.clear, runs)}
    if gl.version_code >= COMPUTE:
        figures["clear_compute_ms"] = milliseconds(gl, replay.clear_by_compute, runs)
    for count in replay.settings["scenes"]:
        seen = []
        for entry in ENTRIES:
            if entry == "compute" and gl.version_code < COMPUTE:
                continue
            run = replay.entry(entry, count)
            figures[f"{entry}_{count}_ms"] = milliseconds(gl, run, runs)
            seen.append(replay.positions().copy())
            figures[f"{entry}_{count}_apart"] = replay.apart(count)
        figures[f"hits_{count}"] = float((seen[0][..., 3] > 0).mean())
        if len(seen) == 2:
            difference = np.abs(seen[0] - seen[1]).max(axis=-1)
            figures[f"entries_{count}_apart"] = float((difference > 1e-6).mean())
    return figures


def main() -> None:
    """Read the command line, print the figures and write them."""
    parser = argparse.ArgumentParser(prog="replay_tracing.py", description=__doc__)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    gl = moderngl.create_context(require=430, standalone=True, backend="egl")
    print(gl.info["GL_RENDERER"], gl.info["GL_VERSION"])
    results = {}
    for path in options.paths:
        results[path.stem] = measure(gl, path, options.runs)
        print(path.stem, " ".join(f"{name} {value:.4g}" for name, value in results[path.stem].items()))
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
