"""Scenes in notebooks and viewers, and how pyvista finds us."""

import os
import sys
import tomllib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from PIL import Image

import decals
from decals.errors import NoGraphics
from decals.rendering import Drawing
from decals.vtk import component as viewer
from tests.decals.vtk.conftest import Factory
from tests.decals.vtk.scenes import both
from tests.display import display
from tests.programs import output_of

__all__ = ["display"]

ROOT = Path(__file__).parents[3]


def test_a_scene_is_a_picture_in_a_notebook(plotter: Factory) -> None:
    plotter()
    scene = both().replace(drawing=Drawing(samples=1))
    data = scene._repr_png_()
    assert data is not None
    np.testing.assert_array_equal(
        np.asarray(Image.open(BytesIO(data))), decals.render(scene, size=(640, 480))
    )


def test_without_graphics_a_scene_is_text(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object, **__: object) -> None:
        raise NoGraphics("none here")

    monkeypatch.setattr("decals.rendering.Renderer", none)
    assert both()._repr_png_() is None


@pytest.mark.parametrize(
    ("notebook", "served", "backend"),
    [
        (True, viewer.SERVING, "server"),
        (True, ("trame_pyvista",), "static"),
        (True, (), "static"),
        (False, viewer.SERVING, None),
    ],
)
def test_showing_hands_over_to_pyvista(
    plotter: Factory,
    monkeypatch: pytest.MonkeyPatch,
    notebook: bool,
    served: tuple[str, ...],
    backend: str | None,
) -> None:
    seen: dict[str, Any] = {}

    def shown(self: pv.Plotter, **options: Any) -> str:
        seen.update(options, scene=self.decals.scene, position=self.camera.position)
        self.close()
        return "what pyvista gives"

    plotter()
    monkeypatch.setattr(pv.Plotter, "show", shown)
    monkeypatch.setattr(pv, "OFF_SCREEN", True)
    monkeypatch.setattr(viewer, "find_spec", lambda name: object() if name in served else None)
    real = pv.Plotter
    monkeypatch.setattr(pv, "Plotter", lambda: real(off_screen=True, notebook=notebook))
    assert decals.show(both(), title="a") == "what pyvista gives"
    assert seen["scene"] is both()
    assert seen["title"] == "a"
    assert seen.get("jupyter_backend") == backend
    np.testing.assert_allclose(seen["position"], both().camera.position)


@pytest.mark.slow
def test_pyvista_finds_us_by_itself(plotter: Factory) -> None:
    """By the entry point, where the package is installed; importing the package does it in any case."""
    plotter()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pyvista.plotter_components"] == {"decals": "decals.vtk"}
    code = (
        "import sys, pyvista as pv\n"
        "assert 'decals' in dir(pv.Plotter(off_screen=True))\n"
        "assert 'decals' not in sys.modules\n"
        "pl = pv.Plotter(off_screen=True)\n"
        "print(type(pl.decals).__name__, pl.decals is pl.decals)\n"
    )
    assert output_of(code).split() == ["DecalsComponent", "True"]


def test_importing_decals_brings_no_vtk() -> None:
    code = "import sys, decals; print(sorted({'vtkmodules', 'pyvista', 'moderngl'} & sys.modules.keys()))"
    assert output_of(code).strip() == "[]"


REFINED = """
import os
import decals
from decals.vtk.subplot import SubplotRenderer
from tests.decals.vtk.scenes import both

drawn = []
draw = SubplotRenderer._draw

def record(self, scene):
    draw(self, scene)
    if not drawn or drawn[-1] != self.samples:
        drawn.append(self.samples)
    if drawn == [1, 2]:
        print("one sample, then all", flush=True)
        os._exit(0)

SubplotRenderer._draw = record
decals.show(both(), window_size=(80, 60))
"""


def test_a_window_shows_one_sample_first(display: str) -> None:
    environment = os.environ | {"DISPLAY": display, "PYTHONPATH": os.pathsep.join(sys.path)}
    assert output_of(REFINED, env=environment) == "one sample, then all\n"
