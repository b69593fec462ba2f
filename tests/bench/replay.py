"""Replay recorded pictures and rays, and time every pass on this machine's graphics card.

    python tests/bench/replay.py dragon.npz rays.npz --runs 20 --json times.json
    python -m tests.bench.replay dragon.npz --counts 100,1000000 --device cuda:0

`tests.bench.record` records pictures, `tests.bench.tracing --record` records rays. Times are medians of
OpenGL timer queries, in milliseconds.

Without ``--counts`` the script needs moderngl and NumPy only, and nothing of this project. With ``--counts``
it replaces the recorded decals by that many random ones at equal coverage, indexed on a Warp device. Then it
needs the project, Warp and msgspec, but not Warp's CPU device.

Of rays, ``apart`` is the fraction of the checked pixels whose depth differs from Warp's by more than 1e-4 of
the cube. ``entries_apart`` is the fraction of all pixels where fragment and compute shaders differ by more
than 1e-6.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

GROUP = 8
"""Width and height of a work group of the recorded compute shaders."""
WARM_UP = 3
"""Runs before the timed ones."""
COMPUTE_VERSION = 430
LIST_HEAD = np.array([0, 1, 1, 0], np.uint32)
"""Numbers before the pixels of an empty list, as in decals/rendering/pixel_pass.py."""
DATA_WIDTH = 4096
"""Width of a data texture, in texels."""
BOX_VERTICES = 36
ENTRY_POINTS = ("fragment", "compute")
DECAL_PASS, LIGHT_PASS = "decal_pass.glsl", "light_pass.glsl"
EARLIER_NAMES = {"paint.glsl": DECAL_PASS, "lit.glsl": LIGHT_PASS}
"""Names of the passes in recordings of earlier versions."""

COVERAGE = 2.5
"""Sum of the areas of random decals over that of the surface; they leave a twelfth of it bare."""
EDITED_LISTS, LIST_LENGTH = 24, 12
"""Lists that a moved decal leaves and enters, and decals in one."""

Figures = dict[str, float]


class Recording:
    """A recorded file in an OpenGL context."""

    def __init__(self, gl: moderngl.Context, path: Path) -> None:
        self.gl = gl
        self.arrays: dict[str, NDArray[Any]] = dict(np.load(path))
        self.settings: dict[str, Any] = json.loads(str(self.arrays["settings"]))
        self.size: tuple[int, int] = tuple(self.settings["size"])
        self.camera = gl.buffer(self.arrays["camera"].tobytes())
        self.camera.bind_to_uniform_block(0)

    def entry_points(self) -> list[str]:
        """Return the kinds of shaders that this context runs."""
        return [
            entry for entry in ENTRY_POINTS if entry != "compute" or self.gl.version_code >= COMPUTE_VERSION
        ]

    def set_uniforms(self, program: Any, values: dict[str, Any]) -> None:
        """Set the uniforms that a program uses."""
        for name, value in values.items():
            if name in program:
                program[name] = tuple(value) if isinstance(value, list) else value

    def milliseconds(self, work: Callable[[], None], runs: int) -> float:
        """Return the median time of some work on the graphics card."""
        query = self.gl.query(time=True)
        times = []
        for number in range(WARM_UP + runs):
            with query:
                work()
            if number >= WARM_UP:
                times.append(query.elapsed * 1e-6)
        return statistics.median(times)


class PictureReplay(Recording):
    """A recorded picture of meshes with decals."""

    def __init__(self, gl: moderngl.Context, path: Path) -> None:
        super().__init__(gl, path)
        formats = {"g_position": "f4", "g_normal": "f4", "g_color": "f2", "g_paint": "f2", "light": "f2"}
        self.targets = {name: gl.texture(self.size, 4, dtype=dtype) for name, dtype in formats.items()}
        for texture in self.targets.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._textures: dict[str, Any] = {}
        self.listed: moderngl.Buffer | None = None
        software = "llvmpipe" in gl.info["GL_RENDERER"]  # as in decals/rendering/context.py
        self.anisotropy = 1.0 if software else min(8.0, gl.max_anisotropy)
        surface = [self.targets[name] for name in ("g_position", "g_normal", "g_color")]
        self.surface = gl.framebuffer(surface, gl.depth_texture(self.size))
        self.meshes = [self._mesh(key.split("/")[1]) for key in self.arrays if key.startswith("rows/")]

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

    def compile_pass(self, entry: str, body: str, target: str) -> Callable[[], None]:
        """Compile a pass that writes a target; return a function that runs it."""
        passes = self.settings["passes"][entry]
        recorded = {EARLIER_NAMES.get(name, name): value for name, value in passes.items()}[body]
        if entry == "compute":
            return self._compile_compute(recorded, target)
        program = self.gl.program(
            vertex_shader=self.settings["texts"]["screen.vert"], fragment_shader=recorded["text"]
        )
        textures = self._set_inputs(program, recorded)
        array = self.gl.vertex_array(program, [])
        framebuffer = self.gl.framebuffer([self.targets[target]])
        return lambda: self._run_fragment(array, framebuffer, textures)

    def _compile_compute(self, recorded: dict[str, Any], target: str) -> Callable[[], None]:
        programs: list[Any] = []
        textures: dict[str, Any] = {}
        for stage in (recorded, recorded.get("listed")):
            if stage is not None:
                programs.append(self.gl.compute_shader(stage["text"]))
                textures |= self._set_inputs(programs[-1], stage, textures)
        programs[0]["end_texel"] = self.size
        if len(programs) > 1:
            self.listed = self.gl.buffer(reserve=LIST_HEAD.nbytes + 4 * self.size[0] * self.size[1])
        return lambda: self._run_compute(programs, textures, target)

    def _set_inputs(
        self, program: Any, recorded: dict[str, Any], before: Iterable[str] = ()
    ) -> dict[str, Any]:
        """Set uniforms and samplers; return the textures by name, those of other programs first."""
        names = dict.fromkeys([*before, *recorded["textures"]])
        self.set_uniforms(program, recorded["uniforms"])
        self.set_uniforms(program, {name: unit for unit, name in enumerate(names)})
        return {name: self._texture(name, layout) for name, layout in recorded["textures"].items()}

    def _texture(self, name: str, layout: dict[str, Any]) -> Any:
        if name in self.targets:
            return self.targets[name]
        if name not in self._textures:
            layered = len(layout["size"]) == 3
            create = self.gl.texture_array if layered else self.gl.texture
            data = self.arrays[f"texture/{name}"].tobytes()
            texture: Any = create(tuple(layout["size"]), layout["components"], data, dtype=layout["dtype"])
            texture.repeat_x = texture.repeat_y = False
            if layered:
                texture.build_mipmaps()
                texture.anisotropy = self.anisotropy
            texture.filter = tuple(layout["filter"])
            self._textures[name] = texture
        return self._textures[name]

    def _run_compute(self, programs: list[Any], textures: dict[str, Any], target: str) -> None:
        for unit, texture in enumerate(textures.values()):
            texture.use(unit)
        self.targets[target].bind_to_image(0, read=False, write=True)
        listed = self.listed if len(programs) > 1 else None
        if listed is not None:
            listed.write(LIST_HEAD.tobytes())
            listed.bind_to_storage_buffer(0)
        programs[0].run(-(-self.size[0] // GROUP), -(-self.size[1] // GROUP))
        self.gl.memory_barrier()
        if listed is not None:
            programs[1].run_indirect(listed)
            self.gl.memory_barrier()

    def listed_count(self) -> int:
        """Return the number of pixels in the list of the last pass that made one."""
        assert self.listed is not None
        return int(np.frombuffer(self.listed.read(LIST_HEAD.nbytes), np.uint32)[3])

    def _run_fragment(
        self, array: moderngl.VertexArray, framebuffer: moderngl.Framebuffer, textures: dict[str, Any]
    ) -> None:
        for unit, texture in enumerate(textures.values()):
            texture.use(unit)
        framebuffer.use()
        self.gl.enable_only(moderngl.NOTHING)
        array.render(vertices=3)

    def measure(self, runs: int) -> Figures:
        """Time the surface, and every pass through fragment and compute shaders."""
        figures = {"surface": self.milliseconds(self.draw_surface, runs)}
        positions = np.frombuffer(self.targets["g_position"].read(), np.float32).reshape(-1, 4)
        figures["covered"] = float((positions[:, 3] > 0).mean())
        painted = {}
        for entry in self.entry_points():
            self.targets["g_paint"].write(bytes(8 * self.size[0] * self.size[1]))
            paint = self.compile_pass(entry, DECAL_PASS, "g_paint")
            light = self.compile_pass(entry, LIGHT_PASS, "light")
            figures[f"decals_{entry}"] = self.milliseconds(paint, runs)
            figures[f"light_{entry}"] = self.milliseconds(light, runs)

            def frame(paint: Callable[[], None] = paint, light: Callable[[], None] = light) -> None:
                self.draw_surface()
                paint()
                light()

            figures[f"frame_{entry}"] = self.milliseconds(frame, runs)
            painted[entry] = np.frombuffer(self.targets["g_paint"].read(), np.float16).astype(np.float32)
        if self.listed is not None:
            figures["listed"] = self.listed_count() / (self.size[0] * self.size[1])
        if len(painted) == 2:
            difference = np.abs(painted["fragment"] - painted["compute"])
            figures["entries_differ"] = float((difference > 2e-3).mean())
        return figures


class CountedReplay(PictureReplay):
    """A recorded picture of one mesh whose decals are replaced by random ones."""

    def __init__(self, gl: moderngl.Context, path: Path) -> None:
        super().__init__(gl, path)
        rows = [name for name in self.arrays if name.startswith("rows/")]
        assert len(rows) == 1, "expected a recording of one mesh"
        self.vertices = self.arrays[rows[0]].reshape(-1, 9)[:, :3]
        self.faces = self.arrays[rows[0].replace("rows", "faces")].reshape(-1, 3)

    def replace_decals(self, count: int, device: Any) -> Figures:
        """Replace the decals; return the time to index them and their memory in megabytes."""
        import warp as wp

        from decals.index.index import index_on

        decals = random_decals(self.vertices, self.faces, count, layered=self.settings["layered"])
        index_on(decals, device)
        wp.synchronize_device(device)
        start = time.perf_counter()
        index = index_on(decals, device)
        wp.synchronize_device(device)
        seconds = time.perf_counter() - start
        arrays = {
            "decal_records": decals.packed(),
            "index_levels": index.levels.numpy(),
            "index_table": index.table.numpy(),
            "index_ids": index.ids.numpy(),
        }
        for name, array in arrays.items():
            self._replace_texture(name, array)
        numbers = {"index_level_count": index.level_count, "index_mask": index.mask}
        for recorded in self._recorded_passes():
            recorded["uniforms"] |= {k: value for k, value in numbers.items() if k in recorded["uniforms"]}
        return {"index_ms": 1e3 * seconds, "mb": 1e-6 * sum(array.nbytes for array in arrays.values())}

    def _recorded_passes(self) -> list[dict[str, Any]]:
        passes = [recorded for passes in self.settings["passes"].values() for recorded in passes.values()]
        return passes + [recorded["listed"] for recorded in passes if "listed" in recorded]

    def _replace_texture(self, name: str, array: NDArray[Any]) -> None:
        rows = max(1, -(-len(array) // DATA_WIDTH))
        padded = np.zeros(rows * DATA_WIDTH * int(np.prod(array.shape[1:])), array.dtype)
        padded[: array.size] = array.reshape(-1)
        self.arrays[f"texture/{name}"] = padded.view(np.uint8)
        if name in self._textures:
            self._textures.pop(name).release()
        for recorded in self._recorded_passes():
            if name in recorded["textures"]:
                recorded["textures"][name]["size"] = [DATA_WIDTH, rows]

    def upload_ms(self, runs: int) -> float:
        """Return the median time to upload one edit: a record and the lists of its cells."""
        from decals.model import RECORD

        records, ids = self._textures["decal_records"], self._textures["index_ids"]
        rng, times = np.random.default_rng(0), []
        for _ in range(runs):
            rows = rng.integers(0, ids.size[1], EDITED_LISTS)
            self.gl.finish()
            start = time.perf_counter()
            records.write(bytes(16 * RECORD), viewport=(0, int(rng.integers(0, records.size[1])), RECORD, 1))
            for row in rows.tolist():
                ids.write(bytes(4 * LIST_LENGTH), viewport=(0, row, LIST_LENGTH, 1))
            self.gl.finish()
            times.append(1e3 * (time.perf_counter() - start))
        return float(np.median(times))

    def painted_fraction(self) -> float:
        """Return the fraction of the objects' pixels that decals recolour."""
        bare, painted = (
            np.frombuffer(self.targets[name].read(), np.float16).reshape(-1, 4).astype(np.float32)
            for name in ("g_color", "g_paint")
        )
        visible = painted[:, 3] > 0
        return float((np.abs(painted - bare)[visible, :3] > 1e-3).any(axis=1).mean())

    def measure_counts(self, counts: list[int], runs: int, device: Any) -> Figures:
        """Time the decal pass with each number of decals."""
        figures: Figures = {}
        self.draw_surface()
        for count in counts:
            costs = self.replace_decals(count, device)
            figures |= {f"{name}_{count}": value for name, value in costs.items()}
            for entry in self.entry_points():
                paint = self.compile_pass(entry, DECAL_PASS, "g_paint")
                figures[f"decals_{entry}_{count}"] = self.milliseconds(paint, runs)
            figures[f"painted_{count}"] = self.painted_fraction()
            figures[f"upload_ms_{count}"] = self.upload_ms(runs)
        for entry in self.entry_points():
            first, last = (figures[f"decals_{entry}_{count}"] for count in (counts[0], counts[-1]))
            if first:
                figures[f"decals_{entry}_{counts[-1]}_over_{counts[0]}"] = last / first
        return figures


