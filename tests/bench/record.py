"""Everything that one picture draws, in one file: shader texts, meshes, textures and uniforms.

`tests/bench/replay.py` draws it again and times it on machines that have a graphics card, moderngl and NumPy,
but neither Warp nor VTK.

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

from decals.field.contact import Contact
from decals.render import entry
from decals.render.context import Context
from decals.render.entry import Entry
from decals.render.mesh import mesh_rows
from decals.render.renderer import Renderer
from decals.render.tile import CameraBuffer, Tile
from decals.scenes.scene import MeshObject, Scene
from implicit_decals.shaders import Source, compose

Arrays = dict[str, NDArray[Any]]
Sources = dict[int, tuple[str, str]]
"""Body and whole text of programs, by their identity."""
TARGETS = ("g_position", "g_normal", "g_color", "g_paint")
"""Textures that the picture itself fills."""


def record(scene: Scene, size: tuple[int, int], path: Path, *, contact: Contact = Contact.PAPER) -> None:
    """Write what a picture draws: a scene of meshes, one sample a pixel, in one tile."""
    arrays: Arrays = {}
    passes: dict[str, dict[str, Any]] = {}
    for number, item in enumerate(scene.objects):
        assert isinstance(item, MeshObject)
        arrays[f"rows/{number}"], arrays[f"faces/{number}"] = mesh_rows(item), item.faces
    for point in Entry:
        with (
            Context.standalone(entry=point) as context,
            Renderer(context) as renderer,
            _listening(arrays, passes.setdefault(point, {})),
        ):
            renderer.render(scene, size=size, samples=1, contact=contact)
    texts = {name: compose(name).text for name in ("mesh.vert", "mesh.frag", "screen.vert")}
    settings = {"size": size, "texts": texts, "passes": passes, "layered": scene.decals.layered}
    np.savez_compressed(path, settings=np.array(json.dumps(settings)), **arrays)  # type: ignore[arg-type]


@contextmanager
def _listening(arrays: Arrays, passes: dict[str, Any]) -> Iterator[None]:
    """Note every pass that runs, with what it reads, and the camera."""
    units: dict[int, Any] = {}
    bodies: dict[str, str] = {}
    sources: Sources = {}
    use_camera, source_of = CameraBuffer.use, entry._source
    of_fragment, of_compute = Context.program, Context.compute_program

    def composed(point: Entry, body: str, *rest: Any) -> Source:
        source = source_of(point, body, *rest)
        bodies[source.text] = body
        return source

    def program(self: Context, vertex: Source, fragment: Source) -> moderngl.Program:
        made = of_fragment(self, vertex, fragment)
        sources[id(made)] = bodies.get(fragment.text, ""), fragment.text
        return made

    def compute_program(self: Context, source: Source) -> moderngl.ComputeShader:
        made = of_compute(self, source)
        sources[id(made)] = bodies.get(source.text, ""), source.text
        return made

    def camera(self: CameraBuffer, tile: Tile) -> CameraBuffer:
        arrays["camera"] = np.frombuffer(tile.block(), np.float32)
        return use_camera(self, tile)

    with ExitStack() as stack:
        for kind in (moderngl.Texture, moderngl.TextureArray):
            stack.enter_context(patch.object(kind, "use", _noting_use(kind.use, units)))
        for kind in (entry.FragmentPass, entry.ComputePass):
            noting = _noting_run(kind.run, units, sources, arrays, passes)
            stack.enter_context(patch.object(kind, "run", noting))
        stack.enter_context(patch.object(entry, "_source", composed))
        stack.enter_context(patch.object(Context, "program", program))
        stack.enter_context(patch.object(Context, "compute_program", compute_program))
        stack.enter_context(patch.object(CameraBuffer, "use", camera))
        yield


def _noting_use(original: Any, units: dict[int, Any]) -> Any:
    def use(self: Any, location: int = 0) -> None:
        units[location] = self
        original(self, location)

    return use


def _noting_run(
    original: Any, units: dict[int, Any], sources: Sources, arrays: Arrays, passes: dict[str, Any]
) -> Any:
    def run(self: Any, where: Any) -> None:
        body, text = sources[id(self.program)]
        uniforms, textures = {}, {}
        for name in self.program:
            member = self.program[name]
            if not isinstance(member, moderngl.Uniform):
                continue
            kind = _type(text, name)
            if "sampler" in kind:
                textures[name] = _texture(units[member.value], name, arrays)
            elif "image" not in kind:
                uniforms[name] = member.value
        passes[body] = {"text": text, "uniforms": uniforms, "textures": textures}
        original(self, where)

    return run


def _type(text: str, uniform: str) -> str:
    """Type of a uniform in a shader."""
    declaration = re.search(rf"uniform\s+(\w+)\s+{uniform}\s*;", text)
    assert declaration, uniform
    return declaration[1]


def _texture(texture: Any, name: str, arrays: Arrays) -> dict[str, Any]:
    """Keep a texture's first level; how it is made again."""
    if name not in TARGETS:
        arrays[f"texture/{name}"] = np.frombuffer(texture.read(), np.uint8)
    return {
        "size": texture.size,
        "components": texture.components,
        "dtype": texture.dtype,
        "filter": texture.filter,
    }


def main() -> None:
    """Read the command line, make the scene and record it."""
    from tests.bench.scenes import bench_scene, in_layers

    parser = argparse.ArgumentParser(prog="python -m tests.bench.record", description=__doc__)
    parser.add_argument("model", help="dragon, horse or knot")
    parser.add_argument("--decals", type=int, default=10_000)
    parser.add_argument("--seeded", action="store_true", help="decals.seed, in place of a quick even coat")
    parser.add_argument("--contact", choices=[mode.name.lower() for mode in Contact], default="paper")
    parser.add_argument("--layered", action="store_true", help="decals of all interactions in three layers")
    parser.add_argument("--size", default="1600x1200")
    parser.add_argument("path", type=Path)
    options = parser.parse_args()
    width, height = (int(part) for part in options.size.split("x"))
    size = width, height
    scene = bench_scene(options.model, options.decals, size, seeded=options.seeded)
    if options.layered:
        scene = scene.replace(decals=in_layers(scene.decals))
    record(scene, size, options.path, contact=Contact[options.contact.upper()])


if __name__ == "__main__":
    main()
