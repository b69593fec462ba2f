"""What VTK and pyvista can do that cannot show our objects as they are: said once, in words."""

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
        "shadows: what decals draws casts them but takes none; `disable_shadows()` lights all actors alike"
    ),
    "vtkSSAOPass": (
        "screen space ambient occlusion comes from VTK's own actors alone; what decals draws has its own"
    ),
}
PEELING = (
    "with some drivers depth peeling draws no translucent actors where there is multisampling, "
    "with decals or without; call `disable_anti_aliasing()` or `enable_anti_aliasing('ssaa')`"
)
WATCHED = "add_on_render_callback"
"""Method of a plotter by which every view of trame-pyvista asks to hear of frames."""
CLIENTS = {
    "PyVistaLocalView": "draws",
    "PyVistaRemoteLocalView": "can be switched to draw",
    "PyVistaWasmView": "draws",
}
"""Those views that draw in the browser."""
EXPORTS = ("export_html", "export_vtksz", "export_gltf", "export_obj", "export_vrml")
"""Methods of a plotter that write its actors, not its picture."""


def complaints(renderer: Any) -> list[str]:
    """Say what of a vtkRenderer's modes does not go with what we draw."""
    names = set(_names(renderer.GetPass()))
    found = [words for name, words in PASSES.items() if name in names]
    multisampled = renderer.GetRenderWindow().GetMultiSamples() > 1 and "vtkSSAAPass" not in names
    return [*found, PEELING] if multisampled and renderer.GetUseDepthPeeling() else found


def _names(render_pass: Any) -> Iterator[str]:
    """Class names of a render pass and of all those that it runs."""
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
    """Let a plotter's exports, and views that draw in a browser, say that they leave out what we draw."""
    for name, wrapper in {**dict.fromkeys(EXPORTS, _exporter), WATCHED: _watcher}.items():
        method = getattr(plotter, name, None)
        if method is not None:
            # Around pyvista's guard against new attributes, as pyvista itself does for components.
            plotter.__dict__[name] = wrapper(name, method)


def _exporter(name: str, method: Any) -> Any:
    @wraps(method)
    def export(*arguments: Any, **options: Any) -> Any:
        warnings.warn(
            f"{name} writes VTK's own actors; what decals draws is live OpenGL and cannot be in the file. "
            "For a picture call `screenshot`; for geometry add `pyvista.PolyData` of `blobtree.polygonize`",
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
                f"{name} {CLIENTS[name]} in the browser, which shows VTK's own actors without decals: what "
                "decals draws is live OpenGL where Python runs. Show the plotter with "
                "jupyter_backend='server', or use PyVistaRemoteView",
                stacklevel=2,
            )
        return method(callback, *arguments, **options)

    return add


def _class_names(callback: Callable[..., Any]) -> set[str]:
    """Names of the classes of what a function was made for: what it is bound to, or what it closes over."""
    owners = [getattr(callback, "__self__", None)]
    for cell in getattr(callback, "__closure__", None) or ():
        with suppress(ValueError):  # a name that is bound later
            owners.append(cell.cell_contents)
    return {one.__name__ for owner in owners for one in type(owner).__mro__}


def restore_exports(plotter: pv.BasePlotter) -> None:
    """Take that back."""
    for name in (*EXPORTS, WATCHED):
        plotter.__dict__.pop(name, None)
