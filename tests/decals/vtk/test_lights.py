"""Our objects under the plotter's lights look as VTK's actors do; under the studio's, as everywhere."""

from collections.abc import Callable

import numpy as np
import pytest
import pyvista as pv
from scipy.ndimage import binary_erosion

from decals.errors import InvalidImage, InvalidScene
from decals.rendering import TRANSPARENT, Environment, RenderOptions
from decals.vtk import Lights
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import both, shot
from tests.decals.vtk.test_composition import lying_behind

BALL = pv.Sphere(theta_resolution=120, phi_resolution=120)
COLOR = (0.8, 0.5, 0.3)
BEFORE_ROUNDING = 2
"""Of 255: half floats in our targets, and normals at vertices."""


def headlight(pl: Plotter) -> None:
    pl.remove_all_lights()
    pl.add_light(pv.Light(light_type="headlight", intensity=0.7))


def sun(pl: Plotter) -> None:
    pl.remove_all_lights()
    pl.add_light(pv.Light(position=(1, 2, 3), focal_point=(0, 0, 0), color="orange", intensity=0.9))


def lamp(pl: Plotter) -> None:
    pl.remove_all_lights()
    light = pv.Light(position=(0.3, -1.2, 0.8), focal_point=(0, 0, 0), color=(0.6, 0.8, 1.0), intensity=1.4)
    light.positional, light.cone_angle, light.attenuation_values = True, 120.0, (0.6, 0.3, 0.2)
    pl.add_light(light)


def spot(pl: Plotter) -> None:
    light = pv.Light(position=(0.2, -2.0, 0.4), focal_point=(0, 0, 0.1), color="cyan", intensity=0.8)
    light.positional, light.cone_angle, light.exponent = True, 12.0, 8.0
    pl.add_light(light)


def one_off(pl: Plotter) -> None:
    sun(pl)
    pl.add_light(pv.Light(position=(-3, 0, 0), color="red", intensity=1.0))
    pl.renderer.lights[-1].switch_off()


LIGHTINGS: dict[str, Callable[[Plotter], object]] = {
    "light kit": lambda pl: None,
    "three lights": lambda pl: pl.enable_3_lights(),
    "none": lambda pl: pl.remove_all_lights(),
    "headlight": headlight,
    "sun": sun,
    "lamp": lamp,
    "spot": spot,
    "one switched off": one_off,
    "parallel": lambda pl: pl.enable_parallel_projection(),
    "scaled": lambda pl: pl.set_scale(zscale=0.6, reset_camera=False),
}


def ball(plotter: Factory, lighting: str, *, ours: bool) -> tuple[Plotter, np.ndarray]:
    pl = plotter(window_size=(120, 120))
    pl.disable_anti_aliasing()
    if ours:
        pl.decals.add_mesh(BALL, color=COLOR)
        pl.decals.lights = "vtk"
        pl.decals.subplot.samples = 1
    else:
        pl.add_mesh(BALL, color=COLOR, smooth_shading=True)
    pl.camera_position = [(0.6, -2.2, 1.0), (0, 0, 0), (0, 0, 1)]
    LIGHTINGS[lighting](pl)
    pl.reset_camera_clipping_range()
    return pl, shot(pl)


@pytest.mark.parametrize("lighting", LIGHTINGS)
def test_a_ball_looks_as_vtks_own(plotter: Factory, lighting: str) -> None:
    _, theirs = ball(plotter, lighting, ours=False)
    pl, seen = ball(plotter, lighting, ours=True)
    inside = binary_erosion(lying_behind(pl.decals.subplot).object_id >= 0, iterations=2)
    assert inside.sum() > 1500
    difference = np.abs(seen - theirs)[inside].max(axis=-1)
    assert (difference <= BEFORE_ROUNDING).mean() > 0.995  # but for the edge of a cone
    assert difference.max() <= (255 if lighting == "spot" else 2 * BEFORE_ROUNDING)
    if lighting == "none":
        assert (np.ptp(seen[inside], axis=0) <= 1).all()
    else:
        assert np.ptp(seen[inside], axis=0).max() > 40


