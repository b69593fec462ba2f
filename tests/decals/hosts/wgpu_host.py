"""A shader of decals as WGSL, by glslang and naga, and pictures with it by wgpu-py.

wgpu takes over the OpenGL context of its thread, so it draws in a process of its own:
``python -m tests.decals.hosts.wgpu_host FILE`` reads and writes pickles.
"""

import pickle
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from decals import Scene
from decals.hosts import Shader, ShaderTexture
from decals.surfaces.normals import vertex_normals
from tests.decals.hosts.moderngl_host import linear

VERTEX = """#version 450
layout(location = 0) in vec3 vertex_position;
layout(location = 1) in vec3 vertex_normal;
layout(set = 1, binding = 0) uniform Host { mat4 clip; vec4 eye; vec4 base; };
layout(location = 0) out vec3 position;
layout(location = 1) out vec3 normal;
void main() {
    position = vertex_position;
    normal = vertex_normal;
    gl_Position = clip * vec4(vertex_position, 1.0);
}
"""
FRAGMENT = """
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(set = 1, binding = 0) uniform Host {{ mat4 clip; vec4 eye; vec4 base; }};
layout(location = 0) out vec4 shown;
void main() {{
    {p}Material d = {p}material(position, normal, position - eye.xyz);
    vec3 c = min(base.rgb * (1.0 - d.color.a) + d.color.rgb + d.emission, vec3(1.0));
    vec3 light = 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055;
    shown = vec4(mix(light, 12.92 * c, lessThanEqual(c, vec3(0.0031308))), 1.0);
}}
"""
TO_WEBGPU = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0.5, 0.5], [0, 0, 0, 1.0]])
"""Matrix from OpenGL's clip space to that of WebGPU, whose depths begin at 0."""

FORMATS = {
    "rgba32f": ("rgba32float", "unfilterable-float"),
    "rgba32i": ("rgba32sint", "sint"),
    "r32i": ("r32sint", "sint"),
    "rgba16f": ("rgba16float", "float"),
    "srgb8-alpha8": ("rgba8unorm-srgb", "float"),
}
"""Format and type of sample in WebGPU."""


def missing_translator() -> str | None:
    """What is missing to make WGSL, or None."""
    if shutil.which("glslangValidator") is None:
        return "glslangValidator is not installed (on Debian: apt-get install glslang-tools)"
    if shutil.which("naga") is None:
        return "naga is not installed (cargo install naga-cli)"
    return None


@cache
def missing_adapter() -> str | None:
    """What is missing to draw by wgpu-py, or None."""
    if find_spec("wgpu") is None:
        return "wgpu is not installed (pip install wgpu)"
    command = [sys.executable, "-c", "import wgpu; wgpu.gpu.enumerate_adapters_sync()[0]"]
    return "wgpu finds no adapter" if subprocess.run(command, capture_output=True).returncode else None


def wgsl(text: str, stage: str) -> str:
    """GLSL of version 450 as WGSL that naga has validated."""
    with tempfile.TemporaryDirectory() as folder:
        source, binary, result = (Path(folder) / f"shader.{end}" for end in (stage, "spv", "wgsl"))
        source.write_text(text, encoding="utf-8")
        commands: list[list[str | Path]] = [
            ["glslangValidator", "-V", source, "-o", binary],
            ["naga", "--keep-coordinate-space", binary, result],
        ]
        for command in commands:
            ran = subprocess.run(command, capture_output=True, text=True)
            assert ran.returncode == 0, ran.stdout + ran.stderr
        return result.read_text(encoding="utf-8")


def fragment_of(shader: Shader) -> str:
    """The fragment shader of a picture, in GLSL."""
    return shader.header + shader.code + FRAGMENT.format(p=shader.prefix)


