"""VTK's state for the renderer: matrices, cameras, lights and modes; and callbacks for its observers."""

import weakref
from collections.abc import Callable, Iterator
from enum import Enum
from functools import lru_cache
from types import MethodType
from typing import Any

import numpy as np
import pyvista as pv

from blobtree._typing import Float64Array
from decals.errors import InvalidScene
from decals.rendering.lights import MAX_LIGHTS, Light, Lighting
from decals.rendering.viewpoint import Projection

EMPTY_DEPTHS = 0.01, 100.0
"""Depths of the clipping planes of a view that shows nothing, in distances from the camera to its target."""


def weak_callback(method: Callable[[], None]) -> Callable[..., None]:
    """Return a function of any arguments that calls a method while its object lives."""
    assert isinstance(method, MethodType)
    owner, name = weakref.ref(method.__self__), method.__name__

    def call(*_: object) -> None:
        alive = owner()
        if alive is not None:
            getattr(alive, name)()

    return call


def matrix_of(actor: Any) -> Float64Array:
    """Return the matrix from an actor's coordinates to the world, float64, shape (4, 4)."""
    return np.asarray(pv.array_from_vtkmatrix(actor.GetMatrix()), np.float64)


def vtk_projection(renderer: Any, model: Float64Array | None = None) -> Projection:
    """Return the projection of a vtkRenderer's camera, perspective or parallel, with its clipping planes.

    Planes that coincide, as VTK's do while the whole scene is behind the camera, are replaced; the camera
    itself stays as it is.

    Parameters
    ----------
    renderer
        A vtkRenderer.
    model
        Matrix from model to world, shape (4, 4). Default: identity.
    """
    world = np.eye(4) if model is None else model
    camera, aspect = renderer.GetActiveCamera(), renderer.GetTiledAspectRatio()
    try:
        return _projection((_clip_matrix(camera, aspect) @ world).tobytes())
    except InvalidScene:
        apart = camera.NewInstance()
        apart.DeepCopy(camera)
        apart.SetClippingRange([camera.GetDistance() * depth for depth in EMPTY_DEPTHS])
        return _projection((_clip_matrix(apart, aspect) @ world).tobytes())


def _clip_matrix(camera: Any, aspect: float) -> Float64Array:
    """Return the matrix from world to clip space of a vtkCamera, float64, shape (4, 4)."""
    matrix = camera.GetCompositeProjectionTransformMatrix(aspect, -1.0, 1.0)
    return np.asarray(pv.array_from_vtkmatrix(matrix), np.float64)


@lru_cache(maxsize=8)
def _projection(matrix: bytes) -> Projection:
    """Return the projection of a float64 matrix; one step of a drag needs it several times."""
    return Projection(np.frombuffer(matrix).reshape(4, 4))


class Lights(Enum):
    """Lights of a subplot.

    Examples
    --------
    >>> import pyvista
    >>> from decals.vtk import Lights
    >>> plotter = pyvista.Plotter(off_screen=True)
    >>> plotter.decals.lights = Lights.VTK
    >>> plotter.decals.lights.value
    'vtk'
    >>> plotter.close()
    """

    SCENE = "scene"
    """A studio light that moves with the camera, as in `decals.render`."""
    VTK = "vtk"
    """The plotter's lights."""


def vtk_lighting(renderer: Any, world: Float64Array) -> Lighting:
    """Return the lights of a vtkRenderer that are switched on, as in its last frame.

    Parameters
    ----------
    renderer
        A vtkRenderer.
    world
        Matrix from scene to world coordinates, shape (4, 4).
    """
    return Lighting(tuple(map(_light, _lights_on(renderer)[:MAX_LIGHTS])), tuple(world.ravel().tolist()))


def _lights_on(renderer: Any) -> list[Any]:
    """Return the lights of a vtkRenderer that are switched on."""
    return [light for light in renderer.GetLights() if light.GetSwitch()]


def _light(light: Any) -> Light:
    position = np.array(light.GetTransformedPosition())
    offset = np.array(light.GetTransformedFocalPoint()) - position
    distance = float(np.linalg.norm(offset)) or 1.0
    red, green, blue = (np.array(light.GetDiffuseColor()) * light.GetIntensity()).tolist()
    x, y, z = (offset / distance).tolist()
    if not light.GetPositional():
        return Light((red, green, blue), (x, y, z))
    return Light(
        (red, green, blue),
        (x, y, z),
        tuple(position.tolist()),
        tuple(light.GetAttenuationValues()),
        light.GetConeAngle(),
        light.GetExponent(),
    )


UNSUPPORTED_PASSES = {
    "vtkShadowMapPass": (
        "shadows: objects of plotter.decals cast shadows but receive none; "
        "`disable_shadows()` lights all actors alike"
    ),
    "vtkSSAOPass": (
        "screen space ambient occlusion covers VTK's own actors only, not the objects of plotter.decals"
    ),
}
DEPTH_PEELING = (
    "with some drivers depth peeling draws no translucent actors where there is multisampling, "
    "with decals or without; call `disable_anti_aliasing()` or `enable_anti_aliasing('ssaa')`"
)
TOO_MANY_LIGHTS = (
    f"more than {MAX_LIGHTS} lights: only the first {MAX_LIGHTS} light the decals and their objects"
)


def unsupported_modes(renderer: Any, lights: Lights) -> list[str]:
    """Return a warning for each mode of a vtkRenderer that a subplot with these lights does not support."""
    names = set(_pass_names(renderer.GetPass()))
    messages = [words for name, words in UNSUPPORTED_PASSES.items() if name in names]
    multisampled = renderer.GetRenderWindow().GetMultiSamples() > 1 and "vtkSSAAPass" not in names
    if multisampled and renderer.GetUseDepthPeeling():
        messages.append(DEPTH_PEELING)
    if lights is Lights.VTK and len(_lights_on(renderer)) > MAX_LIGHTS:
        messages.append(TOO_MANY_LIGHTS)
    return messages


def _pass_names(render_pass: Any) -> Iterator[str]:
    """Yield the class names of a render pass and of its delegates."""
    if render_pass is None:
        return
    yield render_pass.GetClassName()
    if hasattr(render_pass, "GetDelegatePass"):
        yield from _pass_names(render_pass.GetDelegatePass())
    passes = render_pass.GetPasses() if hasattr(render_pass, "GetPasses") else None
    if passes is not None:
        for i in range(passes.GetNumberOfItems()):
            yield from _pass_names(passes.GetItemAsObject(i))
