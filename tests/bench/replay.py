"""Draw again what `tests/bench/record.py` wrote, and time every pass on this machine's graphics card.

Needs moderngl and NumPy alone, and nothing of this project:

    python tests/bench/replay.py dragon.npz --runs 20 --json times.json

Times are medians of OpenGL timer queries, in milliseconds.
"""

import argparse
import json
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

GROUP = 8
WARM_UP = 3


class Replay:
    """A recorded picture in an OpenGL context."""

    def __init__(self, gl: moderngl.Context, path: Path) -> None:
        self.gl = gl
        self.arrays = np.load(path)
        self.settings = json.loads(str(self.arrays["settings"]))
        self.size = tuple(self.settings["size"])
        self.camera = gl.buffer(self.arrays["camera"].tobytes())
        self.camera.bind_to_uniform_block(0)
        names = {"g_position": "f4", "g_normal": "f4", "g_color": "f2", "g_paint": "f2", "light": "f2"}
        self.targets = {name: gl.texture(self.size, 4, dtype=dtype) for name, dtype in names.items()}
        for texture in self.targets.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._made: dict[str, Any] = {}
        software = "llvmpipe" in gl.info["GL_RENDERER"]  # as decals/render/context.py has it
        self.anisotropy = 1.0 if software else min(8.0, gl.max_anisotropy)
        surface = [self.targets[name] for name in ("g_position", "g_normal", "g_color")]
        self.surface = gl.framebuffer(surface, gl.depth_texture(self.size))
        self.meshes = [self._mesh(key.split("/")[1]) for key in self.arrays.files if key.startswith("rows/")]

    def _mesh(self, number: str) -> moderngl.VertexArray:
        texts = self.settings["texts"]
        program = self.gl.program(vertex_shader=texts["mesh.vert"], fragment_shader=texts["mesh.frag"])
        rows = self.gl.buffer(self.arrays[f"rows/{number}"].tobytes())
        faces = self.gl.buffer(self.arrays[f"faces/{number}"].tobytes())
        layout = [(rows, "3f 3f 3f", "vertex_position", "vertex_normal", "vertex_color")]
        return self.gl.vertex_array(program, layout, faces)

    def draw_surface(self) -> None:
        """Fill the G-buffer."""
        self.surface.use()
        self.gl.enable_only(moderngl.DEPTH_TEST)
        self.surface.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        for mesh in self.meshes:
            mesh.render()

    def pass_(self, entry: str, body: str, target: str) -> Callable[[], None]:
        """Compile a pass; what is returned runs it."""
        recorded = self.settings["passes"][entry][body]
        textures = {name: self._texture(name, how) for name, how in recorded["textures"].items()}
        program: Any
        if entry == "compute":
            program = self.gl.compute_shader(recorded["text"])
        else:
            vertex = self.settings["texts"]["screen.vert"]
            program = self.gl.program(vertex_shader=vertex, fragment_shader=recorded["text"])
        for name, value in recorded["uniforms"].items():
            if name in program:
                program[name] = tuple(value) if isinstance(value, list) else value
        for unit, name in enumerate(textures):
            if name in program:
                program[name] = unit
        if entry == "compute":
            program["end_texel"] = self.size
            return lambda: self._compute(program, textures, target)
        array = self.gl.vertex_array(program, [])
        framebuffer = self.gl.framebuffer([self.targets[target]])
        return lambda: self._fragment(array, framebuffer, textures)

    def _texture(self, name: str, how: dict[str, Any]) -> Any:
        if name in self.targets:
            return self.targets[name]
        if name not in self._made:
            make = self.gl.texture_array if len(how["size"]) == 3 else self.gl.texture
            data = self.arrays[f"texture/{name}"].tobytes()
            texture: Any = make(tuple(how["size"]), how["components"], data, dtype=how["dtype"])
            texture.repeat_x = texture.repeat_y = False
            if len(how["size"]) == 3:
                texture.build_mipmaps()
                texture.anisotropy = self.anisotropy
            texture.filter = tuple(how["filter"])
            self._made[name] = texture
        return self._made[name]

    def _compute(self, program: Any, textures: dict[str, Any], target: str) -> None:
        for unit, texture in enumerate(textures.values()):
            texture.use(unit)
        self.targets[target].bind_to_image(0, read=False, write=True)
        program.run(-(-self.size[0] // GROUP), -(-self.size[1] // GROUP))
        self.gl.memory_barrier()

    def _fragment(
        self, array: moderngl.VertexArray, framebuffer: moderngl.Framebuffer, textures: dict[str, Any]
    ) -> None:
        for unit, texture in enumerate(textures.values()):
            texture.use(unit)
        framebuffer.use()
        self.gl.enable_only(moderngl.NOTHING)
        array.render(vertices=3)


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
    """Time a recorded picture: its surface, and every pass through both entry points."""
    replay = Replay(gl, path)
    figures = {"surface": milliseconds(gl, replay.draw_surface, runs)}
    seen = np.frombuffer(replay.targets["g_position"].read(), np.float32).reshape(-1, 4)[:, 3] > 0
    figures["covered"] = float(seen.mean())
    painted = {}
    for entry in replay.settings["passes"]:
        if entry == "compute" and gl.version_code < 430:
            continue
        replay.targets["g_paint"].write(bytes(8 * replay.size[0] * replay.size[1]))
        paint = replay.pass_(entry, "paint.glsl", "g_paint")
        light = replay.pass_(entry, "lit.glsl", "light")
        figures[f"decals_{entry}"] = milliseconds(gl, paint, runs)
        figures[f"light_{entry}"] = milliseconds(gl, light, runs)

        def frame(paint: Callable[[], None] = paint, light: Callable[[], None] = light) -> None:
            replay.draw_surface()
            paint()
            light()

        figures[f"frame_{entry}"] = milliseconds(gl, frame, runs)
        painted[entry] = np.frombuffer(replay.targets["g_paint"].read(), np.float16).astype(np.float32)
    if len(painted) == 2:
        difference = np.abs(painted["fragment"] - painted["compute"])
        figures["entries_differ"] = float((difference > 2e-3).mean())
    return figures


def main() -> None:
    """Read the command line, print a table and write the figures."""
    parser = argparse.ArgumentParser(prog="replay.py", description=__doc__)
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
