"""Small plotters without a screen, closed at the end of each test."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest
import pyvista as pv

import decals.vtk  # noqa: F401  (it registers `plotter.decals`)
from blobtree.graphics import install_advice, missing_gl_libraries
from tests.decals.vtk.scenes import both

if TYPE_CHECKING:

    class Plotter(pv.Plotter):
        """A plotter without pyvista's wrong types: wrapped methods ask for `self`, the window may be None."""

        add_axes: Any
        add_plane_widget: Any
        add_slider_widget: Any
        add_sphere_widget: Any
        camera_position: Any
        enable_depth_peeling: Any
        enable_eye_dome_lighting: Any
        enable_mesh_picking: Any
        enable_parallel_projection: Any
        enable_point_picking: Any
        enable_shadows: Any
        enable_ssao: Any
        enable_terrain_style: Any
        remove_actor: Any
        iren: Any
        render_window: Any
        set_background: Any
        set_scale: Any
        show_bounds: Any
        view_xy: Any
        view_xz: Any
else:
    Plotter = pv.Plotter

Factory = Callable[..., Plotter]


@pytest.fixture
def plotter() -> Iterator[Factory]:
    """Make plotters of 160 × 120 pixels."""
    missing = missing_gl_libraries()
    if missing:
        pytest.skip(f"no OpenGL here: {install_advice(missing)}")
    made: list[Plotter] = []

    def make(**options: Any) -> Plotter:
        made.append(Plotter(**{"off_screen": True, "window_size": [160, 120], **options}))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def pl(plotter: Factory) -> Plotter:
    """Make a plotter with the scene of a tree and a mesh."""
    made = plotter()
    made.decals.add_scene(both(), camera=True)
    return made
