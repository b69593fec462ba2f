"""A shader of decals in plain moderngl: its functions at points, and pictures of scenes of meshes."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np

from decals import MeshObject, Scene
from decals.hosts import Shader, ShaderTexture
from decals.surfaces.normals import vertex_normals

WIDTH = 64
"""Points in a row of a target."""

OUTPUTS = ("found", "place", "color", "surface", "values", "glow")
TYPES = {"rgba32f": (4, "f4"), "rgba32i": (4, "i4"), "r32i": (1, "i4"), "rgba16f": (4, "f2")}

SCREEN = """
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
"""
AT_POINTS = """
uniform highp sampler2D points;
uniform highp sampler2D normals;
{outputs}
void main() {{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 q = texelFetch(points, texel, 0).xyz;
    vec3 n = texelFetch(normals, texel, 0).xyz;
    float field;
    vec2 uv;
    int owner = {p}owner(q, n, field, uv);
    found = vec4(float(owner), field, 0.0, 0.0);
    place = vec4(uv, 0.0, 0.0);
    color = {p}color(q, n, vec3(0.0), vec3(0.0));
    {p}Material m = {p}material(q, n, vec3(0.0), vec3(0.0));
    surface = vec4(m.normal, m.part);
    values = vec4(m.roughness, m.metallic, m.occlusion, length(m.color - color));
    glow = vec4(m.emission, 1.0);
}}
"""
MESH_VERTEX = """
in vec3 vertex_position;
in vec3 vertex_normal;
uniform mat4 clip;
out vec3 position;
out vec3 normal;
void main() {
    position = vertex_position;
    normal = vertex_normal;
    gl_Position = clip * vec4(vertex_position, 1.0);
}
"""
MESH_FRAGMENT = """
in vec3 position;
in vec3 normal;
uniform vec3 base;
uniform vec3 eye;
out vec4 shown;
void main() {{
    {p}Material d = {p}material(position, gl_FrontFacing ? normal : -normal, position - eye);
    vec3 c = min(base * (1.0 - d.color.a) + d.color.rgb + d.emission, vec3(1.0));
    vec3 light = 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055;
    shown = vec4(mix(light, 12.92 * c, lessThanEqual(c, vec3(0.0031308))), 1.0);
}}
"""


def desktop(text: str) -> str:
    """The text of version "450" as OpenGL compiles it: textures with their samplers, without sets."""
    text = re.sub(r"layout\(std140, .*?\)", "layout(std140)", text)
    text = re.sub(r"layout\(set = .*?\) ", "", text)
    text = re.sub(r"^uniform sampler .*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"sampler2DArray\((\w+), \w+\)", r"\1", text)
    return re.sub(r"\b(i?)texture2D(Array)?\b", r"\1sampler2D\2", text).replace("#extension", "// ")


@contextmanager
def bound(gl: moderngl.Context, program: moderngl.Program, shader: Shader, unit: int = 0) -> Iterator[int]:
    """The shader's textures and uniforms in a program, from a unit on; the next unit."""
    made: list[Any] = []
    for texture in shader.textures:
        made.append(uploaded(gl, texture.linear()))
        made[-1].use(unit)
        if texture.name in program:
            program[texture.name] = unit
        unit += 1
    if shader.version == "450":
        block = gl.buffer(shader.uniform_block())
        block.bind_to_uniform_block(0)
        made.append(block)
    else:
        for name, value in shader.uniforms.items():
            if name in program:
                program[name] = value
    yield unit
    for thing in made:
        thing.release()


def uploaded(gl: moderngl.Context, texture: ShaderTexture) -> Any:
    """A texture of a shader, filled."""
    components, kind = TYPES[texture.format]
    make: Any = gl.texture_array if texture.kind == "2d-array" else gl.texture
    made: Any = make(texture.size, components, texture.array.tobytes(), dtype=kind)
    made.filter = (moderngl.NEAREST, moderngl.NEAREST)
    if texture.filter == "linear":
        made.build_mipmaps()
        made.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        made.repeat_x = made.repeat_y = False
    return made


