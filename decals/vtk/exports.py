"""Exports of pyvista, and its views in a browser, that omit decals: warnings."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import suppress
from contextvars import ContextVar
from functools import wraps
from typing import Any

import pyvista as pv

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
