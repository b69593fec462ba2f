"""What VTK's actors hide is not picked; what shows is, at every size and in every mode."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given
from hypothesis import strategies as st

from decals.rendering import RenderOptions
from decals.rendering.viewpoint import Rectangle
from decals.vtk.frame import texels_of
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import shot
from tests.decals.vtk.test_composition import BALL, blue, lying_behind, place, with_plane
from tests.oracles.raster import edges


def plane(pl: Plotter, *, at: float, **options: Any) -> None:
    sheet = pv.Plane(center=(at, 0, 0), direction=(1, 0, 0), i_size=9, j_size=9)
    pl.add_mesh(sheet, reset_camera=False, **options)
    pl.reset_camera_clipping_range()


@pytest.mark.ordinary_cases("<lambda>1", "<lambda>3", "<lambda>6")
@pytest.mark.parametrize(
    "prepare",
    [
        lambda pl: pl.disable_anti_aliasing(),
        lambda pl: pl.enable_anti_aliasing("msaa"),
        lambda pl: pl.enable_anti_aliasing("ssaa"),
        lambda pl: pl.enable_eye_dome_lighting(),
        lambda pl: (pl.disable_anti_aliasing(), pl.enable_depth_peeling(4)),
        lambda pl: pl.enable_parallel_projection(),
        lambda pl: setattr(pl.decals.subplot, "draw_scale", 0.2),
        lambda pl: setattr(pl.decals.subplot, "samples", 1),
    ],
)
def test_a_plane_before_us_hides_us_and_one_behind_us_does_not(
    plotter: Factory, prepare: Callable[[Plotter], object]
) -> None:
    pl = plotter()
    pl.decals.add_implicit(BALL)
    prepare(pl)
    place(pl)
    subplot = pl.decals.subplot
    shot(pl)
    assert subplot.at(80, 60) is not None
    plane(pl, at=-2.0, name="sheet")
    shot(pl)
    assert subplot.at(80, 60) is not None
    plane(pl, at=2.0, opacity=0.5, name="sheet")
    shot(pl)
    assert subplot.at(80, 60) is not None
    plane(pl, at=2.0, name="sheet")
    shot(pl)
    assert subplot.at(80, 60) is None
    pl.remove_actor("sheet")
    shot(pl)
    assert subplot.at(80, 60) is not None


def test_half_of_a_ball_behind_a_plane_is_picked_where_it_is_seen(plotter: Factory) -> None:
    """Every pixel of a cut: what is blue was hidden, what is red was picked."""
    pl = plotter()
    with_plane(pl)
    place(pl)
    seen = shot(pl)
    subplot = pl.decals.subplot
    ball = lying_behind(subplot).object_id >= 0
    hides = blue(seen)
    sure = ball & ~edges(ball) & ~edges(hides)
    for y, x in np.argwhere(sure)[::7].tolist():
        assert (subplot.at(x, 119 - y) is None) == hides[y, x], (x, y)
    assert (sure & hides).sum() > 20
    assert (sure & ~hides).sum() > 500
    np.testing.assert_array_equal(shot(pl), seen)  # the picture is unchanged


def assert_not_hidden(subplot: Any) -> None:
    """Of what lies behind VTK's frame, nothing hides any of the pixels of ours."""
    found = lying_behind(subplot)
    for y, x in np.argwhere(found.object_id >= 0)[::11].tolist():
        assert not subplot.hidden(x, 119 - y, found.position[y, x]), (x, y)


@pytest.mark.parametrize("scale", [1.0, 0.6, 0.125])
def test_nothing_of_ours_hides_us(pl: Plotter, scale: float) -> None:
    """At grazing angles and in coarse frames, where depths in a pixel differ much."""
    subplot = pl.decals.subplot
    subplot.draw_scale = scale
    shot(pl)
    assert_not_hidden(subplot)


def test_text_over_the_picture_hides_nothing(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_implicit(BALL)
    text = pl.add_text("MMMM\nMMMM\nMMMM", font_size=30, position=(0, 0))
    text.prop.SetBackgroundColor(1.0, 1.0, 1.0)
    text.prop.SetBackgroundOpacity(1.0)
    place(pl)
    written = (shot(pl)[59, 80] == 255).all()
    assert written
    assert pl.decals.subplot.at(80, 60) is not None


def test_in_each_subplot_its_own_actors_hide(plotter: Factory) -> None:
    pl = plotter(shape=(1, 2), window_size=(200, 100), border=False)
    for column in range(2):
        pl.subplot(0, column)
        pl.decals.add_implicit(BALL)
        place(pl)
    plane(pl, at=2.0)
    shot(pl)
    assert pl.decals.subplots[0].at(50, 50) is not None
    assert pl.decals.subplots[1].at(150, 50) is None


def test_nothing_is_hidden_where_what_was_drawn_is_forgotten(plotter: Factory) -> None:
    pl = plotter()
    pl.decals.add_implicit(BALL)
    place(pl)
    plane(pl, at=2.0)
    shot(pl)
    subplot = pl.decals.subplot
    with subplot.current():
        subplot.renderer.render(subplot.scene, RenderOptions(size=(160, 120)), viewpoint=subplot.viewpoint())
        assert subplot.at(80, 60) is None
        view = subplot.viewpoint()
        subplot.renderer.begin_frame(
            subplot.scene, RenderOptions(size=(50, 40), samples=1), viewpoint=view, slot="several"
        ).complete()
    assert subplot.at(80, 60) is not None
    pl.camera.zoom(1.1)  # type: ignore[no-untyped-call]
    shot(pl)
    assert subplot.at(80, 60) is None


def test_a_frame_that_is_ready_but_was_not_shown_hides_nothing(pl: Plotter) -> None:
    """What is compared is what was put into VTK's frame, not what will be."""
    subplot = pl.decals.subplot
    subplot.draw_scale = 0.2
    shot(pl)
    while subplot.prepare(2, 10.0) is None:
        pass
    assert_not_hidden(subplot)


@given(st.integers(1, 60), st.integers(1, 200))
def test_every_texel_belongs_to_a_pixel_and_every_pixel_has_some(pixels: int, texels: int) -> None:
    magnified = texels < pixels
    spans = [texels_of(i, 0, (pixels, 1), (texels, 1), magnified=magnified) for i in range(pixels)]
    assert all(0 <= span.x < span.x + span.width <= texels for span in spans)
    assert {i for span in spans for i in range(span.x, span.x + span.width)} == set(range(texels))


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_the_samples_of_a_pixel_are_its_own(samples: int) -> None:
    part = texels_of(7, 3, (20, 10), (20 * samples, 10 * samples), magnified=False)
    assert part == Rectangle(7 * samples, 3 * samples, samples, samples)
