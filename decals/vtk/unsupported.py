"""Modes and exports of VTK and pyvista that do not support decals: warnings."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from contextvars import ContextVar
from functools import wraps
from typing import Any

import pyvista as pv

PASSES = {
    "vtkShadowMapPass": (
        "shadows: objects of plotter.decals cast shadows but receive none; "
        "`disable_shadows()` lights all actors alike"
    ),
    "vtkSSAOPass": (
        "screen space ambient occlusion covers VTK's own actors only, not the objects of plotter.decals"
    ),
}
PEELING = (
    "with some drivers depth peeling draws no translucent actors where there is multisampling, "
    "with decals or without; call `disable_anti_aliasing()` or `enable_anti_aliasing('ssaa')`"
)
WATCHED = "add_on_render_callback"
"""Method of a plotter that every view of trame-pyvista calls."""
CLIENTS = {
    "PyVistaLocalView": "draws",
    "PyVistaRemoteLocalView": "can be switched to draw",
    "PyVistaWasmView": "draws",
}
"""Views that draw in the browser."""
EXPORTS = ("export_html", "export_vtksz", "export_gltf", "export_obj", "export_vrml")
"""Methods of a plotter that write VTK's actors to a file."""


def complaints(renderer: Any) -> list[str]:
    """Return a warning for each mode of a vtkRenderer that does not support decals."""
    names = set(_names(renderer.GetPass()))
    messages = [words for name, words in PASSES.items() if name in names]
    multisampled = renderer.GetRenderWindow().GetMultiSamples() > 1 and "vtkSSAAPass" not in names
    return [*messages, PEELING] if multisampled and renderer.GetUseDepthPeeling() else messages


def _names(render_pass: Any) -> Iterator[str]:
    """Yield the class names of a render pass and of its delegates."""
    if render_pass is None:
        return
    yield render_pass.GetClassName()
    if hasattr(render_pass, "GetDelegatePass"):
        yield from _names(render_pass.GetDelegatePass())
    passes = render_pass.GetPasses() if hasattr(render_pass, "GetPasses") else None
    if passes is not None:
        for i in range(passes.GetNumberOfItems()):
            yield from _names(passes.GetItemAsObject(i))


_exporting = ContextVar("exporting", default=False)


def warn_of_exports(plotter: pv.BasePlotter) -> None:
    """Make a plotter's exports, and views that draw in a browser, warn that they omit decals."""
    for name, wrapper in {**dict.fromkeys(EXPORTS, _exporter), WATCHED: _watcher}.items():
        method = getattr(plotter, name, None)
        if method is not None:
            # Around pyvista's guard against new attributes, as pyvista itself does for components.
            plotter.__dict__[name] = wrapper(name, method)


def _exporter(name: str, method: Any) -> Any:
    @wraps(method)
    def export(*arguments: Any, **options: Any) -> Any:
        warnings.warn(
            f"{name} writes VTK's own actors; objects of plotter.decals are drawn by OpenGL and are not "
            "in the file. For a picture call `screenshot`; for geometry add `pyvista.PolyData` of "
            "`blobtree.polygonize`",
            stacklevel=2,
        )
        token = _exporting.set(True)
        try:
            return method(*arguments, **options)
        finally:
            _exporting.reset(token)

    return export


def _watcher(_name: str, method: Any) -> Any:
    @wraps(method)
    def add(callback: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        for name in () if _exporting.get() else _class_names(callback) & CLIENTS.keys():
            warnings.warn(
                f"{name} {CLIENTS[name]} in the browser, which shows VTK's own actors only: objects of "
                "plotter.decals are drawn by OpenGL where Python runs. Show the plotter with "
                "jupyter_backend='server', or use PyVistaRemoteView",
                stacklevel=2,
            )
        return method(callback, *arguments, **options)

    return add


def _class_names(callback: Callable[..., Any]) -> set[str]:
    """Return the class names of the objects to which a function is bound, or over which it closes."""
    owners = [getattr(callback, "__self__", None)]
    for cell in getattr(callback, "__closure__", None) or ():
        with suppress(ValueError):  # a variable without a value yet
            owners.append(cell.cell_contents)
    return {one.__name__ for owner in owners for one in type(owner).__mro__}


def restore_exports(plotter: pv.BasePlotter) -> None:
    """Undo `warn_of_exports`."""
    for name in (*EXPORTS, WATCHED):
        plotter.__dict__.pop(name, None)
