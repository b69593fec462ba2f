"""Depth against VTK's actors, whatever camera, subplot, window or size."""

from typing import Any

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import binary_erosion

from blobtree import Point
from decals import TreeObject
from decals.rendering import Buffers, RenderOptions
from decals.vtk import SubplotRenderer
from decals.vtk import proxy_actor as anchor
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import both, shot
from tests.oracles.raster import edges

BALL = TreeObject("ball", Point((0, 0, 0), radius=1.0, color=(0.9, 0.1, 0.1)))


def lying_behind(subplot: SubplotRenderer) -> Buffers:
    """What our renderer finds, by itself, in the stage's part of the window."""
    width, height = subplot.vtk_renderer.GetSize()
    assert subplot.scene is not None
    with subplot.current():
        return subplot.renderer.buffers(
            subplot.scene, RenderOptions(size=(width, height)), viewpoint=subplot.viewpoint()
        )


def blue(seen: np.ndarray) -> np.ndarray:
    return (seen[..., 2] > 150) & (seen[..., 0] < 90)


def red(seen: np.ndarray) -> np.ndarray:
    return (seen[..., 0] > seen[..., 1] + 25) & (seen[..., 0] > seen[..., 2] + 25)


def with_plane(pl: Plotter, **options: Any) -> None:
    """The ball, and a blue plane through its middle that cuts it along x = 0.25."""
    pl.disable_anti_aliasing()
    plane = pv.Plane(center=(0.25, 0, 0), direction=(1, 0, 0), i_size=4, j_size=4)
    pl.add_mesh(plane, color=(0.1, 0.1, 1.0), lighting=False, **options)
    pl.decals.add_implicit(BALL)


CAMERAS: dict[str, dict[str, Any]] = {
    "perspective": {},
    "parallel": {"parallel": True},
    "roll": {"roll": 37.0},
    "wide": {"angle": 75.0},
    "clipped": {"clip": (3.6, 9.0)},
    "shifted": {"window": (0.3, -0.2)},
}


def place(
    pl: Plotter,
    *,
    parallel: Any = False,
    roll: Any = None,
    angle: Any = None,
    clip: Any = None,
    window: Any = None,
) -> None:
    pl.camera_position = [(4.0, -1.5, 1.0), (0, 0, 0), (0, 0, 1)]
    camera = pl.camera
    if parallel:
        pl.enable_parallel_projection()
        camera.parallel_scale = 1.6
    if roll is not None:
        camera.roll = roll
    if angle is not None:
        camera.view_angle = angle
    if window is not None:
        camera.SetWindowCenter(*window)
    pl.reset_camera_clipping_range()
    if clip is not None:
        camera.clipping_range = clip


@pytest.mark.parametrize("name", CAMERAS)
def test_a_plane_and_a_ball_cut_each_other_where_they_meet(plotter: Factory, name: str) -> None:
    pl = plotter()
    with_plane(pl)
    place(pl, **CAMERAS[name])
    seen = shot(pl)
    subplot = pl.decals.subplot
    found = lying_behind(subplot)
    ball = found.object_id >= 0
    before = ball & (found.position[..., 0] > 0.28)  # the camera looks along −x
    behind = ball & (found.position[..., 0] < 0.22)
    sure = ~edges(ball)
    assert (before & sure).sum() > 100
    assert red(seen)[before & sure].all()
    if name != "clipped":
        assert (behind & sure).sum() > 3
        assert blue(seen)[behind & sure].all()


@pytest.mark.parametrize("name", ["perspective", "parallel", "shifted"])
def test_vtks_depth_is_our_depth(plotter: Factory, name: str) -> None:
    pl = plotter()
    pl.disable_anti_aliasing()
    pl.decals.add_implicit(BALL)
    pl.decals.subplot.samples = 1
    place(pl, **CAMERAS[name])
    shot(pl)
    subplot = pl.decals.subplot
    found = lying_behind(subplot)
    inside = binary_erosion(found.object_id >= 0)
    clip = np.c_[found.position[inside], np.ones(inside.sum())] @ subplot.viewpoint().matrix.T
    expected = 0.5 * clip[:, 2] / clip[:, 3] + 0.5
    z = vtk_depth(pl)[inside]
    assert inside.sum() > 1000
    np.testing.assert_allclose(z, expected, atol=1e-5)