def at_points(
    gl: moderngl.Context, shader: Shader, points: np.ndarray, normals: np.ndarray
) -> dict[str, np.ndarray]:
    """What the functions of a shader return at points, by the names in `OUTPUTS`: float32[count, 4] each."""
    rows = -(-len(points) // WIDTH)
    outputs = "".join(f"layout(location = {i}) out vec4 {name};\n" for i, name in enumerate(OUTPUTS))
    fragment = shader.header + shader.code + AT_POINTS.format(p=shader.prefix, outputs=outputs)
    version = shader.header
    if shader.version == "450":
        fragment, version = desktop(fragment), "#version 450\n"
    program = gl.program(vertex_shader=version + SCREEN, fragment_shader=fragment)
    made: list[Any] = [program]
    for unit, (name, array) in enumerate({"points": points, "normals": normals}.items()):
        padded = np.zeros((rows * WIDTH, 4), np.float32)
        padded[: len(array), :3] = array
        made.append(gl.texture((WIDTH, rows), 4, padded.tobytes(), dtype="f4"))
        made[-1].use(unit)
        program[name] = unit
    targets = [gl.texture((WIDTH, rows), 4, dtype="f4") for _ in OUTPUTS]
    framebuffer, screen = gl.framebuffer(targets), gl.vertex_array(program, [])
    with bound(gl, program, shader, unit=2):
        framebuffer.use()
        gl.enable_only(moderngl.NOTHING)
        screen.render(vertices=3)
    values = {
        name: np.frombuffer(target.read(), np.float32).reshape(-1, 4)[: len(points)].copy()
        for name, target in zip(OUTPUTS, targets, strict=True)
    }
    for thing in (*made, *targets, framebuffer, screen):
        thing.release()
    return values


def picture(gl: moderngl.Context, shader: Shader, scene: Scene, size: tuple[int, int]) -> np.ndarray:
    """The meshes of a scene without light, uint8[h, w, 4], the upper row first; alpha is 0 beside them."""
    vertex, fragment = (
        shader.header + text for text in (MESH_VERTEX, shader.code + MESH_FRAGMENT.format(p=shader.prefix))
    )
    if shader.version == "300 es":
        vertex = vertex.replace("\n", "\nprecision highp float;\n", 1)
    program = gl.program(vertex_shader=vertex, fragment_shader=fragment)
    clip = scene.camera.clip_matrix(size, scene.bounds)
    program["clip"] = tuple(clip.T.ravel().tolist())
    program["eye"] = tuple(scene.camera.position)
    target = gl.framebuffer([gl.texture(size, 4)], gl.depth_renderbuffer(size))
    target.use()
    target.clear()
    gl.enable_only(moderngl.DEPTH_TEST)
    with bound(gl, program, shader):
        for item in scene.objects:
            draw(gl, program, shader, item)
    shown = np.frombuffer(target.read(components=4), np.uint8).reshape(size[1], size[0], 4)[::-1].copy()
    target.release()
    program.release()
    return shown


def draw(gl: moderngl.Context, program: moderngl.Program, shader: Shader, item: Any) -> None:
    """Draw one mesh of a scene."""
    assert isinstance(item, MeshObject)
    rows = np.hstack([item.vertices, vertex_normals(item.vertices, item.faces)]).astype(np.float32)
    buffers = gl.buffer(rows.tobytes()), gl.buffer(item.faces.astype(np.int32).tobytes())
    array = gl.vertex_array(program, [(buffers[0], "3f 3f", "vertex_position", "vertex_normal")], buffers[1])
    program["base"] = tuple(linear(np.asarray(item.color)).tolist())
    if (name := f"{shader.prefix}surface_receivers") in shader.uniforms:
        program[name] = shader.receivers(item)
    array.render()
    for thing in (array, *buffers):
        thing.release()


def linear(color: np.ndarray) -> np.ndarray:
    """An sRGB colour in linear light."""
    light: np.ndarray = np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
    return light


Host = Callable[[Shader, Scene, tuple[int, int]], np.ndarray]
"""Draws the meshes of a scene without light."""