def random_decals(vertices: Any, faces: Any, count: int, *, layered: bool) -> Any:
    """Return equal `decals.Decals` at random points of a mesh.

    With `layered`, they have random interactions in three layers.
    """
    from decals import Decals

    rng = np.random.default_rng(count)
    corners = vertices.astype(np.float64)[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    face = rng.choice(len(areas), count, p=areas / areas.sum())
    options: dict[str, Any] = {}
    if layered:
        options = {"interactions": rng.integers(0, 3, count), "layers": rng.integers(-1, 2, count)}
    radius = np.sqrt(COVERAGE * areas.sum() / (np.pi * count))
    return Decals(
        np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], count), corners[face]),
        normals[face],
        np.cross(normals[face], rng.normal(size=(count, 3))),
        np.full(count, radius),
        **options,
    )


class TracingReplay(Recording):
    """Recorded rays into implicit models, one scene per number of points."""

    def __init__(self, gl: moderngl.Context, path: Path) -> None:
        super().__init__(gl, path)
        self.group: int = self.settings["group"]
        self.targets = [gl.texture(self.size, 4, dtype=dtype) for dtype in ("f4", "f4", "f2")]
        depth = gl.depth_texture(self.size)
        self.surface = gl.framebuffer(self.targets, depth)
        self.depth_only = gl.framebuffer([], depth)
        if "compute" in self.entry_points():
            self.clear_program = gl.compute_shader(self.settings["clear"])
            self.clear_program["end_texel"] = self.size

    def compile_tracer(self, entry: str, count: str) -> Callable[[], None]:
        """Compile the tracer of a scene; return a function that clears the G-buffer and traces into it."""
        scene = self.settings["scenes"][count]
        program: Any
        if entry == "compute":
            program = self.gl.compute_shader(scene["compute"])
        else:
            vertex = self.settings["vertex"]
            program = self.gl.program(vertex_shader=vertex, fragment_shader=scene["fragment"])
        self.set_uniforms(program, {**scene["uniforms"], "tape": 0, "blocks": 1})
        textures = self._texture(f"tape/{count}", "f4"), self._texture(f"blocks/{count}", "i4")
        array = None if entry == "compute" else self.gl.vertex_array(program, [])
        rectangle = scene["uniforms"]["rectangle"]
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
                self._dispatch(program, rectangle)

        return run

    def clear(self) -> None:
        """Clear the G-buffer through its framebuffer."""
        self.surface.use()
        self.surface.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)

    def clear_by_compute(self) -> None:
        """Clear the G-buffer through a compute shader, and the depth through a framebuffer."""
        for unit, target in enumerate(self.targets):
            target.bind_to_image(unit, read=False, write=True)
        self.clear_program.run(-(-self.size[0] // self.group), -(-self.size[1] // self.group))
        self.gl.memory_barrier()
        self.depth_only.clear(depth=1.0)
        self.surface.use()

    def _dispatch(self, program: Any, rectangle: list[int]) -> None:
        for unit, target in enumerate(self.targets):
            target.bind_to_image(unit, read=unit == 0, write=True)
        self.gl.memory_barrier()
        program.run(-(-rectangle[2] // self.group), -(-rectangle[3] // self.group))
        self.gl.memory_barrier()

    def _texture(self, name: str, dtype: str) -> moderngl.Texture:
        """Return an array as a texture, laid out as in the project's `DataTexture`."""
        array = self.arrays[name]
        components = array.shape[1] if array.ndim == 2 else 1
        rows = -(-len(array) // DATA_WIDTH)
        padded = np.zeros((rows * DATA_WIDTH, components), array.dtype)
        padded[: len(array)] = array.reshape(len(array), components)
        texture = self.gl.texture((DATA_WIDTH, rows), components, padded.tobytes(), dtype=dtype)
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def positions(self) -> NDArray[np.float32]:
        """Return position and object + 1 of each pixel, float32[h, w, 4], the lowest row first."""
        data = np.frombuffer(self.targets[0].read(), np.float32)
        return data.reshape(self.size[1], self.size[0], 4)

    def apart(self, count: str) -> float:
        """Return the fraction of the checked pixels whose depth is not Warp's."""
        step = self.settings["checked"]
        checked = self.positions()[::step, ::step].reshape(-1, 4)
        eye = self.arrays["camera"].reshape(-1, 4)[4, :3]
        distance = np.where(checked[:, 3] > 0, np.linalg.norm(checked[:, :3] - eye, axis=1), np.inf)
        expected = self.arrays[f"distances/{count}"]
        with np.errstate(invalid="ignore"):
            same = (distance == expected) | (np.abs(distance - expected) <= 1e-4)
        return float(1.0 - same.mean())

    def measure(self, runs: int) -> Figures:
        """Time each scene through fragment and compute shaders, clearing included, and clearing alone."""
        figures = {"clear_ms": self.milliseconds(self.clear, runs)}
        if "compute" in self.entry_points():
            figures["clear_compute_ms"] = self.milliseconds(self.clear_by_compute, runs)
        for count in self.settings["scenes"]:
            pictures = []
            for entry in self.entry_points():
                figures[f"{entry}_{count}_ms"] = self.milliseconds(self.compile_tracer(entry, count), runs)
                pictures.append(self.positions().copy())
                figures[f"{entry}_{count}_apart"] = self.apart(count)
            figures[f"hits_{count}"] = float((pictures[0][..., 3] > 0).mean())
            if len(pictures) == 2:
                difference = np.abs(pictures[0] - pictures[1]).max(axis=-1)
                figures[f"entries_{count}_apart"] = float((difference > 1e-6).mean())
        return figures


def measure(
    gl: moderngl.Context, path: Path, runs: int, *, counts: list[int] | None = None, device: Any = "cpu"
) -> Figures:
    """Time a recording of a picture or of rays; with `counts`, the decal pass with random decals."""
    if counts:
        return CountedReplay(gl, path).measure_counts(counts, runs, device)
    with np.load(path) as arrays:
        settings = json.loads(str(arrays["settings"]))
    return (PictureReplay if "passes" in settings else TracingReplay)(gl, path).measure(runs)


def main() -> None:
    """Parse the command line, time the recordings, and print and write the figures."""
    parser = argparse.ArgumentParser(
        prog="replay.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("paths", nargs="+", type=Path, help="recordings")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--counts", help="numbers of random decals, such as 100,10000,100000,1000000")
    parser.add_argument("--device", default="cpu", help="Warp device that indexes the decals of --counts")
    parser.add_argument("--json", type=Path, help="also write {recording: {figure: number}}")
    options = parser.parse_args()
    settings: dict[str, Any] = {"backend": "egl"}
    gl = moderngl.create_context(require=COMPUTE_VERSION, standalone=True, **settings)
    print(gl.info["GL_RENDERER"], gl.info["GL_VERSION"])
    counts = [int(part) for part in options.counts.split(",")] if options.counts else None
    results = {}
    for path in options.paths:
        figures = results[path.stem] = measure(gl, path, options.runs, counts=counts, device=options.device)
        print(
            path.stem, *(f"  {name:32} {value:.4g}" for name, value in figures.items()), sep="\n", flush=True
        )
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