def vtk_depth(pl: Plotter) -> np.ndarray:
    from vtkmodules.vtkCommonCore import vtkFloatArray

    values = vtkFloatArray()
    width, height = pl.window_size
    pl.render_window.GetZbufferData(0, 0, width - 1, height - 1, values)
    return pv.convert_array(values).reshape(height, width)[::-1]


def test_translucent_actors_before_us_tint_and_those_behind_us_hide(plotter: Factory) -> None:
    for peel in (False, True):
        pl = plotter()
        pl.decals.add_implicit(BALL)
        place(pl)
        pl.disable_anti_aliasing()
        bare = shot(pl)
        if peel:
            pl.enable_depth_peeling(4)
        front = pv.Plane(center=(2, 0, 0), direction=(1, 0, 0), i_size=4, j_size=4)
        back = pv.Plane(center=(-2, 0, 0), direction=(1, 0, 0), i_size=9, j_size=9)
        pl.add_mesh(
            back, color=(0.1, 0.1, 1.0), lighting=False, opacity=0.5, name="sheet", reset_camera=False
        )
        pl.reset_camera_clipping_range()
        inside = binary_erosion(lying_behind(pl.decals.subplot).object_id >= 0)
        np.testing.assert_array_equal(shot(pl)[inside], bare[inside])
        pl.add_mesh(
            front, color=(0.1, 0.1, 1.0), lighting=False, opacity=0.5, name="sheet", reset_camera=False
        )
        pl.reset_camera_clipping_range()
        expected = 0.5 * bare + 0.5 * np.array([0.1, 0.1, 1.0]) * 255
        assert np.abs(shot(pl) - expected)[inside].max() <= 2


def test_a_volume_shines_through_before_us_alone(plotter: Factory) -> None:
    pl = plotter()
    pl.disable_anti_aliasing()
    pl.decals.add_implicit(BALL)
    grid = pv.ImageData(dimensions=(12, 12, 12), spacing=(0.09,) * 3, origin=(-0.5, -0.5, -0.5))
    opacity = np.array([0.2, 0.2])
    volume = pl.add_volume(grid, scalars=np.ones(12**3), opacity=opacity, cmap="Blues", show_scalar_bar=False)
    assert isinstance(volume, pv.Volume)
    place(pl)
    pl.camera.clipping_range = (1.0, 20.0)
    within = shot(pl)  # the ball holds the whole volume
    inside = binary_erosion(lying_behind(pl.decals.subplot).object_id >= 0, iterations=2)
    volume.visibility = False
    np.testing.assert_array_equal(shot(pl)[inside], within[inside])
    volume.visibility = True
    volume.position = (2.0, 0, 0)
    assert (shot(pl) != within)[inside].any(axis=-1).mean() > 0.2


def test_text_lies_over_us(plotter: Factory) -> None:
    pl = plotter()
    pl.disable_anti_aliasing()
    pl.add_text("MMMM\nMMMM\nMMMM", font_size=30, color="yellow")
    alone = shot(pl)
    pl.decals.add_implicit(BALL)
    written = (alone == (255, 255, 0)).all(axis=-1)
    assert written.sum() > 200
    assert (shot(pl)[written] == (255, 255, 0)).all()


def test_subplots_show_their_own_scenes(plotter: Factory) -> None:
    pl = plotter(shape=(1, 2), window_size=(200, 100), border=False)
    pl.disable_anti_aliasing()
    pl.subplot(0, 0)
    pl.decals.add_scene(both(), camera=True)
    pl.subplot(0, 1)
    pl.add_mesh(pv.Cube(x_length=0.6, y_length=0.6, z_length=3.0), color="blue")
    pl.decals.add_implicit(BALL)
    place(pl)
    seen = shot(pl)
    assert len(pl.decals.subplots) == 2
    for subplot, left in zip(pl.decals.subplots, (0, 100), strict=True):
        part = seen[:, left : left + 100]
        with subplot.current():
            batch = subplot.renderer.render(
                subplot.scene, RenderOptions(size=(100, 100)), viewpoint=subplot.viewpoint()
            )
        ours = binary_erosion(lying_behind(subplot).object_id >= 0)
        assert ours.sum() > 1000
        assert (np.abs(part - batch[..., :3])[ours].max(axis=-1) <= 1).mean() > 0.85  # but for the cube
    hit = pl.decals.subplots[1].at(150, 50)
    assert hit is not None
    assert pl.decals.subplots[0].at(150, 50) is None


