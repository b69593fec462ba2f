"""Modes that cannot show us as we are say so once; exports too."""

import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
import pyvista as pv

from decals.vtk import modes
from tests.vtk.conftest import Factory
from tests.vtk.scenes import both, shot
from tests.vtk.test_undisturbed import translucent


def peeling(pl: pv.Plotter) -> None:
    pl.enable_depth_peeling(4)
    pl.enable_anti_aliasing("msaa")


def shadows(pl: pv.Plotter) -> None:
    """One light, so one shadow map."""
    pl.remove_all_lights()
    light = pv.Light(position=(3, -3, 5), focal_point=(0, 0, 0), cone_angle=40, light_type="scene light")
    light.positional = True
    pl.add_light(light)
    pl.enable_shadows()


MODES: dict[str, tuple[Callable[[pv.Plotter], object], str]] = {
    "shadows": (shadows, "takes none"),
    "occlusion": (lambda pl: pl.enable_ssao(), "VTK's own actors alone"),
    "peeling": (peeling, "draws no translucent actors"),
}


@pytest.mark.parametrize("mode", MODES)
def test_one_warning_says_what_does_not_work(plotter: Factory, mode: str) -> None:
    prepare, words = MODES[mode]
    pl = plotter()
    pl.decals.add_scene(both())
    prepare(pl)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        shot(pl)
        shot(pl)
    assert len([item for item in said if words in str(item.message)]) == 1


@pytest.mark.parametrize("mode", MODES)
def test_nobody_warns_who_draws_nothing(plotter: Factory, mode: str) -> None:
    pl = plotter()
    pl.add_mesh(pv.Sphere())
    MODES[mode][0](pl)
    assert modes.complaints(pl.renderer)
    shot(pl)


def test_vtks_own_peeling_with_multisampling_is_as_we_say(plotter: Factory) -> None:
    """Without us, too, it leaves out translucent actors."""

    def reddish(multisampling: bool) -> int:
        pl = plotter()
        translucent(pl)
        pl.enable_depth_peeling(4)
        pl.enable_anti_aliasing("msaa") if multisampling else pl.disable_anti_aliasing()
        seen = shot(pl)
        return int((seen[..., 0] > seen[..., 1] + 60).sum())

    assert reddish(True) < 0.2 * reddish(False)


def test_exports_say_what_they_leave_out(plotter: Factory, tmp_path: Path) -> None:
    pl = plotter()
    pl.add_mesh(pv.Sphere())
    pl.decals.add_scene(both())
    shot(pl)
    with pytest.warns(UserWarning, match="export_obj writes VTK's own actors; .* live OpenGL"):
        pl.export_obj(tmp_path / "scene.obj")
    assert (tmp_path / "scene.obj").exists()
    with warnings.catch_warnings(record=True) as said, suppress(ImportError, AttributeError):
        warnings.simplefilter("always")
        pl.export_html(tmp_path / "scene.html")  # pyvista wants a package for it that may not be here
    assert len([item for item in said if "export_html writes" in str(item.message)]) == 1
    pl.close()
    assert "export_html" not in pl.__dict__
