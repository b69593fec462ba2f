"""Exports of pyvista, which write baked decals or warn; and its views in a browser, which warn."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from functools import wraps
from typing import Any

import numpy as np
import pyvista as pv

from blobtree._typing import Float64Array
from blobtree.progress import reporting
from decals.baking.export import TEXTURE, VERTICES, bake_parts
from decals.baking.parts import Baked
from decals.baking.plain_files import as_polydata
from decals.errors import MissingPackage
from decals.rendering.options import SceneLike, drawn_objects

WATCHED = "add_on_render_callback"
"""Method of a plotter that every view of trame-pyvista calls."""
CLIENTS = {
    "PyVistaLocalView": "draws",
    "PyVistaRemoteLocalView": "can be switched to draw",
    "PyVistaWasmView": "draws",
}
"""Views that draw in the browser."""
BAKING_EXPORTS = ("export_html", "export_gltf", "export_obj")
"""Methods of a plotter that write VTK's actors to a file with their textures; decals are baked for them."""
OTHER_EXPORTS = ("export_vtksz", "export_vrml", "export_wazex", "export_wasm_html")
"""Methods that write VTK's actors alone."""

TRAME = "trame"
"""Component of a plotter, of the package trame-pyvista, that has the exports for browsers too."""

BAKED = "plotter.decals, baked"
"""Beginning of the names in pyvista of actors with baked decals, while an export writes them."""

TEXTURE_SIZE, TEXTURE_SAMPLES = 1024, 2
"""Width and height of baked textures in texels, and the samples along each axis of a texel."""


_exporting = ContextVar("exporting", default=False)


def watch_exports(plotter: pv.BasePlotter) -> None:
    """Make exports of a plotter write baked decals or warn, and views that draw in a browser warn."""
    wrappers: dict[str, Callable[..., Any]] = {
        **dict.fromkeys(BAKING_EXPORTS, _baking_exporter),
        **dict.fromkeys(OTHER_EXPORTS, _exporter),
        WATCHED: _watcher,
    }
    for owner in (plotter, getattr(plotter, TRAME, None)):
        for name, wrapper in wrappers.items():
            method = getattr(owner, name, None)
            if method is not None:
                # Around pyvista's guard against new attributes, as pyvista itself does for components.
                vars(owner)[name] = wrapper(name, method, plotter)


def _exporter(name: str, method: Any, plotter: Any) -> Any:
    @wraps(method)
    def export(*arguments: Any, **options: Any) -> Any:
        if _exporting.get():  # by another export
            return method(*arguments, **options)
        _warn(
            f"{name} writes VTK's own actors; objects of plotter.decals are drawn by OpenGL and are not "
            f"in the file. Call decals.bake(plotter.decals.scene, 'scene.glb'), or one of "
            f"{', '.join(BAKING_EXPORTS)}, which write baked decals"
        )
        with ExitStack() as stack:
            for subplot in plotter.decals.subplots:
                stack.enter_context(_hidden(subplot.actor))
            stack.enter_context(_silent_views())
            return method(*arguments, **options)

    return export


def _baking_exporter(name: str, method: Any, plotter: Any) -> Any:
    @wraps(method)
    def export(*arguments: Any, **options: Any) -> Any:
        if _exporting.get():
            return method(*arguments, **options)
        with ExitStack() as stack:
            for subplot in plotter.decals.subplots:
                for number, (scene, actor, world) in enumerate(_sources(subplot)):
                    made = _actor(_baked(name, scene, subplot))
                    made.user_matrix = world
                    if actor is not subplot.actor:
                        made.GetProperty().DeepCopy(actor.GetProperty())
                        made.prop.color = "white"
                    stack.enter_context(_shown(made, f"{BAKED} {number}", actor, subplot.vtk_renderer))
            stack.enter_context(_silent_views())
            return method(*arguments, **options)

    return export


def _sources(subplot: Any) -> Iterator[tuple[SceneLike, Any, Float64Array]]:
    """Yield each scene of a subplot to bake, the actor that shows it, and the matrix to the world."""
    if subplot.scene is not None and drawn_objects(subplot.scene):
        yield subplot.scene, subplot.actor, np.eye(4)
    for injection in subplot.applied.injections:
        found = injection.as_scene() if injection.actor.GetVisibility() else None
        if found is not None:
            scene, world = found
            yield scene, injection.actor, world


def _baked(name: str, scene: SceneLike, subplot: Any) -> Baked:
    """Return the objects of a scene with baked decals, drawn as a subplot draws them."""
    options = subplot.drawing.modes | {"size": TEXTURE_SIZE, "samples": TEXTURE_SAMPLES}
    with reporting() as report:
        try:
            return bake_parts(scene, TEXTURE, report, **options)
        except MissingPackage as error:
            _warn(f"{name} writes decals as colours of vertices: {error}", stacklevel=4)
            return bake_parts(scene, VERTICES, report, **options)


@contextmanager
def _shown(made: pv.Actor, name: str, hidden: Any, renderer: Any) -> Iterator[None]:
    """Show an actor in place of another one."""
    with _hidden(hidden):
        actor, _ = renderer.add_actor(made, name=name, reset_camera=False, render=False)
        try:
            yield
        finally:
            renderer.remove_actor(actor, reset_camera=False, render=False)


@contextmanager
def _hidden(proxy: Any) -> Iterator[None]:
    """Hide an actor, which an exporter would draw, also before the window has OpenGL."""
    visible = proxy.GetVisibility()
    proxy.SetVisibility(False)
    try:
        yield
    finally:
        proxy.SetVisibility(visible)


def _actor(baked: Baked) -> pv.Actor:
    """Return an actor of all parts, with their texture or the colours of their vertices."""
    mapper: Any = pv.DataSetMapper(as_polydata(baked.merged()))
    actor = pv.Actor(mapper=mapper)
    actor.prop.color = "white"
    if baked.maps is not None:
        mapper.scalar_visibility = False
        make_texture: Any = pv.Texture
        actor.texture = make_texture(baked.maps.color)
    else:
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray("RGB")
        mapper.SetColorModeToDirectScalars()
        mapper.scalar_visibility = True
    return actor


def _warn(text: str, stacklevel: int = 3) -> None:
    warnings.warn(text, stacklevel=stacklevel)


@contextmanager
def _silent_views() -> Iterator[None]:
    """Let views in a browser not warn, which exports make, nor exports that others call."""
    token = _exporting.set(True)
    try:
        yield
    finally:
        _exporting.reset(token)


def _watcher(_name: str, method: Any, _plotter: Any) -> Any:
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
    """Undo `watch_exports`."""
    for owner in (plotter, vars(plotter).get(TRAME)):
        for name in (*BAKING_EXPORTS, *OTHER_EXPORTS, WATCHED) if owner is not None else ():
            vars(owner).pop(name, None)
