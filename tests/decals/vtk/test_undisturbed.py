"""What VTK draws is, outside our objects, bit for bit what it draws without us."""

import warnings
from collections.abc import Callable
from functools import cache
from typing import Literal

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import binary_dilation

from blobtree import Point
from decals import Decals, TreeObject, scatter
from decals.rendering import RenderOptions
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import shot

Prepare = Callable[[Plotter], object]

BLOB = TreeObject("blob", Point((0.7, -0.9, 0.2), radius=0.35))


@cache
def spots() -> Decals:
    return scatter([BLOB.surface], count=20, seed=1)


def textured(pl: Plotter) -> None:
    plane = pv.Plane(i_size=3, j_size=3, center=(0, 0, -0.9))
    checks = (np.indices((16, 16)).sum(axis=0) % 2 * 200).astype(np.uint8)
    texture = pv.Texture(np.repeat(checks[..., None], 3, axis=2))  # type: ignore[no-untyped-call]
    pl.add_mesh(plane, texture=texture)


def opaque(pl: Plotter) -> None:
    pl.add_mesh(pv.Sphere(radius=0.6), color="tan", smooth_shading=True)
    wave = pv.Plane(i_size=3, j_size=3, center=(0, 0, -1), i_resolution=9, j_resolution=9)
    pl.add_mesh(wave, scalars=np.sin(7 * wave.points[:, 0]), show_edges=True, scalar_bar_args={"title": "x"})


def translucent(pl: Plotter) -> None:
    opaque(pl)
    for shift in (-0.3, 0.0, 0.3):
        pl.add_mesh(pv.Sphere(radius=0.9, center=(shift, 0.2, 0)), color="red", opacity=0.3)


def everything(pl: Plotter) -> None:
    translucent(pl)
    textured(pl)
    pl.add_text("some text", font_size=8)
    pl.add_axes()
    pl.show_bounds(color="black")
    pl.add_point_labels([(0, 0, 0.7)], ["label"], always_visible=True)
    pl.add_points(np.random.default_rng(0).random((30, 3)), render_points_as_spheres=True, point_size=6)
    pl.add_arrows(np.array([[-1.0, 0, 0]]), np.array([[0.0, 0, 1]]))


def volume(pl: Plotter) -> None:
    opaque(pl)
    grid = pv.ImageData(dimensions=(20, 20, 20), spacing=(0.1,) * 3, origin=(-1, -1, -0.9))
    values = np.exp(-3 * np.sum(np.asarray(grid.points) ** 2, axis=1))
    pl.add_volume(grid, scalars=values, opacity="linear", cmap="viridis", show_scalar_bar=False)


def depth_peeling(pl: Plotter) -> None:
    translucent(pl)
    pl.enable_depth_peeling(10)


def widgets(pl: Plotter) -> None:
    opaque(pl)
    pl.add_slider_widget(lambda _: None, (0, 1), title="slide")
    pl.add_plane_widget(lambda *_: None, bounds=(-1, 1, -1, 1, -1, 1))


def fxaa(pl: Plotter) -> None:
    """VTK's own FXAA draws black where VTK goes through EGL; pyvista says so and takes SSAA."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*does not properly support FXAA")
        pl.enable_anti_aliasing("fxaa")


def anti_aliasing(kind: Literal["", "msaa", "ssaa"]) -> Prepare:
    return lambda pl: pl.enable_anti_aliasing(kind) if kind else pl.disable_anti_aliasing()


def eye_dome(pl: Plotter) -> None:
    pl.disable_anti_aliasing()
    pl.enable_eye_dome_lighting()


def eye_dome_and_ssaa(pl: Plotter) -> None:
    pl.enable_eye_dome_lighting()
    pl.enable_anti_aliasing("ssaa")


def gradient_and_stereo(pl: Plotter) -> None:
    pl.set_background("white", top="blue")
    pl.enable_stereo_render()


# What is drawn, how, and as far from us as filters of that mode may carry our colours, in pixels.
MODES: dict[str, tuple[Prepare, Prepare, int]] = {
    "plain": (everything, anti_aliasing(""), 1),
    "msaa": (everything, anti_aliasing("msaa"), 1),
    "ssaa": (everything, anti_aliasing("ssaa"), 4),
    "fxaa": (everything, fxaa, 4),
    "edl": (opaque, eye_dome, 16),
    "edl and ssaa": (opaque, eye_dome_and_ssaa, 8),
    "depth peeling": (depth_peeling, anti_aliasing(""), 1),
    "volume": (volume, anti_aliasing(""), 1),
    "volume and msaa": (volume, anti_aliasing("msaa"), 1),
    "widgets": (widgets, anti_aliasing(""), 1),
    "parallel": (everything, lambda pl: pl.enable_parallel_projection(), 1),
    "gradient and stereo": (opaque, gradient_and_stereo, 6),
    "hidden lines": (opaque, lambda pl: pl.enable_hidden_line_removal(), 1),
    "light kit": (everything, lambda pl: pl.enable_lightkit(), 1),
    "lit by VTK's lights": (everything, lambda pl: setattr(pl.decals, "lights", "vtk"), 1),
}


def picture(plotter: Factory, mode: str, *, ours: bool) -> tuple[Plotter, np.ndarray]:
    fill, prepare, _ = MODES[mode]
    pl = plotter()
    fill(pl)
    pl.camera_position = [(2.5, -4.0, 2.6), (0, 0, -0.1), (0, 0, 1)]
    prepare(pl)
    if ours:
        pl.decals.add_implicit(BLOB)
        pl.decals.add(spots(), images=["scale"])
    pl.reset_camera_clipping_range()
    for _ in range(2):
        shot(pl)  # VTK's axes take a few frames to find their places
    seen = shot(pl)
    if ours:
        np.testing.assert_array_equal(seen, shot(pl))
    return pl, seen


@pytest.mark.ordinary_cases("plain", "volume and msaa", "widgets")
@pytest.mark.parametrize("mode", MODES)
def test_outside_our_objects_nothing_changes(plotter: Factory, mode: str) -> None:
    _, without = picture(plotter, mode, ours=False)
    pl, seen = picture(plotter, mode, ours=True)
    subplot = pl.decals.subplot
    with subplot.current():
        buffers = subplot.renderer.buffers(
            pl.decals.scene, RenderOptions(size=(160, 120)), viewpoint=subplot.viewpoint()
        )
    mine = buffers.object_id >= 0
    assert 300 < mine.sum() < 3000
    near = binary_dilation(mine, iterations=MODES[mode][2])
    assert (seen != without)[mine].any(axis=-1).mean() > 0.3, "our object is there"
    np.testing.assert_array_equal(seen[~near], without[~near])
