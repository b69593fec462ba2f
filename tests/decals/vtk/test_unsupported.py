"""Modes that cannot show us as we are say so once; views in a browser too."""

import warnings
from collections.abc import Callable

import pytest
import pyvista as pv

from decals.vtk import Lights
from decals.vtk.adapters import unsupported_modes
from decals.vtk.exports import CLIENTS
from tests.decals.vtk.conftest import Factory, Plotter
from tests.decals.vtk.scenes import both, shot
from tests.decals.vtk.test_undisturbed import translucent


def peeling(pl: Plotter) -> None:
    pl.enable_depth_peeling(4)
    pl.enable_anti_aliasing("msaa")


def shadows(pl: Plotter) -> None:
    """One light, so one shadow map."""
    pl.remove_all_lights()
    light = pv.Light(position=(3, -3, 5), focal_point=(0, 0, 0), cone_angle=40, light_type="scene light")
    light.positional = True
    pl.add_light(light)
    pl.enable_shadows()


MODES: dict[str, tuple[Callable[[Plotter], object], str]] = {
    "shadows": (shadows, "receive none"),
    "occlusion": (lambda pl: pl.enable_ssao(), "VTK's own actors only"),
    "peeling": (peeling, "draws no translucent actors"),
}


@pytest.mark.parametrize("mode", MODES)
def test_one_warning_says_what_does_not_work(plotter: Factory, mode: str) -> None:
    prepare, words = MODES[mode]
    pl = plotter()
    pl.decals.add_scene(both(), camera=True)
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
    assert unsupported_modes(pl.renderer, Lights.SCENE)
    shot(pl)


def test_vtks_own_peeling_with_multisampling_is_as_we_say(plotter: Factory) -> None:
    """Without us, too, it leaves out translucent actors with Mesa's drivers, and shows them with others."""
    makers = set()

    def reddish(multisampling: bool) -> int:
        pl = plotter()
        translucent(pl)
        pl.enable_depth_peeling(4)
        pl.enable_anti_aliasing("msaa") if multisampling else pl.disable_anti_aliasing()
        seen = shot(pl)
        makers.add(pl.render_window.GetState().GetVersion())
        return int((seen[..., 0] > seen[..., 1] + 60).sum())

    share = reddish(True) / reddish(False)
    assert share < 0.2 if any("Mesa" in maker for maker in makers) else share > 0.9


class View:
    """Asks to hear of frames as trame-pyvista's views do; subclasses are named like them."""

    def update(self) -> None:
        raise AssertionError("nothing is drawn here")

    def hear_of(self, plotter: Plotter) -> None:
        plotter.add_on_render_callback(lambda *_: self.update(), render_event=False)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("PyVistaLocalView", "draws in the browser"),
        ("PyVistaWasmView", "draws in the browser"),
        ("PyVistaRemoteLocalView", "can be switched to draw in the browser"),
        ("PyVistaRemoteView", None),
        ("PyVistaRCAView", None),
    ],
)
def test_views_that_draw_in_a_browser_say_what_they_leave_out(
    pl: Plotter, name: str, words: str | None
) -> None:
    view = type(name, (View,), {})()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        view.hear_of(pl)
        pl.add_on_render_callback(print, render_event=True)
        pl.add_on_render_callback(lambda *_: later, render_event=True)
    later = None
    assert [str(item.message).startswith(f"{name} {words}") for item in said] == [True] * (words is not None)
    pl.clear_on_render_callbacks()
    pl.close()
    assert "add_on_render_callback" not in pl.__dict__


def test_trames_own_views_say_what_they_leave_out(plotter: Factory) -> None:
    trame = pytest.importorskip(
        "trame_pyvista.widgets", reason="trame is missing: pip install 'implicit-decals[browser]'"
    )
    from trame.app import get_server
    from trame.ui.vuetify3 import VAppLayout

    server = get_server("modes", client_type="vue3")
    pl = plotter()
    pl.decals.add_scene(both(), camera=True)
    said: dict[str, int] = {}
    local = CLIENTS.keys() - {"PyVistaWasmView"}  # that one is fetched from the network
    for name in ("PyVistaRemoteView", "PyVistaRCAView", *local):
        with VAppLayout(server, template_name=name), warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            getattr(trame, name)(pl)
        said[name] = len([item for item in warned if "where Python runs" in str(item.message)])
    assert said == {"PyVistaRemoteView": 0, "PyVistaRCAView": 0, **dict.fromkeys(local, 1)}