def test_two_windows_at_once(plotter: Factory) -> None:
    first, second = plotter(), plotter(window_size=(120, 90))
    first.decals.add_scene(both(), camera=True)
    second.decals.add_implicit(BALL)
    a, b = shot(first), shot(second)
    for _ in range(3):
        np.testing.assert_array_equal(shot(first), a)
        np.testing.assert_array_equal(shot(second), b)
    second.close()
    np.testing.assert_array_equal(shot(first), a)


def test_resizing_there_and_back(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_scene(both(), camera=True)
    first = shot(pl)
    pl.window_size = 220, 90
    wide = shot(pl)
    assert wide.shape == (90, 220, 3)
    fresh = plotter(window_size=(220, 90))
    fresh.decals.add_scene(both(), camera=True)
    np.testing.assert_array_equal(wide, shot(fresh))
    pl.window_size = 160, 120
    np.testing.assert_array_equal(shot(pl), first)


def test_a_larger_screenshot_is_drawn_larger(pl: Plotter) -> None:
    shot(pl)
    large = np.asarray(pl.screenshot(None, return_img=True, scale=2))[..., :3].astype(int)
    assert large.shape == (240, 320, 3)
    subplot = pl.decals.subplot
    with subplot.current():
        batch = subplot.renderer.render(both(), RenderOptions(size=(320, 240)))
        ours = subplot.renderer.buffers(both(), RenderOptions(size=(320, 240))).object_id >= 0
    sure = binary_erosion(ours, iterations=2)
    difference = np.abs(large - batch[..., :3])[sure].max(axis=-1)
    assert (difference <= 6).mean() > 0.95


@pytest.mark.slow_cases("shape2")
@pytest.mark.parametrize("shape", [pytest.param((1, 2), marks=pytest.mark.slow), (2, 2), (1, 3)])
def test_a_larger_screenshot_of_subplots_shows_each(plotter: Factory, shape: tuple[int, int]) -> None:
    """VTK draws it in tiles: some hold nothing of a subplot, others a part of it."""
    pl = plotter(shape=shape, window_size=(240, 160))
    for row, column in np.ndindex(shape):
        pl.subplot(row, column)
        pl.decals.add_implicit(BALL)
        place(pl)
    small = red(shot(pl))
    large = red(np.asarray(pl.screenshot(None, return_img=True, scale=2))[..., :3].astype(int))
    assert small.sum() > 200
    np.testing.assert_allclose(large.sum(), 4 * small.sum(), rtol=0.05)
    inside = binary_erosion(np.kron(small, np.ones((2, 2), bool)), iterations=4)
    assert large[inside].all()


def test_moving_the_whole_scene(plotter: Factory) -> None:
    """Scaling a plotter, or moving the actor that stands for us, moves what we draw."""
    pl = plotter()
    pl.decals.add_implicit(BALL)
    place(pl)
    shot(pl)
    pl.renderer.actors[anchor.NAME].SetPosition(0, 0, 0.7)
    found = pl.decals.subplot.at(80, 60)
    seen = shot(pl)
    assert red(seen)[:60].sum() > 2 * red(seen)[60:].sum()
    assert found is None or found.position[2] < 0


@pytest.mark.parametrize("scale", [0.5, 0.26])
def test_a_coarse_frame_is_nearly_the_fine_one(pl: Plotter, scale: float) -> None:
    fine = shot(pl)
    pl.decals.subplot.draw_scale = scale
    coarse = shot(pl)
    assert (coarse != fine).any()
    assert np.abs(coarse - fine).mean() < 3 / scale
    pl.decals.subplot.draw_scale = 1.0
    np.testing.assert_array_equal(shot(pl), fine)