def test_an_environment_lights_the_objects_and_may_stand_behind_all(plotter: Factory) -> None:
    pl = plotter(window_size=(60, 60))
    pl.disable_anti_aliasing()
    pl.set_background("black")
    pl.decals.add_mesh(BALL, color=COLOR)
    pl.add_mesh(pv.Sphere(radius=0.3, center=(0.7, 0, 0)), color="white", lighting=False)
    pl.camera_position = [(0.6, -4.2, 1.0), (0.3, 0, 0), (0, 0, 1)]
    before = shot(pl)
    pl.decals.environment = np.full((2, 4, 3), 0.2)
    lit = shot(pl)
    owned = binary_erosion(lying_behind(pl.decals.subplot).object_id >= 0, iterations=2)
    assert (lit[owned] != before[owned]).any(axis=-1).mean() > 0.9
    assert (lit[0, 0] == 0).all()
    pl.decals.environment = Environment(pl.decals.environment.picture, visible=True)
    shown = shot(pl)
    assert np.ptp(shown[[0, 0, -1], [0, -1, 0]], axis=0).max() == 0
    assert 90 < shown[0, 0].max() < 140
    white = (lit == 255).all(axis=-1)
    assert white.sum() > 50
    assert (shown[white] == 255).all()
    assert np.abs(shown[owned].astype(int) - lit[owned]).max() <= 1
    pl.decals.environment = None
    assert np.abs(shot(pl).astype(int) - before).max() <= 1
    with pytest.raises(InvalidImage, match="twice as wide"):
        pl.decals.environment = np.ones((4, 4, 3))


def test_the_batch_renderer_gives_the_same_pixels_under_the_same_lights(plotter: Factory) -> None:
    pl = plotter()
    pl.set_background("black")
    pl.decals.add_scene(both(), camera=True)
    pl.decals.lights = Lights.VTK
    pl.add_light(pv.Light(position=(2, -3, 1), color="orange", intensity=0.5))
    subplot = pl.decals.subplot
    seen = shot(pl)
    with subplot.current():
        batch = subplot.renderer.render(
            both(),
            RenderOptions(size=(160, 120), background=TRANSPARENT, lights=subplot.lighting()),
            viewpoint=subplot.viewpoint(),
        )
    inside = binary_erosion(lying_behind(subplot).object_id >= 0, iterations=2)
    assert inside.sum() > 1000
    assert np.abs(seen - batch[..., :3])[inside].max() <= 1


def test_lights_that_change_are_seen_and_the_studios_do_not_care(pl: Plotter) -> None:
    assert pl.decals.lights is Lights.SCENE
    studio = shot(pl)
    pl.renderer.lights[1].intensity *= 2
    np.testing.assert_array_equal(shot(pl), studio)
    pl.decals.lights = "vtk"
    first = shot(pl)
    assert (first != studio).any()
    pl.renderer.lights[1].intensity /= 4
    dimmed = shot(pl)
    assert dimmed.sum() < first.sum()
    pl.remove_all_lights()
    assert (shot(pl) != dimmed).any()
    pl.decals.lights = "scene"
    np.testing.assert_array_equal(shot(pl), studio)


def test_each_subplot_has_lights_of_its_own(plotter: Factory) -> None:
    pl = plotter(shape=(1, 2), window_size=(240, 120), border=False)
    for column in range(2):
        pl.subplot(0, column)
        pl.decals.add_scene(both(), camera=True)
        pl.decals.lights = "vtk"
    pl.renderer.remove_all_lights()
    seen = shot(pl)
    assert (seen[:, :120] != seen[:, 120:]).any()


def test_more_lights_than_there_is_room_for_are_said_once(pl: Plotter) -> None:
    pl.decals.lights = "vtk"
    for _ in range(40):
        pl.add_light(pv.Light(position=(1, 1, 1), intensity=0.01))
    with pytest.warns(UserWarning, match="more than 32 lights"):
        shot(pl)
    shot(pl)


@pytest.mark.parametrize("wrong", ["studio", None, 1, ["vtk"]])
def test_lights_are_one_of_two(plotter: Factory, wrong: object) -> None:
    pl = plotter()
    with pytest.raises(InvalidScene, match="lights: expected one of 'scene', 'vtk', got"):
        pl.decals.lights = wrong
    assert pl.decals.lights is Lights.SCENE
