"""Record all shader texts, meshes, textures and uniforms of a picture in one file.

`tests/bench/replay.py` draws and times it on machines with a graphics card, moderngl and NumPy, but without
Warp and VTK.

    python -m tests.bench.record dragon --decals 10000 --size 1600x1200 dragon.npz
"""

import argparse
import json
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np
from numpy.typing import NDArray

from decals import Contact, ImageMapping, MeshObject, Scene
from decals.rendering import Context, Renderer, RenderOptions
from decals.rendering import context as context_module
from decals.rendering.mesh import mesh_rows, split_mesh
from decals.rendering.pixel_pass import CameraBuffer, PassBackend, PixelPass, pass_source
from decals.rendering.viewpoint import Tile
from decals.shaders import Source, compose

Arrays = dict[str, NDArray[Any]]
Sources = dict[int, tuple[str, str]]
"""Body and whole text of each program, by the program's identity."""
TARGETS = ("g_position", "g_normal", "g_color", "g_paint")
"""Textures that the passes themselves write."""


def record(scene: Scene, path: Path, options: RenderOptions) -> None:
    """Record a picture of a scene of meshes: one sample per pixel, one tile."""
    arrays: Arrays = {}
    passes: dict[str, dict[str, Any]] = {}
    for number, item in enumerate(scene.objects):
        assert isinstance(item, MeshObject)
        split = split_mesh(item)
        arrays[f"rows/{number}"], arrays[f"faces/{number}"] = mesh_rows(item, split), split.faces
    for backend in PassBackend:
        with (
            Context.standalone(backend=backend) as context,
            Renderer(context) as renderer,
            _recording_calls(arrays, passes.setdefault(backend, {})),
        ):
            # as with a graphics card: the whole picture in one call, with one program a pass
            context.part_samples, context.software = None, False
            renderer.render(scene, options)
    texts = {name: compose(name).text for name in ("mesh.vert", "mesh.frag", "screen.vert")}
    settings = {"size": options.size, "texts": texts, "passes": passes, "layered": scene.decals.layered}
    np.savez_compressed(path, settings=np.array(json.dumps(settings)), **arrays)  # type: ignore[arg-type]


@contextmanager
def _recording_calls(arrays: Arrays, passes: dict[str, Any]) -> Iterator[None]:
    """Record each pass that runs with its inputs, and the camera."""
    units: dict[int, Any] = {}
    bodies: dict[str, str] = {}
    sources: Sources = {}
    use_camera, source_of = CameraBuffer.use, pass_source
    fragment_program, whole_program = Context.program, Context.compute_program

    def recorded_source(backend: PassBackend, body: str, *arguments: Any) -> Source:
        source = source_of(backend, body, *arguments)
        bodies[source.text] = body
        return source

    def program(self: Context, vertex: Source, fragment: Source) -> moderngl.Program:
        program = fragment_program(self, vertex, fragment)
        sources[id(program)] = bodies.get(fragment.text, ""), fragment.text
        return program

    def compute_program(self: Context, source: Source) -> moderngl.ComputeShader:
        program = whole_program(self, source)
        sources[id(program)] = bodies.get(source.text, ""), source.text
        return program

    def camera(self: CameraBuffer, tile: Tile) -> CameraBuffer:
        arrays["camera"] = np.frombuffer(tile.block(), np.float32)
        return use_camera(self, tile)

    with ExitStack() as stack:
        for texture in (moderngl.Texture, moderngl.TextureArray):
            stack.enter_context(patch.object(texture, "use", _recording_use(texture.use, units)))
        recording = _recording_run(PixelPass.run, units, sources, arrays, passes)
        stack.enter_context(patch.object(PixelPass, "run", recording))
        stack.enter_context(patch.object(context_module, "pass_source", recorded_source))
        stack.enter_context(patch.object(Context, "program", program))
        stack.enter_context(patch.object(Context, "compute_program", compute_program))
        stack.enter_context(patch.object(CameraBuffer, "use", camera))
        yield


def _recording_use(original: Any, units: dict[int, Any]) -> Any:
    def use(self: Any, location: int = 0) -> None:
        units[location] = self
        original(self, location)

    return use


def _recording_run(
    original: Any, units: dict[int, Any], sources: Sources, arrays: Arrays, passes: dict[str, Any]
) -> Any:
    def recorded(program: Any) -> dict[str, Any]:
        text = sources[id(program)][1]
        uniforms, textures = {}, {}
        for name in program:
            member = program[name]
            if not isinstance(member, moderngl.Uniform):
                continue
            uniform_type = _type(text, name)
            if "sampler" in uniform_type:
                textures[name] = _texture(units[member.value], name, arrays)
            elif "image" not in uniform_type:
                uniforms[name] = member.value
        return {"text": text, "uniforms": uniforms, "textures": textures}

    def run(self: Any, target: Any) -> None:
        first, *listed = self.programs
        body = passes[sources[id(first)][0]] = recorded(first)
        if listed:
            body["listed"] = recorded(*listed)
        original(self, target)

    return run


def _type(text: str, uniform: str) -> str:
    """Return the type of a uniform in a shader."""
    declaration = re.search(rf"uniform\s+(\w+)\s+{uniform}\s*;", text)
    assert declaration, uniform
    return declaration[1]


def _texture(texture: Any, name: str, arrays: Arrays) -> dict[str, Any]:
    """Record the first level of a texture; return its layout."""
    if name not in TARGETS:
        arrays[f"texture/{name}"] = np.frombuffer(texture.read(), np.uint8)
    return {
        "size": texture.size,
        "components": texture.components,
        "dtype": texture.dtype,
        "filter": texture.filter,
    }


def main() -> None:
    """Parse the command line, make the scene and record it."""
    from tests.bench.scenes import bench_scene, in_layers

    parser = argparse.ArgumentParser(prog="python -m tests.bench.record", description=__doc__)
    parser.add_argument("model", help="dragon, horse or knot")
    parser.add_argument("--decals", type=int, default=10_000)
    parser.add_argument(
        "--scattered", action="store_true", help="distribute decals by `scatter` instead of `even_decals`"
    )
    parser.add_argument("--contact", choices=[mode.name.lower() for mode in Contact], default="product")
    parser.add_argument(
        "--mapping", choices=[mode.name.lower() for mode in ImageMapping], default="corrected"
    )
    parser.add_argument("--filtered", action="store_true", help="average the decals over each pixel")
    parser.add_argument("--layered", action="store_true", help="random interactions in three layers")
    parser.add_argument("--size", default="1600x1200")
    parser.add_argument("path", type=Path)
    options = parser.parse_args()
    width, height = (int(part) for part in options.size.split("x"))
    size = width, height
    scene = bench_scene(options.model, options.decals, size, scattered=options.scattered)
    if options.layered:
        scene = scene.replace(decals=in_layers(scene.decals))
    drawing = RenderOptions(
        size=size,
        samples=1,
        contact=Contact[options.contact.upper()],
        mapping=ImageMapping[options.mapping.upper()],
        filtered=options.filtered,
    )
    record(scene, options.path, drawing)


if __name__ == "__main__":
    main()
