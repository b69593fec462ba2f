"""A scene in pyvista's own viewer."""

from importlib.util import find_spec
from typing import Any

import pyvista as pv

from decals.checks import instance
from decals.errors import InvalidScene
from decals.scenes.scene import Scene
from decals.vtk.component import Component

REMOTE = "server"
"""pyvista's backend that draws where Python runs; the others draw in the browser, which has no decals."""
SERVING = ("trame_pyvista", "ipywidgets", "nest_asyncio2")
"""Packages without which pyvista cannot serve in a notebook: the extra ``browser`` has them."""


def show(scene: Scene, **options: Any) -> Any:
    """Show a scene from its own camera: in a window, or live in a notebook if pyvista can serve it there.

    Parameters
    ----------
    scene
        What to show.
    options
        As for pyvista's ``Plotter.show``, which gets them and whose result comes back.
    """
    instance("scene", scene, Scene, InvalidScene, "decals.cover makes one")
    plotter = pv.Plotter()
    stage: Component = plotter.decals
    stage.add_scene(scene)
    if plotter.notebook and "jupyter_backend" not in options:
        options["jupyter_backend"] = REMOTE if all(map(find_spec, SERVING)) else "static"
    return plotter.show(**options)