def picture(shader: Shader, scene: Scene, size: tuple[int, int]) -> np.ndarray:
    """The meshes of a scene without light, uint8[h, w, 4], the upper row first; alpha is 0 beside them."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.pickle"
        path.write_bytes(pickle.dumps((shader, scene, size)))
        command = [sys.executable, "-m", "tests.decals.hosts.wgpu_host", str(path)]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=300)
        assert ran.returncode == 0, ran.stderr
        shown: np.ndarray = pickle.loads(path.read_bytes())
    return shown


def drawn(shader: Shader, scene: Scene, size: tuple[int, int]) -> np.ndarray:
    """The picture, drawn in this process."""
    import wgpu

    device = wgpu.gpu.enumerate_adapters_sync()[0].request_device_sync()
    modules = [
        device.create_shader_module(code=wgsl(text, stage))
        for text, stage in ((VERTEX, "vert"), (fragment_of(shader), "frag"))
    ]
    entries = [
        {"binding": 0, "visibility": wgpu.ShaderStage.FRAGMENT, "buffer": {"type": "uniform"}},
        {"binding": 1, "visibility": wgpu.ShaderStage.FRAGMENT, "sampler": {"type": "filtering"}},
        *map(entry_of, shader.textures),
    ]
    both = wgpu.ShaderStage.VERTEX | wgpu.ShaderStage.FRAGMENT
    layouts = [
        device.create_bind_group_layout(entries=entries),
        device.create_bind_group_layout(
            entries=[{"binding": 0, "visibility": both, "buffer": {"type": "uniform"}}]
        ),
    ]
    pipeline = device.create_render_pipeline(
        layout=device.create_pipeline_layout(bind_group_layouts=layouts),
        vertex={
            "module": modules[0],
            "entry_point": "main",
            "buffers": [
                {
                    "array_stride": 24,
                    "attributes": [
                        {"format": "float32x3", "offset": 12 * place, "shader_location": place}
                        for place in range(2)
                    ],
                }
            ],
        },
        primitive={"topology": "triangle-list"},
        depth_stencil={"format": "depth24plus", "depth_write_enabled": True, "depth_compare": "less"},
        fragment={"module": modules[1], "entry_point": "main", "targets": [{"format": "rgba8unorm"}]},
    )
    usage = wgpu.TextureUsage.RENDER_ATTACHMENT | wgpu.TextureUsage.COPY_SRC
    target = device.create_texture(size=(*size, 1), format="rgba8unorm", usage=usage)
    depth = device.create_texture(
        size=(*size, 1), format="depth24plus", usage=wgpu.TextureUsage.RENDER_ATTACHMENT
    )
    sampler = device.create_sampler(mag_filter="linear", min_filter="linear", mipmap_filter="linear")
    bound = [{"binding": 1, "resource": sampler}]
    bound += [
        {"binding": texture.binding, "resource": view_of(device, texture)} for texture in shader.textures
    ]
    encoder = device.create_command_encoder()
    render = encoder.begin_render_pass(
        color_attachments=[
            {
                "view": target.create_view(),
                "load_op": "clear",
                "store_op": "store",
                "clear_value": (0, 0, 0, 0),
            }
        ],
        depth_stencil_attachment={
            "view": depth.create_view(),
            "depth_clear_value": 1.0,
            "depth_load_op": "clear",
            "depth_store_op": "store",
        },
    )
    render.set_pipeline(pipeline)
    clip = (TO_WEBGPU @ scene.camera.clip_matrix(size, scene.bounds)).T.astype(np.float32)
    for item in scene.objects:
        mesh: Any = item
        eye, base = (*scene.camera.position, 1.0), (*linear(np.asarray(mesh.color)), 1.0)
        host = clip.tobytes() + np.array([*eye, *base], np.float32).tobytes()
        rows = np.hstack([mesh.vertices, vertex_normals(mesh.vertices, mesh.faces)]).astype(np.float32)
        block = {"binding": 0, "resource": buffer_of(device, shader.uniform_block(shader.receivers(mesh)))}
        groups = [[block, *bound], [{"binding": 0, "resource": buffer_of(device, host)}]]
        for place, (layout, group) in enumerate(zip(layouts, groups, strict=True)):
            render.set_bind_group(place, device.create_bind_group(layout=layout, entries=group))
        render.set_vertex_buffer(0, buffer_of(device, rows.tobytes(), "VERTEX")["buffer"])
        faces = mesh.faces.astype(np.uint32)
        render.set_index_buffer(buffer_of(device, faces.tobytes(), "INDEX")["buffer"], "uint32")
        render.draw_indexed(faces.size)
    render.end()
    device.queue.submit([encoder.finish()])
    data = device.queue.read_texture({"texture": target}, {"bytes_per_row": 4 * size[0]}, (*size, 1))
    return np.frombuffer(data, np.uint8).reshape(size[1], size[0], 4).copy()


def entry_of(texture: ShaderTexture) -> dict[str, Any]:
    """The entry of a texture in the layout of its group."""
    import wgpu

    kind = {"sample_type": FORMATS[texture.format][1], "view_dimension": texture.kind}
    return {"binding": texture.binding, "visibility": wgpu.ShaderStage.FRAGMENT, "texture": kind}


def view_of(device: Any, texture: ShaderTexture) -> Any:
    """A texture of a shader, filled with all its levels."""
    import wgpu

    levels = texture.levels()
    width, height, *layers = texture.size
    made = device.create_texture(
        size=(width, height, *(layers or [1])),
        format=FORMATS[texture.format][0],
        mip_level_count=len(levels),
        usage=wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST,
    )
    for number, level in enumerate(levels):
        rows, columns = level.shape[1:3] if layers else level.shape[:2]
        texel = level.nbytes // (rows * columns * (layers or [1])[0])
        device.queue.write_texture(
            {"texture": made, "mip_level": number},
            np.ascontiguousarray(level),
            {"bytes_per_row": columns * texel, "rows_per_image": rows},
            (columns, rows, *(layers or [1])),
        )
    return made.create_view(dimension=texture.kind)


def buffer_of(device: Any, data: bytes, usage: str = "UNIFORM") -> dict[str, Any]:
    """A buffer with data, as a resource of a group."""
    import wgpu

    buffer = device.create_buffer_with_data(data=data, usage=getattr(wgpu.BufferUsage, usage))
    return {"buffer": buffer, "offset": 0, "size": len(data)}


if __name__ == "__main__":
    file = Path(sys.argv[1])
    file.write_bytes(pickle.dumps(drawn(*pickle.loads(file.read_bytes()))))
