"""Ray differentials on the tangent plane, against the plane's own neighbours."""

from pathlib import Path

import moderngl
import numpy as np
import pytest

from decals.camera import Camera
from decals.render.context import Context
from decals.render.tile import CameraBuffer, Rectangle, Tile, attach_camera, set_uniform
from implicit_decals.shaders import compose
from implicit_decals.shaders.compose import DIRECTORY

SIZE = (24, 16)

MAIN = """
//@ include footprint.glsl
uniform vec3 point;
uniform vec3 normal;
layout(location = 0) out vec4 step_right;
layout(location = 1) out vec4 step_up;
void main() {
    vec3 ray = ray_direction(gl_FragCoord.xy);
    vec3 q = eye.xyz + ray * (dot(normal, point - eye.xyz) / dot(normal, ray));
    step_right = vec4(surface_step(q, normal, ray, ray_right.xyz), 1.0);
    step_up = vec4(surface_step(q, normal, ray, ray_up.xyz), 1.0);
}
"""


def on_plane(camera: Camera, x: np.ndarray, y: np.ndarray, normal: np.ndarray) -> np.ndarray:
    rays = camera.rays(*SIZE)
    directions = rays.directions(x, y)
    t = normal @ (camera.target - rays.origin) / (directions @ normal)
    places: np.ndarray = rays.origin + t[..., None] * directions
    return places


@pytest.mark.parametrize("normal", [(0, 0, 1), (0.8, 0, 0.6), (0.5, -0.7, 0.5), (0, 0.9, 0.3)])
def test_a_footprint_is_the_way_to_the_next_pixel(
    context: Context, tmp_path: Path, normal: tuple[float, float, float]
) -> None:
    (tmp_path / "main.frag").write_text(MAIN)
    for name in ("footprint.glsl", "camera.glsl"):
        (tmp_path / name).write_text((DIRECTORY / name).read_text(encoding="utf-8"), encoding="utf-8")
    unit = np.array(normal) / np.linalg.norm(normal)
    camera = Camera((0.3, 0.2, 6), (0.1, 0, 0), fov=10)
    program = attach_camera(context.program(compose("screen.vert"), compose("main.frag", directory=tmp_path)))
    set_uniform(program, "point", camera.target)
    set_uniform(program, "normal", tuple(unit))
    targets = [context.gl.texture(SIZE, 4, dtype="f4") for _ in range(2)]
    framebuffer = context.gl.framebuffer(targets)
    framebuffer.use()
    context.gl.enable_only(moderngl.NOTHING)
    CameraBuffer(context).use(Tile(camera, SIZE, 0, 0, *SIZE, Rectangle(0, 0, *SIZE), 1.0, 10.0))
    context.gl.vertex_array(program, []).render(vertices=3)
    right, up = (np.frombuffer(t.read(), np.float32).reshape(SIZE[1], SIZE[0], 4)[..., :3] for t in targets)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    d = 1e-3
    for found, (dx, dy) in ((right, (d, 0)), (up, (0, d))):
        expected = (on_plane(camera, x + dx, y + dy, unit) - on_plane(camera, x - dx, y - dy, unit)) / (2 * d)
        np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-5)
