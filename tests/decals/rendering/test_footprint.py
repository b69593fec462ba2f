"""Ray differentials on the tangent plane, against the plane's own neighbours."""

from pathlib import Path

import moderngl
import numpy as np
import pytest

from decals import Camera
from decals.rendering import Context, Projection, Viewpoint
from decals.rendering.pixel_pass import CameraBuffer, attach_camera, set_uniform
from decals.rendering.viewpoint import PictureView
from decals.shaders import compose
from decals.shaders.compose import DIRECTORY

SIZE = (24, 16)
TARGET = (0.1, 0.0, 0.0)
BOX = ((-1, -1, -1), (1, 1, 1))

MAIN = """
//@ include footprint.glsl
uniform vec3 point;
uniform vec3 normal;
layout(location = 0) out vec4 step_right;
layout(location = 1) out vec4 step_up;
void main() {
    vec3 ray = ray_direction(gl_FragCoord.xy);
    vec3 origin = ray_origin(gl_FragCoord.xy);
    vec3 q = origin + ray * (dot(normal, point - origin) / dot(normal, ray));
    step_right = vec4(surface_step(q, normal, ray, ray_right.xyz), 1.0);
    step_up = vec4(surface_step(q, normal, ray, ray_up.xyz), 1.0);
}
"""


def on_plane(viewpoint: Viewpoint, x: np.ndarray, y: np.ndarray, normal: np.ndarray) -> np.ndarray:
    rays = viewpoint.rays(*SIZE)
    origins, directions = rays.origins(x, y), rays.directions(x, y)
    t = (TARGET - origins) @ normal / (directions @ normal)
    places: np.ndarray = origins + t[..., None] * directions
    return places


PERSPECTIVE = Camera((0.3, 0.2, 6), TARGET, fov=10)
PARALLEL = Projection(np.diag([0.8, 1.2, -0.1, 1.0]) @ PERSPECTIVE.view())


@pytest.mark.parametrize("viewpoint", [PERSPECTIVE, PARALLEL], ids=["perspective", "parallel"])
@pytest.mark.parametrize("normal", [(0, 0, 1), (0.8, 0, 0.6), (0.5, -0.7, 0.5), (0, 0.9, 0.3)])
def test_a_footprint_is_the_way_to_the_next_pixel(
    context: Context, tmp_path: Path, viewpoint: Viewpoint, normal: tuple[float, float, float]
) -> None:
    (tmp_path / "main.frag").write_text(MAIN)
    for name in ("footprint.glsl", "camera.glsl", "tangent_step.glsl"):
        (tmp_path / name).write_text((DIRECTORY / name).read_text(encoding="utf-8"), encoding="utf-8")
    unit = np.array(normal) / np.linalg.norm(normal)
    program = attach_camera(context.program(compose("screen.vert"), compose("main.frag", directory=tmp_path)))
    set_uniform(program, "point", TARGET)
    set_uniform(program, "normal", tuple(unit))
    targets = [context.gl.texture(SIZE, 4, dtype="f4") for _ in range(2)]
    framebuffer = context.gl.framebuffer(targets)
    framebuffer.use()
    context.gl.enable_only(moderngl.NOTHING)
    CameraBuffer(context.gl).use(PictureView.of(viewpoint, SIZE, BOX).whole())
    context.gl.vertex_array(program, []).render(vertices=3)
    right, up = (np.frombuffer(t.read(), np.float32).reshape(SIZE[1], SIZE[0], 4)[..., :3] for t in targets)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    d = 1e-3
    for found, (dx, dy) in ((right, (d, 0)), (up, (0, d))):
        expected = (on_plane(viewpoint, x + dx, y + dy, unit) - on_plane(viewpoint, x - dx, y - dy, unit)) / (
            2 * d
        )
        np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-5)
